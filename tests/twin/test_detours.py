"""Somebody stands in a corridor that is too narrow to pass, and the robot takes another way."""

import json
import math
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.rigs.run_rig import Daemon
from gvgbot.clock import Clock
from gvgbot.config import TwinConfig
from gvgbot.drivers.kobuki.twin import KobukiTwinConfig
from gvgbot.drivers.people import Walkways
from gvgbot.geometry import Pose
from gvgbot.simulation import Place
from gvgbot.worlds.canvas import Canvas

pytestmark = [pytest.mark.twin, pytest.mark.slow]

START = Pose(3.5, 2.1, 0.2)
RING = [(2.0, 2.0), (8.0, 2.0), (8.0, 5.6), (2.0, 5.6), (2.0, 2.0)]
SOUTH, NORTH = (5.5, 2.0), (5.5, 5.6)  # the ends of a bar across the ring
EAST = (8.0, 3.8)
BAR_M, EAST_M = 3.6, 8.6  # from one end to the other
NEAR = 0.3  # m
FAR_AWAY = (1000.0, 1000.0)  # where people are who are not there
REMEMBERED, PATIENCE = 25.0, 4.0  # s

Point = tuple[float, float]  # m, world frame


class Walker:
    """A robot that has explored, somebody who can be put in its way, and what it has driven."""

    def __init__(self, out: Path, paths: list[list[Point]]) -> None:
        canvas = Canvas(11.0, 9.0)
        for path in paths:
            canvas.carve_path(path, 1.0)
        world = canvas.world("ring")
        twin = TwinConfig(people=1, base=KobukiTwinConfig(odometry="perfect"))
        self.daemon = Daemon(out, Place(world, START, Walkways(world, START)), twin=twin)
        self.pipeline = self.daemon.session.pipeline
        exploration = self.daemon.config.exploration
        exploration = replace(exploration, remember_blocked_s=REMEMBERED, in_the_way_s=PATIENCE)
        self.pipeline.errands.configure(exploration)

    def put_person(self, x: float, y: float) -> None:
        assert self.daemon.session.simulation is not None
        people = self.daemon.session.simulation.people
        assert people is not None
        people.stand(0, x, y)

    def tell(self, story: Callable[[Clock], Awaitable[None]]) -> None:
        """Explore alone, and go on with a story."""

        async def all_of_it(clock: Clock) -> None:
            await clock.sleep_until(clock.now() + 0.5)
            self.put_person(*FAR_AWAY)
            while self.pipeline.mission.outcome is None:
                await clock.sleep_until(clock.now() + 0.2)
            await story(clock)

        with self.daemon.session.directory:
            self.daemon.run(all_of_it)
        assert self.daemon.session.simulation is not None
        assert self.daemon.session.simulation.body.contacts == 0

    async def go(self, clock: Clock, place: Point) -> float:
        """Drive to the vertex that is there, or to the point; metres driven."""
        metres, off = await self.drive_towards(clock, place)
        assert off < NEAR
        return metres

    async def drive_towards(self, clock: Clock, place: Point) -> tuple[float, float]:
        """The same, wherever that ends: metres driven, and metres off."""
        begin, vertex = self.pipeline.past.travelled, self.vertex_at(place)
        x, y = START.inverse().transform(np.array(place)).tolist()
        where = {"x": x, "y": y} if vertex is None else {"vertex": vertex}
        await self.try_to_go(clock, **where)
        here = self.daemon.place
        return self.pipeline.past.travelled - begin, math.dist((here.x, here.y), place)

    def vertex_at(self, place: Point) -> int | None:
        """The vertex that is there; None if none is."""
        belief, point = self.pipeline.mapper.belief, START.inverse().transform(np.array(place))
        off = {v: math.dist(belief.map_vertex(v).position, point) for v in belief.ids}
        vertex = min(off, key=off.__getitem__)
        return vertex if off[vertex] < NEAR else None

    def recoveries(self) -> list[str]:
        """What it did where it got no further."""
        text = (self.daemon.session.directory.path / "events.jsonl").read_text()
        lines = [json.loads(line) for line in text.splitlines()]
        return [line["action"] for line in lines if line["event"] == "recovery"]

    async def try_to_go(self, clock: Clock, **where: object) -> None:
        """Drive to a vertex or a point, or as near to it as it comes."""
        answer = await self.daemon.network.ask("goto", **where)
        assert answer.done, answer.text
        while self.pipeline.errands.errand is not None:
            await clock.sleep_until(clock.now() + 0.2)
        await clock.sleep_until(clock.now() + 1.0)


@dataclass
class Detours:
    """Two in one building: metres driven, metres off in the end, and what was done about it."""

    over_bar: tuple[float, float] = (math.nan, math.nan)
    over_east: tuple[float, float] = (math.nan, math.nan)
    recoveries: list[str] = field(default_factory=list)  # on the first


@pytest.fixture(scope="module")
def detours(tmp_path_factory: pytest.TempPathFactory) -> Detours:
    walker = Walker(tmp_path_factory.mktemp("theta") / "run", [RING, [SOUTH, NORTH]])
    made = Detours()

    async def story(clock: Clock) -> None:
        await walker.go(clock, SOUTH)
        walker.put_person(5.5, 4.2)
        made.over_bar = await walker.drive_towards(clock, NORTH)
        made.recoveries = walker.recoveries()
        walker.put_person(*FAR_AWAY)
        await walker.go(clock, EAST)
        await clock.sleep_until(max(walker.pipeline.errands.closures.until.values(), default=0.0))
        walker.put_person(8.0, 2.4)
        made.over_east = await walker.drive_towards(clock, SOUTH)

    walker.tell(story)
    return made


