"""The way back to what was near before, by its geometry."""

import math
from itertools import pairwise

import numpy as np
import pytest

from gvgbot.autonomy.control.edge_follower import Track
from gvgbot.autonomy.retracing import Retracing
from gvgbot.autonomy.views import Correspondence, View
from gvgbot.geometry import Pose
from tests.unit.autonomy.local_graphs import drawn
from tests.unit.autonomy.sights import carved, line, looked

HALL = looked(carved([(-2.0, -4.0, 12.0, 6.0)]), line(0.0, 0.0, 10.0, 0.0, 0.0))
NEAR_START = drawn({1: (0.0, 0.0), 2: (9.0, 0.0)}, {10: (1, 2, [])})  # node 1 is vertex 7


def view_from(x: float, y: float) -> View:
    return View(0, 0.0, 0.0, Pose(x, y, 0.0), NEAR_START, HALL)


def driven(*corners: tuple[float, float]) -> Retracing:
    """Along corners, in steps of 5 cm; vertex 7 is in sight from 3 m."""
    retracing, seen = Retracing(), Correspondence()
    seen.pair(1, 7)
    for (x0, y0), (x1, y1) in pairwise(corners):
        for share in np.linspace(0.0, 1.0, 1 + round(math.dist((x0, y0), (x1, y1)) / 0.05)):
            x, y = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
            retracing.note(view_from(x, y), seen if math.hypot(x, y) < 3.0 else Correspondence())
    return retracing


def rest(retracing: Retracing, x: float, y: float) -> Track | None:
    return retracing.track(view_from(x, y), [])


def test_it_leads_over_the_way_to_where_the_vertex_was_near() -> None:
    """The corner of the way is 3 m from the vertex, and the robot was at it before that."""
    retracing = driven((0.0, 0.0), (3.0, 0.0), (3.0, 4.0))
    assert retracing.begin({7, 8})
    ahead = rest(retracing, 3.0, 4.0)
    assert ahead is not None
    assert ahead.polyline[0] == pytest.approx((3.0, 4.0), abs=0.11)
    assert ahead.polyline[:, 0] == pytest.approx(3.0)
    last = rest(retracing, 3.0, 0.0)
    assert last is not None
    assert last.polyline[-1] == pytest.approx((0.0, 0.0), abs=0.11)
    assert rest(retracing, 0.1, 0.0) is None


def test_it_leads_to_a_vertex_that_is_far_from_the_origin() -> None:
    retracing, seen = Retracing(), Correspondence()
    seen.pair(2, 8)
    for x in np.arange(9.0, 4.9, -0.05).tolist():
        retracing.note(view_from(x, 0.0), seen if x > 6.0 else Correspondence())
    assert retracing.begin({8})
    last = rest(retracing, 7.0, 0.0)
    assert last is not None
    assert last.polyline[-1] == pytest.approx((9.0, 0.0), abs=0.11)


def test_detours_are_left_out() -> None:
    loop = [(4.0, 0.0), (6.0, 0.0), (6.0, 3.0), (4.1, 3.0), (4.1, 0.1), (4.1, -3.0)]
    retracing = driven((0.0, 0.0), *loop)
    assert retracing.begin({7})
    ahead = rest(retracing, 4.1, 0.5)
    assert ahead is not None
    assert ahead.polyline[:, 0].max() < 4.2


def test_to_each_vertex_it_goes_back_once_and_to_none_that_was_never_near() -> None:
    retracing = driven((0.0, 0.0), (5.0, 0.0))
    assert not retracing.begin({8})
    assert not retracing.is_on
    assert retracing.begin({7})
    retracing.end()
    assert not retracing.begin({7})
    retracing.renew()
    assert retracing.begin({7})


def test_what_was_long_ago_is_forgotten() -> None:
    """Two kilometres to and fro."""
    retracing = driven((0.0, 0.0), *[(5.0, 0.0), (9.0, 0.0)] * 250)
    assert not retracing.begin({7})


def test_to_what_is_in_sight_it_does_not_go_back() -> None:
    assert not driven((0.0, 0.0), (5.0, 0.0), (2.9, 0.0)).begin({7})
