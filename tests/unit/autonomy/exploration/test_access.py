"""From the middle of a room to the nearest edge that no wall keeps the robot from."""

import numpy as np
import pytest

from gvgbot.autonomy.exploration.access import way_to_edge
from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.views import View
from gvgbot.geometry import Pose
from tests.unit.autonomy.local_graphs import Point, drawn
from tests.unit.autonomy.sights import carved, looked

ROOM_AND_CORRIDOR = carved([(-4.0, -2.0, 4.0, 2.0), (-4.0, -4.0, 4.0, -2.2)])
NEAR: dict[int, tuple[int, int, list[Point]]] = {10: (1, 2, []), 11: (3, 4, [])}
HERE = Pose(0.0, -1.2, 0.0)


def view_of(gvg: LocalGvg) -> View:
    """What is seen of the room from within; the corridor behind its wall is not."""
    return View(0, 0.0, 0.0, HERE, gvg, looked(ROOM_AND_CORRIDOR, [HERE]))


def test_the_edge_behind_a_wall_is_not_the_way_although_it_is_nearer() -> None:
    corridor = {1: (-3.0, -3.1), 2: (3.0, -3.1)}  # 1.9 m away, the room's middle 2.4 m
    gvg = drawn(corridor | {3: (-2.0, 1.2), 4: (2.0, 1.2)}, NEAR)
    way = way_to_edge(view_of(gvg))
    assert way is not None
    line, room = way
    assert line[0] == pytest.approx(HERE.position)
    assert line[-1] == pytest.approx((0.0, 1.2), abs=0.06)
    assert room[0] == pytest.approx(0.8, abs=0.05)
    assert np.all(room > 0.7)


def test_with_walls_before_every_edge_there_is_no_way() -> None:
    gvg = drawn({1: (-3.0, -3.1), 2: (3.0, -3.1)}, {10: (1, 2, [])})
    assert way_to_edge(view_of(gvg)) is None
