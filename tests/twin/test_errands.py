"""A robot that is asked for things, in virtual time, in a world shaped like the letter theta.

Two meetpoints, 3.6 m apart over the bar in the middle, 8.6 m around its east, 10.6 m its west.
"""

import asyncio
import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.rigs.run_rig import STOP, Daemon, base_commands
from gvgbot.clock import Clock
from gvgbot.geometry import Pose
from gvgbot.requests import REQUESTS, Answer
from gvgbot.simulation import Place
from gvgbot.worlds.canvas import Canvas

pytestmark = [pytest.mark.twin, pytest.mark.slow]

MEETPOINTS = ((5.5, 2.0), (5.5, 5.6))
START = Pose(3.5, 2.1, 0.2)
RING = ((2.0, 2.0), (8.0, 2.0), (8.0, 5.6), (2.0, 5.6), (2.0, 2.0))
BAR_M, EAST_M, RING_M = 3.6, 8.6, 19.2
BESIDE = (7.8, 3.8)  # 0.2 m beside the middle of the eastern corridor
NEAR = 0.3  # m

Point = tuple[float, float]  # m, world frame


def theta() -> Place:
    canvas = Canvas(10.0, 7.6)
    canvas.carve_path(list(RING), 1.4)
    canvas.carve_path(list(MEETPOINTS), 1.4)
    return Place(canvas.world("theta"), START)


@dataclass
class Trip:
    """One errand: what was answered, how it ended, where the robot is in the world."""

    answer: Answer
    outcome: str = ""
    reason: str = ""
    world: Point = (math.nan, math.nan)
    driven: float = math.nan
    fastest: float = math.nan

    def off(self, x: float, y: float) -> float:
        return math.hypot(self.world[0] - x, self.world[1] - y)


@dataclass
class Tour:
    """All that happened on the way."""

    daemon: Daemon
    paused: list[Point] = field(default_factory=list)
    answers: dict[str, Answer] = field(default_factory=dict)
    trips: dict[str, Trip] = field(default_factory=dict)
    phases: dict[str, str] = field(default_factory=dict)
    vertices: dict[int, Point] = field(default_factory=dict)
    errors: list[tuple[float, float]] = field(default_factory=list)  # of the pose: m, rad
    covered: list[Point] = field(default_factory=list)
    doing: set[str | None] = field(default_factory=set)  # on patrol, as it was published

    def lines(self, kind: str) -> list[dict[str, Any]]:
        text = (self.daemon.session.directory.path / "events.jsonl").read_text()
        lines = [json.loads(line) for line in text.splitlines()]
        return [line for line in lines if line["event"] == kind]


async def until(clock: Clock, is_so: Callable[[], bool], patience: float = 300.0) -> None:
    end = clock.now() + patience
    while not is_so():
        assert clock.now() < end, "it did not become so"
        await clock.sleep_until(clock.now() + 0.2)


async def a_while(clock: Clock, seconds: float) -> None:
    await clock.sleep_until(clock.now() + seconds)


