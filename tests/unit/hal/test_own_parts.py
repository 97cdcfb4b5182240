"""A post of the robot that stands in its laser's view is not a part of the building."""

import math

import numpy as np
import pytest

from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan
from gvgbot.hal.own_parts import OwnParts, how_to_clear

RADIUS, PERIOD, BEAMS = 0.177, 0.1, 682  # of a Kobuki, m; of a URG-04LX, s
FIRST, LAST = -2.09, 2.09


def seen(k: int, ranges: Array, mount: Pose) -> Scan:
    increment = (LAST - FIRST) / (BEAMS - 1)
    return Scan(k * PERIOD, ranges.copy(), FIRST, increment, 0.02, 5.6, base_laser=mount)


def room(post: float | None) -> Array:
    """Walls two metres away, and perhaps a post at a range (m) to the left, 11 beams wide."""
    ranges = np.full(BEAMS, 2.0)
    ranges[:100] = math.inf
    ranges[100:120] = math.nan
    if post is not None:
        ranges[600:611] = post
    return ranges


def told(sights: list[Array], mount: Pose | None = None) -> list[Array]:
    parts = OwnParts(RADIUS)
    found = [parts.note(seen(k, sight, mount or Pose())) for k, sight in enumerate(sights)]
    return [own for own in found if own is not None and len(own)]


def test_a_post_is_told_of_once_with_what_leaves_it_out() -> None:
    (own,) = told(200 * [room(0.14)])
    assert own.tolist() == 11 * [0.14]
    assert "set laser.min_range_m=0.16" in how_to_clear(own)


def test_whoever_stands_at_the_robot_for_a_while_is_no_part_of_it() -> None:
    assert told([*10 * [room(0.14)], *190 * [room(None)]]) == []


def test_what_is_as_near_to_the_laser_but_beside_the_robot_is_no_part_of_it() -> None:
    """Beam 605 looks to 92.6 degrees: from a laser 0.15 m to the left, out of the robot."""
    assert told(100 * [room(0.14)], Pose(0.0, 0.15)) == []
    assert len(told(100 * [room(0.14)], Pose(0.0, -0.15))) == 1


@pytest.mark.parametrize("other", [341, 1081])
def test_another_laser_is_looked_at_by_itself(other: int) -> None:
    parts = OwnParts(RADIUS)
    for k in range(20):
        assert parts.note(seen(k, np.full(other, 2.0), Pose())) is None
    found = [parts.note(seen(k, room(0.14), Pose())) for k in range(40)]
    assert [len(own) for own in found if own is not None] == [11]
