"""A recording on the network at the pace of life, as if the robot were driving just now."""

import asyncio
import contextlib
import os
import sys
from dataclasses import replace
from itertools import chain, islice
from pathlib import Path

import structlog

from gvgbot.clock import Clock, LoopClock, OffLoop
from gvgbot.hal.messages import Battery, Contact, Scan
from gvgbot.hal.reopening import ReopeningBase
from gvgbot.links import Devices, Links
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.recording import Lived
from gvgbot.replay import Log, Wanted, open_log
from gvgbot.robot import Network, Robot
from gvgbot.service import Notifier, set_up_logging
from gvgbot.session import Session
from gvgbot.stop_signals import StopSignals
from gvgbot.telemetry import Telemetry

_BEAT = 0.1  # s of the recording's time, between signs of life when it is over

log = structlog.get_logger()


def serve(wanted: Wanted, *, out: Path | None, speed: float) -> int:
    """Play a log until a signal ends it; the exit status. The run directory is written meanwhile.

    Raises UsageError for a log or directory that cannot be used, ConfigError, and GvgbotError if
    the network address is taken or the map cannot be written.
    """
    set_up_logging(sys.stderr, os.environ)
    played = open_log(wanted)
    telemetry = replace(played.config.telemetry, enabled=True, requests=())
    config = replace(played.config, telemetry=telemetry)
    with contextlib.ExitStack() as stack:
        signals = stack.enter_context(StopSignals())
        network = stack.enter_context(Telemetry(telemetry, config.robot.name))
        directory = stack.enter_context(RunDirectory.create(out, world=played.title))
        session = Session(config, directory, place=None, led=played.led)
        session.title = played.title
        log.info("playing", robot=config.robot.name, network=network.addresses)
        try:
            with asyncio.Runner() as runner:
                runner.run(PlayedRobot(session, network, played, speed).serve(signals.wait()))
        finally:
            session.save()
            log.info("map saved", path=str(directory.path))
    return 0


class PlayedClock:
    """The time of a recording while it is played."""

    def __init__(self, clock: Clock, start: float, speed: float) -> None:
        """It is `start` now."""
        self._clock, self._began, self._start, self._speed = clock, clock.now(), start, speed

    def now(self) -> float:
        """Seconds, as the recorded robot had them."""
        return self._start + (self._clock.now() - self._began) * self._speed

    async def sleep_until(self, stamp: float) -> None:
        """Return at the stamp, or at once if it has passed."""
        await self._clock.sleep_until(self._began + (stamp - self._start) / self._speed)


class PlayedRobot(Robot):
    """A robot that lives through a recording; neither devices nor guard have a part in it."""

    def __init__(
        self,
        session: Session,
        network: Network | None,
        played: Log,
        speed: float,
        off_loop: OffLoop = asyncio.to_thread,
    ) -> None:
        survey = session.pipeline.mission.survey
        super().__init__(session, Notifier(None), network, off_loop)
        # done at once: after the last scan none asks again
        session.pipeline.mission.survey = survey
        self._played, self._speed = played, speed

    def _prepare(self, links: Links) -> None:
        first = list(islice(self._played.messages, 1))
        self._messages = chain(first, self._played.messages)
        start = first[0][0] if first else 0.0
        self._clock = PlayedClock(LoopClock(), start, self._speed)
        super()._prepare(links)
        self._steering.declines = "this is a recording: it can only be watched"
        self._base = _PlayedBase(links.open_base, self._clock)
        self._devices = _PlayedDevices(links, self._base)

    async def _explore(self) -> None:
        """Live through the recording to its end, and stand there."""
        for at, message in self._messages:
            await self._clock.sleep_until(at)
            self._live_through(message)
        self._saving.finish()
        log.info("the recording is over")
        while self._odometry is not None:
            await self._clock.sleep_until(self._clock.now() + _BEAT)
            self._note(replace(self._odometry, stamp=self._clock.now()))

    def _live_through(self, message: Lived) -> None:
        match message:
            case Battery():
                self._base.charge = message
            case Scan():
                self._show_scan(message)
                self._on_events(self._pipeline.perceive(message))
            case _:
                self._base.felt = message.felt.contact
                self._loop.stopped_for = message.felt.stopped_for
                self._pipeline.control(message.odometry, message.felt)
                self._on_cycle(message.odometry)


class _PlayedBase(ReopeningBase):
    """A base that feels what it is told."""

    felt: Contact | None = None
    charge: Battery | None = None

    @property
    def contact(self) -> Contact | None:
        return self.felt

    @property
    def battery(self) -> Battery | None:
        return self.charge


class _PlayedDevices(Devices):
    """Devices that are there, and do nothing."""

    def __init__(self, links: Links, base: ReopeningBase) -> None:
        super().__init__(links)
        self.base, self.base.away, self.laser.away = base, None, None

    async def run(self) -> None:
        await asyncio.Event().wait()
