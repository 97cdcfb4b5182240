"""Unlucky places to start from, wheels that turn without effect, and odometry that errs."""

import math

import pytest

from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.config import TwinConfig
from gvgbot.drivers.hokuyo.twin_config import HokuyoTwinConfig
from gvgbot.drivers.kobuki.twin_config import KobukiTwinConfig
from gvgbot.geometry import Pose
from tests.scenarios.rig import (
    Play,
    assert_degrees,
    assert_explored,
    assert_found,
    graph_shape,
    play,
)
from tests.unit.autonomy.sights import carved

pytestmark = [pytest.mark.slow, pytest.mark.twin]

# A T: a corridor of 1.4 m from west to east, and one to the south.
TEE = carved([(-3.5, -0.7, 3.5, 0.7), (-0.7, -4.0, 0.7, 0.0)])
SMALL_TEE = carved([(-3.0, -0.7, 2.4, 0.7), (-0.7, -3.0, 0.7, 0.0)])
SMALL_ENDS = [(-2.3, 0.0), (1.7, 0.0), (0.0, -2.3)]
IMPATIENT = ExplorationConfig(retries=0, patience_s=10.0)
MEETPOINT = (0.0, -(1.4**2) / (8 * 1.4))  # as far from the wall opposite as from both corners
ENDS = [(-2.8, 0.0), (2.8, 0.0), (0.0, -3.3)]
STARTS = {
    "against a wall": Pose(-2.0, 0.7 - 0.18, math.pi / 2),
    "along a wall": Pose(-2.0, 0.7 - 0.185, 0.0),
    "inside the margin of the guard": Pose(-2.0, -0.7 + 0.182, -math.pi / 4),
    "in a corner": Pose(-3.5 + 0.19, 0.7 - 0.19, 0.75 * math.pi),
    "at the vertex": Pose(*MEETPOINT, 1.0),
    "at an endpoint": Pose(*ENDS[1], 0.0),
}


@pytest.mark.parametrize("start", STARTS.values(), ids=STARTS)
def test_the_graph_is_reached_from_anywhere(start: Pose) -> None:
    run = play(TEE, start)
    assert_explored(run)
    assert_found(run, "meetpoint", [MEETPOINT])
    assert_degrees(run, {MEETPOINT: 3})
    assert_found(run, "endpoint", ENDS)


def test_a_slot_that_the_robot_just_fits_into_is_left() -> None:
    """Half a metre wide, with the nose to its end."""
    world = carved([(-2.5, -0.7, 2.5, 0.7), (-0.25, 0.7, 0.25, 2.0)])
    run = play(world, Pose(0.0, 1.75, math.pi / 2))
    assert run.outcome == "explored", run.pipeline.mission.reason
    assert run.contacts == 0
    assert min(pose.y for pose in run.truth) < 0.5


def test_who_goes_into_the_corner_that_it_starts_in_turns_round() -> None:
    """Of two rooms, with a laser that does not see their far ends: one edge through the door."""
    rooms = carved([(0.5, 0.5, 5.9, 6.5), (5.9, 3.0, 6.1, 3.6), (6.1, 0.5, 11.5, 6.5)])
    twin = TwinConfig(seed=1, laser=HokuyoTwinConfig(model="URG-04LX"))
    run = play(rooms, Pose(0.9, 0.9, 0.8), twin=twin)
    assert_explored(run)
    assert run.recoveries().count("turn round") == 1
    assert max(pose.x for pose in run.truth) > 6.5


def test_wheels_that_spin_for_a_while_leave_the_map_where_it_is() -> None:
    """On a metre and a half of smooth floor the robot goes half as far as its wheels say."""
    run = play(TEE, Pose(-2.8, 0.0, 0.0), grip=lambda pose: 0.5 if -2.0 < pose.x < -0.5 else 1.0)
    assert_explored(run)
    assert_found(run, "meetpoint", [MEETPOINT])
    assert_found(run, "endpoint", ENDS)


def test_a_robot_that_does_not_get_on_backs_off_and_gives_up_in_the_end() -> None:
    """Beyond x = -1, the wheels turn and nothing moves, but for the way back."""
    start = Pose(-2.6, 0.0, 0.0)
    run = play(SMALL_TEE, start, grip=_stuck_ahead, exploration=IMPATIENT, limit=300.0)
    assert run.recoveries().count("back off") >= 1
    assert run.outcome is not None
    assert run.contacts == 0


def _stuck_ahead(pose: Pose) -> float:
    return 0.0 if pose.x > -1.0 else 1.0


def test_much_odometry_error_is_corrected_by_the_walls() -> None:
    """Worn wheels, and no gyro to tell the heading."""
    twin = TwinConfig(seed=4, base=KobukiTwinConfig(odometry="worn"))
    run = play(TEE, Pose(-2.5, 0.1, 0.2), twin=twin)
    assert_explored(run)
    assert graph_shape(run) == (1, 3, 3)
    assert_found(run, "endpoint", ENDS)


def test_a_cable_of_people_and_bumps_at_once_does_not_stop_the_run() -> None:
    """One after another: a bump, an overload, wheels in the air."""

    async def story(run: Play) -> None:
        await run.until(lambda: run.here.x > -1.5)
        run.mishap("bump", 0.3, side=4)
        await run.sleep(4.0)
        run.mishap("over-current", 0.5)
        await run.sleep(5.0)
        run.mishap("wheel drop", 1.0)

    run = play(SMALL_TEE, Pose(-2.6, 0.0, 0.0), story=story)
    assert run.outcome == "explored", run.pipeline.mission.reason
    assert_found(run, "endpoint", SMALL_ENDS)
