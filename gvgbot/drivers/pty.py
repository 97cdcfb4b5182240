"""Pseudo-terminals for twins: any program can open one like the serial port of a real device."""

import array
import asyncio
import contextlib
import fcntl
import os
import termios
import tty
from pathlib import Path

from gvgbot.errors import UsageError

_UNREAD_LIMIT = 4095  # bytes: what a terminal holds for its reader; more is hidden behind it


class PtyPort:
    """The device's end of a pseudo-terminal: a stream that outlives its clients and unplugging.

    `path` is what clients open: the link if there is one, else the terminal itself, None while
    unplugged. A message is written whole or dropped whole, and counted in `dropped`; a message that
    the kernel takes in part is finished before another begins. The terminal is raw before anybody
    can see it, and one descriptor of the clients' side stays open, so that a client that leaves
    takes neither the settings nor the terminal with it.
    """

    def __init__(self, link: Path | None = None) -> None:
        """Plugged in. Raises UsageError if something else is in the link's place."""
        self.dropped = 0
        self._link = link
        self._loop = asyncio.get_running_loop()
        self._device: int | None = None
        self._client = -1
        self._arrived = bytearray()
        self._readable = asyncio.Event()
        self._rest = b""  # of the message that the kernel has taken in part
        self.plug(True)

    @property
    def path(self) -> str | None:
        """What to open; None while unplugged."""
        if self._device is None:
            return None
        return os.ttyname(self._client) if self._link is None else str(self._link)

    def plug(self, is_plugged: bool) -> None:
        """Plug in or unplug; clients of an unplugged terminal see it hang up."""
        if is_plugged and self._device is None:
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

    def write(self, data: bytes) -> None:
        """Send a message whole, or drop it when its reader is too far behind."""
        if not data or self._device is None:
            return
        if self._rest or _unread(self._client) >= _UNREAD_LIMIT:
            self.dropped += 1
        else:
            self._push(data)

    def close(self) -> None:
        """Unplug: the link goes first, then the terminal."""
        if self._device is None:
            return
        if self._link is not None and self._points_here(self._link):
            self._link.unlink()
        self._loop.remove_reader(self._device)
        self._loop.remove_writer(self._device)
        os.close(self._device)
        os.close(self._client)
        self._device, self._rest = None, b""

    def _open(self) -> None:
        device, client = os.openpty()
        tty.setraw(client)
        os.set_blocking(device, False)
        self._device, self._client = device, client
        self._loop.add_reader(device, self._on_readable)
        if self._link is not None:
            try:
                _place_link(self._link, os.ttyname(client))
            except BaseException:
                self.close()
                raise

    def _on_readable(self) -> None:
        assert self._device is not None
        with contextlib.suppress(OSError):
            self._arrived += os.read(self._device, 65536)
        if self._arrived:
            self._readable.set()

    def _push(self, data: bytes) -> None:
        """Write what the kernel takes, and see to the rest when it takes more."""
        assert self._device is not None
        sent = 0
        with contextlib.suppress(OSError):
            sent = os.write(self._device, data)
        if not sent and not self._rest:
            self.dropped += 1
            return
        had_rest, self._rest = bool(self._rest), data[sent:]
        if self._rest and not had_rest:
            self._loop.add_writer(self._device, lambda: self._push(self._rest))
        elif had_rest and not self._rest:
            self._loop.remove_writer(self._device)

    def _points_here(self, link: Path) -> bool:
        with contextlib.suppress(OSError):
            return str(link.readlink()) == os.ttyname(self._client)
        return False


def _place_link(link: Path, target: str) -> None:
    """Make the link, over an old one if need be, never over anything else. Raises UsageError."""
    if not link.name:
        raise UsageError("a link without a name: give a path")
    if os.path.lexists(link) and not link.is_symlink():
        raise UsageError(f"{link}: exists and is no link: choose another name, or remove it")
    fresh = link.with_name(f".{link.name}.{os.getpid()}")
    try:
        fresh.symlink_to(target)
        fresh.replace(link)
    except OSError as error:
        with contextlib.suppress(OSError):
            fresh.unlink()
        raise UsageError(f"{link}: cannot make the link: {error.strerror}") from error


def _unread(client: int) -> int:
    """Bytes that wait in the terminal for a client to read them."""
    waiting = array.array("i", [0])
    with contextlib.suppress(OSError):
        fcntl.ioctl(client, termios.FIONREAD, waiting)
    return waiting[0]
