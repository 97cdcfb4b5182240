"""People stand in the way: the robot waits, goes round them or elsewhere, and comes back."""

import math
from dataclasses import dataclass
from itertools import dropwhile, pairwise, takewhile

import numpy as np
import pytest

from gvgbot.autonomy.events import VertexAdded
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.config import RobotConfig, TwinConfig
from gvgbot.drivers.hokuyo.twin_config import HokuyoTwinConfig
from gvgbot.geometry import Pose
from gvgbot.live.team import member_of
from gvgbot.team.member import TeamConfig
from tests.scenarios.rig import (
    FAR_AWAY,
    ROBOT_RADIUS,
    Play,
    assert_degrees,
    assert_found,
    play,
)
from tests.unit.autonomy.sights import carved

pytestmark = [pytest.mark.slow, pytest.mark.twin]

# A corridor from west to east, with a branch to the north whose end cannot be seen from its mouth.
NARROW = 1.0  # m: no way past a person of 0.4 m or more
WORLD = carved(
    [
        (-4.0, -0.5, 3.0, 0.5),
        (-0.5, 0.0, 0.5, 3.5),
        (-0.5, 2.5, 3.0, 3.5),
    ]
)
START = Pose(-3.0, 0.0, 0.0)
MEETPOINT = (0.0, NARROW**2 / (8 * NARROW))
ENDS = [(-3.5, 0.0), (2.5, 0.0), (2.5, 3.0)]


def distances_to_person(run: Play, x: float, y: float, *, since: float) -> list[float]:
    return [math.dist((p.x, p.y), (x, y)) for p in run.truth[round(since * 50) :]]


@dataclass(eq=False)
class Met:
    """A run in which somebody jumps into the way, and later stands in the branch for a while."""

    run: Play
    jumped_to: tuple[float, float]
    jumped_at: float  # stamp


@pytest.fixture(scope="module")
def met() -> Met:
    jumps: list[tuple[float, float, float]] = []

    async def story(run: Play) -> None:
        await run.until(lambda: run.here.x > -1.5)
        jumps.append((run.here.x + 1.0, run.here.y, run.clock.now()))
        run.put_person(*jumps[0][:2])
        await run.sleep(6.0)
        run.put_person(*FAR_AWAY)
        await run.until(lambda: run.here.y > 0.3)
        run.put_person(0.0, 1.8)
        await run.sleep(8.0)
        run.put_person(*FAR_AWAY)

    run = play(WORLD, START, story=story, with_person=True)
    ((x, y, when),) = jumps
    return Met(run, (x, y), when)


def test_a_person_who_steps_aside_soon_is_waited_for(met: Met) -> None:
    run = met.run
    assert run.outcome == "explored", run.pipeline.mission.reason
    assert run.contacts == 0
    assert "try another way" not in run.recoveries()
    assert_found(run, "meetpoint", [MEETPOINT])
    assert_degrees(run, {MEETPOINT: 3})
    assert_found(run, "endpoint", ENDS)


def test_a_person_who_jumps_into_the_way_is_not_touched(met: Met) -> None:
    """A metre ahead of a robot at half a metre a second; it stops and does not brush past."""
    run, when = met.run, met.jumped_at
    near = distances_to_person(run, *met.jumped_to, since=when)[:300]
    assert min(near) > ROBOT_RADIUS + 0.2
    assert run.contacts == 0
    stood = run.truth[round((when + 4.0) * 50) : round((when + 5.0) * 50)]
    assert math.dist((stood[0].x, stood[0].y), (stood[-1].x, stood[-1].y)) < 0.02
    assert run.outcome == "explored", run.pipeline.mission.reason


def test_a_person_who_stays_for_a_while_is_left_alone_and_the_branch_explored_later() -> None:
    """Waited for at most fifteen seconds; nothing is believed that only the person makes so."""
    spot = (0.0, 1.8)
    gone: list[float] = []

    async def story(run: Play) -> None:
        await run.until(lambda: run.here.y > 0.3)
        run.put_person(*spot)
        await run.until(lambda: "try another way" in run.recoveries())
        gone.append(run.clock.now())
        await run.sleep(5.0)
        run.put_person(*FAR_AWAY)

    patience = ExplorationConfig(in_the_way_s=4.0, retry_after_s=8.0)
    run = play(WORLD, START, story=story, with_person=True, exploration=patience)
    assert gone
    assert run.outcome == "explored", run.pipeline.mission.reason
    assert run.contacts == 0
    assert "try again" in run.recoveries()
    assert_found(run, "meetpoint", [MEETPOINT])
    assert_found(run, "endpoint", ENDS)
    added = [e for e in run.events if isinstance(e, VertexAdded)]
    assert len(added) == 4