class Story:
    """What somebody asks for on the way, and what is taken down of what comes of it."""

    def __init__(self, tour: Tour, clock: Clock) -> None:
        self.tour, self.clock = tour, clock
        self.daemon, self.states = tour.daemon, tour.daemon.network.states
        self.pipeline = tour.daemon.session.pipeline

    async def tell(self) -> None:
        await self.explore()
        await self.visit_every_vertex()
        await self.cover()
        await self.patrol()
        await self.ask("limit", "set", key="robot.limits.max_speed_mps", value=0.2)
        await self.trip("home", "home")
        await self.ask("no limit", "set", key="robot.limits.max_speed_mps", value=0.7)
        await self.ask("unknown", "goto", vertex=999)
        await self.ask("outside", "goto", x=50.0, y=50.0)
        await self.ask("save", "save")
        await self.explore_on()
        await self.be_carried()
        await self.ask("stop", "stop")

    async def explore(self) -> None:
        await a_while(self.clock, 1.5)
        await self.ask("too early", "home")
        await self.ask("explore at once", "explore")
        await a_while(self.clock, 8.0)
        await self.pause()
        await until(self.clock, lambda: self.states[-1].phase == "finished")
        belief = self.pipeline.mapper.belief
        for vertex in belief.ids:
            x, y = START.transform(belief.map_vertex(vertex).position)
            self.tour.vertices[vertex] = (float(x), float(y))

    async def pause(self) -> None:
        await self.ask("pause", "pause")
        await self.ask("pause again", "pause")
        await a_while(self.clock, 1.5)  # to brake
        for _ in range(2):
            self.tour.paused.append(self.place)
            await a_while(self.clock, 2.0)
        self.tour.phases["paused"] = self.states[-1].phase
        await self.ask("goto while paused", "goto", x=0.0, y=0.0)
        await self.ask("resume", "resume")
        await self.ask("resume again", "resume")
        await a_while(self.clock, 5.0)
        self.tour.paused.append(self.place)
        self.tour.phases["resumed"] = self.states[-1].phase

    async def visit_every_vertex(self) -> None:
        for vertex in self.tour.vertices:
            await self.trip(f"goto {vertex}", "goto", vertex=vertex)
        self.tour.phases["after a trip"] = self.states[-1].phase
        await self.ask("there already", "goto", vertex=max(self.tour.vertices))
        await until(self.clock, self.is_done)
        x, y = START.inverse().transform(np.array(BESIDE))
        await self.trip("beside", "goto", x=float(x), y=float(y))

    async def cover(self) -> None:
        """Drive over all edges, and take down where the robot is."""

        async def watch() -> None:
            while True:
                self.tour.covered.append(self.place)
                await asyncio.sleep(0.3)

        watching = asyncio.ensure_future(watch())  # noqa: TID251  # cancelled below
        await self.trip("coverage", "coverage")
        watching.cancel()

    async def patrol(self) -> None:
        tour, ends = self.tour, list(meetpoints(self.tour))
        await self.ask("patrol", "patrol", vertices=ends)
        await until(self.clock, lambda: len(tour.lines("round_ended")) == 1)
        await self.ask("patrol again", "patrol", vertices=ends)
        await a_while(self.clock, 1.0)
        tour.doing = {state.errand for state in self.states[-5:]}
        await self.ask("patrol of one", "patrol", vertices=[min(tour.vertices)])
        await self.ask("patrol of none", "patrol", vertices=[min(tour.vertices), 999])

    async def be_carried(self) -> None:
        """Somebody puts the robot elsewhere, along the corridor and turned: it feels nothing.

        Somebody else sees that after it has driven on.
        """
        assert self.daemon.session.simulation is not None
        here = self.daemon.place
        self.daemon.session.simulation.body.pose = Pose(here.x + 0.7, here.y, here.theta + 0.2)
        self.note_error()
        await self.trip("on", "goto", vertex=max(self.tour.vertices))
        self.note_error()
        await self.trip("relocalise", "relocalise")
        self.note_error()

    async def explore_on(self) -> None:
        await self.ask("explore", "explore")
        is_resting = self.pipeline.errands.is_resting
        self.tour.phases["explore"] = "" if is_resting else "exploring"
        await until(self.clock, lambda: self.pipeline.mission.outcome is not None)

    async def ask(self, title: str, name: str, **arguments: object) -> None:
        self.tour.answers[title] = await self.daemon.network.ask(name, **arguments)

    async def trip(self, title: str, name: str, **arguments: object) -> None:
        begin, first = self.pipeline.past.travelled, len(self.states)
        made = self.tour.trips[title] = Trip(await self.daemon.network.ask(name, **arguments))
        await until(self.clock, self.is_done)
        await a_while(self.clock, 1.0)
        events = self.daemon.network.events[-1].events
        (*_, end) = [event for event in events if event.kind == "errand_ended"]
        made.outcome, made.reason = str(end.details["outcome"]), str(end.details["reason"])
        made.world = self.place
        made.driven = self.pipeline.past.travelled - begin
        made.fastest = max(abs(state.twist[0]) for state in self.states[first:])

    def is_done(self) -> bool:
        return self.pipeline.errands.errand is None

    @property
    def place(self) -> Point:
        return self.daemon.place.x, self.daemon.place.y

    def note_error(self) -> None:
        error = START.compose(self.pipeline.map_base).to(self.daemon.place)
        self.tour.errors.append((math.hypot(error.x, error.y), abs(error.theta)))