def test_who_stands_in_the_way_of_an_errand_is_left_alone_and_another_way_taken(
    detours: Detours,
) -> None:
    """In the bar, 1.4 m before its end; it is too narrow to pass: 3.6 m become 8.6 m around.

    The robot looks nowhere else first: all that is hidden is behind the person.
    """
    driven, off = detours.over_bar
    assert off < NEAR
    assert EAST_M - 2 * NEAR < driven < EAST_M + BAR_M + NEAR  # and into the bar
    assert detours.recoveries == ["try another way"]


def test_who_cannot_go_back_goes_on_to_an_end_of_the_corridor_that_is_out_of_sight(
    detours: Detours,
) -> None:
    """From the middle of the east side, 4.3 m from either end of the bar."""
    (driven, off), around = detours.over_east, EAST_M / 2 + BAR_M
    assert off < NEAR
    assert around - 2 * NEAR < driven < around + 3.0  # and to the person and back


def test_on_a_ring_that_comes_back_to_its_only_vertex_the_other_way_round_is_taken(
    tmp_path: Path,
) -> None:
    """12 m around, the vertex is anywhere, and somebody stands on the shorter way of 3 m."""
    ring, east = [(2.0, 2.0), (5.4, 2.0), (5.4, 4.6), (2.0, 4.6), (2.0, 2.0)], (5.4, 3.3)
    walker = Walker(tmp_path / "run", [ring])
    driven: list[float] = []

    async def story(clock: Clock) -> None:
        belief = walker.pipeline.mapper.belief
        (vertex,) = belief.ids
        x, y = START.transform(belief.map_vertex(vertex).position).tolist()
        assert math.dist((x, y), (3.7, 2.0)) < 0.7
        await walker.go(clock, (x, y))
        walker.put_person(5.0, 2.0)
        driven.append(await walker.go(clock, east))
        await clock.sleep_until(max(walker.pipeline.errands.closures.until.values(), default=0.0))
        walker.put_person(5.4, 2.2)
        driven.append(await walker.go(clock, (x, y)))

    walker.tell(story)
    for metres in driven:
        assert 12.0 - 4.0 < metres < 12.0 - 3.0 + 3.0  # and to the person and back


def test_a_near_point_is_driven_to_when_somebody_asks_again_after_the_way_was_closed(
    tmp_path: Path,
) -> None:
    """Round two corners, where nothing is to be seen from beside the junction, 3.0 m away."""
    fork, beside, stem, end = (5.5, 2.0), (6.5, 2.0), (5.5, 3.5), (7.0, 5.0)
    arms: list[Point] = [(2.0, 2.0), (9.0, 2.0)]
    walker = Walker(tmp_path / "run", [arms, [fork, stem, (7.0, 3.5), end]])

    async def story(clock: Clock) -> None:
        await walker.go(clock, beside)
        walker.put_person(5.5, 3.2)
        x, y = START.inverse().transform(np.array(end)).tolist()
        await walker.try_to_go(clock, x=x, y=y)
        walker.put_person(*FAR_AWAY)
        await walker.go(clock, beside)
        assert walker.pipeline.mapper.graph.blocked()
        await walker.try_to_go(clock, x=x, y=y)
        here = walker.daemon.place
        assert math.dist((here.x, here.y), end) < NEAR

    walker.tell(story)


def test_who_asks_opens_ways_that_were_closed_while_the_robot_explored(tmp_path: Path) -> None:
    """Somebody stood behind it in an arm whose end is out of sight, and has gone."""
    fork: Point = (5.5, 2.0)
    west: list[Point] = [fork, (2.5, 2.0), (2.5, 5.0), (4.0, 5.0)]
    arm: list[Point] = [fork, (5.5, 5.6), (7.5, 5.6)]
    walker = Walker(tmp_path / "run", [[fork, (7.5, 2.0)], west, arm])
    ask, pipeline = walker.daemon.network.ask, walker.pipeline
    covered: list[str] = []

    async def story(clock: Clock) -> None:
        async def until(is_so: Callable[[], bool]) -> None:
            end = clock.now() + 300.0
            while not is_so():
                assert clock.now() < end, "it did not become so"
                await clock.sleep_until(clock.now() + 0.2)

        await clock.sleep_until(0.5)
        walker.put_person(*FAR_AWAY)
        await until(lambda: walker.daemon.place.y > 5.1)
        walker.put_person(5.5, 3.6)
        await until(lambda: bool(pipeline.mapper.graph.blocked()))
        walker.put_person(*FAR_AWAY)
        await ask("stop")
        await ask("home")
        await until(lambda: pipeline.errands.errand is None)
        assert walker.daemon.place.y < 3.0
        await ask("patrol", vertices=[walker.vertex_at(arm[-1]), walker.vertex_at(fork)])
        await until(
            lambda: math.dist((walker.daemon.place.x, walker.daemon.place.y), arm[-1]) < 0.6
        )
        await ask("stop")
        covered.append((await ask("coverage")).text)
        await until(lambda: pipeline.errands.errand is None)
        await clock.sleep_until(clock.now() + 1.0)
        (*_, last) = walker.daemon.network.events[-1].events
        covered.append(str(last.details["reason"]))

    with walker.daemon.session.directory:
        walker.daemon.run(story)
    assert "2 of 2 edges" in covered[0]
    assert covered[1] == "2 of 2 edges driven"
