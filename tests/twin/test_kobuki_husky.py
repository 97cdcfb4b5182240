"""A differential base that the code has never heard of, described by configuration alone."""

import asyncio
import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import load_config
from gvgbot.daemon import explore
from gvgbot.drivers.body import BodyConfig, RobotBody
from gvgbot.drivers.kobuki.driver import KobukiBase
from gvgbot.drivers.kobuki.twin import KobukiTwin
from gvgbot.drivers.transport import pipe, serve_twin
from gvgbot.drivers.world import World, save_world
from gvgbot.geometry import Pose, Twist, wrap_angle
from gvgbot.hal.messages import Odometry
from gvgbot.stop_signals import StopSignals
from gvgbot.worlds.canvas import Canvas

pytestmark = pytest.mark.twin
START = Pose(15.0, 15.0, 0.0)
HUSKY = load_config(Path("husky.yaml"), ["twin.base.odometry=perfect"])


@pytest.mark.parametrize("heading", ["gyro", "wheels"])
def test_its_odometry_is_where_its_body_is(heading: str) -> None:
    """Truth: the body's own pose after arcs to both sides, turning on the spot, and backwards."""
    config = load_config(
        Path("husky.yaml"), ["twin.base.odometry=perfect", f"base.heading={heading}"]
    )

    async def main() -> tuple[Odometry, Pose]:
        clock = LoopClock()
        shape = BodyConfig(radius_m=0.6, wheel_base_m=config.base.wheel_base_m)
        body = RobotBody(World(np.zeros((30, 30), bool), 1.0), START, shape)
        here, there = pipe()
        base = KobukiBase(here, config.base, clock)
        twin = KobukiTwin(config.twin.base, body, 1, config.base.geometry)
        async with asyncio.TaskGroup() as tasks:
            work = [
                tasks.create_task(serve_twin(twin, there, clock)),
                tasks.create_task(base.run()),
            ]
            odometry = await base.next_odometry()
            for until, twist in PROGRAMME:
                while odometry.stamp < until:
                    base.drive(twist)
                    odometry = await base.next_odometry()
            for task in work:
                task.cancel()
        return odometry, START.to(body.pose)

    odometry, truth = run_in_virtual_time(main())
    assert odometry.odom_base.distance(truth) < 0.01
    assert abs(wrap_angle(odometry.odom_base.theta - truth.theta)) < 0.005
    assert truth.distance(Pose()) > 1.0


PROGRAMME = [
    (3.0, Twist(0.8, 0.0)),
    (6.0, Twist(0.5, 0.6)),
    (9.0, Twist(0.5, -0.4)),
    (11.0, Twist(0.0, 1.2)),
    (14.0, Twist(-0.3, 0.1)),
    (16.0, Twist()),
]


def test_its_fast_wheel_is_limited_by_its_own_width() -> None:
    async def main() -> Twist:
        here, _ = pipe()
        base = KobukiBase(here, HUSKY.base, LoopClock())
        return base.drive(Twist(0.9, 2.0))

    twist = run_in_virtual_time(main())
    assert abs(twist.linear) + abs(twist.angular) * 0.555 / 2 == pytest.approx(1.0, abs=0.003)
    assert twist.linear / twist.angular == pytest.approx(0.45, abs=0.002)


@pytest.mark.slow
def test_it_explores_a_ring_without_touching_a_wall(tmp_path: Path) -> None:
    """Geometry: along the middle of the ring the robot comes back to where it was."""
    canvas = Canvas(10.0, 10.0)
    canvas.carve_path([(2.0, 2.0), (8.0, 2.0), (8.0, 8.0), (2.0, 8.0), (2.0, 2.0)], 2.6)
    ring = replace(HUSKY.twin, world=str(save_world(canvas.world("ring"), tmp_path)))
    config = replace(HUSKY, twin=replace(ring, start=(5.0, 2.0, 0.0)))
    assert explore(config, print, StopSignals(), out=tmp_path / "run", real_time=False) == 0
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["contacts"] == 0
    assert summary["config"]["robot"]["radius_m"] == 0.6
    rows = [line.split() for line in (tmp_path / "run" / "truth.tum").read_text().splitlines()]
    xs, ys = ([float(row[i]) for row in rows if row[0] != "#"] for i in (1, 2))
    turned, middle = 0.0, (sum(xs) / len(xs), sum(ys) / len(ys))
    bearings = [math.atan2(y - middle[1], x - middle[0]) for x, y in zip(xs, ys, strict=True)]
    for before, after in pairwise(bearings):
        turned += wrap_angle(after - before)
    assert abs(turned) > 0.95 * math.tau
