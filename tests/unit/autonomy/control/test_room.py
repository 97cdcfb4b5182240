"""How far there is floor that was seen to be free, in a room whose walls are three metres away."""

import math

import numpy as np
import pytest

from gvgbot.autonomy.control.room import room_ahead
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.geometry import Array, Pose
from tests.unit.autonomy.sights import carved, sweep

RADIUS, MARGIN, FARTHEST = 0.2, 0.05, 0.5  # m
ROOM = carved([(-3.0, -3.0, 3.0, 3.0)])
NOBODY, BEHIND = np.empty((0, 2)), Pose(theta=math.pi)


def room(view: float, pose: Pose, others: Array = NOBODY) -> float:
    """The room of who has looked ahead in the middle, with a field of view, rad."""
    local_map = LocalMap(LocalMapConfig())
    local_map.insert(sweep(ROOM, Pose(), field_of_view=view), Pose(), 0.0)
    return room_ahead(local_map, others, pose, FARTHEST, radius=RADIUS, margin=MARGIN)


def test_there_is_none_over_floor_that_nobody_has_seen() -> None:
    assert room(math.tau, BEHIND) >= FARTHEST
    assert room(math.pi, Pose()) >= FARTHEST
    assert room(math.pi, BEHIND) == 0.0


@pytest.mark.parametrize("pose", [Pose(2.5), Pose(-2.5, 0.0, math.pi)], ids=["ahead", "behind"])
def test_it_ends_a_margin_before_a_wall(pose: Pose) -> None:
    assert room(math.tau, pose) == pytest.approx(0.5 - RADIUS - MARGIN, abs=0.05)


def test_it_ends_a_margin_before_what_is_in_no_map() -> None:
    others = np.array([[0.6, 0.0], [-0.6, 1.0]])
    assert room(math.tau, Pose(), others) == pytest.approx(0.6 - RADIUS - MARGIN, abs=0.01)
    assert room(math.tau, BEHIND, others) >= FARTHEST
