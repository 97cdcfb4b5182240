"""An in-memory link between twin and driver whose cable can be pulled and plugged in again."""

import asyncio
import contextlib

from gvgbot.drivers.transport import ByteStream, pipe
from gvgbot.errors import DeviceLost


class Cable:
    """Two joined streams. Unplugged, `host` raises DeviceLost, while `device` waits and drops."""

    def __init__(self) -> None:
        self.host: ByteStream = _HostEnd(self)
        self.device: ByteStream = _DeviceEnd(self)
        self._plugged = asyncio.Event()
        self._ends = pipe()
        self._plugged.set()

    def plug(self, is_plugged: bool) -> None:
        """Plug in or unplug; what was under way is lost."""
        if is_plugged == self._plugged.is_set():
            return
        if is_plugged:
            self._ends = pipe()
            self._plugged.set()
        else:
            self._plugged.clear()
            self._ends[0].close()

    @property
    def ends(self) -> tuple[ByteStream, ByteStream]:
        """The host's and the device's end of the wire as it is now."""
        return self._ends

    async def plugged(self) -> None:
        """Wait until the cable is plugged in."""
        await self._plugged.wait()


class _HostEnd:
    def __init__(self, cable: Cable) -> None:
        self._cable = cable

    async def read(self) -> bytes:
        return await self._cable.ends[0].read()

    def write(self, data: bytes) -> None:
        self._cable.ends[0].write(data)

    def close(self) -> None:
        """The device stays at the other end."""


class _DeviceEnd:
    def __init__(self, cable: Cable) -> None:
        self._cable = cable

    async def read(self) -> bytes:
        while True:
            await self._cable.plugged()
            with contextlib.suppress(DeviceLost):
                return await self._cable.ends[1].read()

    def write(self, data: bytes) -> None:
        with contextlib.suppress(DeviceLost):
            self._cable.ends[1].write(data)

    def close(self) -> None:
        self._cable.ends[1].close()
