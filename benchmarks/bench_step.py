"""Computing time of perception and control, for each scan, while the robot explores worlds.

    python benchmarks/bench_step.py [WORLD ...]    (built-in names or map_server YAML files)

Each world is explored with both lasers. Times are of the thread, not of the clock, so that other
programs disturb them less. A scan's time is its perception and all control until the next scan.
"""

import sys
import time
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import numpy as np

from benchmarks.report import report, report_fact
from gvgbot.autonomy.control.reflexes import Felt
from gvgbot.autonomy.estimate import smoothed
from gvgbot.autonomy.events import Event
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import Config, load_config
from gvgbot.driving import drive
from gvgbot.geometry import Twist
from gvgbot.hal.messages import Odometry, Scan
from gvgbot.links import Devices, Links
from gvgbot.simulation import Simulation, open_place

DEFAULT_WORLDS = ("office", "floor_plan:201")
P = ParamSpec("P")
T = TypeVar("T")
TARGETS_MS = {"UTM-30LX": (4.0, 12.0), "URG-04LX": (2.5, 7.5)}  # for a scan: mean, 99th percentile


class TimedPipeline(Pipeline):
    """Takes down how long each of its steps took, s."""

    def __init__(self, config: Config) -> None:
        super().__init__(config.mind, config.exploration, config.robot.radius_m)
        self.scan_times: list[float] = []
        self.keyframe_times: list[float] = []
        self.control_times: list[float] = []
        self.stages: dict[str, list[float]] = {}
        self._time("match", self, "_localise")
        self._time("insert", self.tracker.maps, "insert")
        self._time("local GVG", self.sight, "_local_gvg")
        self._time("recognise", self.mapper, "observe")
        self._time("decide", self.errands, "advance")

    def _time(self, stage: str, owner: object, method: str) -> None:
        """Take down from now on how long a method takes."""
        setattr(owner, method, self._timed(stage, getattr(owner, method)))

    def _timed(self, stage: str, work: Callable[P, T]) -> Callable[P, T]:
        """The same work, that takes down how long it takes."""
        times = self.stages[stage] = []

        def timed(*args: P.args, **kwargs: P.kwargs) -> T:
            begin = time.thread_time()
            done = work(*args, **kwargs)
            times.append(time.thread_time() - begin)
            return done

        return timed

    def perceive(self, scan: Scan) -> list[Event]:
        """Time a scan, and once more if it is a keyframe."""
        count, begin = len(self.past.keyframes), time.thread_time()
        happened = super().perceive(scan)
        spent = time.thread_time() - begin
        self.scan_times.append(spent)
        if len(self.past.keyframes) > count:
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
    await drive(config.robot, Devices(Links(config, clock, simulation)), pipeline)
    return clock.now()


def report_times(what: str, times: list[float]) -> None:
    """Mean and 99th percentile of a list of times."""
    report_fact(f"{what}, mean", 1e3 * float(np.mean(times)), "ms")
    report_fact(f"{what}, p99", 1e3 * float(np.percentile(times, 99)), "ms")


def bench(world: str, laser: str) -> None:
    """Explore one world and print its times."""
    config = load_config(None, [f"twin.world={world}", f"twin.laser.model={laser}"])
    pipeline = TimedPipeline(config)
    begin = time.thread_time()
    robot_time = run_in_virtual_time(explore(config, pipeline))
    spent = time.thread_time() - begin
    print(f"{world}, {laser}: {pipeline.mission.outcome}, {pipeline.past.travelled:.0f} m driven")
    place, (mean, worst) = f"{world}, {laser}", TARGETS_MS[laser]
    times = 1e3 * np.array(pipeline.scan_times)
    report(f"{place}: a scan, mean", float(np.mean(times)), "ms", at_most=mean)
    report(f"{place}: a scan, p99", float(np.percentile(times, 99)), "ms", at_most=worst)
    report_times(f"{place}: a keyframe", pipeline.keyframe_times)
    for stage, spans in pipeline.stages.items():
        report_times(f"{place}: stage {stage}", spans)
    report_times(f"{place}: a control cycle", pipeline.control_times)
    share = 100 * sum(pipeline.scan_times) / robot_time
    report_fact(f"{place}: autonomy in real time", share, "% of a core")
    report_fact(f"{place}: simulated faster than life", robot_time / spent, "times")
    begin = time.thread_time()
    smoothed(pipeline)
    report_fact(f"{place}: smoothing at the end", time.thread_time() - begin, "s")


def main() -> None:
    """Time the worlds that are named, or the default ones."""
    for world in sys.argv[1:] or DEFAULT_WORLDS:
        for laser in TARGETS_MS:
            bench(world, laser)


if __name__ == "__main__":
    main()
