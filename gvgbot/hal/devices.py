"""What autonomy may ask of hardware. A class that has the methods is a laser or a base."""

from typing import Protocol

from gvgbot.geometry import Twist
from gvgbot.hal.messages import Battery, Contact, Odometry, Scan, Sign


class Laser(Protocol):
    """A planar laser scanner."""

    async def run(self) -> None:
        """Serve the link until cancelled. Raises DeviceLost or DeviceRefused."""

    async def next_scan(self) -> Scan:
        """The newest scan not handed out before; waits for one.

        May raise DeviceLost at the moment when the laser is lost, and be asked again.
        """


class Base(Protocol):
    """A differential-drive base."""

    async def run(self) -> None:
        """Serve the link until cancelled. Raises DeviceLost or DeviceRefused."""

    async def next_odometry(self) -> Odometry:
        """The newest odometry not handed out before; waits for one."""

    def drive(self, twist: Twist) -> Twist:
        """Send the twist now and return what the base will really do.

        It writes without waiting, so that a stop gets out while every task is being cancelled.
        """

    def show(self, sign: Sign) -> None:
        """Show people what the robot is about, as far as the base can, without waiting.

        A sign that is shown already costs nothing: say it as often as you like.
        """

    @property
    def contact(self) -> Contact | None:
        """The newest contact state, None before the first."""

    @property
    def battery(self) -> Battery | None:
        """The newest battery state, None before the first."""
