"""Where a robot may start, in worlds whose spaces are known."""

import numpy as np
import pytest
import structlog

from gvgbot.drivers.body import BodyConfig
from gvgbot.drivers.start import check_start, warn_of_small_space
from gvgbot.drivers.world import World
from gvgbot.errors import WorldError
from gvgbot.geometry import Pose
from tests.unit.drivers.test_world_body import walled

RADIUS = BodyConfig().radius_m


def two_rooms(*, second: float) -> World:
    """Rooms of 2 by 3 m and of `second` by 3 m, in a bitmap that is free around them."""
    last = 60 + round(second / 0.05)
    occupied = np.zeros((80, last + 20), dtype=bool)
    for x0, x1 in ((20, 60), (60, last)):
        occupied[10:71, [x0, x1]] = occupied[[10, 70], x0 : x1 + 1] = True
    return World(occupied, 0.05)


@pytest.mark.parametrize(
    ("x", "y", "complaint"),
    [
        (-1.0, 5.0, "outside the map"),
        (1e308, 5.0, "outside the map"),
        (5.02, 5.0, "inside a wall"),
        (4.85, 5.0, "0.150 m away"),
    ],
)
def test_a_start_without_room_is_refused_with_its_reason(
    x: float, y: float, complaint: str
) -> None:
    with pytest.raises(WorldError, match=complaint) as refusal:
        check_start(walled(5.0), Pose(x, y, 0.0), RADIUS)
    assert f"({x:g}, {y:g})" in str(refusal.value)
    assert "choose" in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_start_in_a_wall_is_answered_with_one_in_the_middle_of_the_largest_closed_space() -> None:
    world = two_rooms(second=4.0)
    with pytest.raises(WorldError) as refusal:
        check_start(world, Pose(3.02, 2.0, 0.0), RADIUS)
    x, y, theta = map(float, str(refusal.value).rpartition("such as ")[2].split())
    check_start(world, Pose(x, y, theta), 1.4)
    assert 3.0 < x < 7.0


def test_a_start_that_just_fits_is_accepted() -> None:
    check_start(walled(5.0), Pose(5.0 - RADIUS - 1e-6, 5.0, 0.0), RADIUS)


@pytest.mark.parametrize(
    ("x", "second", "warnings"),
    [(2.0, 10.0, 1), (2.0, 6.0, 0), (5.0, 10.0, 0), (0.5, 10.0, 0)],
    ids=["small", "not that small", "large", "around them"],
)
def test_who_starts_closed_in_is_told_of_a_far_larger_space(
    x: float, second: float, warnings: int
) -> None:
    world = two_rooms(second=second)
    with structlog.testing.capture_logs() as logs:
        warn_of_small_space(world, Pose(x, 2.0), RADIUS)
    assert len(logs) == warnings
    for log in logs:
        larger_x, larger_y, theta = map(float, log["larger"].removeprefix("--start ").split())
        check_start(world, Pose(larger_x, larger_y, theta), 1.4)
        assert 3.0 < larger_x < 13.0
