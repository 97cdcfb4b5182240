"""A laser that is covered says that nothing is within range, and so does one in an open hall."""

from math import inf, nan

import numpy as np
import pytest

from gvgbot.geometry import Array
from gvgbot.hal.cover import Cover
from gvgbot.hal.messages import Scan

REACH, PERIOD, BEAMS = 5.6, 0.1, 682  # of a URG-04LX: m, s
BEARINGS = np.linspace(-2.09, 2.09, BEAMS)
NOTHING = np.full(BEAMS, inf)


def judged(*sights: Array, period: float = PERIOD) -> list[Array]:
    cover = Cover()
    scans = [
        Scan(k * period, sight.copy(), -2.09, 4.18 / (BEAMS - 1), 0.02, REACH)
        for k, sight in enumerate(sights)
    ]
    return [cover.judge(scan).ranges for scan in scans]


def wall_at(distance: float, bearing: float = 0.0) -> Array:
    """Ranges to an endless wall whose nearest point is there."""
    with np.errstate(divide="ignore"):
        ranges = distance / np.maximum(np.cos(BEARINGS - bearing), 0.0)
    return np.where(ranges > REACH, inf, ranges)


def test_walls_that_vanish_between_two_scans_are_doubted_until_something_is_seen_again() -> None:
    stray = NOTHING.copy()
    stray[5] = 3.0
    ranges = judged(wall_at(1.0), NOTHING, stray, *[NOTHING] * 50, wall_at(1.0), wall_at(1.0))
    assert all(np.isnan(doubted).all() for doubted in ranges[1:-2])
    assert all(np.array_equal(believed, wall_at(1.0)) for believed in (ranges[0], *ranges[-2:]))


@pytest.mark.parametrize("sight", [NOTHING, np.full(BEAMS, nan)], ids=["hall", "error codes"])
def test_nothing_from_the_first_scan_on_is_taken_as_it_comes(sight: Array) -> None:
    assert np.array_equal(judged(sight, sight)[-1], sight, equal_nan=True)


def test_the_last_wall_of_a_hall_leaves_sight_without_a_doubt() -> None:
    """At 0.7 m/s; the faster the wall goes, the nearer it was when it was seen last."""
    walls = [wall_at(5.0 + 0.07 * k) for k in range(12)]
    assert np.isfinite(walls[0]).mean() > 0.2
    assert np.array_equal(judged(*walls)[-1], NOTHING)


def test_a_wall_that_a_turning_robot_loses_from_sight_is_not_missed() -> None:
    """At 1.5 rad/s."""
    walls = [wall_at(4.0, 0.15 * k) for k in range(21)]
    assert np.array_equal(judged(*walls)[-1], NOTHING)


def test_after_half_a_second_without_a_scan_the_robot_may_be_elsewhere() -> None:
    assert np.array_equal(judged(wall_at(1.0), NOTHING, period=0.6)[-1], NOTHING)
