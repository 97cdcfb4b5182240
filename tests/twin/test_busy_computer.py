"""Twins and drivers on a computer that is too slow, now and then or all the time."""

import asyncio
import math

import numpy as np
import pytest

from gvgbot.autonomy.odometry_log import OdometryLog
from gvgbot.clock import LoopClock, VirtualTimeLoop, run_in_virtual_time
from gvgbot.config import Config, TwinConfig
from gvgbot.drivers.hokuyo.driver import HokuyoLaser
from gvgbot.drivers.hokuyo.twin import HokuyoTwinConfig
from gvgbot.drivers.kobuki.driver import KobukiBase
from gvgbot.drivers.kobuki.feedback import FeedbackReader
from gvgbot.drivers.kobuki.twin import KobukiTwinConfig
from gvgbot.drivers.kobuki.wheel_odometry import KOBUKI
from gvgbot.drivers.transport import pipe
from gvgbot.errors import DeviceLost
from gvgbot.geometry import Pose, Twist, wrap_angle
from gvgbot.hal.deskew import deskewed
from gvgbot.simulation import Place, Simulation
from gvgbot.worlds.canvas import Canvas

pytestmark = pytest.mark.twin
START = Pose(3.0, 2.0, 0.5)
TURNING = 20.0  # s


def compute(seconds: float) -> None:
    """Let the computer be busy for so long: time goes on, and nothing else happens."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualTimeLoop)
    loop._jumping.now += seconds


class Turning:
    """A robot that turns in a room; `looks` are scans as odometry and world make expect them."""

    def __init__(self, control_s: float, look_s: float) -> None:
        canvas = Canvas(8.0, 6.0)
        canvas.carve(1.0, 1.0, 7.0, 4.5)
        self.control_s, self.look_s = control_s, look_s
        self.clock, self.place = LoopClock(), Place(canvas.world("room"), START)
        base = KobukiTwinConfig(odometry="perfect")
        laser = HokuyoTwinConfig(range_sigma_m=0.0, dropout_fraction=0.0)
        self.config = Config(twin=TwinConfig(base=base, laser=laser))
        self.simulation = Simulation(self.config, self.place, self.clock)
        self.feedback = FeedbackReader("gyro", 0.0, KOBUKI)
        self.base = KobukiBase(self.simulation.base, self.config.base, self.clock, self.feedback)
        self.laser = HokuyoLaser(self.simulation.laser, self.config.laser, self.clock)
        self.log = OdometryLog()
        self.misfits: list[float] = []  # of scans, m

    async def control(self) -> None:
        while True:
            self.log.append(await self.base.next_odometry())
            compute(self.control_s)
            self.base.drive(Twist(0.0, 1.0 if self.clock.now() < TURNING else 0.0))

    async def look(self) -> None:
        while True:
            scan = await self.laser.next_scan()
            compute(self.look_s)
            await asyncio.sleep(0.1)  # until odometry has caught up
            odom_base = self.log.odom_base_at(scan.stamp)
            if odom_base is None:
                continue  # a scan of a while in which the base was not heard
            seen = deskewed(scan, self.log.motion_during(scan))
            world_laser = START.compose(odom_base).compose(scan.base_laser)
            expected = self.place.world.cast(world_laser, scan.bearings, 10.0)
            self.misfits.append(float(np.nanmedian(np.abs(seen.ranges - expected))))

    async def live(self) -> None:
        work = [
            self.simulation.run(),
            self.base.run(),
            self.laser.run(),
            self.control(),
            self.look(),
        ]
        async with asyncio.TaskGroup() as tasks:
            working = [tasks.create_task(each) for each in work]
            await asyncio.sleep(TURNING + 3.0)
            for task in working:
                task.cancel()


def turned(control_s: float, look_s: float) -> Turning:
    async def main() -> Turning:
        robot = Turning(control_s, look_s)
        await robot.live()
        return robot

    robot = run_in_virtual_time(main())
    assert isinstance(robot, Turning)
    return robot


@pytest.mark.parametrize(
    ("control_s", "look_s"), [(0.0, 0.0), (0.03, 0.0), (0.0, 0.12), (0.02, 0.1)]
)
def test_a_slow_computer_bends_neither_odometry_nor_scans(control_s: float, look_s: float) -> None:
    """The twins' truth: the body. What computing takes is more than there is time for."""
    robot = turned(control_s, look_s)
    newest = robot.log.newest
    assert newest is not None
    truth = robot.simulation.body.pose.theta - START.theta
    assert abs(wrap_angle(newest.odom_base.theta - truth)) < math.radians(0.1)
    assert robot.feedback.statistics.resets == 0
    assert len(robot.misfits) > 50
    assert np.max(robot.misfits) < 0.03


def test_no_base_is_lost_because_the_computer_hung() -> None:
    """It hangs for longer than the base may be silent; `live` would raise DeviceLost."""

    async def main() -> Turning:
        robot = Turning(0.0, 0.0)
        loop = asyncio.get_running_loop()
        for at in (3.0, 6.013, 9.509):
            loop.call_at(at, compute, 1.7)
        await robot.live()
        return robot

    robot = run_in_virtual_time(main())
    assert isinstance(robot, Turning)
    newest = robot.log.newest
    assert newest is not None
    truth = robot.simulation.body.pose.theta - START.theta
    assert abs(wrap_angle(newest.odom_base.theta - truth)) < math.radians(0.1)
    assert robot.feedback.statistics.resets == 0


async def restarts(robot: Turning, goes_dumb: float) -> int:
    """How often the scans are started again by a computer that hangs, until the laser is dumb."""
    for at, hangs in ((3.0, 0.45), (4.05, 0.35), (5.0, 1.7), (goes_dumb + 0.1, 0.45)):
        asyncio.get_running_loop().call_at(at, compute, hangs)

    async def listen() -> None:
        with pytest.raises(DeviceLost):
            await robot.laser.run()

    async with asyncio.timeout(goes_dumb + 10.0), asyncio.TaskGroup() as tasks:
        living = tasks.create_task(robot.simulation.run())
        tasks.create_task(listen())
        await asyncio.sleep(goes_dumb)
        restarted = robot.laser.link.restarts
        living.cancel()
    return restarted


def test_scans_are_not_started_again_because_the_computer_hung() -> None:
    """A laser that is still silent afterwards is lost, all the same."""

    async def main() -> int:
        return await restarts(Turning(0.0, 0.0), goes_dumb=9.0)

    assert run_in_virtual_time(main()) == 0


def test_a_base_that_is_still_silent_after_a_computer_hung_is_lost() -> None:
    async def main() -> float:
        clock, (here, _) = LoopClock(), pipe()
        asyncio.get_running_loop().call_at(0.9, compute, 3.0)
        with pytest.raises(DeviceLost):
            await KobukiBase(here, Config().base, clock).run()
        return clock.now()

    assert 3.9 < run_in_virtual_time(main()) < 4.2
