"""Byte streams: a serial port, or an in-memory pipe, behind one small protocol."""

import asyncio
import contextlib
import errno
import fcntl
import math
import os
import sys
import termios
from array import array
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import serial

from gvgbot.clock import Clock, on_loop
from gvgbot.drivers.deadman import Deadman
from gvgbot.errors import DeviceLost

_TCGETS2 = 0x802C542A  # linux/termios.h: what termios has no word for, rates in bit/s
_TERMIOS2_SIZE = 44  # bytes, of which the last four are the rate of sending
_RATE_TOLERANCE = 0.03  # of a bit rate; 0.05 is half a bit at the last of the ten of a byte


class NoSerialPort(DeviceLost):
    """What was to be opened is something else: a file, say."""


class ByteStream(Protocol):
    """Bytes both ways."""

    async def read(self) -> bytes:
        """Whatever has arrived, at least one byte. Raises DeviceLost when the other end is gone."""

    def write(self, data: bytes) -> None:
        """Send without waiting. Raises DeviceLost when the other end is gone, or takes no more."""

    def close(self) -> None:
        """Give the link up; closing twice is harmless."""


class _PipeEnd:
    """One end of an in-memory stream."""

    def __init__(self) -> None:
        self._arrived = bytearray()
        self._readable = asyncio.Event()
        self._closed = False
        self.peer: _PipeEnd

    async def read(self) -> bytes:
        await self._readable.wait()
        if not self._arrived:
            raise DeviceLost("the link was closed")
        data = bytes(self._arrived)
        self._arrived.clear()
        if not self._closed:
            self._readable.clear()
        return data

    def write(self, data: bytes) -> None:
        if self._closed:
            raise DeviceLost("the link was closed")
        if data:
            self.peer.arrive(data)

    def arrive(self, data: bytes) -> None:
        """Take what the other end has written."""
        self._arrived += data
        self._readable.set()

    def close(self) -> None:
        self.hang_up()
        self.peer.hang_up()

    def hang_up(self) -> None:
        """Know that the link is closed."""
        self._closed = True
        self._readable.set()


def pipe() -> tuple[ByteStream, ByteStream]:
    """Two joined ends: what is written to one is read from the other."""
    here, there = _PipeEnd(), _PipeEnd()
    here.peer, there.peer = there, here
    return here, there


def open_port(path: str, baud: int) -> serial.Serial:
    """A serial port, raw and exclusive; waits for it.

    Raises DeviceLost when the port is absent or in use, NoSerialPort when it is none.
    """
    try:
        return serial.Serial(path, baud, timeout=0, write_timeout=0, exclusive=True)
    except (serial.SerialException, OSError, ValueError, termios.error) as error:
        lost = NoSerialPort if _number(error) == errno.ENOTTY else DeviceLost
        raise lost(f"cannot open {path}: {_obstacle(error)}") from error


async def open_serial(
    path: str, baud: int, opening: Callable[[str, int], serial.Serial] = open_port
) -> "SerialStream":
    """A stream on a port that may take its time to open. Raises DeviceLost."""
    return SerialStream(path, baud, await asyncio.to_thread(opening, path, baud))


