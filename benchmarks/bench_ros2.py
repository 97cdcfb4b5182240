"""What it costs to tell neighbours in the messages of ROS 2, and how many bytes that makes.

Run: python -m benchmarks.bench_ros2

Scans of 1081 beams, odometry with its transforms, and a grid of 40 by 40 m, as the daemon makes
them. The way of the bytes through the network is zenoh's, and is measured by bench_telemetry.
"""

import time
from collections.abc import Callable
from itertools import count
from types import SimpleNamespace
from typing import cast

import numpy as np

from benchmarks.report import report, report_fact
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam.ekf import OdometryNoise
from gvgbot.geometry import Pose, Twist
from gvgbot.hal.messages import Odometry, Scan
from gvgbot.live.ros import LiveRos
from gvgbot.ros2.cdr import encode
from gvgbot.ros2.topics import Topic
from gvgbot.ros2.translation import occupancy_grid

TIMES, BEAMS, SCAN_HZ, ODOMETRY_HZ = 500, 1081, 40, 50
SIDE = 800  # cells of 5 cm


class Neighbour:
    """Wants everything, and counts the bytes."""

    def __init__(self) -> None:
        self.bytes = 0

    def wants(self, topic: Topic) -> bool:
        return True

    def send(self, topic: Topic, data: bytes, unix_ns: int) -> None:
        self.bytes += len(data)


def milliseconds(work: Callable[[], object]) -> float:
    """The median of processor time."""
    taken = []
    for _ in range(TIMES):
        begin = time.thread_time_ns()
        work()
        taken.append(time.thread_time_ns() - begin)
    return float(np.median(taken)) / 1e6


def main() -> None:
    neighbour, numbers = Neighbour(), count()
    mind = cast(
        "Pipeline", SimpleNamespace(past=SimpleNamespace(last=1), map_base=Pose(), is_lost=False)
    )
    live = LiveRos([neighbour], mind, OdometryNoise(), lambda stamp: stamp)
    ranges = np.random.default_rng(1).uniform(0.1, 30.0, BEAMS)
    scan = Scan(1.0, ranges, -2.35, 0.00436, 0.1, 30.0)

    def move() -> None:
        k = next(numbers)
        live.on_odometry(Odometry(k / ODOMETRY_HZ, Pose(0.01 * k, 0.0, 0.1), Twist(0.5, 0.1)))

    cells = np.random.default_rng(1).integers(-1, 100, (SIDE, SIDE)).astype(np.int8)
    live.on_scan(scan)  # which also tells once where the laser is
    for what, work, rate in (
        ("scan", lambda: live.on_scan(scan), SCAN_HZ),
        ("odometry and transforms", move, ODOMETRY_HZ),
    ):
        neighbour.bytes = 0
        taken = milliseconds(work)
        report(f"{what}: to CDR", taken, "ms", at_most=0.2)
        report_fact(f"{what}: at {rate} Hz", neighbour.bytes / TIMES * rate / 1e3, "kB/s")
        report_fact(f"{what}: at {rate} Hz", 0.1 * taken * rate, "% of a core")
    drawn = encode(occupancy_grid(cells, 0.05, (0.0, 0.0), 1.0))
    report(
        "grid of 40 x 40 m: to CDR",
        milliseconds(lambda: encode(occupancy_grid(cells, 0.05, (0.0, 0.0), 1.0))),
        "ms",
        at_most=5.0,
    )
    report_fact("grid of 40 x 40 m", len(drawn) / 1e3, "kB")


if __name__ == "__main__":
    main()
