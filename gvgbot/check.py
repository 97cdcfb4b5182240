"""`gvgbot check`: opens the devices, listens for a while, and gives a verdict on each point.

The robot is told to stand, and nothing else.
"""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Coroutine, Iterator
from dataclasses import asdict, astuple, dataclass, field
from typing import Any, Literal

import numpy as np

from gvgbot.clock import Clock, LoopClock, VirtualTimeLoop
from gvgbot.config import Config, RobotConfig
from gvgbot.drivers.hokuyo.driver import FEWEST_BEAMS, FINER, HokuyoLaser
from gvgbot.drivers.kobuki.driver import KobukiBase
from gvgbot.errors import DeviceLost, DeviceRefused, GvgbotError, underlying
from gvgbot.hal.guard import GuardConfig
from gvgbot.hal.messages import EMPTY_BATTERY, LOW_BATTERY, Battery, Contact, Scan
from gvgbot.hal.own_parts import how_to_clear, own_ranges
from gvgbot.links import Links
from gvgbot.simulation import Simulation, open_place
from gvgbot.words import counted

_PATIENCE = 10.0  # s for a device's first message
_LISTEN = 3.0  # s of messages that are judged
_SETTLE = 1.0  # s at the start that rates are not judged by
_RATE_TOLERANCE = 0.05
_CALM = 0.008  # s: a link that varies by more hands out its bytes late
_BASE_RATE = 50.0  # Hz
_MESSAGE_COUNTS = ("frames", "scans")
_OF_NEWER_FIRMWARE = "unknown_parts"  # checksums were right
_SEEN_SHARE = 0.2  # of the beams; a laser that sees less is covered or dirty
_UNCOVER = "uncover and clean its window"
_UNCOVER_OR_MOVE = f"{_UNCOVER}, or put the robot where there are walls"
_BUSY = "see what else the computer is busy with"
_LATENCY_TIMER = f"set the port's latency_timer to 1, as systemd/60-gvgbot.rules does, and {_BUSY}"

Verdict = Literal["ok", "warn", "fail"]


@dataclass(frozen=True, slots=True)
class Line:
    """One point of the report; `remedy` says what to do unless it is ok."""

    verdict: Verdict
    subject: str
    finding: str
    remedy: str = ""

    def __str__(self) -> str:
        line = f"{self.verdict:5} {self.subject:14} {self.finding}"
        return line if self.verdict == "ok" or not self.remedy else f"{line}: {self.remedy}"


@dataclass(slots=True)
class Heard:
    """What came: when it was true, when it arrived (s), and how many had come by then.

    `failure` says why nothing more came.
    """

    stamps: list[float] = field(default_factory=list)
    arrivals: list[float] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)
    failure: str | None = None

    @property
    def rate(self) -> float:
        """Messages per second, 0 if there were too few to tell."""
        if len(self.arrivals) < 2:
            return 0.0
        return (self.counts[-1] - self.counts[0]) / (self.arrivals[-1] - self.arrivals[0])

    @property
    def delay(self) -> tuple[float, float]:
        """From being true to being here: least and 95th percentile, s."""
        delays = np.subtract(self.arrivals, self.stamps)
        return float(delays.min()), float(np.percentile(delays, 95))


def check(config: Config, say: Callable[[str], None]) -> int:
    """Look at the devices of a configuration, say a line on each point; 0, the exit status.

    Twins are looked at in virtual time. Raises GvgbotError if any point fails, WorldError for a
    world that cannot be used.
    """
    say(str(Line("ok", "configuration", _summary(config))))
    with asyncio.Runner(loop_factory=VirtualTimeLoop if config.twin.enabled else None) as runner:
        lines = runner.run(_examine_all(config))
    for line in lines:
        say(str(line))
    say(_conclusion([line.verdict for line in lines]))
    return 0


def _conclusion(verdicts: list[Verdict]) -> str:
    failed, doubtful = verdicts.count("fail"), verdicts.count("warn")
    if failed:
        raise GvgbotError(f"{failed} of {len(verdicts)} points failed")
    return f"ready to drive, {doubtful} to look at" if doubtful else "ready to drive"


def _summary(config: Config) -> str:
    if config.twin.enabled:
        return f"robot {config.robot.name}, twins in the world {config.twin.world}"
    return f"robot {config.robot.name}, laser {config.laser.port}, base {config.base.port}"


async def _examine_all(config: Config) -> list[Line]:
    place = open_place(config) if config.twin.enabled else None
    return await examine(config, None if place is None else Simulation(config, place, LoopClock()))


