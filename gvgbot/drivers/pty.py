"""Pseudo-terminals for twins: any program can open one like the serial port of a real device."""

import array
import contextlib
import fcntl
import os
import termios
import tty
from pathlib import Path

from gvgbot.drivers.device_port import DevicePort
from gvgbot.errors import UsageError

_UNREAD_LIMIT = 4095  # bytes: what a terminal holds for its reader; more is hidden behind it


class PtyPort(DevicePort):
    """The device's end of a pseudo-terminal, on which errors are the clients' affair.

    The terminal is raw before anybody can see it, and one descriptor of the clients' side stays
    open, so that a client that leaves takes neither the settings nor the terminal with it.
    """

    def __init__(self, link: Path | None = None) -> None:
        """Plugged in. Raises UsageError if something else is in the link's place."""
        self._link = link
        self._client = -1
        super().__init__()

    @property
    def path(self) -> str | None:
        """The link if there is one, else the terminal itself; None while unplugged."""
        if self._line is None:
            return None
        return os.ttyname(self._client) if self._link is None else str(self._link)

    def write(self, data: bytes) -> None:
        """Send a message whole, or drop it when its reader is too far behind."""
        if not data or self._line is None:
            return
        if self._rest or _unread(self._client) >= _UNREAD_LIMIT:
            self.dropped += 1
        else:
            self._push(self._line, data)

    def close(self) -> None:
        """Unplug: the link goes first, then the terminal."""
        if self._line is None:
            return
        if self._link is not None and self._points_here(self._link):
            self._link.unlink()
        self._hang_up()
        os.close(self._client)

    def _open(self) -> None:
        device, self._client = os.openpty()
        tty.setraw(self._client)
        os.set_blocking(device, False)
        self._serve(device)
        if self._link is not None:
            try:
                _place_link(self._link, os.ttyname(self._client))
            except BaseException:
                self.close()
                raise

    def _on_error(self) -> None:
        """The terminal stays for the next client."""

    def _points_here(self, link: Path) -> bool:
        with contextlib.suppress(OSError):
            return str(link.readlink()) == os.ttyname(self._client)
        return False


def _place_link(link: Path, target: str) -> None:
    """Make the link, over an old one that leads nowhere, never over anything else.

    Raises UsageError.
    """
    if not link.name:
        raise UsageError("a link without a name: give a path")
    if os.path.lexists(link) and not link.is_symlink():
        raise UsageError(f"{link}: exists and is no link: choose another name, or remove it")
    if link.exists() and str(link.readlink()) != target:
        raise UsageError(
            f"{link}: leads to {link.readlink()}, a device that is there, perhaps of another twin: "
            "choose another name, or remove it"
        )
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
