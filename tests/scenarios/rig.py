"""Short explorations of small worlds on the twins, with people and mishaps at the right moment."""

import asyncio
import math
from collections import Counter
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from gvgbot.autonomy.config import AutonomyConfig
from gvgbot.autonomy.events import Event, Recovery
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.loop import Loop
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam.graph import Vertex
from gvgbot.autonomy.virtual_walls import VirtualWall
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import Config, TwinConfig
from gvgbot.drivers.body import RobotBody
from gvgbot.drivers.hokuyo.driver import HokuyoLaser
from gvgbot.drivers.kobuki.driver import KobukiBase
from gvgbot.drivers.kobuki.mishaps import Mishap
from gvgbot.drivers.kobuki.twin import KobukiTwin
from gvgbot.drivers.people import Walkways
from gvgbot.drivers.world import World
from gvgbot.geometry import Pose
from gvgbot.hal.guard import Guard
from gvgbot.hal.messages import Odometry
from gvgbot.simulation import Place, Simulation
from gvgbot.survey import survey

ROBOT_RADIUS = 0.177  # m
NEAR = 0.3  # m that a vertex may be off
FAR_AWAY = (1000.0, 1000.0)  # where people are who are not there

Point = tuple[float, float]


@dataclass(eq=False)
class Play:
    """An exploration while it runs, and what is left of it afterwards."""

    simulation: Simulation
    pipeline: Pipeline
    clock: LoopClock
    events: list[Event] = field(default_factory=list)
    truth: list[Pose] = field(default_factory=list)  # world_base at each control cycle
    stopped_for: Counter[str | None] = field(default_factory=Counter)  # cycles
    ended: float = 0.0  # s

    @property
    def outcome(self) -> str | None:
        return self.pipeline.mission.outcome

    @property
    def contacts(self) -> int:
        return self.simulation.body.contacts

    @property
    def here(self) -> Pose:
        """world_base now."""
        self.simulation.body.advance(self.clock.now())
        return self.simulation.body.pose

    def vertices(self, kind: str) -> dict[int, Vertex]:
        graph = self.pipeline.mapper.graph
        return {v.id: v for v in graph.vertices.values() if v.kind == kind}

    def world(self, vertex: int) -> Point:
        """Where a vertex stands in the world, as believed."""
        map_vertex = self.pipeline.mapper.belief.map_vertex(vertex)
        x, y = self.simulation.place.start.transform(map_vertex.position)
        return float(x), float(y)

    def recoveries(self) -> list[str]:
        return [e.action for e in self.events if isinstance(e, Recovery)]

    def mishap(self, mishap: Mishap, duration: float, *, side: int = 2) -> None:
        """Let something befall the base; `side` is 4 for left, 2 for centre, 1 for right."""
        twin = self.simulation.base_twin._device
        assert isinstance(twin, KobukiTwin)
        twin.mishaps._rng = _Always(side)  # type: ignore[assignment]  # in its place
        twin.inject(mishap, duration)

    def put_person(self, x: float, y: float) -> None:
        """Let the one person of this world stand somewhere from now on."""
        assert self.simulation.people is not None
        self.simulation.people.stand(0, x, y)

    async def until(self, condition: Callable[[], bool]) -> None:
        """Wait for something to become true."""
        while not condition():
            await self.clock.sleep_until(self.clock.now() + 0.05)

    async def sleep(self, seconds: float) -> None:
        await self.clock.sleep_until(self.clock.now() + seconds)


class _Always:
    """Draws the side on which a mishap happens."""

    def __init__(self, side: int) -> None:
        self._index = (4, 2, 1).index(side)

    def integers(self, _: int) -> int:
        return self._index


Story = Callable[[Play], Awaitable[None]]
Grip = Callable[[Pose], float]  # share of what the wheels turn that the body goes, by its pose


def play(
    world: World,
    start: Pose,
    *,
    story: Story | None = None,
    with_person: bool = False,
    limit: float = 600.0,
    twin: TwinConfig | None = None,
    exploration: ExplorationConfig | None = None,
    virtual_walls: tuple[VirtualWall, ...] = (),
    grip: Grip | None = None,
    goes_on: Callable[[Play], bool] | None = None,
) -> Play:
    """Explore a world while a story happens to the robot, for at most so many seconds.

    It ends with an outcome, or when it no longer `goes_on`, if that is given.
    """
    config = Config(
        twin=replace(twin or TwinConfig(seed=3), people=int(with_person)),
        exploration=exploration or ExplorationConfig(),
        autonomy=AutonomyConfig(virtual_walls=virtual_walls),
    )
    return run_in_virtual_time(_played(config, world, start, story, limit, grip, goes_on))


