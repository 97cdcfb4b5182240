"""Whether a robot goes back over its way, and how far."""

import numpy as np
import pytest

from gvgbot.autonomy.backtracking import Backtracking
from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.views import View
from gvgbot.autonomy.whereabouts import Whereabouts
from gvgbot.geometry import Pose
from tests.unit.autonomy.sights import carved, line, looked

CORRIDOR = looked(carved([(-1.0, -1.0, 8.0, 1.0)]), line(0.0, 0.0, 7.0, 0.0, 0.0))
DRIVEN = Whereabouts(trail=[np.array([0.25 * i, 0.0]) for i in range(25)])  # six metres eastwards


def seen_from(x: float) -> View:
    return View(0, 0.0, 0.0, Pose(x, 0.0, 0.0), LocalGvg(), CORRIDOR)


def test_it_leads_to_where_the_way_began() -> None:
    track = Backtracking().track(seen_from(4.0), DRIVEN, [])
    assert track is not None
    assert track.polyline[0] == pytest.approx((4.0, 0.0))
    assert track.polyline[-1] == pytest.approx((0.0, 0.0))
    assert track.clearance == pytest.approx(1.0, abs=0.05)


def test_it_ends_there_and_where_a_known_vertex_is_in_sight() -> None:
    back = Backtracking()
    assert back.track(seen_from(0.0), DRIVEN, []) is None
    assert back.track(seen_from(4.0), Whereabouts(), []) is None
    back.sees_known = True
    assert back.track(seen_from(4.0), DRIVEN, []) is None


def test_it_is_tried_once_for_each_target() -> None:
    back = Backtracking()
    assert back.begin()
    back.end()
    assert not back.begin()
    assert not back.is_on
    back.renew()
    assert back.begin()


def test_who_sees_what_it_knows_need_not_go_back() -> None:
    back = Backtracking()
    back.sees_known = True
    assert not back.begin()
    back.sees_known = False
    assert back.begin()  # which did not count as a try
    assert back.is_on
