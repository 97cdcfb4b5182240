"""Byte streams over TCP, for devices on Ethernet: opened without waiting, lost like a cable."""

import asyncio
import contextlib
import errno
import ipaddress
import os
import socket
import threading
from concurrent.futures import Future

from gvgbot.drivers.deadman import Deadman
from gvgbot.errors import DeviceLost

SCHEME = "tcp://"
CONNECT_TIMEOUT = 3.0  # s
UNSENT_LIMIT = 65536  # bytes; a device that takes no more than this is gone
_LAST_PORT = 65535


def parse_address(port: str) -> tuple[str, int]:
    """Host and port number of `tcp://host:number`. Raises DeviceLost when it is none."""
    host, colon, number = port.removeprefix(SCHEME).rpartition(":")
    if not port.startswith(SCHEME) or not colon or not _is_host(host) or not _is_number(number):
        raise DeviceLost(f"{port} is no address: write {SCHEME}host:10940")
    return host.strip("[]"), int(number)


def written_address(host: str, number: int) -> str:
    """What `parse_address` reads as this."""
    return f"{SCHEME}[{host}]:{number}" if ":" in host else f"{SCHEME}{host}:{number}"


def _is_host(name: str) -> bool:
    """Whether one can ask for a host of this name: no part of it may be empty, or too long."""
    try:
        return bool(name.encode("idna"))
    except UnicodeError:
        return False


def _is_number(digits: str) -> bool:
    """Whether it is the number of a port."""
    return digits.isdecimal() and len(digits) <= len(str(_LAST_PORT)) and int(digits) <= _LAST_PORT


async def open_tcp(port: str) -> "TcpStream":
    """A stream on a connection that may take its time to be made. Raises DeviceLost."""
    stream = TcpStream(port)
    try:
        await stream.connect()
    except BaseException:
        stream.close()
        raise
    return stream


class TcpStream:
    """A connection to a device. `connect` or the first `read` makes it, or tells why it cannot."""

    def __init__(self, port: str) -> None:
        """`port` is tcp://host:number. Raises DeviceLost for anything else."""
        self._name = port
        self._host, self._number = parse_address(port)
        self._connecting: asyncio.Task[asyncio.StreamReader] | None = None
        self._writer: asyncio.StreamWriter | None = None
        self._unsent = bytearray()
        self._closed = False
        self._watch = contextlib.ExitStack()

    async def connect(self) -> asyncio.StreamReader:
        """Wait for the connection, which is made on when nobody waits. Raises DeviceLost."""
        if self._closed:
            raise self._end()
        if self._connecting is None:
            self._connecting = asyncio.get_running_loop().create_task(self._connect())
            self._connecting.add_done_callback(_heed)
        if not self._connecting.done():
            await asyncio.wait([self._connecting])
        if self._connecting.cancelled():
            raise self._end()
        return self._connecting.result()

    async def read(self) -> bytes:
        """Whatever has arrived. Raises DeviceLost when there is no connection any more."""
        reader = await self.connect()
        try:
            data = await reader.read(65536)
        except OSError as error:
            raise self._lost(error) from error
        if not data or self._closed:
            raise DeviceLost(f"{self._name} closed the connection")
        return data

    def write(self, data: bytes) -> None:
        """Send without waiting. Raises DeviceLost when there is no connection any more."""
        if self._closed:
            raise self._end()
        if self._writer is None:
            self._unsent += data
            return
        if self._writer.is_closing() or _waiting(self._writer) > UNSENT_LIMIT:
            raise DeviceLost(f"{self._name} takes no more bytes")
        self._writer.write(data)

    def watch_over(self, last_words: bytes, patience_s: float) -> None:
        """Write the last words while the event loop hangs for longer than that.

        Raises DeviceLost if the connection has ended by now. If it ends later, the number of its
        file may be another's, so this has one of its own.
        """
        assert self._writer is not None, "nothing is said without a connection"
        try:
            fd = os.dup(self._writer.get_extra_info("socket").fileno())
        except OSError as error:
            self.close()
            raise DeviceLost(f"{self._name} closed the connection") from error
        self._watch.callback(os.close, fd)
        self._watch.callback(Deadman(fd, last_words, patience_s).close)

    def close(self) -> None:
        """End the connection; closing twice is harmless."""
        self._closed = True
        self._watch.close()
        if self._connecting is not None:
            self._connecting.cancel()
        if self._writer is not None:
            with contextlib.suppress(OSError, RuntimeError):
                self._writer.close()

    async def _connect(self) -> asyncio.StreamReader:
        try:
            addresses = await _addresses(self._host)
            async with asyncio.timeout(CONNECT_TIMEOUT):
                reader, self._writer = await _connected(addresses, self._number)
        except (OSError, TimeoutError) as error:
            raise self._lost(error) from error
        connection = self._writer.get_extra_info("socket")
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        self._writer.write(bytes(self._unsent))
        self._unsent.clear()
        return reader

    def _lost(self, error: OSError) -> DeviceLost:
        return DeviceLost(f"{self._name} {_reason(error)}: check address, cable and power")

    def _end(self) -> DeviceLost:
        return DeviceLost(f"{self._name}: the connection is closed")


async def _addresses(host: str) -> list[str]:
    """The addresses of a host, in numbers, the best one first. Raises OSError if none is found.

    A name server that is silent takes half a minute, and would hold up whatever else waits for a
    thread of the event loop's.
    """
    with contextlib.suppress(ValueError):
        return [str(ipaddress.ip_address(host))]
    found: Future[list[str]] = Future()
    found.set_running_or_notify_cancel()

    def look_up() -> None:
        try:
            found.set_result(_look_up(host))
        except OSError as error:
            found.set_exception(error)

    threading.Thread(target=look_up, name="lookup", daemon=True).start()  # noqa: TID251  # see above
    return await asyncio.wrap_future(found)


def _look_up(host: str) -> list[str]:
    found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    numbers = socket.NI_NUMERICHOST | socket.NI_NUMERICSERV
    return [socket.getnameinfo(address, numbers)[0] for *_, address in found]


async def _connected(
    addresses: list[str], number: int
) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    """The first connection that one of the addresses takes. Raises OSError if none does."""
    for address in addresses[:-1]:
        with contextlib.suppress(OSError):
            return await asyncio.open_connection(address, number)
    return await asyncio.open_connection(addresses[-1], number)


def _reason(error: OSError) -> str:
    if isinstance(error, socket.gaierror):  # with numbers of its own
        return f"is not found: {error.strerror}"
    if error.errno == errno.ECONNREFUSED:
        return "refuses the connection"
    if isinstance(error, TimeoutError) or error.errno is None:
        return "does not answer"
    return f"fails: {os.strerror(error.errno)}"


def _heed(connecting: asyncio.Task[asyncio.StreamReader]) -> None:
    """Take note of the end, of which a later reader is told, if there is one."""
    if not connecting.cancelled():
        connecting.exception()


def _waiting(writer: asyncio.StreamWriter) -> int:
    """Bytes that the network has not taken yet."""
    return writer.transport.get_write_buffer_size()
