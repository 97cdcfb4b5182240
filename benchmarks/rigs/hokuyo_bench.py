"""A laser driver and a simulated laser on the two ends of a link, in virtual time."""

import asyncio
import contextlib
import math
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass, field

import numpy as np

from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.drivers.hokuyo.driver import HokuyoConfig, HokuyoLaser
from gvgbot.drivers.hokuyo.scip import encode_reply
from gvgbot.drivers.hokuyo.scip_messages import Reply
from gvgbot.drivers.hokuyo.twin import HokuyoTwinConfig
from gvgbot.drivers.transport import ByteStream, TwinDevice, pipe, serve_twin
from gvgbot.errors import DeviceLost
from gvgbot.geometry import Array
from gvgbot.hal.messages import Scan

PERFECT = HokuyoTwinConfig(range_sigma_m=0.0, dropout_fraction=0.0)
QUANTISATION = 0.0005 + 1e-9  # m


@dataclass
class World:
    """Ranges that name their scan, and a record of when they were asked for."""

    beams: int = 1081
    stamps: list[float] = field(default_factory=list)

    def __call__(self, stamp: float, steps: int) -> Array:
        self.stamps.append(stamp)
        return self.ranges(len(self.stamps) - 1)

    def ranges(self, scan_number: int) -> Array:
        ranges = 1.0 + 0.01 * scan_number + np.linspace(0.0, 2.0, self.beams)
        ranges[::100] = math.inf
        return ranges


@dataclass
class Bench:
    """A driver and a twin on the two ends of a link."""

    laser: HokuyoLaser
    link: ByteStream
    served: asyncio.Task[None]
    running: asyncio.Task[None]
    clock: LoopClock

    async def scans(self, count: int) -> list[Scan]:
        return [await self.laser.next_scan() for _ in range(count)]


class Deaf:
    """A device that answers nothing."""

    def __init__(self) -> None:
        self.heard = b""

    def receive(self, data: bytes, now: float) -> bytes:
        self.heard += data
        return b""

    def advance(self, now: float) -> bytes:
        return b""

    def next_due(self) -> float:
        return math.inf


class SlowLink:
    """A twin whose scans take 30 ms to come over."""

    def __init__(self, twin: TwinDevice) -> None:
        self.twin = twin
        self.parts: list[tuple[float, bytes]] = []

    def receive(self, data: bytes, now: float) -> bytes:
        return self.twin.receive(data, now)

    def advance(self, now: float) -> bytes:
        frame = self.twin.advance(now)
        size = len(frame) // 3 + 1
        if frame:
            self.parts += [(now + 0.01 * i, frame[i * size : (i + 1) * size]) for i in range(4)]
        sent = b"".join(part for due, part in self.parts if due <= now)
        self.parts = [(due, part) for due, part in self.parts if due > now]
        return sent

    def next_due(self) -> float:
        return min(self.twin.next_due(), *(due for due, _ in self.parts), math.inf)


class FrozenClock:
    """A twin that after some scans sends the last one over and over."""

    def __init__(self, twin: TwinDevice, good_scans: int) -> None:
        self.twin = twin
        self.good_scans = good_scans
        self.last = b""

    def receive(self, data: bytes, now: float) -> bytes:
        return self.twin.receive(data, now)

    def advance(self, now: float) -> bytes:
        frame = self.twin.advance(now)
        if frame and self.good_scans > 0:
            self.good_scans -= 1
            self.last = frame
        return self.last if frame else b""

    def next_due(self) -> float:
        return self.twin.next_due()


class Scripted(Deaf):
    """A device that gives fixed replies to commands, and others to a twin."""

    def __init__(self, replies: dict[bytes, bytes], twin: TwinDevice) -> None:
        super().__init__()
        self.replies = replies
        self.twin = twin

    def receive(self, data: bytes, now: float) -> bytes:
        return b"".join(self.answer(command, now) for command in data.splitlines(keepends=True))

    def answer(self, command: bytes, now: float) -> bytes:
        scripted = self.replies.get(command)
        return self.twin.receive(command, now) if scripted is None else scripted

    def advance(self, now: float) -> bytes:
        return self.twin.advance(now)

    def next_due(self) -> float:
        return self.twin.next_due()


class Reports(Scripted):
    """A laser that for a while has a status in place of every scan; an empty one is silence.

    `since` and `until` (s) are counted from its last MD, or from the beginning of time. `resets`
    counts those that it was told to do.
    """

    def __init__(
        self, twin: TwinDevice, status: str, since: float, until: float, *, after_md: bool = False
    ) -> None:
        super().__init__({}, twin)
        self.status, self.since, self.until = status, since, until
        self.after_md = after_md
        self.began = 0.0
        self.echo = ""
        self.resets = 0

    def answer(self, command: bytes, now: float) -> bytes:
        self.resets += command == b"RS\n"
        if command.startswith(b"MD"):
            self.echo = command.decode().strip()
            self.began = now if self.after_md else 0.0
        return super().answer(command, now)

    def advance(self, now: float) -> bytes:
        frame = self.twin.advance(now)
        if not frame or not self.since <= now - self.began < self.until:
            return frame
        return encode_reply(Reply(self.echo, self.status)) if self.status else b""


class TiresOfTime(Scripted):
    """A laser that tells its time so often, and then no more; one that is `dying` says nothing."""

    def __init__(self, twin: TwinDevice, times: int, *, dying: bool = False) -> None:
        super().__init__({}, twin)
        self.times = times
        self.is_dying = dying

    def answer(self, command: bytes, now: float) -> bytes:
        is_question = command == b"TM1\n"
        self.times -= is_question
        is_mute = self.times < 0 and (is_question or self.is_dying)
        return b"" if is_mute else super().answer(command, now)


class CutsReply(Scripted):
    """A laser whose first reply to a command is cut in the middle of a line."""

    def __init__(self, twin: TwinDevice, command: bytes) -> None:
        super().__init__({}, twin)
        self.command = command
        self.cuts = 0

    def answer(self, command: bytes, now: float) -> bytes:
        reply = super().answer(command, now)
        if command != self.command or self.cuts:
            return reply
        self.cuts += 1
        return reply[: len(reply) - 5]


def on_bench(
    twin: TwinDevice,
    scenario: Callable[[Bench], Awaitable[None]],
    config: HokuyoConfig | None = None,
    first: Callable[[ByteStream, LoopClock], Awaitable[None]] | None = None,
    ahead: float = 0.0,
) -> None:
    """Run the scenario with the driver and the twin at work; `first` has the link before that.

    Their clock is `ahead` of the loop's, s.
    """

    async def main() -> None:
        here, there = pipe()
        clock = LoopClock(ahead)
        async with asyncio.TaskGroup() as tasks:
            served = tasks.create_task(serve_twin(twin, there, clock))
            if first is not None:
                await first(here, clock)
            laser = HokuyoLaser(here, config or HokuyoConfig(), clock)
            running = tasks.create_task(until_lost(laser))
            await scenario(Bench(laser, here, served, running, clock))
            running.cancel()
            served.cancel()

    run_in_virtual_time(main())


async def until_lost(laser: HokuyoLaser) -> None:
    with contextlib.suppress(DeviceLost):
        await laser.run()


def quantised(ranges: Array) -> Callable[[Array], bool]:
    return lambda measured: np.allclose(measured, ranges, rtol=0.0, atol=QUANTISATION)


def increments(values: Iterable[float]) -> Array:
    return np.diff(np.array(list(values)))
