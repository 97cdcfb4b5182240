"""Somebody stands in a corridor that is too narrow to pass, and the robot takes another way."""

import math
from collections.abc import Awaitable, Callable
from dataclasses import replace
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

pytestmark = [pytest.mark.twin, pytest.mark.slow, pytest.mark.timeout(300)]

START = Pose(3.5, 2.1, 0.2)
RING = [(2.0, 2.0), (8.5, 2.0), (8.5, 6.0), (2.0, 6.0), (2.0, 2.0)]
SOUTH, NORTH = (5.5, 2.0), (5.5, 6.0)  # the ends of a bar across the ring
EAST = (8.5, 4.0)
NEAR = 0.3  # m
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
            self.put_person(1000.0, 1000.0)
            while self.pipeline.mission.outcome is None:
                await clock.sleep_until(clock.now() + 0.2)
            await story(clock)

        with self.daemon.session.directory:
            self.daemon.run(all_of_it)
        assert self.daemon.session.simulation is not None
        assert self.daemon.session.simulation.body.contacts == 0

    async def go(self, clock: Clock, place: Point) -> float:
        """Drive to the vertex that is there, or to the point; metres driven."""
        begin, belief = self.pipeline.past.travelled, self.pipeline.mapper.belief
        x, y = point = START.inverse().transform(np.array(place)).tolist()
        off = {v: math.dist(belief.map_vertex(v).position, point) for v in belief.ids}
        vertex = min(off, key=off.__getitem__)
        where = {"vertex": vertex} if off[vertex] < NEAR else {"x": x, "y": y}
        await self.try_to_go(clock, **where)
        here = self.daemon.place
        assert math.dist((here.x, here.y), place) < NEAR
        return self.pipeline.past.travelled - begin

    async def try_to_go(self, clock: Clock, **where: object) -> None:
        """Drive to a vertex or a point, or as near to it as it comes."""
        answer = await self.daemon.network.ask("goto", **where)
        assert answer.done, answer.text
        while self.pipeline.errands.errand is not None:
            await clock.sleep_until(clock.now() + 0.2)
        await clock.sleep_until(clock.now() + 1.0)


def test_who_cannot_go_back_goes_on_to_an_end_of_the_corridor_that_is_out_of_sight(
    tmp_path: Path,
) -> None:
    """From the middle of the east side, 5 m from either end of the bar, which is 4 m long."""
    walker = Walker(tmp_path / "run", [RING, [SOUTH, NORTH]])
    driven: list[float] = []

    async def story(clock: Clock) -> None:
        await walker.go(clock, EAST)
        walker.put_person(8.5, 2.6)
        driven.append(await walker.go(clock, SOUTH))

    walker.tell(story)
    assert 9.0 - 2 * NEAR < driven[0] < 9.0 + 3.0  # and to the person and back


def test_on_a_ring_that_comes_back_to_its_only_vertex_the_other_way_round_is_taken(
    tmp_path: Path,
) -> None:
    """14 m around, the vertex is anywhere, and somebody stands on the shorter way of 4 m."""
    ring, east = [(2.0, 2.0), (6.0, 2.0), (6.0, 5.0), (2.0, 5.0), (2.0, 2.0)], (6.0, 3.5)
    walker = Walker(tmp_path / "run", [ring])
    driven: list[float] = []

    async def story(clock: Clock) -> None:
        belief = walker.pipeline.mapper.belief
        (vertex,) = belief.ids
        x, y = START.transform(belief.map_vertex(vertex).position).tolist()
        assert math.dist((x, y), (4.0, 2.0)) < 1.0
        await walker.go(clock, (x, y))
        walker.put_person(5.5, 2.0)
        driven.append(await walker.go(clock, east))
        await clock.sleep_until(max(walker.pipeline.errands.closures.until.values(), default=0.0))
        walker.put_person(6.0, 2.3)
        driven.append(await walker.go(clock, (x, y)))

    walker.tell(story)
    for metres in driven:
        assert 14.0 - 5.0 < metres < 14.0 - 3.0 + 3.0  # and to the person and back


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
        walker.put_person(1000.0, 1000.0)
        await walker.go(clock, beside)
        assert walker.pipeline.mapper.graph.blocked()
        await walker.try_to_go(clock, x=x, y=y)
        here = walker.daemon.place
        assert math.dist((here.x, here.y), end) < NEAR

    walker.tell(story)


def test_who_asks_opens_ways_that_were_closed_while_the_robot_explored(tmp_path: Path) -> None:
    """Somebody stood behind it in an arm whose end is out of sight, and has gone."""
    west: list[Point] = [(6.5, 2.0), (2.5, 2.0), (2.5, 5.0), (4.0, 5.0)]
    arm: list[Point] = [(6.5, 2.0), (6.5, 6.0), (9.0, 6.0)]
    walker = Walker(tmp_path / "run", [[(6.5, 2.0), (9.0, 2.0)], west, arm])
    ask, pipeline = walker.daemon.network.ask, walker.pipeline
    covered: list[str] = []

    async def story(clock: Clock) -> None:
        async def until(is_so: Callable[[], bool]) -> None:
            end = clock.now() + 300.0
            while not is_so():
                assert clock.now() < end, "it did not become so"
                await clock.sleep_until(clock.now() + 0.2)

        await clock.sleep_until(0.5)
        walker.put_person(1000.0, 1000.0)
        await until(lambda: walker.daemon.place.y > 5.5)
        walker.put_person(6.5, 4.0)
        await until(lambda: bool(pipeline.mapper.graph.blocked()))
        walker.put_person(1000.0, 1000.0)
        await ask("stop")
        await ask("home")
        await until(lambda: pipeline.errands.errand is None)
        assert walker.daemon.place.y < 3.0
        await ask("patrol")
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
