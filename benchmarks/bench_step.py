"""Computing time of perception and control, for each scan, while the robot explores worlds.

    python benchmarks/bench_step.py [WORLD ...]    (built-in names or map_server YAML files)

Each world is explored with both lasers. Times are of the thread, not of the clock, so that other
programs disturb them less. A scan's time is its perception and all control until the next scan.
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

DEFAULT_WORLDS = ("office", "floor_plan:201", "floor_plan:213")  # the last one is large
TARGETS_MS = {"UTM-30LX": (4.0, 12.0), "URG-04LX": (2.5, 7.5)}  # for a scan: mean, 99th percentile


class TimedPipeline(Pipeline):
    """Takes down how long each of its steps took, s."""

    def __init__(self, config: Config) -> None:
        super().__init__(config.autonomy, config.exploration, config.robot.radius_m)
        self.scan_times: list[float] = []
        self.keyframe_times: list[float] = []
        self.control_times: list[float] = []

    def perceive(self, scan: Scan) -> list[Event]:
        """Time a scan, and once more if it is a keyframe."""
        count, begin = len(self.keyframes), time.thread_time()
        happened = super().perceive(scan)
        spent = time.thread_time() - begin
        self.scan_times.append(spent)
        if len(self.keyframes) > count:
            self.keyframe_times.append(spent)
        return happened

    def control(self, odometry: Odometry, *felt: Felt) -> Twist:
        """Time a control cycle, by itself and as a part of the newest scan's time."""
        begin = time.thread_time()
        twist = super().control(odometry, *felt)
        self.control_times.append(time.thread_time() - begin)
        if self.scan_times:
            self.scan_times[-1] += self.control_times[-1]
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


def row(name: str, times: list[float], targets: str = "") -> str:
    """Count, mean, median, 99th percentile and maximum of a list of times."""
    p50, p99, most = np.percentile(times, [50, 99, 100]) * 1e3
    return (
        f"  {name:<9}{len(times):>7} times: mean {np.mean(times) * 1e3:6.2f} ms, p50 {p50:6.2f}, "
        f"p99 {p99:6.2f}, max {most:6.2f}{targets}"
    )


def bench(world: str, laser: str) -> None:
    """Explore one world and print its times."""
    config = load_config(None, [f"twin.world={world}", f"twin.laser.model={laser}"])
    pipeline = TimedPipeline(config)
    begin = time.thread_time()
    robot_time = run_in_virtual_time(explore(config, pipeline))
    spent = time.thread_time() - begin
    print(f"{world}, {laser}: {pipeline.mission.outcome}, {pipeline.travelled:.0f} m driven")
    mean, worst = TARGETS_MS[laser]
    print(row("scan", pipeline.scan_times, f"; targets: mean {mean} ms, p99 {worst} ms"))
    print(row("keyframe", pipeline.keyframe_times))
    print(row("control", pipeline.control_times))
    begin = time.thread_time()
    smoothed(pipeline)
    print(
        f"  autonomy {100 * sum(pipeline.scan_times) / robot_time:.1f} % of one core in real time; "
        f"{robot_time:.0f} s simulated in {spent:.0f} s; smoothing "
        f"{time.thread_time() - begin:.2f} s",
        flush=True,
    )


def main() -> None:
    """Time the worlds that are named, or the default ones."""
    for world in sys.argv[1:] or DEFAULT_WORLDS:
        for laser in TARGETS_MS:
            bench(world, laser)


if __name__ == "__main__":
    main()
