"""Time of the pipeline's two steps, perception of a keyframe and control, while it explores worlds.

Run: python benchmarks/bench_step.py [WORLD ...]   (built-in names or map_server YAML files)
"""

import asyncio
import sys
import time

import numpy as np

from gvgbot.autonomy.control.reflexes import Felt
from gvgbot.autonomy.estimate import smoothed
from gvgbot.autonomy.events import Event
from gvgbot.autonomy.loop import Loop
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import Config, load_config
from gvgbot.drivers.hokuyo.driver import HokuyoLaser
from gvgbot.drivers.kobuki.driver import KobukiBase
from gvgbot.geometry import Twist
from gvgbot.hal.guard import Guard
from gvgbot.hal.messages import Odometry, Scan
from gvgbot.simulation import Simulation, open_place

DEFAULT_WORLDS = ("office", "rooms")


class TimedPipeline(Pipeline):
    """Takes down how long each of its steps took, s."""

    def __init__(self, config: Config) -> None:
        super().__init__(config.autonomy, config.exploration, config.robot.radius_m)
        self.keyframe_times: list[float] = []
        self.idle_times: list[float] = []
        self.control_times: list[float] = []

    def perceive(self, scan: Scan) -> list[Event]:
        """Time a scan, apart from those that were no keyframe."""
        count, begin = len(self.keyframes), time.perf_counter()
        happened = super().perceive(scan)
        spent = time.perf_counter() - begin
        (self.keyframe_times if len(self.keyframes) > count else self.idle_times).append(spent)
        return happened

    def control(self, odometry: Odometry, *felt: Felt) -> Twist:
        """Time a control cycle."""
        begin = time.perf_counter()
        twist = super().control(odometry, *felt)
        self.control_times.append(time.perf_counter() - begin)
        return twist


async def explore(config: Config, pipeline: Pipeline) -> float:
    """Drive through the twins until there is an outcome; seconds of the robot's clock."""
    clock = LoopClock()
    simulation = Simulation(config, open_place(config), clock)
    laser = HokuyoLaser(simulation.laser, config.laser, clock)
    base = KobukiBase(simulation.base, config.base, clock)
    guard = Guard(config.robot.limits, config.robot.radius_m)
    loop = Loop(laser, base, pipeline, guard, on_events=lambda _: None, on_cycle=lambda _: None)
    async with asyncio.TaskGroup() as tasks:
        serving = [tasks.create_task(part.run()) for part in (laser, base, simulation)]
        await loop.run()
        for task in serving:
            task.cancel()
    return clock.now()


def row(name: str, times: list[float]) -> str:
    """Count, median, 99th percentile, maximum and sum of a list of times."""
    p50, p99, most = np.percentile(times, [50, 99, 100]) * 1e3
    return (
        f"  {name:<9}{len(times):>7} times: p50 {p50:7.3f} ms, p99 {p99:7.3f} ms, "
        f"max {most:7.2f} ms, sum {sum(times):6.2f} s"
    )


def bench(world: str) -> None:
    """Explore one world and print its times."""
    config = load_config(None, [f"twin.world={world}"])
    pipeline = TimedPipeline(config)
    begin = time.perf_counter()
    robot_time = run_in_virtual_time(explore(config, pipeline))
    wall = time.perf_counter() - begin
    print(f"{world}: {pipeline.mission.outcome}, {pipeline.travelled:.0f} m in {robot_time:.0f} s")
    print(row("keyframe", pipeline.keyframe_times))
    print(row("other", pipeline.idle_times))
    print(row("control", pipeline.control_times))
    autonomy = sum(pipeline.keyframe_times + pipeline.idle_times + pipeline.control_times)
    begin = time.perf_counter()
    smoothed(pipeline)
    smoothing = time.perf_counter() - begin
    print(
        f"  autonomy {100 * autonomy / robot_time:.1f} % of one core in real time; whole "
        f"simulation {robot_time / wall:.0f} times as fast as life; smoothing {smoothing:.2f} s"
    )


def main() -> None:
    """Time the worlds that are named, or the default ones."""
    for world in sys.argv[1:] or DEFAULT_WORLDS:
        bench(world)


if __name__ == "__main__":
    main()
