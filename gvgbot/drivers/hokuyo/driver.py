"""A Hokuyo laser as the HAL's Laser: opens it, keeps it streaming, turns replies into scans."""

import asyncio
import contextlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import structlog

from gvgbot.clock import Clock, on_loop
from gvgbot.drivers.hokuyo import clock_sync
from gvgbot.drivers.hokuyo.clock_sync import ClockMap, Synchronisation
from gvgbot.drivers.hokuyo.config import HokuyoConfig
from gvgbot.drivers.hokuyo.dialogue import Arrival, Dialogue, Refusal, Silence
from gvgbot.drivers.hokuyo.models import Identity, Parameters
from gvgbot.drivers.hokuyo.modes import Mode, choose_mode, link_rate
from gvgbot.drivers.hokuyo.opening import ABNORMAL, DENIED, quiet, reboot, tune
from gvgbot.drivers.hokuyo.scan_geometry import (
    ScanGeometry,
    arrival_delay,
    one_per_step,
    scan_geometry,
)
from gvgbot.drivers.hokuyo.scip_codec import Values
from gvgbot.drivers.hokuyo.scip_messages import (
    ACCEPTED,
    BadReply,
    Message,
    Reply,
    ScanReply,
    ScanRequest,
)
from gvgbot.drivers.hokuyo.statistics import LinkStatistics
from gvgbot.drivers.hokuyo.time_mode import synchronise
from gvgbot.drivers.transport import ByteStream
from gvgbot.errors import DeviceLost, DeviceRefused
from gvgbot.hal.cover import Cover
from gvgbot.hal.latest import Latest
from gvgbot.hal.messages import Scan

__all__ = ["HokuyoConfig", "HokuyoLaser", "LinkStatistics"]

SHORTEST_SILENCE = 0.2  # s; links deliver in bursts
HUNG = 0.02  # s; so late, it was the host that did not listen, and not the laser that was silent
UNKNOWN_COMMAND = frozenset({"0C", "0D", "0E", "0F"})  # firmware generations disagree on which
UNSTABLE = "0M"  # in place of a scan: the motor is not at its speed
HALTED = range(21, 50)  # statuses of a laser that looks into a fault, and is silent until it knows
RESUMED = "98"  # what it says when there was none
BROKEN = range(50, 98)  # statuses of hardware trouble
OFF_AND_ON = "if that lasts, switch it off and on"
REMEDIES = {  # against a refusal, by its status
    UNSTABLE: f"its mirror does not turn as fast as it must; check its power, and {OFF_AND_ON}",
    DENIED: f"it is busy with something else; end other programs that use it, and {OFF_AND_ON}",
}
NO_SCANS, DAMAGED = "no scans", "damaged scans only"
FROZEN = "one scan over and over, by its stamp"
CHECK_CABLE = "try another cable or port, away from motors"
FEWEST_BEAMS = 100  # of a scan; with fewer the place is lost
FINER = "lower laser.cluster, or widen laser.first_angle_deg and laser.last_angle_deg"
FASTER = "raise robot.limits.max_scan_age_s, laser.rate_hz or laser.baud, or lower laser.skip"
SPINS_UP = 0.5  # s until a laser whose motor does not turn as it must is asked again
LONGEST_WITHOUT_SCAN = 5.0  # s, for a motor to reach its speed or a laser to check itself
MOST_DOUBLINGS = 3  # of that: a laser that needed longer must not be reset for ever
SIMPLER = {"NE": "ND", "ND": "MD", "ME": "MD"}  # what to ask for when a command is unknown

log = structlog.get_logger()


