"""Explores worlds, then asks for random vertices and points: what is reached, and by which ways.

    python -m benchmarks.errands_table --worlds office ring rooms cave --requests 100

In virtual time, on the twins. `reached` counts what the robot said to have reached and where it
truly stands then; `refused` and `given up` are what it declined, and left, with a reason; `wrong`
is all else, and is told of line by line. `ratio` is metres driven by metres of the shortest way
over the graph, of all that was reached together; `worst` that of a single way of more than 5 m.
With --out every world leaves a line of JSON when it is done, and is not run again.
"""

import argparse
import asyncio
import math
from collections import Counter
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import structlog

from benchmarks import campaign
from benchmarks.campaign import Row
from gvgbot.autonomy.destinations import foot_of, route_to_foot, route_to_vertex
from gvgbot.autonomy.errands import Declined
from gvgbot.autonomy.events import ErrandEnded, Event
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import Config, load_config
from gvgbot.driving import drive
from gvgbot.geometry import Array, Pose
from gvgbot.links import Devices, Links
from gvgbot.simulation import Place, Simulation, open_place

REACHED_M = 0.3
LONGEST_S = 1200.0  # of an errand
LONG_M = 5.0  # a way for which its ratio says something
ROOM_M = 0.3  # that a point which is asked for has beside the robot's radius
HEAD = (
    "world            seed explored reached refused given-up wrong hits  ratio  worst  driven   s"
)


@dataclass
class Score:
    """What became of the requests in one world."""

    world: str
    seed: int
    settings: list[str] = field(default_factory=list)
    explored: str = ""
    reached: int = 0
    refused: int = 0
    given_up: int = 0
    wrong: int = 0
    contacts: int = 0
    driven: float = 0.0
    shortest: float = 0.0
    worst: float = 0.0
    duration: float = 0.0
    reasons: dict[str, int] = field(default_factory=dict)

    @property
    def row(self) -> str:
        ratio = self.driven / self.shortest if self.shortest else math.nan
        return (
            f"{self.world:16} {self.seed:4} {self.explored:8} {self.reached:7} {self.refused:7} "
            f"{self.given_up:8} {self.wrong:5} {self.contacts:4} {ratio:6.3f} {self.worst:6.2f} "
            f"{self.driven:7.0f} {self.duration:6.0f}"
        )


