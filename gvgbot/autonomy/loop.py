"""The task around the pipeline: scans and odometry in, twists out, a stop on every way out."""

import asyncio
import contextlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from gvgbot.autonomy.control.reflexes import Felt
from gvgbot.autonomy.events import Event
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.errors import DeviceLost
from gvgbot.geometry import STANDSTILL, Twist
from gvgbot.hal.devices import Base, Laser
from gvgbot.hal.guard import Guard, GuardState, Reason
from gvgbot.hal.messages import Battery, Odometry, Scan

_LATEST_S = 0.1  # that odometry comes after a scan of its time; a slow link brings it 0.04 s late


@dataclass(frozen=True, slots=True)
class Cycle:
    """What a control cycle was given, what autonomy wished, and what the guard made of that."""

    odometry: Odometry
    felt: Felt
    wish: Twist
    permitted: Twist


class Log(Protocol):
    """Takes down what the pipeline is given, in that order."""

    def on_scan(self, scan: Scan) -> None:
        """A scan that is about to be looked at."""

    def on_cycle(self, cycle: Cycle, battery: Battery | None) -> None:
        """A control cycle, and the newest state of the battery."""


class Loop:
    """Perception per scan, control per odometry message, until the mission has an outcome.

    With `goes_on` that tells how long instead: the robot may be of use to somebody even then.
    `on_events` gets what happened after each scan, `on_cycle` the odometry of each control cycle.
    """

    def __init__(
        self,
        laser: Laser,
        base: Base,
        pipeline: Pipeline,
        guard: Guard,
        *,
        on_events: Callable[[list[Event]], None],
        on_cycle: Callable[[Odometry], None],
        log: Log | None = None,
        goes_on: Callable[[], bool] | None = None,
    ) -> None:
        self._laser, self._base, self._pipeline, self._guard = laser, base, pipeline, guard
        self._on_events, self._on_cycle, self._log = on_events, on_cycle, log
        self._goes_on = goes_on or (lambda: pipeline.mission.outcome is None)
        self._scan: Scan | None = None
        self._guard_state = GuardState()
        self._heard, self._hearing = -math.inf, asyncio.Event()  # the newest odometry's stamp, s
        self.stopped_for: Reason | None = None

    def guard_by(self, guard: Guard) -> None:
        """Use another guard from now on."""
        self._guard = guard

    async def run(self) -> None:
        """Drive until done; the base stands still when this returns or is cancelled."""
        try:
            async with asyncio.TaskGroup() as tasks:
                perceiving = tasks.create_task(self._perceive(), name="perceive")
                tasks.create_task(self._control(perceiving), name="control")
        finally:
            self._base.drive(STANDSTILL)

    async def _perceive(self) -> None:
        while self._goes_on():
            try:
                scan = await self._laser.next_scan()
            except DeviceLost:
                self._scan = None  # the guard stops now, not when the last scan is too old
                continue
            self._scan = scan
            await self._hear_until(scan.stamp)
            if self._log is not None:
                self._log.on_scan(scan)
            events = self._pipeline.perceive(scan)
            if events:
                self._on_events(events)

    async def _hear_until(self, stamp: float) -> None:
        """Wait for the odometry of a stamp (s), if it is still on its way."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_LATEST_S):
                while self._heard < stamp:
                    self._hearing.clear()
                    await self._hearing.wait()

    async def _control(self, perceiving: asyncio.Task[None]) -> None:
        while self._goes_on():
            odometry = await self._base.next_odometry()
            contact = self._base.contact
            felt = Felt(contact, self.stopped_for)
            wish = self._pipeline.control(odometry, felt)
            self._guard_state, twist, self.stopped_for = self._guard.permit(
                self._guard_state,
                wish,
                stamp=odometry.stamp,
                odometry=odometry,
                scan=self._scan,
                contact=contact,
            )
            self._base.drive(twist)
            self._heard = odometry.stamp
            self._hearing.set()
            if self._log is not None:
                self._log.on_cycle(Cycle(odometry, felt, wish, twist), self._base.battery)
            self._on_cycle(odometry)
        perceiving.cancel()
