"""A sweep from a moving base equals, once deskewed, what a base standing at its start sees."""

import math

import numpy as np
import pytest

from gvgbot.geometry import Array, Pose
from gvgbot.hal.deskew import deskewed
from gvgbot.hal.messages import Scan

BEAMS = 1081
BEARINGS = np.radians(np.linspace(-135.0, 135.0, BEAMS))
MOUNT = Pose(0.1, 0.02, 0.3)


def room(world_laser: Pose, bearing: float) -> float:
    """Range to the walls of a room that reaches from -3 to 4 m in x and from -2 to 2.5 m in y."""
    dx, dy = math.cos(world_laser.theta + bearing), math.sin(world_laser.theta + bearing)
    to_x = ((4.0 if dx > 0 else -3.0) - world_laser.x) / dx if dx else math.inf
    to_y = ((2.5 if dy > 0 else -2.0) - world_laser.y) / dy if dy else math.inf
    return min(to_x, to_y)


def sweep(motion: Pose) -> Scan:
    """Each beam from where an evenly moving base has the laser at its time."""
    ranges = np.empty(BEAMS)
    for i in range(BEAMS):
        share = i / BEAMS
        base = Pose(share * motion.x, share * motion.y, share * motion.theta)
        ranges[i] = room(base.compose(MOUNT), BEARINGS[i])
    return to_scan(ranges)


def to_scan(ranges: Array, time_increment: float = 1e-5) -> Scan:
    return Scan(
        stamp=0.0,
        ranges=ranges,
        angle_min=float(BEARINGS[0]),
        angle_increment=float(BEARINGS[1] - BEARINGS[0]),
        range_min=0.02,
        range_max=30.0,
        time_increment=time_increment,
        base_laser=MOUNT,
    )


@pytest.mark.parametrize(
    "motion",
    [Pose(0.03, 0.0, 0.0), Pose(0.0, 0.0, 0.1), Pose(0.0, 0.0, -0.1), Pose(-0.02, 0.0, 0.05)],
    ids=["ahead", "left turn", "right turn", "backing arc"],
)
def test_a_moving_sweep_becomes_what_a_standing_laser_sees(motion: Pose) -> None:
    still = np.array([room(MOUNT, bearing) for bearing in BEARINGS])
    straight = deskewed(sweep(motion), motion)
    seen = np.isfinite(straight.ranges)
    wrong = np.abs(straight.ranges - still)[seen]
    assert seen.mean() > 0.9
    assert np.quantile(wrong, 0.98) < 1e-4  # the rest is beside the corners
    corner = 5.0 * math.tan(math.radians(75)) * math.radians(0.25)  # a beam's step on a slant wall
    assert wrong.max() < corner
    assert straight.time_increment == 0.0


def test_a_still_sweep_stays_as_it_is() -> None:
    scan = sweep(Pose())
    assert deskewed(scan, Pose()).ranges.tobytes() == scan.ranges.tobytes()


def test_directions_into_which_no_beam_looked_are_not_invented() -> None:
    straight = deskewed(sweep(Pose(0.0, 0.0, -0.2)), Pose(0.0, 0.0, -0.2))
    # the last beam looks 0.2 rad further right than it would have from the start
    assert np.isnan(straight.ranges[-round(0.18 / (BEARINGS[1] - BEARINGS[0])) :]).all()


def test_nothing_in_range_stays_nothing_and_untrusted_stays_untrusted() -> None:
    nothing = deskewed(to_scan(np.full(BEAMS, math.inf)), Pose(0.02, 0.0, 0.05))
    assert not np.isfinite(nothing.ranges).any()
    assert np.isinf(nothing.ranges).mean() > 0.9
    untrusted = deskewed(to_scan(np.full(BEAMS, math.nan)), Pose(0.02, 0.0, 0.05))
    assert np.isnan(untrusted.ranges).all()


def test_between_a_post_and_the_wall_behind_it_nothing_is_invented() -> None:
    ranges = np.full(BEAMS, 4.0)
    ranges[500:520] = 3.0
    straight = deskewed(to_scan(ranges), Pose(0.0, 0.0, 0.05))
    seen = straight.ranges[np.isfinite(straight.ranges)]
    assert set(np.round(seen, 1)) == {3.0, 4.0}
