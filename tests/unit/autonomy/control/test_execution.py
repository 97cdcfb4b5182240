"""Orders are carried out: turns to their end, tracks as carefully as it takes."""

import math

import numpy as np
import pytest

from gvgbot.autonomy.control.edge_follower import EdgeFollowerConfig, Track
from gvgbot.autonomy.control.execution import Execution
from gvgbot.autonomy.control.orders import Drive, LookAround, Stand
from gvgbot.geometry import STANDSTILL, Pose, Twist

AHEAD = Drive(Track.of(np.array([[0.0, 0.0], [5.0, 0.0]]), np.ones(2)))


def as_it_is(twist: Twist) -> Twist:
    return twist


@pytest.fixture
def execution() -> Execution:
    return Execution(EdgeFollowerConfig(), 0.2)


def test_at_first_it_stands(execution: Execution) -> None:
    assert execution.wish(Pose(), as_it_is) == STANDSTILL


def test_it_turns_on_the_spot_until_the_base_has_turned_so_far(execution: Execution) -> None:
    execution.obey(LookAround(math.pi))
    for turned in (2.0, -0.5, 1.0):  # 2.5 rad in all
        execution.note_turn(turned, 0.1)
        twist = execution.wish(Pose(), as_it_is)
        assert (twist.linear, twist.angular > 0.0) == (0.0, True)
    execution.note_turn(0.7, 0.1)
    assert not execution.is_turning
    execution.note_turn(-1.0, 0.1)  # a turn that has ended does not begin again
    assert execution.wish(Pose(), as_it_is) == STANDSTILL


def test_a_track_is_followed_after_the_turn(execution: Execution) -> None:
    execution.turn(1.0)
    execution.obey(AHEAD)
    assert execution.wish(Pose(), as_it_is).linear == 0.0
    execution.note_turn(1.0, 0.1)
    assert execution.wish(Pose(), as_it_is).linear > 0.0


def test_whoever_is_careful_slows_it_down_along_a_track(execution: Execution) -> None:
    execution.obey(AHEAD)
    assert execution.wish(Pose(), lambda twist: Twist(0.0, twist.angular)).linear == 0.0


def test_to_stand_gives_up_the_turn_and_the_track(execution: Execution) -> None:
    execution.obey(AHEAD)
    execution.turn(1.0)
    execution.stand()
    assert not execution.is_turning
    assert execution.order == Stand()
    assert execution.wish(Pose(), as_it_is) == STANDSTILL


def test_a_base_that_does_not_turn_is_known_after_ten_seconds_that_it_was_free_to(
    execution: Execution,
) -> None:
    """Not the time in which the guard forbids it."""
    execution.turn(3.0)
    for _ in range(200):
        execution.note_turn(0.0001, 0.0)
    for _ in range(12):
        execution.note_turn(0.06, 2.0)  # slowly, but it turns
    assert not execution.cannot_turn
    for _ in range(6):
        execution.note_turn(0.001, 2.0)
    assert execution.cannot_turn


def test_another_turn_is_tried_anew(execution: Execution) -> None:
    execution.turn(3.0)
    execution.note_turn(0.0, 20.0)
    execution.turn(1.0)
    assert not execution.cannot_turn