async def examine(config: Config, simulation: Simulation | None) -> list[Line]:
    """The verdicts on the laser and the base of a simulation, or on the real ones."""
    clock = LoopClock()
    links = Links(config, clock, simulation)
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
        laser, close = await links.open_laser()
    except DeviceLost as error:
        return [Line("fail", "laser", str(error))]
    scans: list[Scan] = []

    async def next_stamp() -> float:
        scans.append(await laser.next_scan())
        return scans[-1].stamp

    with contextlib.ExitStack() as stack:
        stack.callback(close)
        heard = await _listen(laser.run, next_stamp, lambda: laser.link.scans, clock)
    return list(_laser_lines(laser, scans, heard, links.config.robot))


async def _examine_base(links: Links, clock: Clock) -> list[Line]:
    try:
        base, close = await links.open_base()
    except DeviceLost as error:
        return [Line("fail", "base", str(error))]

    async def next_stamp() -> float:
        return (await base.next_odometry()).stamp

    with contextlib.ExitStack() as stack:
        stack.callback(close)
        heard = await _listen(base.run, next_stamp, lambda: base.statistics.frames, clock)
    return list(_base_lines(base, heard))


async def _listen(
    run: Callable[[], Coroutine[Any, Any, None]],
    next_stamp: Callable[[], Awaitable[float]],
    count: Callable[[], int],
    clock: Clock,
) -> Heard:
    """Serve a device until it has been heard for long enough, or fails."""
    heard = Heard()

    async def listen() -> None:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_PATIENCE):
                await next_stamp()
            await clock.sleep_until(clock.now() + _SETTLE)
            async with asyncio.timeout(_LISTEN):
                await next_stamp()  # came while nobody listened
                while True:
                    heard.stamps.append(await next_stamp())
                    heard.arrivals.append(clock.now())
                    heard.counts.append(count())

    try:
        async with asyncio.TaskGroup() as tasks:
            serving = tasks.create_task(run())
            await listen()
            serving.cancel()
    except* (DeviceLost, DeviceRefused) as failures:
        heard.failure = str(underlying(failures))
    return heard


def _laser_lines(
    laser: HokuyoLaser, scans: list[Scan], heard: Heard, robot: RobotConfig
) -> Iterator[Line]:
    limits = robot.limits
    identity = laser.identity
    if identity is not None:
        yield Line("ok", "laser", f"{identity.product}, serial {identity.serial or 'not told'}")
        firmware = ", ".join(filter(None, (identity.firmware, identity.protocol)))
        yield Line("ok", "laser firmware", firmware or "not told")
    parameters, mode = laser.parameters, laser.mode
    if heard.failure is not None and laser.link.reboots:
        finding = "was in an abnormal state, for which it has been started anew"
        yield Line("fail", "laser", finding, "check once more in a few seconds")
        return
    if heard.failure is not None or not heard.arrivals or parameters is None or mode is None:
        yield _absence("laser", heard, "sends no scans")
        return
    interval = parameters.period * (mode.request.skip + 1)
    if interval + heard.delay[1] > limits.max_scan_age_s:
        yield _rareness(heard, limits)
    else:
        yield _steadiness("laser rate", heard, 1.0 / interval)
    yield _link("laser link", laser.link)
    yield _timing("laser clock", heard, f"{_BUSY}, and the network if it is on Ethernet")
    yield _view(scans)
    yield from _own_parts(scans, robot.radius_m)
    if len(scans[-1].ranges) < FEWEST_BEAMS:
        yield Line("warn", "laser beams", f"they are fewer than {FEWEST_BEAMS}", FINER)
    if not scans[-1].looks_ahead:
        yield Line(
            "fail",
            "laser mount",
            "it does not see where the robot drives",
            "say how it is mounted by laser.yaw_deg, or widen laser.first_angle_deg and "
            "laser.last_angle_deg",
        )


def _base_lines(base: KobukiBase, heard: Heard) -> Iterator[Line]:
    identity = base.identity
    if heard.failure is not None or not heard.arrivals:
        yield _absence("base", heard, "sends no odometry")
        return
    names = ("hardware", "firmware", "UDID")
    told = zip(names, astuple(identity), strict=True)
    answered = ", ".join(f"{name} {text}" for name, text in told if text is not None)
    yield Line(
        "ok" if answered else "warn",
        "base",
        answered or "does not answer what it is",
        "check the wire from the computer to it",
    )
    yield _steadiness("base rate", heard, _BASE_RATE)
    yield _link("base link", base.statistics)
    yield _timing("base clock", heard, _LATENCY_TIMER)
    if base.battery is not None:
        yield _battery(base.battery)
    if base.contact is not None:
        yield _contact(base.contact)


