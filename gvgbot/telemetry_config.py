"""Where the robot can be watched on the network, and by whom: the settings, and their addresses."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from gvgbot.ranges import Range
from gvgbot.requests import RequestName

LAST_PORT = 65535
_HAVE_PORTS = frozenset({"tcp", "udp", "tls", "quic", "ws"})
_PROTOCOLS = _HAVE_PORTS | {"unixsock-stream"}  # that zenoh's package has been built with


@dataclass(frozen=True, slots=True, kw_only=True)
class TelemetryConfig:
    """Where the robot can be watched; loopback only, unless the configuration opens it.

    `requests` names what it may be asked for; to permit all, list pause, resume, stop, home, goto,
    patrol, coverage, explore, relocalise, save and set.
    """

    enabled: bool = True  # false: nothing goes over the network
    requests: tuple[RequestName, ...] = ()  # what the robot may be asked for
    zenoh_file: Path | None = None  # JSON5: keys, passwords, access control; see configs/zenoh
    listen: tuple[str, ...] = ("tcp/127.0.0.1:7447",)  # addresses that others can reach it at
    connect: tuple[str, ...] = ()  # routers or robots of the team, joined again when they are back
    lease_s: Annotated[float, Range(0.5, 60.0)] = 2.0  # silence until the robot counts as gone
    scan_rate_hz: Annotated[float, Range(0.1, 40.0)] = 10.0  # at most; with nobody there, none

    def __post_init__(self) -> None:
        """Raises ValueError for addresses that cannot be listened on."""
        check_endpoints("listen", self.listen)
        check_endpoints("connect", self.connect)
        if self.enabled and not self.listen:
            raise ValueError("listen is empty: give an address, or set enabled: false")


def check_endpoints(key: str, endpoints: tuple[str, ...]) -> None:
    """Raises ValueError if one of a key's addresses cannot be one."""
    for endpoint in endpoints:
        if not is_endpoint(endpoint):
            raise ValueError(
                f"{key} = {endpoint!r}: must be protocol/host:port, such as tcp/0.0.0.0:7447"
            )


def is_endpoint(text: str) -> bool:
    """Whether the text is an address: a protocol that zenoh has/address, or protocol/host:port."""
    protocol, _, address = text.partition("/")
    if protocol not in _PROTOCOLS or not address.isprintable() or not address or "/" in address:
        return False
    host, _, port = re.split("[?#]", address)[0].rpartition(":")
    has_port = host != "" and re.fullmatch("[0-9]{1,5}", port) and int(port) <= LAST_PORT
    return protocol not in _HAVE_PORTS or bool(has_port)
