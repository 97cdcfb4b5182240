"""Rooms seen while the robot turns, by a laser that hangs as it is said to, and a mirrored one."""

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.handedness import Handedness
from gvgbot.drivers.world import World
from gvgbot.geometry import Pose
from gvgbot.hal.messages import Scan
from tests.unit.autonomy.sights import ALL_ROUND, LASER_270, carved, sweep

SQUARE = carved([(-2.0, -2.0, 2.0, 2.0)])
CROSSING = carved([(-6.0, -1.0, 6.0, 1.0), (-1.0, -6.0, 1.0, 6.0)])
CORRIDOR = carved([(-9.0, -1.0, 9.0, 1.0)])
TURN = 0.28  # rad, from one sweep to the next
PLACES = [
    pytest.param(SQUARE, Pose(), id="the middle of a square"),
    pytest.param(SQUARE, Pose(1.2, -0.7, 0.3), id="a corner of a square"),
    pytest.param(CROSSING, Pose(), id="the middle of a crossing"),
    pytest.param(CORRIDOR, Pose(0.0, 0.0, 0.1), id="a corridor"),
]


def as_is(scan: Scan) -> Scan:
    return scan


def mirrored(scan: Scan) -> Scan:
    return replace(scan, ranges=scan.ranges[::-1].copy())


def turns(world: World, start: Pose, turn: float = TURN, count: int = 8) -> list[Scan]:
    """What a laser sees between turns on the spot."""
    rng = np.random.default_rng(1)
    poses = [start.compose(Pose(0.0, 0.0, turn * k)) for k in range(count)]
    return [
        sweep(world, pose, field_of_view=LASER_270, sigma=0.01, rng=rng, reach=20.0)
        for pose in poses
    ]


def learnt(scans: Iterable[Scan], turn: float = TURN, wished: float = 1.0) -> Handedness:
    """What is known after sweeps between which odometry turns by an angle."""
    handedness = Handedness()
    for k, scan in enumerate(scans):
        handedness.note(scan, Pose(1.0, 2.0, turn * k), wished)
    return handedness


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("hung", [as_is, mirrored])
@pytest.mark.parametrize(("world", "start"), PLACES)
def test_a_turn_tells_which_way_up_a_laser_hangs(
    world: World, start: Pose, hung: Callable[[Scan], Scan], sense: float
) -> None:
    seen = map(hung, turns(world, start, sense * TURN))
    handedness = learnt(seen, sense * TURN, wished=sense)
    assert handedness.is_settled
    assert handedness.is_mirrored is (hung is mirrored)


@pytest.mark.parametrize("hung", [as_is, mirrored])
def test_less_than_a_radian_tells_nothing(hung: Callable[[Scan], Scan]) -> None:
    assert not learnt(map(hung, turns(SQUARE, Pose(), count=4))).is_settled


@pytest.mark.parametrize("metres", [3.0, np.inf, np.nan])
def test_a_round_room_and_an_open_field_tell_nothing(metres: float) -> None:
    rng, scan = np.random.default_rng(2), sweep(SQUARE, Pose(), field_of_view=LASER_270)
    scans = [replace(scan, ranges=metres + rng.normal(0.0, 0.03, 1081)) for _ in range(500)]
    assert not learnt(scans).is_settled


def test_who_is_turned_by_hand_learns_nothing() -> None:
    assert not learnt(map(mirrored, turns(SQUARE, Pose())), wished=0.0).is_settled


def test_odometry_that_turns_the_other_way_is_no_mirrored_laser() -> None:
    """To walls it looks the same, but not to who wished to turn."""
    assert not learnt(turns(SQUARE, Pose()), -TURN, wished=1.0).is_settled


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 0.7, 1.5, 2.0, 3.0])
def test_whatever_share_of_the_turn_odometry_feels_a_right_laser_is_none_that_is_mirrored(
    share: float,
) -> None:
    """A dead gyro, wheels that slip, a base that does not turn."""
    scans = turns(SQUARE, Pose(0.4, 0.3, 0.0), TURN, count=200)
    assert not learnt(scans, share * TURN).is_mirrored


def test_a_laser_that_shows_the_same_over_and_over_is_none_that_is_mirrored() -> None:
    assert not learnt(turns(CROSSING, Pose(0.3, 0.2, 0.5))[:1] * 300).is_mirrored


@pytest.mark.parametrize("hung", [as_is, mirrored])
def test_people_who_walk_about_do_not_hide_it(hung: Callable[[Scan], Scan]) -> None:
    rng, scans = np.random.default_rng(3), turns(SQUARE, Pose(0.4, 0.3, 0.0), count=20)
    for k, scan in enumerate(scans):
        ranges = scan.ranges.copy()
        for legs in rng.integers(0, 1000, 2):
            ranges[legs : legs + 40] = rng.uniform(0.4, 1.2)
        scans[k] = hung(replace(scan, ranges=ranges))
    handedness = learnt(scans)
    assert handedness.is_settled
    assert handedness.is_mirrored is (hung is mirrored)


def test_sweeps_from_different_places_are_not_compared() -> None:
    handedness = Handedness()
    for k, scan in enumerate(turns(SQUARE, Pose())):
        handedness.note(mirrored(scan), Pose(0.2 * k, 0.0, TURN * k), 1.0)
    assert not handedness.is_settled


def test_a_laser_that_was_exchanged_for_one_with_other_beams_is_waited_for() -> None:
    scans = turns(SQUARE, Pose())
    few = [replace(scan, ranges=scan.ranges[::2].copy()) for scan in scans]
    mixed = [scan for pair in zip(scans, few, strict=True) for scan in pair]
    assert not learnt(mixed).is_settled


def test_a_laser_that_sees_all_round_is_compared_where_both_have_beams() -> None:
    poses = [Pose(0.4, 0.3, TURN * k) for k in range(8)]
    scans = [mirrored(sweep(SQUARE, pose, field_of_view=ALL_ROUND)) for pose in poses]
    assert learnt(scans).is_mirrored
