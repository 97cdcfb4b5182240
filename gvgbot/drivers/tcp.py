"""Byte streams over TCP, for devices on Ethernet: opened without waiting, lost like a cable."""

import asyncio
import contextlib
import errno
import os
import socket

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


class TcpStream:
    """A connection to a device. The first `read` makes it, or tells why it cannot be made."""

    def __init__(self, port: str) -> None:
        """`port` is tcp://host:number. Raises DeviceLost for anything else."""
        self._name = port
        self._host, self._number = parse_address(port)
        self._reader: asyncio.StreamReader | None = None
        self._writer: asyncio.StreamWriter | None = None
        self._unsent = bytearray()
        self._closed = False

    async def read(self) -> bytes:
        """Whatever has arrived. Raises DeviceLost when there is no connection any more."""
        reader = self._reader or await self._connect()
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
            raise DeviceLost(f"{self._name}: the connection is closed")
        if self._writer is None:
            self._unsent += data
            return
        if self._writer.is_closing() or _waiting(self._writer) > UNSENT_LIMIT:
            raise DeviceLost(f"{self._name} takes no more bytes")
        self._writer.write(data)

    def close(self) -> None:
        """End the connection; closing twice is harmless."""
        self._closed = True
        if self._writer is not None:
            with contextlib.suppress(OSError, RuntimeError):
                self._writer.close()

    async def _connect(self) -> asyncio.StreamReader:
        try:
            async with asyncio.timeout(CONNECT_TIMEOUT):
                self._reader, self._writer = await asyncio.open_connection(self._host, self._number)
        except (OSError, TimeoutError) as error:
            raise self._lost(error) from error
        connection = self._writer.get_extra_info("socket")
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        self._writer.write(bytes(self._unsent))
        self._unsent.clear()
        return self._reader

    def _lost(self, error: Exception) -> DeviceLost:
        number = getattr(error, "errno", None)
        if isinstance(error, TimeoutError) or number is None:
            return DeviceLost(f"{self._name} does not answer: check address, cable and power")
        return DeviceLost(f"{self._name}: {_reason(error, number)}")


def _reason(error: Exception, number: int) -> str:
    if isinstance(error, socket.gaierror):  # with numbers of its own
        return str(error.strerror)
    return "refuses the connection" if number == errno.ECONNREFUSED else os.strerror(number)


def _waiting(writer: asyncio.StreamWriter) -> int:
    """Bytes that the network has not taken yet."""
    return writer.transport.get_write_buffer_size()