class SerialStream:
    """A serial port, or a pseudo-terminal, read by the event loop without blocking it."""

    def __init__(self, path: str, baud: int, port: serial.Serial | None = None) -> None:
        """On an open `port`, or on one that is opened now. Raises DeviceLost if it cannot be."""
        self._port = port or open_port(path, baud)
        self._path = path
        self._fd = self._port.fileno()
        self._arrived = bytearray()
        self._readable = asyncio.Event()
        self._rest = b""  # of what the kernel has taken in part
        self._gone = self._is_closed = False
        self._deadman: Deadman | None = None
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(self._fd, self._on_readable)

    def _on_readable(self) -> None:
        try:
            data = os.read(self._fd, 65536)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self._arrived += data
        else:
            self._gone = True
            self._loop.remove_reader(self._fd)
        self._readable.set()

    async def read(self) -> bytes:
        """Whatever has arrived. Raises DeviceLost when the port is gone."""
        await self._readable.wait()
        if not self._arrived:
            raise DeviceLost(f"{self._path} is gone: plug it in again")
        data = bytes(self._arrived)
        self._arrived.clear()
        if not self._gone:
            self._readable.clear()
        return data

    def write(self, data: bytes) -> None:
        """Hand the bytes to the kernel. Raises DeviceLost when not all of them fit, or it is gone.

        Nothing is waited for; what has begun to go is finished before anything else goes.
        """
        before, sent = len(self._rest), 0
        try:
            sent = os.write(self._fd, self._rest + data)
        except BlockingIOError:
            pass
        except OSError as error:
            self._gone = True
            self._readable.set()
            raise DeviceLost(f"{self._path} is gone: plug it in again") from error
        if sent < before + len(data):
            self._rest = (self._rest + data if sent > before else self._rest)[sent:]
            raise DeviceLost(f"{self._path} takes no more bytes: switch the device off and on")
        self._rest = b""

    def watch_over(self, last_words: bytes, patience_s: float) -> None:
        """Write the last words while the event loop hangs for longer than that."""
        self._deadman = Deadman(self._fd, last_words, patience_s)

    def set_baud(self, baud: int) -> None:
        """Send and receive at this rate (bit/s) from now on. Raises DeviceLost."""
        try:
            self._port.baudrate = baud
        except (serial.SerialException, OSError, ValueError, termios.error) as error:
            if self._gone or not Path(self._path).exists():
                raise DeviceLost(f"{self._path} is gone: plug it in again") from error
            raise DeviceLost(f"{self._path} does not take {baud} bit/s") from error
        taken = _rate(self._fd)
        if taken is not None and abs(taken / baud - 1.0) > _RATE_TOLERANCE:
            raise DeviceLost(
                f"{self._path} takes {taken} bit/s instead of {baud}: set baud to a rate it has"
            )

    def close(self) -> None:
        """Release the port; one that has bytes still to send is closed when they are sent."""
        if self._is_closed:
            return
        self._gone = self._is_closed = True
        if self._deadman is not None:
            self._deadman.close()
        self._loop.remove_reader(self._fd)
        if _has_unsent(self._port):  # which the kernel may wait for
            self._loop.run_in_executor(None, _close, self._port)
        else:
            _close(self._port)


def _rate(fd: int) -> int | None:
    """The bit rate that a port really has (bit/s); None where the system does not tell.

    A driver takes the nearest rate that its chip has, and says so nowhere else.
    """
    if sys.platform != "linux":
        return None
    settings = array("I", bytes(_TERMIOS2_SIZE))
    try:
        fcntl.ioctl(fd, _TCGETS2, settings)
    except OSError:
        return None
    return settings[-1] or None


def _has_unsent(port: serial.Serial) -> bool:
    with contextlib.suppress(OSError, serial.SerialException):
        return bool(port.out_waiting)
    return False


def _close(port: serial.Serial) -> None:
    with contextlib.suppress(OSError, serial.SerialException):
        port.close()


def _obstacle(error: Exception) -> str:
    """Why a port does not open, in the words of the system, and what to do about it."""
    match _number(error):
        case None:
            return f"{error}: check its name"
        case errno.EAGAIN | errno.EBUSY:
            return "another program uses it: stop that one"
        case errno.EACCES:
            return "permission denied: join the group dialout"
        case errno.ENOENT | errno.ENODEV | errno.ENXIO:
            return "there is no such port: plug it in"
        case errno.EIO:
            return "it has just gone: plug it in again"
        case number:
            return f"{os.strerror(number)}: check its name"


def _number(error: Exception) -> int | None:
    """The system's number of an error; pyserial passes on that of a terminal as text only."""
    terminal = error if isinstance(error, termios.error) else error.__context__
    if isinstance(terminal, termios.error):
        return int(terminal.args[0])
    return getattr(error, "errno", None)


class TwinDevice(Protocol):
    """A simulated device without I/O: bytes in, bytes out, told the time (s)."""

    def receive(self, data: bytes, now: float) -> bytes:
        """Take bytes from the host; the bytes that answer them at once."""

    def advance(self, now: float) -> bytes:
        """The bytes that the device has sent by itself up to now."""

    def next_due(self) -> float:
        """When `advance` will next have something; inf if never."""


async def serve_twin(twin: TwinDevice, stream: ByteStream, clock: Clock) -> None:
    """Join a twin to a stream until cancelled or until the other end goes."""
    loop = asyncio.get_running_loop()
    wake = asyncio.Event()
    awaited = math.inf  # when `talk` will wake by itself

    async def listen() -> None:
        while True:
            data = await stream.read()
            stream.write(twin.receive(data, clock.now()))
            if twin.next_due() < awaited:
                wake.set()

    async def talk() -> None:
        nonlocal awaited
        while True:
            if twin.next_due() <= clock.now():
                stream.write(twin.advance(clock.now()))
            awaited = twin.next_due()
            if awaited <= clock.now():
                await asyncio.sleep(0)
                continue
            is_never = awaited == math.inf
            timer = None if is_never else loop.call_at(on_loop(clock, awaited), wake.set)
            await wake.wait()
            wake.clear()
            if timer is not None:
                timer.cancel()

    try:
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(listen())
            tasks.create_task(talk())
    except* DeviceLost:
        pass  # the other end has gone