def test_a_person_who_never_goes_leaves_a_frontier_blocked() -> None:
    """All is over before he has stood for the two minutes that make him a part of the building."""

    async def story(run: Play) -> None:
        await run.until(lambda: run.here.y > 0.3)
        run.put_person(0.0, 1.8)

    patience = ExplorationConfig(in_the_way_s=2.0, retry_after_s=2.0, retries=1, patience_s=10.0)
    run = play(WORLD, START, story=story, with_person=True, exploration=patience)
    assert run.outcome == "explored_with_blocked", run.pipeline.mission.reason
    assert run.contacts == 0
    assert run.recoveries().count("try again") == 1
    assert len(run.vertices("endpoint")) == 2  # the person is none


@dataclass(eq=False)
class Passed:
    """A run in a wide corridor with somebody at the first look, and somebody in the way later."""

    run: Play
    added_at_first: list[str]  # kinds of vertices, until the second one came


def kinds_added(run: Play) -> list[str]:
    return [event.kind for event in run.events if isinstance(event, VertexAdded)]


@pytest.fixture(scope="module")
def passed() -> Passed:
    world = carved([(-4.0, -1.1, 6.0, 1.1), (3.8, -1.1, 6.0, 5.0)])
    added_at_first: list[str] = []

    async def story(run: Play) -> None:
        run.put_person(0.5, 0.0)
        await run.sleep(15.0)
        run.put_person(*FAR_AWAY)
        await run.until(lambda: run.here.x > -1.2)
        added_at_first.extend(kinds_added(run))
        run.put_person(1.8, 0.0)
        await run.until(lambda: run.here.x > 3.0)
        run.put_person(*FAR_AWAY)

    return Passed(play(world, START, story=story, with_person=True), added_at_first)


def test_a_person_in_a_wide_corridor_is_passed(passed: Passed) -> None:
    """Between the person, 0.25 m in radius at most, and either wall there is 0.85 m."""
    run = passed.run
    assert run.outcome == "explored", run.pipeline.mission.reason
    assert run.contacts == 0
    assert_found(run, "endpoint", [(-2.9, 0.0), (4.9, 3.9)])
    assert len(run.vertices("meetpoint")) == 0


def test_a_person_who_stands_there_at_the_first_look_is_no_pillar(passed: Passed) -> None:
    """A pillar in the middle of a wide corridor makes two meetpoints; whoever goes makes none."""
    run = passed.run
    assert run.outcome == "explored", run.pipeline.mission.reason
    assert run.contacts == 0
    assert passed.added_at_first == ["endpoint"]
    assert kinds_added(run) == ["endpoint", "endpoint"]


@pytest.mark.parametrize("in_team", [False, True])
def test_a_person_who_stands_in_a_corridor_at_the_first_look_is_not_its_end(
    *, in_team: bool
) -> None:
    """A pillar would be, for there is no way past it; the rest is known long before he goes."""
    world = carved([(-4.0, -0.5, 3.0, 0.5), (2.0, -0.5, 3.0, 2.5)])

    async def story(run: Play) -> None:
        if in_team:
            member_of(RobotConfig(), TeamConfig(), run.pipeline)
        run.put_person(1.0, 0.0)
        await run.sleep(38.0)
        run.put_person(*FAR_AWAY)

    run = play(world, START, story=story, with_person=True)
    assert run.outcome == "explored", run.pipeline.mission.reason
    assert run.contacts == 0
    assert_found(run, "endpoint", [(-3.5, 0.0), (2.5, 2.0)])
    assert len(run.pipeline.mapper.graph.vertices) == 2