@dataclass
class Tour:
    """A robot that explores, and then does errands."""

    config: Config
    place: Place
    pipeline: Pipeline
    clock: LoopClock
    simulation: Simulation
    score: Score
    verbose: bool = False
    events: list[Event] = field(default_factory=list)

    @property
    def here(self) -> Pose:
        """world_base, the truth."""
        self.simulation.body.advance(self.clock.now())
        return self.simulation.body.pose

    async def resting(self, patience: float) -> None:
        end = self.clock.now() + patience
        while not self.pipeline.errands.is_resting and self.clock.now() < end:
            await self.clock.sleep_until(self.clock.now() + 0.5)

    def shortest(self, goal: int | Array) -> float:
        """Metres of the shortest way over the graph, NaN if none is known."""
        here, mapper = self.pipeline.errands.whereabouts(), self.pipeline.mapper
        if here is None:
            return math.nan
        if isinstance(goal, int):
            route = route_to_vertex(mapper.graph, here.starts(), goal)
            return math.nan if route is None else route.metres
        foot = foot_of(mapper, goal)
        route = None if foot is None else route_to_foot(here, here.starts(), foot)
        return math.nan if route is None or foot is None else route.metres + foot.away

    async def visit(self, goal: int | Array) -> None:
        """Drive to a vertex or to a point of the map (2,), and count how that went."""
        errands, begin, start = (
            self.pipeline.errands,
            self.pipeline.past.travelled,
            self.clock.now(),
        )
        shortest, count = self.shortest(goal), len(self.events)
        try:
            if isinstance(goal, int):
                errands.goto_vertex(goal, start)
            else:
                errands.goto_point(float(goal[0]), float(goal[1]), start)
        except Declined as reason:
            self.score.refused += 1
            self.note(goal, f"refused: {reason}")
            return
        await self.resting(LONGEST_S)
        await self.clock.sleep_until(self.clock.now() + 1.0)
        ended = [event for event in self.events[count:] if isinstance(event, ErrandEnded)]
        driven = self.pipeline.past.travelled - begin
        way = f"{driven:.1f} m for {shortest:.1f} m in {self.clock.now() - start:.0f} s"
        if not ended:
            self.score.wrong += 1
            self.note(goal, f"WRONG: did not end; {way}")
        elif ended[-1].outcome != "arrived":
            self.score.given_up += 1
            self.note(goal, f"{ended[-1].outcome}: {ended[-1].reason}; {way}")
        else:
            self.arrived(goal, driven, shortest, way)

    def arrived(self, goal: int | Array, driven: float, shortest: float, way: str) -> None:
        mapper = self.pipeline.mapper
        place = mapper.belief.map_vertex(goal).position if isinstance(goal, int) else goal
        off = float(np.hypot(*(self.place.start.transform(place) - self.here.position)))
        if off > REACHED_M:
            self.score.wrong += 1
            self.note(goal, f"WRONG: {off:.2f} m off; {way}")
            return
        self.score.reached += 1
        if not math.isnan(shortest):
            self.score.driven += driven
            self.score.shortest += shortest
            if shortest > LONG_M:
                self.score.worst = max(self.score.worst, driven / shortest)
                if driven > 1.3 * shortest:
                    self.note(goal, f"detour; {way}")

    def note(self, goal: int | Array, what: str) -> None:
        reasons = Counter(self.score.reasons)
        reasons[what.split(";", maxsplit=1)[0]] += 1
        self.score.reasons = dict(reasons)
        if self.verbose:
            name = goal if isinstance(goal, int) else np.round(goal, 2)
            print(f"  {self.clock.now():7.0f} s  {name}: {what}", flush=True)

    def goals(self, count: int) -> list[int | Array]:
        """Vertices and points in turn, at random; points have room, and lie near the known."""
        rng = np.random.default_rng(self.config.twin.seed)
        world, start = self.place.world, self.place.start
        goals: list[int | Array] = []
        vertices = list(self.pipeline.mapper.graph.vertices)
        walls = np.argwhere(world.occupied)[:, ::-1]
        walls = (walls + 0.5) * world.resolution_m + np.array(world.origin)
        seen = np.array([k.map_base.position for k in self.pipeline.past.keyframes])
        while len(goals) < count:
            if len(goals) % 2 == 0:
                goals.append(int(rng.choice(vertices)))
                continue
            point = seen[rng.integers(len(seen))] + rng.uniform(-0.7, 0.7, 2)
            room = np.hypot(*(walls - start.transform(point)).T).min()
            if room > self.config.robot.radius_m + ROOM_M:
                goals.append(point)
        return goals

    async def run(self, count: int) -> None:
        await self.clock.sleep_until(3.0)
        await self.resting(self.config.twin.time_limit_s)
        self.score.explored = "yes" if self.pipeline.mission.outcome == "explored" else "no"
        for goal in self.goals(count):
            if not isinstance(goal, int) or goal in self.pipeline.mapper.graph.vertices:
                await self.visit(goal)
        self.score.contacts = self.simulation.body.contacts
        self.score.duration = self.clock.now()


async def explore_and_visit(config: Config, score: Score, count: int, *, verbose: bool) -> None:
    clock, place = LoopClock(), open_place(config)
    simulation = Simulation(config, place, clock)
    devices = Devices(Links(config, clock, simulation))
    pipeline = Pipeline(config.mind, config.exploration, config.robot.radius_m)
    tour = Tour(config, place, pipeline, clock, simulation, score, verbose)
    driving = drive(
        config.robot, devices, pipeline, on_events=tour.events.extend, goes_on=lambda: True
    )
    async with asyncio.TaskGroup() as tasks:
        work = tasks.create_task(driving)
        await tour.run(count)
        work.cancel()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--worlds", nargs="+", default=["office", "ring", "rooms", "cave"])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--requests", type=int, default=100, help="in each world")
    parser.add_argument("--out", type=Path, help="lines of JSON; worlds in it are not run again")
    parser.add_argument("--verbose", action="store_true", help="tell of all that was not reached")
    parser.add_argument("--set", dest="overrides", action="append", default=[])
    options = parser.parse_args()
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(50))
    print(HEAD)
    for row in campaign.rows(
        options.out,
        [(world, options.seed, tuple(options.overrides)) for world in options.worlds],
        lambda cases: (scored(world, options) for world, *_ in cases),
        case_of=lambda row: (row["world"], row["seed"], tuple(row.get("settings", ()))),
    ):
        score = Score(**row)
        print(score.row, flush=True)
        for reason, times in sorted(score.reasons.items(), key=lambda item: -item[1]):
            print(f"    {times:3} {reason}")


def scored(world: str, options: argparse.Namespace) -> Row:
    """What becomes of the requests in a world."""
    score = Score(world, options.seed, options.overrides)
    chosen = [f"twin.world={world}", f"twin.seed={options.seed}", *options.overrides]
    work = explore_and_visit(
        load_config(None, chosen), score, options.requests, verbose=options.verbose
    )
    run_in_virtual_time(work)
    return asdict(score)


if __name__ == "__main__":
    main()
