"""TCP ports for twins of devices on Ethernet: one client at a time, who may come and go."""

import contextlib
import socket

from gvgbot.drivers.device_port import DevicePort
from gvgbot.drivers.tcp import parse_address, written_address
from gvgbot.errors import DeviceLost, UsageError


class TcpPort(DevicePort):
    """The device's end of TCP connections: as real lasers do, it hangs up on a second client."""

    def __init__(self, address: str) -> None:
        """Plugged in at tcp://host:number; 0 is any free number. Raises UsageError."""
        try:
            self._address = parse_address(address)
        except DeviceLost as error:
            raise UsageError(str(error)) from error
        self._listener: socket.socket | None = None
        super().__init__()

    @property
    def path(self) -> str | None:
        """What to open; None while unplugged."""
        return None if self._listener is None else written_address(*self._address)

    def write(self, data: bytes) -> None:
        """Send a message whole; without a client, or when it is too far behind, drop it."""
        if not data:
            return
        if self._line is None or self._rest:
            self.dropped += 1
        else:
            self._push(self._line, data)

    def close(self) -> None:
        """Unplug."""
        self._hang_up()
        if self._listener is not None:
            self._loop.remove_reader(self._listener)
            self._listener.close()
            self._listener = None

    def _open(self) -> None:
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
            if self._line is not None:
                client.close()
                return
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._serve(client.detach())

    def _on_error(self) -> None:
        """The client has left."""
        self._hang_up()
