"""TCP ports for twins of devices on Ethernet: one client at a time, who may come and go."""

import asyncio
import contextlib
import socket

from gvgbot.drivers.tcp import parse_address, written_address
from gvgbot.errors import DeviceLost, UsageError

_CHUNK = 65536  # bytes


class TcpPort:
    """The device's end of TCP connections: a stream that outlives its clients and unplugging.

    `path` is what clients open; None while unplugged. As real lasers do, it serves one client and
    hangs up on others. A message is written whole or dropped whole, and counted in `dropped`.
    """

    def __init__(self, address: str) -> None:
        """Plugged in at tcp://host:number; 0 is any free number. Raises UsageError."""
        try:
            self._address = parse_address(address)
        except DeviceLost as error:
            raise UsageError(str(error)) from error
        self.dropped = 0
        self._loop = asyncio.get_running_loop()
        self._listener: socket.socket | None = None
        self._client: socket.socket | None = None
        self._arrived = bytearray()
        self._readable = asyncio.Event()
        self._rest = b""  # of the message that the network has taken in part
        self.plug(True)

    @property
    def path(self) -> str | None:
        """What to open; None while unplugged."""
        return None if self._listener is None else written_address(*self._address)

    def plug(self, is_plugged: bool) -> None:
        """Plug in or unplug; the client of an unplugged port sees its connection end."""
        if is_plugged and self._listener is None:
            self._listen()
        elif not is_plugged:
            self.close()

    async def read(self) -> bytes:
        """What clients have sent, at least one byte; waits for it."""
        await self._readable.wait()
        data = bytes(self._arrived)
        self._arrived.clear()
        self._readable.clear()
        return data

    def write(self, data: bytes) -> None:
        """Send a message whole; without a client, or when it is too far behind, drop it."""
        if data and (self._client is None or self._rest):
            self.dropped += 1
        elif data:
            self._push(data)

    def close(self) -> None:
        """Unplug."""
        self._hang_up()
        if self._listener is not None:
            self._loop.remove_reader(self._listener)
            self._listener.close()
            self._listener = None

    def _listen(self) -> None:
        host, _ = self._address
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            self._listener = socket.create_server(self._address, family=family)
        except OSError as error:
            reason = str(error.strerror).partition(" (while")[0]  # what it was doing is clear
            address = written_address(*self._address)
            raise UsageError(
                f"{address}: {reason}: choose another address, or port 0 for any"
            ) from error
        self._listener.setblocking(False)
        self._address = host, self._listener.getsockname()[1]
        self._loop.add_reader(self._listener, self._accept)

    def _accept(self) -> None:
        assert self._listener is not None
        with contextlib.suppress(BlockingIOError):
            client, _ = self._listener.accept()
            if self._client is not None:
                client.close()
                return
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._client = client
            self._loop.add_reader(client, self._on_readable)

    def _on_readable(self) -> None:
        assert self._client is not None
        try:
            data = self._client.recv(_CHUNK)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._hang_up()
            return
        self._arrived += data
        self._readable.set()

    def _push(self, data: bytes) -> None:
        """Send what the network takes, and see to the rest when it takes more."""
        assert self._client is not None
        sent = 0
        try:
            sent = self._client.send(data)
        except BlockingIOError:
            pass
        except OSError:
            self._hang_up()
            return
        if not sent and not self._rest:
            self.dropped += 1
            return
        had_rest, self._rest = bool(self._rest), data[sent:]
        if self._rest and not had_rest:
            self._loop.add_writer(self._client, lambda: self._push(self._rest))
        elif had_rest and not self._rest:
            self._loop.remove_writer(self._client)

    def _hang_up(self) -> None:
        if self._client is not None:
            self._loop.remove_reader(self._client)
            self._loop.remove_writer(self._client)
            self._client.close()
            self._client, self._rest = None, b""