def meetpoints(tour: Tour) -> tuple[int, ...]:
    """The vertices at both ends of the bar."""
    return tuple(
        vertex
        for vertex, place in tour.vertices.items()
        if min(math.dist(place, true) for true in MEETPOINTS) < NEAR
    )


@pytest.fixture(scope="module")
def tour(tmp_path_factory: pytest.TempPathFactory) -> Tour:
    made = Tour(Daemon(tmp_path_factory.mktemp("theta"), theta()))
    with made.daemon.session.directory:
        made.daemon.run(lambda clock: Story(made, clock).tell())
    return made


def test_a_paused_robot_stands_and_goes_on_when_it_is_told_to(tour: Tour) -> None:
    stood, still, gone_on = tour.paused
    assert math.dist(stood, still) < 1e-3
    assert math.dist(still, gone_on) > 0.5
    assert (tour.phases["paused"], tour.phases["resumed"]) == ("paused", "exploring")
    assert all(tour.answers[name].done for name in ("pause", "resume"))


def test_asking_twice_does_no_harm(tour: Tour) -> None:
    assert tour.answers["explore at once"].done  # though it knows nothing yet
    assert "already" in tour.answers["explore at once"].text
    assert tour.answers["pause again"].done
    assert "already" in tour.answers["pause again"].text
    assert tour.answers["resume again"].done
    assert tour.answers["there already"].done


def test_a_paused_robot_is_driven_by_nobody_else(tour: Tour) -> None:
    assert not tour.answers["goto while paused"].done
    assert "paused" in tour.answers["goto while paused"].text


def test_every_vertex_can_be_driven_to_by_the_shortest_way(tour: Tour) -> None:
    assert len(meetpoints(tour)) == 2
    for vertex, place in tour.vertices.items():
        trip = tour.trips[f"goto {vertex}"]
        assert (trip.outcome, trip.answer.done) == ("arrived", True)
        assert trip.off(*place) < NEAR
    assert tour.trips[f"goto {meetpoints(tour)[1]}"].driven < BAR_M + 2 * NEAR  # over the bar
    assert tour.phases["after a trip"] == "finished"


def test_a_point_beside_an_edge_is_driven_to(tour: Tour) -> None:
    trip = tour.trips["beside"]
    assert trip.outcome == "arrived"
    assert trip.off(*BESIDE) < NEAR


def test_a_coverage_drives_over_every_edge_and_hardly_any_twice(tour: Tour) -> None:
    """The ring of 19 m and the bar of 4 m, in one go from one meetpoint to the other."""
    trip, driven = tour.trips["coverage"], np.array(tour.covered)
    assert (trip.outcome, trip.reason) == ("arrived", "3 of 3 edges driven")
    for start, end in (*pairwise(RING), MEETPOINTS):
        for share in np.linspace(0.1, 0.9, 20):
            place = (1 - share) * np.array(start) + share * np.array(end)
            assert np.hypot(*(driven - place).T).min() < 0.5
    to_start = min(trip_to.off(*BESIDE) for trip_to in tour.trips.values())
    assert to_start < NEAR  # where it began: halfway between the meetpoints
    to_meetpoint = EAST_M / 2  # the first one
    assert trip.driven < 1.1 * (RING_M + BAR_M) + to_meetpoint + 2 * NEAR


