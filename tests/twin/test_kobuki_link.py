"""Driver and simulated base joined by a pipe, in virtual time."""

import asyncio
import math
from collections.abc import Awaitable, Callable
from itertools import pairwise

import pytest

from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.drivers.kobuki.driver import KobukiBase, KobukiConfig
from gvgbot.drivers.kobuki.twin import KobukiTwin, KobukiTwinConfig
from gvgbot.drivers.kobuki.wheel_odometry import Heading
from gvgbot.drivers.transport import pipe, serve_twin
from gvgbot.geometry import Pose, Twist, wrap_angle
from gvgbot.hal.messages import Odometry
from tests.twin.kobuki_body import IdealBody

pytestmark = pytest.mark.twin
PERFECT = KobukiTwinConfig(odometry="perfect")


class Robot:
    """A driver and its twin."""

    def __init__(self, twin: KobukiTwinConfig, config: KobukiConfig, seed: int) -> None:
        self.clock = LoopClock()
        self.body = IdealBody()
        here, self.there = pipe()
        self.twin = KobukiTwin(twin, self.body, seed)
        self.base = KobukiBase(here, config, self.clock)

    async def follow(
        self, twist: Twist, seconds: float, each: Callable[[Odometry], None] = lambda _: None
    ) -> Odometry:
        """Drive like a control loop: one command per odometry message."""
        until = self.clock.now() + seconds
        while True:
            odometry = await self.base.next_odometry()
            each(odometry)
            if odometry.stamp >= until - 1e-6:
                return odometry
            self.base.drive(twist)


def play(
    script: Callable[[Robot], Awaitable[None]],
    twin: KobukiTwinConfig = PERFECT,
    config: KobukiConfig | None = None,
    seed: int = 1,
) -> Robot:
    async def main() -> Robot:
        robot = Robot(twin, config or KobukiConfig(), seed)
        async with asyncio.TaskGroup() as tasks:
            serving = tasks.create_task(serve_twin(robot.twin, robot.there, robot.clock))
            running = tasks.create_task(robot.base.run())
            await script(robot)
            running.cancel()
            await asyncio.sleep(0.2)
            serving.cancel()
        return robot

    robot = run_in_virtual_time(main())
    assert isinstance(robot, Robot)
    return robot


def test_a_circle_closes() -> None:
    async def script(robot: Robot) -> None:
        found.append(await robot.follow(Twist(0.2, 0.5), 4 * math.pi))
        await robot.follow(Twist(), 0.2)
        found.append(await robot.base.next_odometry())

    found: list[Odometry] = []
    body = play(script).body
    at_end = found[-1].odom_base
    assert at_end.distance(body.pose) < 2e-3
    assert abs(wrap_angle(at_end.theta - body.pose.theta)) < 1e-3
    assert at_end.distance(Pose()) < 0.04
    assert body.left_travel + body.right_travel == pytest.approx(2 * 0.8 * math.pi, abs=0.05)


def test_odometry_is_stamped_by_when_it_was_true() -> None:
    """The body's true pose at each stamp is known: it drives straight at a known speed."""

    async def script(robot: Robot) -> None:
        def look(odometry: Odometry) -> None:
            moves = [at for at, twist in robot.body.commands if twist != Twist()]
            started = moves[0] if moves else math.inf
            truth = max(0.0, odometry.stamp - started) * 0.3
            assert odometry.odom_base.x == pytest.approx(truth, abs=5e-4)
            stamps.append(odometry.stamp)

        await robot.follow(Twist(0.3, 0.0), 3.0, look)

    stamps: list[float] = []
    play(script)
    steps = [b - a for a, b in pairwise(stamps)]
    assert len(steps) > 140
    assert all(step == pytest.approx(0.02, abs=1e-5) for step in steps)


@pytest.mark.parametrize("heading", ["gyro", "wheels"])
def test_either_heading_follows_perfect_sensors(heading: Heading) -> None:
    async def script(robot: Robot) -> None:
        await robot.follow(Twist(0.1, 2.0), 3.0)
        found.append(await robot.follow(Twist(), 0.5))

    found: list[Odometry] = []
    body = play(script, config=KobukiConfig(heading=heading)).body
    assert abs(wrap_angle(found[0].odom_base.theta - body.pose.theta)) < 3e-3
    assert found[0].odom_base.distance(body.pose) < 3e-3


def test_the_gyro_keeps_a_better_heading_than_unequal_wheels() -> None:
    def heading_error(heading: Heading, seed: int) -> float:
        async def script(robot: Robot) -> None:
            for _ in range(5):
                await robot.follow(Twist(0.0, 1.5), 2.0)
                await robot.follow(Twist(0.0, -1.5), 1.0)
            found.append(await robot.follow(Twist(), 0.5))

        found: list[Odometry] = []
        twin = KobukiTwinConfig(odometry="kobuki")
        body = play(script, twin, KobukiConfig(heading=heading), seed).body
        return abs(wrap_angle(found[0].odom_base.theta - body.pose.theta))

    gyro, wheels = (sum(heading_error(h, s) for s in range(3)) for h in ("gyro", "wheels"))
    assert gyro < wheels / 2


def test_what_drive_returns_is_what_the_body_does() -> None:
    async def script(robot: Robot) -> None:
        await robot.base.next_odometry()
        told.append(robot.base.drive(Twist(0.6, 1.7)))
        await robot.follow(Twist(0.6, 1.7), 0.3)
        done.append(robot.body.twist)

    told: list[Twist] = []
    done: list[Twist] = []
    play(script)
    assert done[0].linear == pytest.approx(told[0].linear, rel=1e-3)
    assert done[0].angular == pytest.approx(told[0].angular, rel=1e-3)


def test_when_nobody_drives_any_more_the_base_stops() -> None:
    async def script(robot: Robot) -> None:
        await robot.follow(Twist(0.3, 0.0), 1.0)
        left.append(robot.clock.now())
        await asyncio.sleep(2.0)

    left: list[float] = []
    body = play(script).body
    stopped = next(at for at, twist in body.commands if at > left[0] and twist == Twist())
    assert stopped - left[0] == pytest.approx(0.5 + 0.06, abs=0.03)


def test_a_cancelled_driver_leaves_the_base_standing() -> None:
    async def script(robot: Robot) -> None:
        await robot.follow(Twist(0.3, 0.0), 1.0)

    assert play(script).body.commands[-1][1] == Twist()


def test_the_base_says_who_it_is() -> None:
    async def script(robot: Robot) -> None:
        await asyncio.sleep(0.2)

    robot = play(script, KobukiTwinConfig(firmware_version="1.1.4"))
    identity = robot.base.identity
    assert (identity.hardware, identity.firmware) == ("1.0.4", "1.1.4")
    assert identity.udid is not None
    assert robot.twin.received.bad_frames == 0


def test_bumper_and_battery_reach_the_driver() -> None:
    async def script(robot: Robot) -> None:
        await asyncio.sleep(0.1)
        assert robot.base.contact is not None
        assert not robot.base.contact.bumper
        robot.body.bumper = (False, False, True)
        await asyncio.sleep(0.04)
        assert robot.base.contact.bumper_right
        assert not robot.base.contact.bumper_left
        assert robot.base.battery is not None
        assert robot.base.battery.fraction == pytest.approx(0.885, abs=1e-3)

    play(script)
