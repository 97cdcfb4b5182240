"""Lines on the map that the robot does not cross, though its laser sees beyond them."""

import math

import numpy as np
import pytest

from gvgbot.autonomy.errands import Declined
from gvgbot.autonomy.events import ErrandEnded
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.virtual_walls import VirtualWall, points_of
from gvgbot.geometry import Pose
from tests.scenarios.rig import (
    NEAR,
    ROBOT_RADIUS,
    Play,
    assert_degrees,
    assert_explored,
    assert_found,
    play,
)
from tests.unit.autonomy.sights import carved

pytestmark = [pytest.mark.slow, pytest.mark.twin]

# A T: a corridor of 1.4 m from west to east, and one to the south.
TEE = carved([(-2.2, -0.7, 2.2, 0.7), (-0.7, -4.6, 0.7, 0.0)])
START = Pose(-1.2, 0.0, 0.3)
MEETPOINT = (0.0, -(1.4**2) / (8 * 1.4))  # as far from the wall opposite as from both corners
ENDS = [(-1.5, 0.0), (1.5, 0.0)]
# A room of 6 m by 6 m, and a corridor that leads out of it to the west.
ROOM = carved([(-3.0, -1.0, 3.0, 5.0), (-4.5, 0.5, -2.9, 1.5)])
ACROSS_M = -2.4  # the wall is here, from side to side of the arm to the south
HALL = carved([(-10.0, -10.0, 10.0, 10.0)])


def in_map(*corners: tuple[float, float], start: Pose = START) -> VirtualWall:
    """Corners in the world as they are on the map, which begins at the start."""
    return tuple((x, y) for x, y in start.inverse().transform(np.array(corners)).tolist())


ARM = in_map((-0.8, ACROSS_M), (0.8, ACROSS_M))


def southernmost(run: Play) -> float:
    return min(pose.y for pose in run.truth)


@pytest.mark.parametrize("drives_dead_ends", [False, True])
def test_an_arm_ends_at_a_virtual_wall_as_at_any_other(drives_dead_ends: bool) -> None:
    exploration = ExplorationConfig(drive_dead_ends=drives_dead_ends)
    run = play(TEE, START, exploration=exploration, virtual_walls=(ARM,))
    assert_explored(run)
    assert run.pipeline.mission.reason == "no frontier is left"
    assert_found(run, "meetpoint", [MEETPOINT])
    assert_degrees(run, {MEETPOINT: 3})
    assert_found(run, "endpoint", [*ENDS, (0.0, ACROSS_M + 0.7)])
    assert southernmost(run) > ACROSS_M + ROBOT_RADIUS


def test_a_fence_in_an_empty_hall_is_a_room() -> None:
    fence = in_map((-4.0, -3.0), (3.0, -3.0), (3.0, 2.0), (-4.0, 2.0), (-4.0, -3.0))
    run = play(HALL, START, virtual_walls=(fence,))
    assert_explored(run)
    assert_found(run, "endpoint", [(-1.5, -0.5), (0.5, -0.5)])  # of its middle line
    x, y = np.array([(pose.x, pose.y) for pose in run.truth]).T
    assert (x > -4.0 + ROBOT_RADIUS).all()
    assert (x < 3.0 - ROBOT_RADIUS).all()
    assert (y > -3.0 + ROBOT_RADIUS).all()
    assert (y < 2.0 - ROBOT_RADIUS).all()


def test_who_starts_beside_one_stays_on_its_side() -> None:
    """The strip beyond is narrow: its middle line is nearer than that of the room."""
    start = Pose(0.0, 0.6, 0.2)
    run = play(ROOM, start, virtual_walls=(in_map((-3.1, 0.0), (3.1, 0.0), start=start),))
    assert_explored(run)
    assert_found(run, "endpoint", [(0.5, 2.5), (-4.0, 1.0)])
    assert southernmost(run) > ROBOT_RADIUS


def test_who_is_shut_in_closely_stays_there() -> None:
    """In a place of which it does not see all: it does not call it explored."""
    tee, start = carved([(-3.5, -0.7, 3.5, 0.7), (-0.7, -6.0, 0.7, 0.0)]), Pose(-2.0, 0.0, 0.3)
    corners = (-2.3, -0.3), (-1.7, -0.3), (-1.7, 0.3), (-2.3, 0.3), (-2.3, -0.3)
    run = play(tee, start, virtual_walls=(in_map(*corners, start=start),))
    assert run.outcome == "failed"
    assert max(math.dist((pose.x, pose.y), (start.x, start.y)) for pose in run.truth) < 0.1


def test_on_a_known_map_no_way_leads_over_it_as_long_as_it_is_there() -> None:
    """The map keeps what is beyond; who is asked to go there says at once what is in the way."""
    goals = np.array([(1.2, 0.0), (-1.2, 0.0), (0.0, -3.9)])
    east, west, far = START.inverse().transform(goals)

    async def story(run: Play) -> None:
        await run.until(lambda: run.pipeline.mission.outcome is not None)
        run.pipeline.sight.virtual_walls = points_of([ARM])
        errands = run.pipeline.errands
        for place in (east, west, far):
            run.truth.clear()
            errands.goto_point(float(place[0]), float(place[1]), run.clock.now())
            await run.until(lambda: errands.is_resting)
            await run.sleep(1.0)
            souths.append(southernmost(run))
            if place is east:
                with pytest.raises(Declined) as declined:
                    errands.goto_point(float(far[0]), float(far[1]), run.clock.now())
                reasons.append(str(declined.value))
                run.pipeline.sight.virtual_walls = np.empty((0, 2))

    souths: list[float] = []
    reasons: list[str] = []
    run = play(TEE, START, story=story, goes_on=lambda _: len(souths) < 3)
    assert souths[0] > ACROSS_M + ROBOT_RADIUS
    ended = [event for event in run.events if isinstance(event, ErrandEnded)]
    assert [event.outcome for event in ended] == ["arrived"] * 3
    assert reasons == ["no known way leads there but over a virtual wall"]
    assert math.dist((run.truth[-1].x, run.truth[-1].y), (0.0, -3.9)) < NEAR
    assert_found(run, "endpoint", [*ENDS, (0.0, -3.9)])
