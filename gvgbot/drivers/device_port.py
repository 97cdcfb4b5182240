"""The device's end of a link that other programs open, whatever kind of port it is."""

import asyncio
import os
from abc import ABC, abstractmethod

_CHUNK = 65536  # bytes


class DevicePort(ABC):
    """A stream that outlives its clients and unplugging.

    A message is written whole or dropped whole, and counted in `dropped`; one that the system
    takes in part is finished before another begins.
    """

    def __init__(self) -> None:
        """Plugged in, with all that `_open` needs there."""
        self.dropped = 0
        self._loop = asyncio.get_running_loop()
        self._line: int | None = None  # the descriptor on which clients are heard and talked to
        self._arrived = bytearray()
        self._readable = asyncio.Event()
        self._rest = b""  # of the message that the system has taken in part
        self.plug(True)

    @property
    @abstractmethod
    def path(self) -> str | None:
        """What clients open; None while unplugged."""

    def plug(self, is_plugged: bool) -> None:
        """Plug in or unplug; clients see an unplugged port hang up."""
        if is_plugged and self.path is None:
            self._open()
        elif not is_plugged:
            self.close()

    async def read(self) -> bytes:
        """What clients have written, at least one byte; waits for it."""
        await self._readable.wait()
        data = bytes(self._arrived)
        self._arrived.clear()
        self._readable.clear()
        return data

    @abstractmethod
    def write(self, data: bytes) -> None:
        """Send a message whole, or drop it."""

    @abstractmethod
    def close(self) -> None:
        """Unplug."""

    @abstractmethod
    def _open(self) -> None: ...

    @abstractmethod
    def _on_error(self) -> None: ...

    def _serve(self, line: int) -> None:
        """Hear clients on this descriptor, which does not block."""
        self._line = line
        self._loop.add_reader(line, self._on_readable, line)

    def _hang_up(self) -> None:
        if self._line is not None:
            self._loop.remove_reader(self._line)
            self._loop.remove_writer(self._line)
            os.close(self._line)
            self._line, self._rest = None, b""

    def _on_readable(self, line: int) -> None:
        try:
            data = os.read(line, _CHUNK)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self._arrived += data
            self._readable.set()
        else:
            self._on_error()

    def _push(self, line: int, data: bytes) -> None:
        """Write what the system takes, and see to the rest when it takes more."""
        sent = 0
        try:
            sent = os.write(line, data)
        except BlockingIOError:
            pass
        except OSError:
            self._on_error()
            if self._line is None:
                return
        if not sent and not self._rest:
            self.dropped += 1
            return
        had_rest, self._rest = bool(self._rest), data[sent:]
        if self._rest and not had_rest:
            self._loop.add_writer(line, lambda: self._push(line, self._rest))
        elif had_rest and not self._rest:
            self._loop.remove_writer(line)
