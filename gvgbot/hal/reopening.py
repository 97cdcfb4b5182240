"""Devices that are opened again when they are lost, for a daemon that must not give up."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Generic, Protocol, TypeVar

import structlog

from gvgbot.clock import Clock
from gvgbot.errors import DeviceLost, DeviceRefused
from gvgbot.geometry import STANDSTILL, Twist
from gvgbot.hal.devices import Base, Laser
from gvgbot.hal.latest import Latest
from gvgbot.hal.messages import Battery, Contact, Odometry, Scan, Sign

RETRY = 0.5  # s between losing a device, or not finding it, and trying again

log = structlog.get_logger()


class _Device(Protocol):
    async def run(self) -> None: ...


D = TypeVar("D", bound=_Device)
Opened = tuple[D, Callable[[], None]]  # the device, and what gives its link up
Open = Callable[[], Awaitable[Opened[D]]]


class _Reopening(Generic[D]):
    """Opens a device, serves it until it is lost, waits a while, and so on until cancelled.

    `away` says why the device cannot be used just now; None when it can. `reconnects` counts how
    often it came back.
    """

    def __init__(self, name: str, open_device: Open[D], clock: Clock) -> None:
        """`open_device` raises DeviceLost when that is not possible."""
        self.away: str | None = "not there yet"
        self._name, self._open, self._clock = name, open_device, clock
        self._since: float | None = None  # when it was lost; None before it was ever there
        self.reconnects = 0
        self._device: D | None = None

    async def run(self) -> None:
        """Serve the device until cancelled, whatever happens to it."""
        while True:
            try:
                device, close = await self._open()
            except (DeviceLost, DeviceRefused) as failure:
                self._lost(str(failure))
            else:
                await self._serve(device, close)
            await self._clock.sleep_until(self._clock.now() + RETRY)

    async def _serve(self, device: D, close: Callable[[], None]) -> None:
        """Serve the device until it is lost.

        A loss does not leave the group, in which it could hide a cancellation of the same moment.
        """
        try:
            async with asyncio.TaskGroup() as tasks:
                self._device = device
                passing = tasks.create_task(self._pass_on(device), name=f"{self._name} values")
                try:
                    await device.run()
                except (DeviceLost, DeviceRefused) as failure:
                    self._lost(str(failure))
                    passing.cancel()
        finally:
            self._device = None  # a closed link must not be written to: its number may be reused
            close()

    async def _pass_on(self, device: D) -> None:
        raise NotImplementedError

    def _lost(self, reason: str) -> None:
        if reason != self.away:
            event = f"{self._name} lost" if self.away is None else f"waiting for the {self._name}"
            log.warning(event, reason=reason)
        if self.away is None:
            self._since = self._clock.now()
        self.away = reason

    def _heard(self) -> None:
        """Note that a value has come."""
        if self.away is None:
            return
        after = None if self._since is None else round(self._clock.now() - self._since, 1)
        log.info(f"{self._name} is there" if after is None else f"{self._name} back", after_s=after)
        self.reconnects += after is not None
        self.away = None


class ReopeningLaser(_Reopening[Laser]):
    """A laser that is lost only for a while.

    `on_scan` is given each scan as it comes, too, and must not take long.
    """

    def __init__(self, open_device: Open[Laser], clock: Clock) -> None:
        super().__init__("laser", open_device, clock)
        self.on_scan: Callable[[Scan], None] | None = None
        self._scans: Latest[Scan | DeviceLost] = Latest()

    async def next_scan(self) -> Scan:
        """The newest scan not handed out before; waits for one.

        Raises DeviceLost once for each time that the laser is lost; ask again to wait for it.
        """
        found = await self._scans.next()
        if isinstance(found, DeviceLost):
            raise found
        return found

    def _lost(self, reason: str) -> None:
        if self.away is None:
            self._scans.put(DeviceLost(reason))
        super()._lost(reason)

    async def _pass_on(self, device: Laser) -> None:
        while True:
            scan = await device.next_scan()
            self._scans.put(scan)
            self._heard()
            if self.on_scan is not None:
                self.on_scan(scan)


class ReopeningBase(_Reopening[Base]):
    """A base that is lost only for a while.

    What is opened again must go on with the odometry of what was lost: poses are passed on as they
    come.
    """

    def __init__(self, open_device: Open[Base], clock: Clock) -> None:
        super().__init__("base", open_device, clock)
        self._newest: Latest[Odometry] = Latest()

    async def next_odometry(self) -> Odometry:
        """The newest odometry not handed out before; waits for one."""
        return await self._newest.next()

    def drive(self, twist: Twist) -> Twist:
        """Send the twist now; what the base will really do."""
        return STANDSTILL if self._device is None else self._device.drive(twist)

    def show(self, sign: Sign) -> None:
        """Show people what the robot is about; one that comes back is to be told again."""
        if self._device is not None:
            self._device.show(sign)

    @property
    def contact(self) -> Contact | None:
        """The newest contact state, None before the first."""
        return None if self._device is None else self._device.contact

    @property
    def battery(self) -> Battery | None:
        """The newest battery state, None before the first."""
        return None if self._device is None else self._device.battery

    async def _pass_on(self, device: Base) -> None:
        while True:
            self._newest.put(await device.next_odometry())
            self._heard()
