"""A simulated base behind a bad link, and a driver that is opened again whenever it is lost."""

import math
from collections.abc import Awaitable, Callable

from benchmarks.rigs.stamp_errors import OtherClock
from gvgbot.clock import LoopClock
from gvgbot.drivers.kobuki.driver import KobukiBase, KobukiConfig
from gvgbot.drivers.kobuki.feedback import FeedbackReader
from gvgbot.drivers.kobuki.twin import KobukiTwin, KobukiTwinConfig
from gvgbot.drivers.kobuki.wheel_odometry import KOBUKI
from gvgbot.drivers.link_faults import FaultyLink
from gvgbot.drivers.transport import TwinDevice
from gvgbot.geometry import Twist
from gvgbot.hal.messages import Contact, Odometry
from gvgbot.hal.reopening import ReopeningBase
from tests.twin.device_rig import ENDS_OF_LINK, Wire, Work
from tests.twin.device_rig import play as play_rig
from tests.twin.kobuki_body import IdealBody

WRAP_MS, FRAME_MS = 1 << 16, 20
COUNTER = slice(5, 7)  # of a frame's bytes: after preamble, length, and the first part's head
PERFECT = KobukiTwinConfig(odometry="perfect")
FORWARD = Twist(0.2, 0.0)


class Logged:
    """A base that remembers by its counter when it made the last minutes' frames."""

    def __init__(self, device: TwinDevice) -> None:
        self._device = device
        self._made = [math.nan] * WRAP_MS  # s
        self._last_ms = 0
        self.wraps = 0  # of the counter

    def receive(self, data: bytes, now: float) -> bytes:
        return self._device.receive(data, now)

    def advance(self, now: float) -> bytes:
        frame = self._device.advance(now)
        if frame:
            raw_ms = int.from_bytes(frame[COUNTER], "little")
            self.wraps += raw_ms - self._last_ms == FRAME_MS - WRAP_MS
            self._made[raw_ms] = now
            self._last_ms = raw_ms
        return frame

    def next_due(self) -> float:
        return self._device.next_due()

    def made(self, raw_ms: int) -> float:
        """When the newest frame with this counter was made (s)."""
        return self._made[raw_ms]


class Robot:
    """A twin behind a link, and a driver that is opened again whenever it is lost."""

    def __init__(
        self, config: KobukiTwinConfig, twist: Twist, seed: int, drift_ppm: float = 0.0
    ) -> None:
        self.clock = LoopClock()
        self.twist = twist
        self.body = IdealBody()
        self.twin = KobukiTwin(config, self.body, seed)
        self.frames = Logged(OtherClock(self.twin, drift_ppm))
        self.wire = Wire(self.frames, config.link, seed)
        self.feedback = FeedbackReader("gyro", 0.0, KOBUKI)
        self.base = ReopeningBase(self.open, self.clock)
        self.heard: list[tuple[float, Odometry]] = []
        self.contacts: list[Contact] = []
        self.errors: list[float] = []  # of the stamps, s
        self.openings = 0

    @property
    def link(self) -> FaultyLink:
        return self.wire.link

    def inject(self, fault: str, seconds: float) -> None:
        """Let something befall the device or its link, for so long."""
        inject: Callable[..., None] = (
            self.link.inject if fault in ENDS_OF_LINK else self.twin.inject
        )
        inject(fault, seconds)

    def work(self) -> Work:
        return [self.wire.serve(self.clock), self.base.run(), self.follow(self.twist)]

    async def open(self) -> tuple[KobukiBase, Callable[[], None]]:
        stream = self.wire.opened()
        self.openings += 1
        return KobukiBase(stream, KobukiConfig(), self.clock, self.feedback), lambda: None

    async def follow(self, twist: Twist) -> None:
        while True:
            odometry = await self.base.next_odometry()
            self.heard.append((self.clock.now(), odometry))
            self.errors.append(odometry.stamp - self.made_newest())
            if self.base.contact is not None:
                self.contacts.append(self.base.contact)
            self.base.drive(twist)

    def made_newest(self) -> float:
        """When the frame was made that was read last (s)."""
        assert self.feedback._clock is not None
        return self.frames.made(self.feedback._clock.raw_ms)

    def heard_between(self, start: float, end: float) -> int:
        return sum(start <= at <= end for at, _ in self.heard)


def play(
    script: Callable[[Robot], Awaitable[None]],
    config: KobukiTwinConfig = PERFECT,
    twist: Twist = FORWARD,
    seed: int = 1,
) -> Robot:
    return play_rig(lambda: Robot(config, twist, seed), script)


def for_seconds(seconds: float) -> Callable[[Robot], Awaitable[None]]:
    async def script(robot: Robot) -> None:
        await robot.clock.sleep_until(seconds)

    return script
