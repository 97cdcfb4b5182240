"""A simulated base behind a bad link, and a driver that is opened again whenever it is lost."""

import asyncio
from collections.abc import Awaitable, Callable

from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.drivers.cable import Cable
from gvgbot.drivers.kobuki.driver import KobukiBase, KobukiConfig
from gvgbot.drivers.kobuki.feedback import FeedbackReader
from gvgbot.drivers.kobuki.twin import KobukiTwin, KobukiTwinConfig
from gvgbot.drivers.link_faults import FaultyLink
from gvgbot.drivers.transport import serve_twin
from gvgbot.geometry import Twist
from gvgbot.hal.messages import Contact, Odometry
from gvgbot.hal.reopening import ReopeningBase
from tests.twin.kobuki_body import IdealBody

PERFECT = KobukiTwinConfig(odometry="perfect")
FORWARD = Twist(0.2, 0.0)


class Robot:
    """A twin behind a link, and a driver that is opened again whenever it is lost."""

    def __init__(self, config: KobukiTwinConfig, seed: int) -> None:
        self.clock = LoopClock()
        self.body = IdealBody()
        self.twin = KobukiTwin(config, self.body, seed)
        self.cable = Cable()
        self.link = FaultyLink(self.twin, config.link, seed, self.cable.plug)
        self.feedback = FeedbackReader("gyro", 0.0)
        self.base = ReopeningBase(self.open, self.clock)
        self.heard: list[tuple[float, Odometry]] = []
        self.contacts: list[Contact] = []

    def open(self) -> tuple[KobukiBase, Callable[[], None]]:
        stream = self.cable.host
        return KobukiBase(stream, KobukiConfig(), self.clock, self.feedback), lambda: None

    async def follow(self, twist: Twist) -> None:
        while True:
            odometry = await self.base.next_odometry()
            self.heard.append((self.clock.now(), odometry))
            if self.base.contact is not None:
                self.contacts.append(self.base.contact)
            self.base.drive(twist)

    def heard_between(self, start: float, end: float) -> int:
        return sum(start <= at <= end for at, _ in self.heard)


def play(
    script: Callable[[Robot], Awaitable[None]],
    config: KobukiTwinConfig = PERFECT,
    twist: Twist = FORWARD,
    seed: int = 1,
) -> Robot:
    async def main() -> Robot:
        robot = Robot(config, seed)
        async with asyncio.TaskGroup() as tasks:
            work = [
                tasks.create_task(serve_twin(robot.link, robot.cable.device, robot.clock)),
                tasks.create_task(robot.base.run()),
                tasks.create_task(robot.follow(twist)),
            ]
            await script(robot)
            for task in work:
                task.cancel()
        return robot

    robot = run_in_virtual_time(main())
    assert isinstance(robot, Robot)
    return robot


def for_seconds(seconds: float) -> Callable[[Robot], Awaitable[None]]:
    async def script(robot: Robot) -> None:
        await robot.clock.sleep_until(seconds)

    return script
