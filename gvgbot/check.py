"""`gvgbot check`: opens the devices, listens for a while, and gives a verdict on each point.

The robot is told to stand, and nothing else.
"""

import asyncio
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from typing import Literal

import numpy as np

from gvgbot.clock import Clock, LoopClock, VirtualTimeLoop
from gvgbot.config import Config
from gvgbot.drivers.hokuyo.driver import HokuyoLaser
from gvgbot.drivers.kobuki.driver import KobukiBase
from gvgbot.errors import DeviceLost, DeviceRefused
from gvgbot.hal.messages import Battery, Contact, Scan
from gvgbot.links import Links
from gvgbot.simulation import Simulation, open_place

PATIENCE = 10.0  # s for a device's first message; a laser that has just been switched on takes some
LISTEN = 3.0  # s of messages that are judged
RATE_TOLERANCE = 0.05
LOW_BATTERY, EMPTY_BATTERY = 14.0, 13.2  # V
CALM_JITTER = 0.008  # s; more is a link that hands out bytes late
BASE_RATE = 50.0  # Hz
MALFORMED = ("bad_frames", "bad_messages", "malformed", "missed_frames", "repeated_scans")
STREAM_COUNTS = ("frames", "scans")

Verdict = Literal["ok", "warn", "fail"]


@dataclass(frozen=True, slots=True)
class Line:
    """One point of the report; `remedy` says what to do unless it is ok."""

    verdict: Verdict
    subject: str
    finding: str
    remedy: str = ""

    def __str__(self) -> str:
        remedy = f"\n{'':22}-> {self.remedy}" if self.remedy and self.verdict != "ok" else ""
        return f"{self.verdict:4}  {self.subject:14}  {self.finding}{remedy}"


@dataclass(slots=True)
class Heard:
    """When messages were true and when they came, s; `failure` is why there were no more."""

    stamps: list[float] = field(default_factory=list)
    arrivals: list[float] = field(default_factory=list)
    failure: str | None = None

    def note(self, stamp: float, now: float) -> None:
        """Take down a message."""
        self.stamps.append(stamp)
        self.arrivals.append(now)

    @property
    def rate(self) -> float:
        """Messages per second of the device's time; 0 for less than two."""
        if len(self.stamps) < 2:
            return 0.0
        return (len(self.stamps) - 1) / (self.stamps[-1] - self.stamps[0])

    @property
    def delays(self) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
        """From being true to being here (N,), s."""
        return np.array(self.arrivals) - np.array(self.stamps)


def check(config: Config, say: Callable[[str], None]) -> int:
    """Look at the devices of a configuration, say a line on each point; 1 if any point fails.

    Twins are looked at in virtual time. Raises WorldError for a world that cannot be used.
    """
    lines = [Line("ok", "configuration", _devices(config))]
    with asyncio.Runner(loop_factory=VirtualTimeLoop if config.twin.enabled else None) as runner:
        lines += runner.run(_examine(config))
    for line in lines:
        say(str(line))
    failures = sum(line.verdict == "fail" for line in lines)
    say("all is well" if not failures else f"{failures} of {len(lines)} points failed")
    return min(failures, 1)


def _devices(config: Config) -> str:
    if config.twin.enabled:
        return f"robot {config.robot.name}, on twins in the world {config.twin.world}"
    return f"robot {config.robot.name}, laser {config.laser.port}, base {config.base.port}"


async def _examine(config: Config) -> list[Line]:
    clock = LoopClock()
    simulation = Simulation(config, open_place(config), clock) if config.twin.enabled else None
    links = Links(config, clock, simulation)
    laser, base = asyncio.Task[list[Line]], asyncio.Task[list[Line]]
    async with asyncio.TaskGroup() as tasks:
        twins = None if simulation is None else tasks.create_task(simulation.run())
        laser = tasks.create_task(_examine_laser(links, clock))
        base = tasks.create_task(_examine_base(links, clock))
        lines = await laser + await base
        if twins is not None:
            twins.cancel()
    return lines


async def _examine_laser(links: Links, clock: Clock) -> list[Line]:
    try:
        laser, close = links.open_laser()
    except DeviceLost as error:
        return [_absent("laser", str(error))]
    assert isinstance(laser, HokuyoLaser)
    scans: list[Scan] = []

    async def listen() -> float:
        scans.append(await laser.next_scan())
        return scans[-1].stamp

    heard = await _listen(laser.run, listen, clock)
    close()
    return list(_laser_lines(laser, scans, heard))


async def _examine_base(links: Links, clock: Clock) -> list[Line]:
    try:
        base, close = links.open_base()
    except DeviceLost as error:
        return [_absent("base", str(error))]
    assert isinstance(base, KobukiBase)

    async def listen() -> float:
        return (await base.next_odometry()).stamp

    heard = await _listen(base.run, listen, clock)
    close()
    return list(_base_lines(base, heard))


def _absent(name: str, reason: str) -> Line:
    return Line("fail", name, reason, f"check cable and power, and {name}.port")
