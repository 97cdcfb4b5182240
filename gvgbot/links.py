"""Drivers on the links of a configuration: serial ports, or the twins of a simulation."""

import asyncio
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from gvgbot.clock import Clock
from gvgbot.config import Config
from gvgbot.drivers.hokuyo.driver import HokuyoLaser, LinkStatistics
from gvgbot.drivers.kobuki.driver import STANDSTILL_FRAME, KobukiBase
from gvgbot.drivers.kobuki.feedback import FeedbackReader
from gvgbot.drivers.tapped import Tap, TappedStream
from gvgbot.drivers.tcp import SCHEME, TcpStream, open_tcp
from gvgbot.drivers.transport import ByteStream, NoSerialPort, SerialStream, open_serial
from gvgbot.errors import DeviceLost
from gvgbot.hal.reopening import ReopeningBase, ReopeningLaser
from gvgbot.simulation import Simulation
from gvgbot.topics import LinkHealth

Close = Callable[[], None]


class Links:
    """Opens devices, as often as they are lost; without a simulation they are real.

    The odometry of a base that is opened again goes on from where it ended.
    """

    def __init__(
        self,
        config: Config,
        clock: Clock,
        simulation: Simulation | None,
        tap: Tap | None = None,
    ) -> None:
        if simulation is not None and config.twin.base.odometry == "wheels":
            config = replace(config, base=replace(config.base, heading="wheels"))
        self.config, self.clock, self.simulation = config, clock, simulation
        self._tap = tap
        self._laser_link = LinkStatistics()
        self._laser: HokuyoLaser | None = None
        self.feedback = FeedbackReader(
            config.base.heading, config.base.link_delay_s, config.base.geometry
        )

    async def open_laser(self) -> tuple[HokuyoLaser, Close]:
        """A laser to be run, and what closes its link. Raises DeviceLost."""
        config, longest_s = self.config.laser, self.config.robot.limits.max_scan_age_s
        stream: ByteStream
        if self.simulation is None:
            stream, close = await _open_port("laser", config.port, config.baud)
        else:
            stream, close = self.simulation.laser, _leave_open
        stream = self._tapped("laser", stream)
        self._laser = HokuyoLaser(stream, config, self.clock, self._laser_link, longest_s)
        return self._laser, close

    async def open_base(self) -> tuple[KobukiBase, Close]:
        """A base to be run, and what closes its link. Raises DeviceLost."""
        config = self.config.base
        stream: ByteStream
        if self.simulation is None:
            port, close = await _open_port("base", config.port, config.baud)
            port.watch_over(STANDSTILL_FRAME, config.deadman_s)
            stream = port
        else:
            stream, close = self.simulation.base, _leave_open
        stream = self._tapped("base", stream)
        return KobukiBase(stream, config, self.clock, self.feedback), close

    def _tapped(self, link: str, stream: ByteStream) -> ByteStream:
        if self._tap is None:
            return stream
        heard, said = (partial(self._tap, link, said=said) for said in (False, True))
        return TappedStream(stream, heard, said)

    def laser_health(self, *, connected: bool, reconnects: int) -> LinkHealth:
        """What has come from the laser."""
        link = self._laser_link
        return LinkHealth(
            connected=connected,
            messages=link.scans,
            damaged=link.bad_messages,
            lost=link.missed_scans,
            reconnects=reconnects,
            clock_offset=None if self._laser is None else self._laser.clock_offset,
        )

    def base_health(self, *, connected: bool, reconnects: int) -> LinkHealth:
        """What has come from the base."""
        statistics = self.feedback.statistics
        return LinkHealth(
            connected=connected,
            messages=statistics.frames,
            damaged=statistics.bad_frames + statistics.malformed,
            lost=statistics.missed_frames,
            reconnects=reconnects,
            clock_offset=self.feedback.clock_offset,
        )


class Devices:
    """The laser and the base on their links, opened again for as long as they are lost."""

    def __init__(self, links: Links) -> None:
        self._links = links
        self.laser = ReopeningLaser(links.open_laser, links.clock)
        self.base = ReopeningBase(links.open_base, links.clock)

    async def run(self) -> None:
        """Serve them, and the twins at the other ends, until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self.laser.run(), name="laser")
            tasks.create_task(self.base.run(), name="base")
            if self._links.simulation is not None:
                tasks.create_task(self._links.simulation.run(), name="twins")

    @property
    def away(self) -> str | None:
        """Which devices are missing, and why; None if they are all there."""
        devices = {"base": self.base.away, "laser": self.laser.away}
        return "; ".join(f"no {name}: {why}" for name, why in devices.items() if why) or None

    @property
    def laser_health(self) -> LinkHealth:
        """What has come over the laser's link."""
        is_there, reconnects = self.laser.away is None, self.laser.reconnects
        return self._links.laser_health(connected=is_there, reconnects=reconnects)

    @property
    def base_health(self) -> LinkHealth:
        """What has come over the base's link."""
        is_there, reconnects = self.base.away is None, self.base.reconnects
        return self._links.base_health(connected=is_there, reconnects=reconnects)

    @property
    def slips(self) -> int:
        """How often gyro and wheels began to disagree."""
        return self._links.feedback.statistics.slips


async def _open_port(name: str, port: str, baud: int) -> tuple[SerialStream | TcpStream, Close]:
    is_tcp = port.startswith(SCHEME)
    stream: SerialStream | TcpStream
    try:
        stream = await open_tcp(port) if is_tcp else await open_serial(port, baud)
    except NoSerialPort as error:
        raise DeviceLost(f"{port} is no serial port: set {name}.port") from error
    except DeviceLost as error:
        is_path = port.startswith("/")
        form = "" if is_tcp or is_path else f" (on Ethernet it is {SCHEME}host:number)"
        raise DeviceLost(f"{error}, or set {name}.port{form}") from error
    return stream, stream.close


def _leave_open() -> None:
    """The twin stays at the other end."""
