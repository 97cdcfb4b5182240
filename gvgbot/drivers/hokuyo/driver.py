"""A Hokuyo laser as the HAL's Laser: opens it, keeps it streaming, turns replies into scans."""

import asyncio
import contextlib
import math
from dataclasses import dataclass, field
from typing import Annotated

from gvgbot.clock import Clock
from gvgbot.drivers.hokuyo.clock_sync import ClockMap, follow
from gvgbot.drivers.hokuyo.models import Identity, Parameters, find_model
from gvgbot.drivers.hokuyo.scan_geometry import ScanGeometry
from gvgbot.drivers.hokuyo.scip import ScipParser, encode_command
from gvgbot.drivers.hokuyo.scip_messages import (
    ACCEPTED,
    BadReply,
    Message,
    Reply,
    ScanReply,
    ScanRequest,
)
from gvgbot.drivers.transport import ByteStream
from gvgbot.errors import DeviceLost, DeviceRefused
from gvgbot.geometry import Pose
from gvgbot.hal.latest import Latest
from gvgbot.hal.messages import Scan
from gvgbot.ranges import Range

QUIET_ATTEMPTS = 3  # a QT can be lost as a scan starts
ASK_ATTEMPTS = 2
SHORTEST_SILENCE = 0.2  # s; links deliver in bursts
SCIP_1_STATUS = "E"  # what a laser that still speaks SCIP 1.1 answers to QT


@dataclass(frozen=True, slots=True, kw_only=True)
class HokuyoConfig:
    """How the laser is connected, mounted and read."""

    port: str = "/dev/ttyACM0"
    baud: Annotated[int, Range(19200, 750000)] = 115200
    skip: Annotated[int, Range(0, 9)] = 3  # scans left out between two; 3 makes 40 Hz 10 Hz
    cluster: Annotated[int, Range(1, 99)] = 1  # steps per beam
    x_m: float = 0.0  # of the laser on the base
    y_m: float = 0.0
    yaw_deg: Annotated[float, Range(-180.0, 180.0)] = 0.0
    min_range_m: Annotated[float, Range(0.0, 10.0)] = 0.0  # the laser's own limit holds too
    max_range_m: Annotated[float, Range(0.5, 100.0)] = 30.0
    processing_latency_s: Annotated[float, Range(0.0, 0.1)] = 0.00475  # last beam to first byte
    reply_timeout_s: Annotated[float, Range(0.15, 10.0)] = 1.0
    missed_scans: Annotated[int, Range(1, 100)] = 3  # before the stream is started again

    @property
    def base_laser(self) -> Pose:
        """The laser on the base."""
        return Pose(self.x_m, self.y_m, math.radians(self.yaw_deg))


@dataclass(slots=True)
class LinkStatistics:
    """What happened on the link since the driver was made."""

    scans: int = 0
    bad_messages: int = 0  # damaged: dropped, the stream goes on
    stray_messages: int = 0  # whole, but not what was asked for
    repeated_scans: int = 0  # the same stamp again: the laser is frozen
    restarts: int = 0
    clock_resets: int = 0


def scan_geometry(
    config: HokuyoConfig, parameters: Parameters, request: ScanRequest
) -> ScanGeometry:
    """The geometry of the requested scans; models outside the catalogue get their own limits."""
    model = find_model(parameters.model)
    first_beam = request.start + (request.group - 1) / 2
    usable_mm = parameters.range_max_mm if model is None else model.usable_mm
    return ScanGeometry(
        base_laser=config.base_laser,
        angle_min=parameters.bearing(first_beam),
        angle_increment=request.group * parameters.step_angle,
        time_increment=request.group * parameters.step_time,
        first_beam_delay=first_beam * parameters.step_time,
        arrival_delay=request.end * parameters.step_time + config.processing_latency_s,
        shortest_mm=max(parameters.range_min_mm, round(config.min_range_m * 1000)),
        longest_mm=min(usable_mm, round(config.max_range_m * 1000)),
        nothing_code=None if model is None else model.nothing_code,
    )


@dataclass(slots=True)
class _Stream:
    """A running MD stream."""

    request: ScanRequest
    geometry: ScanGeometry
    silence: float
    clock_map: ClockMap | None = field(default=None)