def test_a_person_half_hidden_at_first_is_no_pillar() -> None:
    """Round the corner of a bend, less of a person is seen than can be told from furniture."""
    world = carved([(-4.0, -1.1, 6.0, 1.1), (3.8, -1.1, 6.0, 5.0)])

    async def story(run: Play) -> None:
        run.put_person(4.9, 1.3)
        await run.until(lambda: run.here.x > 2.0)
        run.put_person(*FAR_AWAY)

    run = play(world, START, story=story, with_person=True)
    assert run.outcome == "explored", run.pipeline.mission.reason
    assert run.contacts == 0
    assert kinds_added(run) == ["endpoint", "endpoint"]


@pytest.mark.parametrize("seed", [0, 2])
def test_a_person_half_hidden_from_a_noisy_laser_is_no_pillar(seed: int) -> None:
    """With three times the usual noise, and four times the failures, no single scan tells."""
    world = carved([(-4.0, -1.1, 6.0, 1.1), (3.8, -1.1, 6.0, 5.0)])
    noisy = HokuyoTwinConfig(model="URG-04LX", range_sigma_m=0.03, dropout_fraction=0.02)

    async def story(run: Play) -> None:
        run.put_person(4.9, 1.3)
        await run.until(lambda: run.here.x > 2.0)
        run.put_person(*FAR_AWAY)

    twin = TwinConfig(seed=seed, laser=noisy)
    run = play(world, START, story=story, with_person=True, twin=twin)
    assert run.outcome == "explored", run.pipeline.mission.reason
    assert run.contacts == 0
    assert kinds_added(run) == ["endpoint", "endpoint"]


def test_a_room_is_found_though_somebody_stood_before_its_door_as_the_robot_passed() -> None:
    """Round the bend the robot does not see how the way becomes free."""
    corridor, bend = (-4.0, -1.0, 7.0, 1.0), (5.0, -1.0, 7.0, 4.6)
    door, room = (0.6, 0.9, 1.4, 1.3), (-1.0, 1.2, 3.0, 4.0)

    async def story(run: Play) -> None:
        await run.until(lambda: run.here.x > -2.5)
        run.put_person(1.0, 0.75)
        await run.until(lambda: run.here.y > 1.0)
        run.put_person(*FAR_AWAY)

    world = carved([corridor, bend, door, room])
    run = play(world, START, story=story, with_person=True)
    assert run.outcome == "explored", run.pipeline.mission.reason
    assert run.contacts == 0
    assert any(
        run.world(vertex)[0] < 3.0 and run.world(vertex)[1] > 1.3
        for vertex in run.pipeline.mapper.graph.vertices
    )


def test_who_stands_in_the_middle_of_a_room_is_driven_round_but_once() -> None:
    """There is no vertex on the way round him, as long as he may go."""
    room, rooms = (0.0, 0.0, 6.1, 5.2), [(2.2, 5.5, 6.1, 9.4), (-3.0, 5.5, 1.9, 9.4)]
    doors = [(3.25, 5.0, 4.4, 5.7), (0.7, 5.0, 1.55, 5.7)]
    corridor = [(-3.0, 9.7, 6.1, 11.7), (2.4, 9.2, 3.6, 9.9), (0.3, 9.2, 1.5, 9.9)]
    driven: list[float] = []

    async def story(run: Play) -> None:
        await run.until(lambda: 5.7 < run.here.y < 9.0)
        x = 3.95 if run.here.x > 2.0 else 1.1
        for y in np.arange(min(5.2, run.here.y - 1.5), 3.6, -0.1).tolist():
            run.put_person(x, y)
            await run.sleep(0.1)
        before = len(run.truth)
        await run.sleep(70.0)
        inside = dropwhile(lambda p: p.y > 5.2, run.truth[before:])
        stay = [(p.x, p.y) for p in takewhile(lambda p: p.y < 5.2, inside)]
        driven.append(sum(math.dist(*pair) for pair in pairwise(stay)))
        run.put_person(*FAR_AWAY)

    twin = TwinConfig(seed=3, laser=HokuyoTwinConfig(model="URG-04LX"))
    world = carved([room, *rooms, *doors, *corridor])
    run = play(world, Pose(-1.0, 10.6, 0.1), story=story, with_person=True, twin=twin)
    assert run.outcome == "explored", run.pipeline.mission.reason
    assert run.contacts == 0
    assert 0.5 * math.tau * 1.8 < driven[0] < 1.5 * math.tau * 1.8