@dataclass(slots=True)
class _Stream:
    """A running stream of scans; `interval`, `delay`, `silence` and `patience` in s.

    It has stopped when nothing was heard for the silence, or no scan for the patience. Before the
    first scan only the patience counts.
    """

    request: ScanRequest
    geometry: ScanGeometry
    interval: float
    delay: float
    silence: float
    patience: float
    last_scan: float  # when it came, s; before the first one when the stream began
    until: float  # when it will have stopped if nothing more comes, s
    sync: Synchronisation | None = None
    clock_map: ClockMap | None = None
    is_fresh: bool = True  # no scan was handed on yet
    is_doubted: bool = False  # the first one fits no synchronisation
    instead: str = NO_SCANS  # what it has sent since it began
    is_excused: bool = False  # the host hung since the last scan

    def note_scan(self, now: float) -> None:
        """One more scan has come."""
        self.last_scan = now
        self.until = now + self.silence
        self.is_excused = False

    def note_hanging(self, now: float) -> None:
        """When nobody listened as it was to have stopped, what has come is read first."""
        if now > self.until + HUNG and not self.is_excused:
            self.until = now + self.silence
            self.is_excused = True

    def note_damage(self) -> None:
        """Something has come, but not whole."""
        if self.instead == NO_SCANS:
            self.instead = DAMAGED

    def note_status(self, status: str, now: float) -> None:
        """There is no scan, but the laser says why."""
        self.instead = f"status {status} in place of scans"
        limit = self.last_scan + self.patience
        if _is_in(status, HALTED):
            self.until = limit
        elif status in {UNSTABLE, RESUMED}:
            self.until = max(self.until, min(now + self.silence, limit))


def _is_in(status: str, statuses: range) -> bool:
    return status.isdecimal() and int(status) in statuses


