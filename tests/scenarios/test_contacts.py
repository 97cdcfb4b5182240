"""The robot hits, falls off, is lifted or overloaded: it gets away, and explores to the end."""

import math
from dataclasses import dataclass

import pytest

from gvgbot.autonomy.events import EdgeJoined
from gvgbot.geometry import Pose
from gvgbot.worlds.canvas import Canvas
from tests.scenarios.rig import Play, assert_found, graph_shape, play
from tests.unit.autonomy.sights import carved

pytestmark = [pytest.mark.slow, pytest.mark.twin]

# A corridor to the east that bends to the north: one has to go there to see its end.
CORRIDOR = carved([(-3.0, -0.7, 3.0, 0.7), (1.6, -0.7, 3.0, 4.0)])
WIDTH = 1.4  # m
START = Pose(-2.0, 0.0, 0.0)
ENDS = [(-3.0 + WIDTH / 2, 0.0), (2.3, 4.0 - WIDTH / 2)]


@pytest.mark.parametrize(
    ("mishap", "cause"), [("bump", "bumper"), ("cliff", "cliff")], ids=["bumper", "cliff"]
)
def test_a_contact_makes_the_robot_back_off_once_and_go_on(mishap: str, cause: str) -> None:
    """It ends up ten to fifteen centimetres behind where it felt something."""
    felt: list[int] = []

    async def story(run: Play) -> None:
        await run.until(lambda: run.here.x > 0.3)
        felt.append(len(run.truth))
        run.mishap("bump" if mishap == "bump" else "cliff", 0.5)

    run = play(CORRIDOR, START, story=story)
    xs = [pose.x for pose in run.truth[felt[0] :]]
    furthest = max(range(50), key=lambda cycle: xs[cycle])  # within a second
    assert xs[furthest] - xs[0] < 0.3  # v^2 / 2a from half a metre a second, and the reaction
    assert xs[0] - min(xs[furthest : furthest + 250]) == pytest.approx(0.125, abs=0.035)
    assert run.recoveries().count("back off") == 1
    assert run.outcome == "explored", run.pipeline.mission.reason
    joined = max(event.stamp for event in run.events if isinstance(event, EdgeJoined))
    assert run.ended < joined + 10.0  # it does not wait before what it felt
    assert_found(run, "endpoint", ENDS)
    assert run.contacts == 0


def test_a_place_where_there_is_no_floor_is_never_driven_over() -> None:
    """The cliff was felt by the middle sensor; the disc that lies before it is kept clear of."""
    spot: list[Pose] = []
    cycle: list[int] = []

    async def story(run: Play) -> None:
        await run.until(lambda: run.here.x > 0.3)
        run.mishap("cliff", 0.3)
        spot.append(run.here)
        cycle.append(len(run.truth))

    run = play(carved([(-3.0, -1.2, 5.0, 1.2), (2.6, -1.2, 5.0, 4.0)]), START, story=story)
    (felt,) = spot
    edge = felt.transform(Pose(0.27, 0.0).position)  # just beyond the rim, a little braking apart
    since = run.truth[cycle[0] :]
    back = next(i for i, p in enumerate(since) if p.x < felt.x - 0.08)  # it has braked, and left
    assert any(p.x > felt.x + 0.6 for p in since)  # it found a way round
    crossing = [p for p in since[back:] if abs(p.x - edge[0]) < 0.05]
    assert min(math.dist((p.x, p.y), edge) for p in crossing) > 0.177
    assert run.outcome == "explored", run.pipeline.mission.reason


@dataclass(eq=False)
class Interrupted:
    """A run in which the robot is lifted once, and later its motor is overloaded twice."""

    run: Play
    moved_in_the_air: float  # m
    moved_at_rest: float  # m, after the first overload
    before_the_second: list[str]  # recoveries


@pytest.fixture(scope="module")
def interrupted() -> Interrupted:
    moved: list[float] = []
    recoveries: list[str] = []

    async def stand(run: Play, seconds: float) -> None:
        await run.sleep(1.0)
        here = run.here
        await run.sleep(seconds)
        moved.append(run.here.distance(here))

    async def story(run: Play) -> None:
        await run.until(lambda: run.here.x > -1.2)
        run.mishap("wheel drop", 6.0)
        await stand(run, 4.5)
        await run.until(lambda: run.here.x > 0.3)
        run.mishap("over-current", 0.5)
        await stand(run, 0.8)
        await run.sleep(2.2)
        recoveries.extend(run.recoveries())
        run.mishap("over-current", 0.5)

    run = play(CORRIDOR, START, story=story)
    in_the_air, at_rest = moved
    return Interrupted(run, in_the_air, at_rest, recoveries)


def test_a_robot_that_is_lifted_stands_until_its_wheels_are_down_again(
    interrupted: Interrupted,
) -> None:
    run = interrupted.run
    assert interrupted.moved_in_the_air < 0.01
    assert "look around" in run.recoveries()
    assert run.outcome == "explored", run.pipeline.mission.reason
    assert_found(run, "endpoint", ENDS)


def test_an_overloaded_motor_rests_and_the_robot_goes_on(interrupted: Interrupted) -> None:
    run = interrupted.run
    assert interrupted.moved_at_rest < 0.01
    assert "back off" not in interrupted.before_the_second
    assert run.outcome == "explored", run.pipeline.mission.reason
    assert_found(run, "endpoint", ENDS)


def test_a_motor_overloaded_again_makes_the_robot_back_off(interrupted: Interrupted) -> None:
    run = interrupted.run
    assert run.recoveries().count("back off") == 1
    assert run.outcome == "explored", run.pipeline.mission.reason


def test_a_pane_of_glass_across_a_corridor_ends_it_after_a_few_touches() -> None:
    """The branch to the north is closed by a pane that only its dust shows from afar."""
    canvas = Canvas(10.0, 8.0)
    canvas.carve(1.0, 1.0, 9.0, 2.4)
    canvas.carve(4.3, 2.4, 5.7, 7.0)
    canvas.build(4.3, 4.5, 5.7, 4.55)
    canvas.glaze(4.3, 4.5, 5.7, 4.55)
    run = play(canvas.world("glass"), Pose(2.0, 1.7, 0.0))
    assert run.outcome in ("explored", "explored_with_blocked"), run.pipeline.mission.reason
    assert run.contacts <= 4
    assert graph_shape(run)[0] == 1
    assert max(pose.y for pose in run.truth) < 4.5


def test_an_invisible_post_is_led_around() -> None:
    """Glass that only the bumper notices, in the middle of a corridor with room on both sides."""
    canvas = Canvas(9.0, 8.0)
    canvas.carve(1.0, 1.0, 8.0, 3.0)
    canvas.carve(6.0, 1.0, 8.0, 7.0)
    canvas.build(5.0, 1.95, 5.05, 2.05)
    canvas.glaze(5.0, 1.95, 5.05, 2.05)
    run = play(canvas.world("post"), Pose(2.0, 2.0, 0.0))
    assert run.outcome == "explored", run.pipeline.mission.reason
    assert run.contacts <= 2
    assert max(pose.x for pose in run.truth) > 6.0