def _absence(device: str, heard: Heard, silence: str) -> Line:
    """That there is nothing to judge; a failure brings its own remedy."""
    if heard.failure is not None:
        return Line("fail", device, heard.failure)
    remedy = f"check that {device}.port is its port, then switch it off and on"
    return Line("fail", device, silence, remedy)


def _view(scans: list[Scan]) -> Line:
    """Whether something covers the laser."""
    beams = f"{len(scans[-1].ranges)} beams"
    trusted = float(np.mean([np.mean(~np.isnan(scan.ranges)) for scan in scans]))
    if trusted < _SEEN_SHARE:
        return Line("fail", "laser view", f"{beams}, {trusted:.0%} of them of use", _UNCOVER)
    if not any(np.isfinite(scan.ranges).any() for scan in scans):
        return Line("warn", "laser view", f"{beams}, nothing within range", _UNCOVER_OR_MOVE)
    return Line("ok", "laser view", f"{beams}, {trusted:.0%} of them of use")


def _own_parts(scans: list[Scan], radius: float) -> Iterator[Line]:
    """What the laser sees within the robot's radius (m), again and again: parts of the robot."""
    own = own_ranges(scans, radius)
    if len(own):
        yield Line(
            "warn",
            "laser view",
            f"{len(own)} beams end within the robot, {own.min():.2f} to {own.max():.2f} m away",
            how_to_clear(own),
        )


def _steadiness(subject: str, heard: Heard, nominal: float) -> Line:
    is_right = abs(heard.rate / nominal - 1.0) <= _RATE_TOLERANCE
    return Line(
        "ok" if is_right else "fail",
        subject,
        f"{heard.rate:.1f} of {nominal:.3g} messages per second",
        "check the cable, and what else the computer is busy with",
    )


def _rareness(heard: Heard, limits: GuardConfig) -> Line:
    """That the newest scan is too old to drive by before the next one comes."""
    return Line(
        "fail",
        "laser rate",
        f"{heard.rate:.1f} messages per second, and the robot stops when the last one is older "
        f"than {limits.max_scan_age_s:g} s (robot.limits.max_scan_age_s)",
        "raise laser.rate_hz or laser.baud, or lower laser.skip",
    )


def _link(subject: str, statistics: Any) -> Line:
    counts = {key: value for key, value in asdict(statistics).items() if isinstance(value, int)}
    good = sum(counts.pop(key, 0) for key in _MESSAGE_COUNTS)
    odd = {key: value for key, value in counts.items() if value}
    told = ", ".join(_counted(value, key.replace("_", " ")) for key, value in odd.items())
    return Line(
        "warn" if odd.keys() - {_OF_NEWER_FIRMWARE} else "ok",
        subject,
        f"{counted(good, 'message')}, {told or 'no damage'}",
        "try another cable or port, away from motors",
    )


def _counted(count: int, what: str) -> str:
    """A number and what there is of it, by its name for many, or for any number."""
    one = what if what.endswith("ss") else what.removesuffix("s")
    return counted(count, one, what)


def _timing(subject: str, heard: Heard, remedy: str) -> Line:
    least, most = heard.delay
    return Line(
        "ok" if most - least <= _CALM else "warn",
        subject,
        f"messages arrive {1000 * least:.1f} to {1000 * most:.1f} ms after they were true",
        remedy,
    )


def _battery(battery: Battery) -> Line:
    finding = f"{battery.voltage:.1f} V, {battery.fraction:.0%}"
    finding += ", charging" if battery.charging else ""
    empty, low = battery.fraction < EMPTY_BATTERY, battery.fraction < LOW_BATTERY
    verdict: Verdict = "fail" if empty else "warn" if low else "ok"
    return Line(verdict, "battery", finding, "charge it")


def _contact(contact: Contact) -> Line:
    felt = {
        "bumper": contact.bumper,
        "cliff": contact.cliff,
        "wheel drop": contact.wheel_drop,
        "over-current": contact.over_current,
        "charger cable": contact.charger_cable,
    }
    pressed = ", ".join(name for name, is_felt in felt.items() if is_felt)
    remedy = "put the robot on a flat floor, away from walls and stairs and off the charger's cable"
    return Line("warn" if pressed else "ok", "contact", pressed or "none", remedy)