def test_a_patrol_goes_to_and_fro_until_something_else_is_asked_for(tour: Tour) -> None:
    (first,) = tour.lines("round_ended")
    assert (first["round"], first["reached"], first["missed"]) == (1, 2, 0)
    a, b = meetpoints(tour)
    assert tour.answers["patrol"].done
    assert "already" in tour.answers["patrol again"].text
    assert tour.doing == {f"patrol {a} {b}, round 2"}
    assert not tour.answers["patrol of one"].done
    assert "two vertices or more" in tour.answers["patrol of one"].text
    assert "no vertex 999" in tour.answers["patrol of none"].text
    ended = [line for line in tour.lines("errand_ended") if line["errand"] == f"patrol {a} {b}"]
    assert [line["outcome"] for line in ended] == ["replaced"]


def test_the_robot_comes_home(tour: Tour) -> None:
    assert tour.trips["home"].outcome == "arrived"
    assert tour.trips["home"].off(START.x, START.y) < NEAR


def test_a_speed_limit_holds_and_can_only_be_lowered_below_the_configured_one(tour: Tour) -> None:
    assert tour.answers["limit"].done
    assert tour.trips["home"].fastest < 0.21 < tour.trips["beside"].fastest
    assert tour.answers["no limit"].done


@pytest.mark.parametrize(
    ("title", "says"),
    [
        ("too early", "not seen enough"),
        ("unknown", "no vertex 999; known are 1, 2"),
        ("outside", "the nearest known way ends"),
    ],
)
def test_what_cannot_be_is_refused_with_a_reason(tour: Tour, title: str, says: str) -> None:
    assert not tour.answers[title].done
    assert says in tour.answers[title].text


def test_exploring_goes_on_after_the_end(tour: Tour) -> None:
    assert tour.answers["explore"].done
    assert tour.phases["explore"] == "exploring"
    assert len(tour.lines("finished")) == 2
    assert tour.daemon.session.pipeline.mission.outcome == "explored"


def test_a_robot_that_was_carried_finds_its_place_when_it_is_told_to(tour: Tour) -> None:
    (carried_m, carried_rad), (later_m, _), (found_m, found_rad) = tour.errors
    assert (carried_m, carried_rad) == pytest.approx((0.7, 0.2), abs=0.05)
    assert later_m == pytest.approx(0.7, abs=0.05)
    assert tour.trips["relocalise"].outcome == "arrived"
    assert found_m < 0.05
    assert found_rad < 0.02


def test_nothing_was_touched_on_the_way(tour: Tour) -> None:
    assert tour.daemon.session.simulation is not None
    assert tour.daemon.session.simulation.body.contacts == 0


def test_every_request_is_in_the_list_of_events_with_who_asked(tour: Tour) -> None:
    lines = tour.lines("requested")
    assert len(lines) == len(tour.answers) + len(tour.trips)
    assert all(line["origin"] == "a test" for line in lines)
    refused = [line["request"] for line in lines if not line["done"]]
    low = min(tour.vertices)
    assert refused == [
        "home",
        "goto 0 0",
        f"patrol {low}",
        f"patrol {low} 999",
        "goto 999",
        "goto 50 50",
    ]
    assert {line["request"] for line in lines} >= {"pause", "resume", "save", "stop", "explore"}


def test_a_stopped_exploration_is_over_until_somebody_wants_more(tmp_path: Path) -> None:
    daemon, places, phases = Daemon(tmp_path / "run"), list[Pose](), list[str]()

    async def tell(clock: Clock) -> None:
        await a_while(clock, 8.0)
        answer = await daemon.network.ask("stop")
        assert answer.done
        assert str(daemon.session.directory.path) in answer.text
        summary = json.loads((daemon.session.directory.path / "summary.json").read_text())
        assert summary["outcome"] == "stopped"
        await a_while(clock, 2.0)
        for _ in range(2):
            places.append(daemon.place)
            phases.append(daemon.network.states[-1].phase)
            await a_while(clock, 4.0)
        assert (await daemon.network.ask("explore")).done
        await a_while(clock, 5.0)
        places.append(daemon.place)
        phases.append(daemon.network.states[-1].phase)

    with daemon.session.directory:
        daemon.run(tell)
    assert places[0] == places[1]
    assert places[1].distance(places[2]) > 0.5
    assert phases == ["finished", "finished", "exploring"]