class HokuyoLaser:
    """Serves one laser over one byte stream; after DeviceLost make a new one on a new stream."""

    def __init__(self, stream: ByteStream, config: HokuyoConfig, clock: Clock) -> None:
        self.link = LinkStatistics()
        self._wire = stream
        self._config = config
        self._clock = clock
        self._parser = ScipParser()
        self._began = 0.0
        self._scans: Latest[Scan] = Latest()
        self._identity: Identity | None = None
        self._parameters: Parameters | None = None

    @property
    def identity(self) -> Identity | None:
        """What the laser says it is; None until it is open."""
        return self._identity

    @property
    def parameters(self) -> Parameters | None:
        """The laser's geometry and timing; None until it is open."""
        return self._parameters

    async def next_scan(self) -> Scan:
        """The newest scan not handed out before; waits for one."""
        return await self._scans.next()

    async def run(self) -> None:
        """Open the laser and stream until cancelled. Raises DeviceLost or DeviceRefused."""
        try:
            await self._quiet()
            stream = self._prepare(await self._open())
            while True:
                await self._ask(stream.request.text())
                await self._stream_until_silence(stream)
                self.link.restarts += 1
                await self._quiet()
        finally:
            with contextlib.suppress(DeviceLost):
                self._send("QT")

    async def _quiet(self) -> None:
        """End whatever the laser was doing, and drop all that it had sent."""
        status = None
        for _ in range(QUIET_ATTEMPTS):
            self._wire.write(b"\n")  # completes, and so discards, a command cut in half
            self._send("TM2")
            self._send("QT")
            reply = await self._reply_to("QT")
            status = None if reply is None else reply.status
            if status == ACCEPTED:
                return
            if status == SCIP_1_STATUS:
                self._send("SCIP2.0")
        if status is None:
            raise DeviceLost("the laser does not answer: check its power and cable")
        raise DeviceRefused(f"the laser answers QT with status {status}: switch it off and on")

    async def _open(self) -> Parameters:
        self._identity = Identity.from_lines((await self._ask("VV")).fields)
        reply = await self._ask("PP")
        try:
            self._parameters = Parameters.from_lines(reply.fields)
        except ValueError as error:
            raise DeviceRefused(f"the laser's PP reply makes no sense: {error}") from error
        return self._parameters

    def _prepare(self, parameters: Parameters) -> _Stream:
        config = self._config
        request = ScanRequest(
            "MD", parameters.first_step, parameters.last_step, config.cluster, config.skip
        )
        interval = parameters.period * (config.skip + 1)
        return _Stream(
            request,
            scan_geometry(config, parameters, request),
            max(SHORTEST_SILENCE, config.missed_scans * interval),
        )

    async def _stream_until_silence(self, stream: _Stream) -> None:
        """Hand on scans until they stop coming. Raises DeviceLost if not one came."""
        if not await self._scan_within(self._config.reply_timeout_s + stream.silence, stream):
            raise DeviceLost("the laser answers but sends no scans: switch it off and on")
        while await self._scan_within(stream.silence, stream):
            pass

    async def _scan_within(self, seconds: float, stream: _Stream) -> bool:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while not self._hand_on(await self._receive(), stream):
                    pass
                return True
        return False

    def _hand_on(self, arrivals: list[tuple[Message, float]], stream: _Stream) -> bool:
        """Whether there was a scan among the messages."""
        scans = [self._take(message, arrival, stream) for message, arrival in arrivals]
        fresh = [scan for scan in scans if scan is not None]
        for scan in fresh:
            self._scans.put(scan)
        self.link.scans += len(fresh)
        return bool(fresh)

    def _take(self, message: Message, arrival: float, stream: _Stream) -> Scan | None:
        match message:
            case ScanReply(request=stream.request):
                return self._timed_scan(message, arrival, stream)
            case BadReply():
                self.link.bad_messages += 1
            case _:
                self.link.stray_messages += 1
        return None

    def _timed_scan(self, reply: ScanReply, arrival: float, stream: _Stream) -> Scan | None:
        before = stream.clock_map
        if before is not None and reply.stamp == before.stamp_ms:
            self.link.repeated_scans += 1
            return None
        stream.clock_map = follow(before, reply.stamp, arrival)
        self.link.clock_resets = stream.clock_map.resets
        return stream.geometry.scan(reply.ranges, stream.clock_map.host_stamp)

    async def _ask(self, command: str) -> Reply:
        """The reply to a command. Raises DeviceLost or DeviceRefused."""
        for _ in range(ASK_ATTEMPTS):
            self._send(command)
            reply = await self._reply_to(command)
            if reply is None:
                continue
            if reply.status != ACCEPTED:
                raise DeviceRefused(f"the laser answers {command} with status {reply.status}")
            return reply
        raise DeviceLost(f"the laser does not answer {command}")

    async def _reply_to(self, command: str) -> Reply | None:
        """The next reply that echoes the command; None when none comes in time."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(self._config.reply_timeout_s):
                while True:
                    for message, _ in await self._receive():
                        if isinstance(message, Reply) and message.echo == command:
                            return message
        return None

    async def _receive(self) -> list[tuple[Message, float]]:
        """The messages that the next bytes complete, and when each one's first byte arrived (s)."""
        continues = self._parser.pending > 0
        data = await self._wire.read()
        now = self._clock.now()
        first_began = self._began if continues else now
        messages = self._parser.feed(data)
        self._began = now if messages else first_began
        return [(message, now if i else first_began) for i, message in enumerate(messages)]

    def _send(self, command: str) -> None:
        self._wire.write(encode_command(command))
