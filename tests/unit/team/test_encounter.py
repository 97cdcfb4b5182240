"""Two robots that see each other know where the other's frame lies; other bodies tell nothing."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from gvgbot.autonomy.control.company import BodiesSeen
from gvgbot.geometry import Array, Pose, wrap_angle
from gvgbot.team.encounter import frame_of

STARTS = Pose(3.0, -2.0, 0.7), Pose(11.0, 6.0, -2.4)  # of either map frame, world frame
RADIUS = 0.177
SIGHT_M = 5.0

Way = Callable[[float], Array]  # where something is (2,), m, at a time, s; world frame


def straight(x: float, y: float, vx: float, vy: float, until: float = math.inf) -> Way:
    return lambda t: np.array([x + vx * min(t, until), y + vy * min(t, until)])


EAST = straight(0.0, 0.0, 0.4, 0.0, until=8.0)  # and then it waits, to let the other one pass
WEST = straight(7.0, 0.6, -0.45, 0.0)


def looks(number: int, way: Way, *bodies: Way, radius: float = RADIUS) -> list[BodiesSeen]:
    """What a robot sees from its way, to a centimetre; two robots do not look at the same time."""
    rng = np.random.default_rng(number)
    found = []
    for t in (np.arange(0.0, 15.0, 0.4) + 0.17 * number).tolist():
        dx, dy = way(t + 0.1) - way(t)
        map_base = STARTS[number].to(Pose(way(t)[0], way(t)[1], math.atan2(dy, dx)))
        seen = [body(t) for body in bodies if math.dist(body(t), way(t)) < SIGHT_M]
        centres = STARTS[number].inverse().transform(np.array(seen).reshape(-1, 2))
        centres += rng.normal(0.0, 0.01, centres.shape)
        rows = np.column_stack([centres, np.full(len(centres), radius)])
        found.append(BodiesSeen(t, map_base, rows))
    return found


def frame(mine: list[BodiesSeen], theirs: list[BodiesSeen]) -> tuple[Pose, Array] | None:
    return frame_of(mine, theirs, RADIUS, RADIUS)


@pytest.mark.parametrize("passer_by", [(), (straight(2.0, 1.0, 0.1, 0.3),)])
def test_two_that_pass_each_other_know_how_their_frames_lie(passer_by: tuple[Way, ...]) -> None:
    """Whether or not both see somebody else as well."""
    one, two = looks(0, EAST, WEST, *passer_by), looks(1, WEST, EAST, *passer_by)
    for here, there, mine, theirs in ((*STARTS, one, two), (*STARTS[::-1], two, one)):
        found = frame(mine, theirs)
        assert found is not None
        pose, covariance = found
        true, meeting = here.to(there), there.inverse().transform(WEST(6.0))
        assert math.dist(pose.transform(meeting), true.transform(meeting)) < 0.02
        off = wrap_angle(pose.theta - true.theta)
        assert abs(off) < min(0.02, 3.0 * math.sqrt(covariance[2, 2]))


def test_who_sees_without_being_seen_does_not_know_whom() -> None:
    assert frame(looks(0, EAST, WEST), looks(1, WEST)) is None


@pytest.mark.parametrize("metres", [2.0, 0.4])
def test_two_that_stand_before_each_other_may_be_any_two(metres: float) -> None:
    here, there = straight(0.0, 0.0, 0.0, 0.0), straight(metres, 0.0, 0.0, 0.0)
    assert frame(looks(0, here, there), looks(1, there, here)) is None


def test_of_two_others_that_drive_off_alike_either_may_be_the_one_that_tells() -> None:
    here = straight(0.0, 0.0, 0.0, 0.0)
    east, north = straight(1.0, 0.0, 0.25, 0.0), straight(0.0, 1.0, 0.0, 0.25)
    assert frame(looks(0, here, east), looks(1, east, here)) is not None
    assert frame(looks(0, here, east, north), looks(1, east, here)) is None


def test_two_that_only_move_to_and_fro_before_each_other_may_be_any_two() -> None:
    def to_and_fro(t: float) -> Array:
        return np.array([2.0 + 0.1 * math.sin(3.0 * t), 0.0])

    here = straight(0.0, 0.0, 0.0, 0.0)
    assert frame(looks(0, here, to_and_fro), looks(1, to_and_fro, here)) is None


def test_two_that_stood_on_either_side_of_a_third_are_not_taken_for_it_by_one_look() -> None:
    """Four robots that had started in a corridor were joined two metres off."""
    here = straight(0.0, 0.0, 0.0, 0.0)

    def there(t: float) -> Array:
        return np.array([4.0 + 0.25 * max(0.0, t - 3.0), 0.0])

    def third(t: float) -> Array:  # it is once where the other one would be
        return there(t) - (2.0, 0.0) if t < 3.0 or 11.9 < t < 12.3 else np.array([50.0, 0.0])

    assert sum(math.dist(third(t), (50.0, 0.0)) > 0.0 for t in np.arange(3.0, 15.0, 0.4)) == 1
    assert frame(looks(0, here, third), looks(1, there, third)) is None


def test_two_that_meet_others_at_the_same_time_are_not_taken_for_each_other() -> None:
    """Both drive along corridors, and somebody comes towards each, who is not the other one."""
    mine, theirs = (
        looks(0, EAST, straight(6.0, 0.6, -0.3, 0.05)),
        looks(1, WEST, straight(1.0, 0.0, 0.5, 0.0)),
    )
    assert frame(mine, theirs) is None


def test_a_body_of_another_width_is_not_the_robot() -> None:
    assert frame(looks(0, EAST, WEST, radius=0.3), looks(1, WEST, EAST)) is None


def test_who_was_silent_while_it_was_seen_is_not_known_to_have_been_there() -> None:
    told = [look for look in looks(1, WEST, EAST) if not 1.0 < look.stamp < 14.0]
    assert frame(looks(0, EAST, WEST), told) is None


def test_nobody_is_recognised_before_anything_was_seen() -> None:
    assert frame([], []) is None
    assert frame(looks(0, EAST), looks(1, WEST)) is None