def test_on_a_ring_without_meetpoints_every_place_is_driven_to_by_the_shorter_way(
    tmp_path: Path,
) -> None:
    canvas = Canvas(6.8, 6.4)
    canvas.carve_path([(2.0, 2.0), (4.8, 2.0), (4.8, 4.4), (2.0, 4.4), (2.0, 2.0)], 1.4)
    tour = Tour(Daemon(tmp_path / "run", Place(canvas.world("ring"), START)))
    east, north, west = (4.8, 3.2), (3.4, 4.4), (2.0, 3.2)
    around = {east: 3.0, north: 2.6, west: 2.6}  # m, from the place before

    async def tell(clock: Clock) -> None:
        story = Story(tour, clock)
        await until(clock, lambda: story.pipeline.mission.outcome is not None)
        for place in around:
            x, y = START.inverse().transform(np.array(place)).round(3).tolist()
            await story.trip(str(place), "goto", x=x, y=y)
        await story.trip("home", "home")
        (vertex,) = story.pipeline.mapper.graph.vertices
        await story.trip("vertex", "goto", vertex=vertex)
        await story.trip("coverage", "coverage")
        await story.ask("patrol", "patrol")

    with tour.daemon.session.directory:
        tour.daemon.run(tell)
    for place, metres in around.items():
        trip = tour.trips[str(place)]
        assert (trip.outcome, trip.reason) == ("arrived", "")
        assert trip.off(*place) < NEAR
        assert trip.driven < metres + 1.0
    assert tour.trips["home"].off(START.x, START.y) < NEAR
    assert tour.trips["vertex"].outcome == "arrived"
    assert tour.trips["coverage"].outcome == "arrived"
    around_m = 2 * (2.8 + 2.4) - 4 * 0.2  # it cuts corners: there it is as far from both sides
    assert tour.trips["coverage"].driven == pytest.approx(around_m, rel=0.1)
    assert "two vertices or more" in tour.answers["patrol"].text


def test_before_the_first_vertex_the_robot_comes_home_round_a_corner(tmp_path: Path) -> None:
    """The way home goes out of sight while it turns round: no edge is known yet to go by."""
    tour = Tour(Daemon(tmp_path / "run", theta()))

    async def tell(clock: Clock) -> None:
        story = Story(tour, clock)
        await until(clock, lambda: story.place[1] > 3.6)
        assert not story.pipeline.mapper.graph.edges
        await story.ask("stop", "stop")
        await story.trip("home", "home")

    with tour.daemon.session.directory:
        tour.daemon.run(tell)
    assert tour.trips["home"].outcome == "arrived"
    assert tour.trips["home"].off(START.x, START.y) < NEAR


def test_without_permission_nothing_is_done(tmp_path: Path) -> None:
    """As it comes: who can reach the robot can watch it, and that is all."""
    daemon = Daemon(tmp_path / "run", requests=())
    answers: list[Answer] = []
    fitting: dict[str, dict[str, object]] = {
        "goto": {"vertex": 1},
        "set": {"key": "robot.limits.max_speed_mps", "value": 0.1},
    }

    async def tell(clock: Clock) -> None:
        await a_while(clock, 3.0)
        answers.extend(
            [await daemon.network.ask(name, **fitting.get(name, {})) for name in REQUESTS]
        )
        await a_while(clock, 3.0)

    with daemon.session.directory:
        daemon.run(tell)
    assert not any(answer.done for answer in answers)
    assert all("not permitted" in answer.text for answer in answers)
    assert daemon.network.states[-1].phase == "exploring"
    assert set(base_commands(bytes(daemon.cable.written))[-100:-10]) != {STOP}
