"""Explores a world, drives to each of its vertices and home: what is reached, and by which ways.

    python -m benchmarks.errands_table --world office --seed 1

In virtual time, on the twins. A vertex counts as reached if the robot truly stands where the map
has the vertex, and `ratio` is metres driven by metres of the shortest way over the graph.
"""

import argparse
import asyncio
from dataclasses import dataclass, field

import numpy as np

from gvgbot.autonomy.destinations import route_to_vertex
from gvgbot.autonomy.errands import Declined
from gvgbot.autonomy.events import ErrandEnded, Event
from gvgbot.autonomy.loop import Loop
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import Config, load_config
from gvgbot.geometry import Pose
from gvgbot.hal.guard import Guard
from gvgbot.links import Devices, Links
from gvgbot.simulation import Place, Simulation, open_place

REACHED_M = 0.3
LONGEST_S = 1200.0  # of an errand


@dataclass
class Tour:
    """A robot that explores, and then does errands."""

    config: Config
    place: Place
    pipeline: Pipeline
    clock: LoopClock
    simulation: Simulation
    events: list[Event] = field(default_factory=list)
    missed: int = 0
    driven: float = 0.0
    shortest: float = 0.0

    @property
    def here(self) -> Pose:
        """world_base, the truth."""
        self.simulation.body.advance(self.clock.now())
        return self.simulation.body.pose

    async def resting(self, patience: float) -> None:
        end = self.clock.now() + patience
        while not self.pipeline.errands.is_resting and self.clock.now() < end:
            await self.clock.sleep_until(self.clock.now() + 0.5)

    async def visit(self, vertex: int | None) -> None:
        """Drive to a vertex, or home, and print how that went."""
        errands, graph = self.pipeline.errands, self.pipeline.mapper.graph
        begin, start = self.pipeline.travelled, self.clock.now()
        here, shortest = errands.whereabouts(), float("nan")
        if here is not None and vertex is not None:
            route = route_to_vertex(graph, here.starts(), vertex)
            shortest = shortest if route is None else route.metres
        try:
            if vertex is None:
                errands.home(start)
            else:
                errands.goto_vertex(vertex, start)
        except Declined as reason:
            self.missed += 1
            print(f"{vertex}: refused: {reason}")
            return
        await self.resting(LONGEST_S)
        await self.clock.sleep_until(self.clock.now() + 1.0)
        self.conclude(vertex, begin, start, shortest)

    def conclude(self, vertex: int | None, begin: float, start: float, shortest: float) -> None:
        ended = [event for event in self.events if isinstance(event, ErrandEnded)]
        goal = np.zeros(2)
        if vertex is not None and vertex in self.pipeline.mapper.graph.vertices:
            goal = self.pipeline.mapper.belief.map_vertex(vertex).position
        off = float(np.hypot(*(self.place.start.transform(goal) - self.here.position)))
        driven = self.pipeline.travelled - begin
        is_reached = bool(ended) and ended[-1].stamp > start and off < REACHED_M
        self.missed += not is_reached
        if shortest == shortest:  # not for the way home, which ends beside the graph
            self.driven, self.shortest = self.driven + driven, self.shortest + shortest
        print(
            f"{'home' if vertex is None else vertex:>5} "
            f"{'reached' if is_reached else 'MISSED':8} off {off:5.2f} m, driven {driven:6.1f} m, "
            f"shortest {shortest:6.1f} m, {self.clock.now() - start:5.0f} s  "
            f"{ended[-1].reason if ended else ''}"
        )

    async def run(self) -> None:
        await self.clock.sleep_until(3.0)
        await self.resting(self.config.twin.time_limit_s)
        mission, graph = self.pipeline.mission, self.pipeline.mapper.graph
        print(
            f"{mission.outcome}: {mission.reason}; {len(graph.vertices)} vertices, "
            f"{self.clock.now():.0f} s, {self.pipeline.travelled:.0f} m"
        )
        vertices = list(graph.vertices)
        np.random.default_rng(self.config.twin.seed).shuffle(vertices)
        for vertex in [*vertices, None]:
            await self.visit(vertex)
        ratio = self.driven / self.shortest if self.shortest else float("nan")
        print(
            f"missed {self.missed} of {len(vertices) + 1}, "
            f"contacts {self.simulation.body.contacts}, driven {self.driven:.1f} m, "
            f"shortest {self.shortest:.1f} m, ratio {ratio:.3f}"
        )


async def explore_and_visit(config: Config) -> None:
    clock, place = LoopClock(), open_place(config)
    simulation = Simulation(config, place, clock)
    devices = Devices(Links(config, clock, simulation))
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    tour = Tour(config, place, pipeline, clock, simulation)
    loop = Loop(
        devices.laser,
        devices.base,
        pipeline,
        Guard(config.robot.limits, config.robot.radius_m),
        on_events=tour.events.extend,
        on_cycle=lambda odometry: None,
        stays=True,
    )
    async with asyncio.TaskGroup() as tasks:
        work = [tasks.create_task(devices.run()), tasks.create_task(loop.run())]
        await tour.run()
        for task in work:
            task.cancel()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--world", default="office")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--set", dest="overrides", action="append", default=[])
    options = parser.parse_args()
    overrides = [f"twin.world={options.world}", f"twin.seed={options.seed}", *options.overrides]
    run_in_virtual_time(explore_and_visit(load_config(None, overrides)))


if __name__ == "__main__":
    main()