async def _played(
    config: Config,
    world: World,
    start: Pose,
    story: Story | None,
    limit: float,
    grip: Grip | None,
    goes_on: Callable[[Play], bool] | None,
) -> Play:
    clock = LoopClock()
    walkways = Walkways(world, start) if config.twin.people else None
    simulation = Simulation(config, Place(world, start, walkways), clock)
    if grip is not None:
        _lose_grip(simulation.body, grip)
    pipeline = Pipeline(config.mind, config.exploration, config.robot.radius_m)
    pipeline.mission.survey = partial(survey, pipeline)
    run = Play(simulation, pipeline, clock)
    if walkways is not None:
        run.put_person(*FAR_AWAY)
    laser = HokuyoLaser(simulation.laser, config.laser, clock)
    base = KobukiBase(simulation.base, config.base, clock)

    def on_cycle(_: Odometry) -> None:
        run.truth.append(run.here)
        run.stopped_for[loop.stopped_for] += 1

    guard = Guard(config.robot.limits, config.robot.radius_m)
    loop = Loop(
        laser,
        base,
        pipeline,
        guard,
        on_events=run.events.extend,
        on_cycle=on_cycle,
        goes_on=None if goes_on is None else partial(goes_on, run),
    )
    async with asyncio.TaskGroup() as tasks:
        serving = [tasks.create_task(part.run()) for part in (laser, base, simulation)]
        if story is not None:
            serving.append(tasks.create_task(_told(story, run)))
        try:
            async with asyncio.timeout(limit):
                await loop.run()
        except TimeoutError:
            pass
        for task in serving:
            task.cancel()
    run.ended = clock.now()
    return run


def _lose_grip(body: RobotBody, grip: Grip) -> None:
    """Let the wheels turn, but the body only roll on by the share that the grip says."""
    roll = body._roll

    def slipping(way: float, turn: float) -> None:
        share = grip(body.pose)
        roll(share * way, share * turn)

    body._roll = slipping  # type: ignore[method-assign]  # in its place


async def _told(story: Story, run: Play) -> None:
    await story(run)


# -- what must be true of a run --------------------------------------------------------------------


def gap_to_walls(run: Play) -> float:
    """The least distance from the robot's centre to a wall on its way, m; 0.3 at most."""
    world = run.simulation.place.world
    places = {(round(p.x, 2), round(p.y, 2)) for p in run.truth}
    return min(
        float(np.hypot(*world.wall_offsets(x, y, 0.3).T).min(initial=0.3)) for x, y in places
    )


def assert_found(run: Play, kind: str, wanted: list[Point], *, within: float = NEAR) -> None:
    """The map has these vertices of a kind, each once, and no others."""
    found = {v: run.world(v) for v in run.vertices(kind)}
    nearest = [_nearest(wanted, xy) for xy in found.values()]
    assert Counter(nearest) == Counter(wanted), f"{kind}s at {list(found.values())}"
    for xy, point in zip(found.values(), nearest, strict=True):
        assert math.dist(xy, point) < within


def _nearest(wanted: list[Point], xy: Point) -> Point:
    return min(wanted, key=lambda point: math.dist(point, xy), default=FAR_AWAY)


def assert_degrees(run: Play, degrees: dict[Point, int]) -> None:
    """The meetpoints have these degrees."""
    for vertex in run.vertices("meetpoint").values():
        point = min(degrees, key=lambda p: math.dist(p, run.world(vertex.id)))
        assert vertex.degree == degrees[point], f"at {point}"


def assert_explored(run: Play) -> None:
    """All was explored, and nothing was touched on the way."""
    assert run.outcome == "explored", run.pipeline.mission.reason
    assert run.contacts == 0
    assert gap_to_walls(run) > ROBOT_RADIUS - 0.01


def graph_shape(run: Play) -> tuple[int, int, int]:
    """Meetpoints, endpoints and edges."""
    graph = run.pipeline.mapper.graph
    return len(run.vertices("meetpoint")), len(run.vertices("endpoint")), len(graph.edges)