class HokuyoLaser:
    """Serves one laser over one byte stream; after DeviceLost make a new one on a new stream."""

    def __init__(
        self,
        stream: ByteStream,
        config: HokuyoConfig,
        clock: Clock,
        link: LinkStatistics | None = None,
        longest_s: float = math.inf,
    ) -> None:
        """A lost driver's `link` counts on; by scans more than `longest_s` apart nobody drives."""
        self._config, self._longest_s = config, longest_s
        link = link or LinkStatistics()
        self._dialogue = Dialogue(stream, clock, config.reply_timeout_s, link)
        self._reboots_before = link.reboots
        self._clock_map: ClockMap | None = None
        self._scans: Latest[Scan] = Latest()
        self._cover = Cover()
        self._is_switched_on = False  # by a command of its own, since the stream was to start
        self._baud = config.baud
        self._identity: Identity | None = None
        self._parameters: Parameters | None = None
        self._mode: Mode | None = None
        self._status: Mapping[str, str] = {}
        self._intensities: Values | None = None

    @property
    def link(self) -> LinkStatistics:
        """What has happened on the link."""
        return self._dialogue.link

    @property
    def identity(self) -> Identity | None:
        """What the laser says it is; None until it is open."""
        return self._identity

    @property
    def parameters(self) -> Parameters | None:
        """The laser's geometry and timing; None until it is open."""
        return self._parameters

    @property
    def mode(self) -> Mode | None:
        """The scans that are asked for, and what was changed to fit the link; None until open."""
        return self._mode

    @property
    def clock_offset(self) -> float | None:
        """The host's clock minus the laser's at the newest scan (s); None before the first."""
        now = self._clock_map
        return None if now is None else now.host_stamp - now.stamp_ms / 1000.0

    @property
    def intensities(self) -> Values | None:
        """Those of the newest scan (N,), without unit, beam by beam; None if not asked for."""
        return self._intensities

    async def next_scan(self) -> Scan:
        """The newest scan not handed out before; waits for one."""
        return await self._scans.next()

    async def run(self) -> None:
        """Open the laser and stream until cancelled. Raises DeviceLost or DeviceRefused."""
        patience = self._config.opening_patience_s
        before: ClockMap | None = None
        try:
            self._baud = await tune(self._dialogue, self._baud, patience=patience)
            parameters = await self._open()
            while True:
                sync = await synchronise(self._dialogue) if self._config.synchronise else None
                stream = await self._start(parameters)
                stream.sync, stream.clock_map = sync, before
                await self._stream_until_silence(stream)
                before = stream.clock_map
                self.link.restarts += 1
                await quiet(self._dialogue, patience=self._dialogue.patience)
        except Refusal as refusal:
            remedy = REMEDIES.get(refusal.status, OFF_AND_ON)
            raise DeviceRefused(f"{refusal}: {remedy}") from refusal
        finally:
            with contextlib.suppress(DeviceLost):
                self._dialogue.send("QT")

    # -- opening -----------------------------------------------------------------------------------

    async def _open(self) -> Parameters:
        self._identity = Identity.from_lines((await self._dialogue.ask("VV")).fields)
        self._check_serial(self._identity.serial)
        try:
            self._parameters = Parameters.from_lines((await self._dialogue.ask("PP")).fields)
        except ValueError as error:
            raise DeviceRefused(f"the laser's PP reply makes no sense: {error}") from error
        with contextlib.suppress(Refusal, Silence):
            self._status = (await self._dialogue.ask("II")).fields
        self._mode = mode = self._choose(self._parameters)
        if mode.adapted is not None:
            log.warning("laser mode fitted to its link", change=mode.adapted)
        if mode.request.values < FEWEST_BEAMS:
            log.warning("too few beams to map by", beams=mode.request.values, remedy=FINER)
        every = round(self._parameters.period * (mode.request.skip + 1), 3)
        late = round(arrival_delay(self._config, self._parameters, mode.request) + mode.transfer, 3)
        if every + late > self._longest_s:
            log.warning("scans are too rare to drive by", every_s=every, late_s=late, remedy=FASTER)
        return self._parameters

    def _check_serial(self, serial: str) -> None:
        """Raises DeviceRefused if another laser is wanted: on USB they are alike but for this."""
        wanted = self._config.serial
        if wanted not in ("", serial):
            raise DeviceRefused(
                f"{self._config.port} is the laser {serial or 'without a serial number'}, not "
                f"{wanted}: set laser.port to the other one, or correct laser.serial"
            )

    def _choose(self, parameters: Parameters) -> Mode:
        port = self._config.port
        name = port if port.startswith("tcp:") else str(Path(port).resolve())
        baud = link_rate(self._config, self._baud, name, self._status.get("SBPS", ""))
        try:
            return choose_mode(self._config, parameters, baud)
        except ValueError as error:
            raise DeviceRefused(str(error)) from error

    async def _start(self, parameters: Parameters) -> _Stream:
        """Start the scans, simpler ones if the laser does not know those that were asked for."""
        assert self._mode is not None
        self._is_switched_on = False
        until = self._dialogue.clock.now() + self._config.opening_patience_s
        while True:
            request = self._mode.request
            try:
                await self._dialogue.ask(request.text())
            except Refusal as refusal:
                await self._give_way(refusal, request, until)
            else:
                return self._stream(request, parameters)

    async def _give_way(self, refusal: Refusal, request: ScanRequest, until: float) -> None:
        """Ask for less, reboot the laser, switch it on or wait until then (s) for its motor.

        Raises the refusal if nothing helps.
        """
        clock = self._dialogue.clock
        simpler = SIMPLER.get(request.command)
        if request.command == "NE" and self._config.intensities:
            simpler = "ME"  # whoever knows no NE knows no ND either
        if refusal.status == ABNORMAL and self.link.reboots == self._reboots_before:
            await reboot(self._dialogue)
            await quiet(self._dialogue, patience=self._config.opening_patience_s)
        elif refusal.status in UNKNOWN_COMMAND and simpler is not None:
            log.warning("laser has no such scans", command=request.command, instead=simpler)
            change = f"command {simpler} instead of {request.command}: the laser does not know it"
            self._mode = Mode(replace(request, command=simpler), change)
        elif refusal.status == DENIED and not self._is_switched_on:
            self._is_switched_on = True  # as a rule, asking for scans is enough
            with contextlib.suppress(Refusal):
                await self._dialogue.ask("BM")
        elif refusal.status == UNSTABLE and clock.now() < until:
            await clock.sleep_until(clock.now() + SPINS_UP)
        else:
            raise refusal

    def _stream(self, request: ScanRequest, parameters: Parameters) -> _Stream:
        config = self._config
        interval = parameters.period * (request.skip + 1)
        silence = max(SHORTEST_SILENCE, config.missed_scans * interval)
        longest = LONGEST_WITHOUT_SCAN * 2 ** min(self.link.fruitless, MOST_DOUBLINGS)
        patience = max(longest, config.reply_timeout_s + silence)
        now = self._dialogue.clock.now()
        return _Stream(
            request,
            scan_geometry(config, parameters, request),
            interval,
            arrival_delay(config, parameters, request),
            silence,
            patience,
            last_scan=now,
            until=now + patience,
        )

    # -- streaming ---------------------------------------------------------------------------------

    async def _stream_until_silence(self, stream: _Stream) -> None:
        """Hand on scans until they stop coming. Raises DeviceLost if not one came."""
        while stream.until > self._dialogue.clock.now():
            await self._listen(stream)
            stream.note_hanging(self._dialogue.clock.now())
        if stream.is_fresh:
            self.link.fruitless += 1
            self._dialogue.send("RS")
            remedy = CHECK_CABLE if stream.instead == DAMAGED else "switch it off and on"
            raise DeviceLost(f"the laser answers but sends {stream.instead}: {remedy}")

    async def _listen(self, stream: _Stream) -> None:
        """Hand on what comes; a timer for each scan would cost more than its checksums."""
        until = stream.until
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout_at(on_loop(self._dialogue.clock, until)):
                while stream.until >= until:
                    self._hand_on(await self._dialogue.receive(), stream)

    def _hand_on(self, arrivals: list[Arrival], stream: _Stream) -> None:
        for message, arrival in arrivals:
            scan = self._take(message, arrival, stream)
            if scan is not None:
                self._scans.put(scan)
                self.link.scans += 1
                self.link.fruitless = 0
                stream.note_scan(self._dialogue.clock.now())

    def _take(self, message: Message, arrival: float, stream: _Stream) -> Scan | None:
        match message:
            case ScanReply(request=stream.request):
                return self._timed_scan(message, arrival, stream)
            case Reply(echo, status) if echo == stream.request.text() and status != ACCEPTED:
                self._no_scan(status, stream)
            case BadReply():  # counted as it was heard
                stream.note_damage()
            case _:
                self.link.stray_messages += 1
        return None

    def _no_scan(self, status: str, stream: _Stream) -> None:
        """What a status in place of a scan means. Raises DeviceLost if there will be none."""
        self.link.refused_scans += 1
        if status == ABNORMAL or _is_in(status, BROKEN):
            trouble = f"the laser reports a fault of its own, status {status}"
            raise DeviceLost(f"{trouble}: {OFF_AND_ON}")
        stream.note_status(status, self._dialogue.clock.now())

    def _timed_scan(self, reply: ScanReply, arrival: float, stream: _Stream) -> Scan | None:
        before = stream.clock_map
        if before is not None and reply.stamp == before.stamp_ms:
            self.link.repeated_scans += 1
            stream.instead = FROZEN
            return None
        stream.clock_map = self._clock_map = now = self._follow(stream, reply.stamp, arrival)
        if before is not None:
            scans_later = round((now.host_stamp - before.host_stamp) / stream.interval)
            self.link.missed_scans += max(0, scans_later - 1)
        if stream.is_fresh and now.anchor is None and not stream.is_doubted:
            stream.is_doubted = True  # a frozen laser begins with an old scan; the next one decides
            return None
        stream.is_fresh = False
        assert self._parameters is not None
        ranges, intensities = one_per_step(reply, self._config.echo, self._parameters)
        if intensities is not None:
            self._intensities = intensities[::-1] if stream.geometry.is_reversed else intensities
        return self._cover.judge(stream.geometry.scan(ranges, now.host_stamp))

    def _follow(self, stream: _Stream, stamp_ms: int, arrival: float) -> ClockMap:
        """The laser's clock after this scan; a stream that was started again begins a new map.

        Nothing in a new stream is old, and the laser may have rebooted unnoticed in between.
        """
        before = stream.clock_map
        now = None if before is None else clock_sync.follow(before, stamp_ms, arrival)
        if before is not None and now is not None:
            self.link.clock_resets += now.resets - before.resets
        if now is None or stream.is_fresh:
            delay = stream.delay if before is None else before.known_delay
            now = clock_sync.start(stamp_ms, arrival, delay=delay, sync=stream.sync)
        return now
