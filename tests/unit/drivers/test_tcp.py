"""Addresses of devices on Ethernet, good and bad."""

import asyncio
import socket

import pytest

from gvgbot.drivers.tcp import TcpStream, parse_address, written_address
from gvgbot.errors import DeviceLost


@pytest.mark.parametrize(
    ("port", "host", "number"),
    [
        ("tcp://192.168.0.10:10940", "192.168.0.10", 10940),
        ("tcp://laser.local:80", "laser.local", 80),
        ("tcp://laser.local.:65535", "laser.local.", 65535),
        ("tcp://[fe80::1]:10940", "fe80::1", 10940),
    ],
)
def test_an_address_names_host_and_number(port: str, host: str, number: int) -> None:
    assert parse_address(port) == (host, number)
    assert written_address(host, number) == port


@pytest.mark.parametrize(
    "port",
    [
        "tcp://",
        "tcp://host",
        "tcp://host:",
        "/dev/x",
        "tcp://:1",
        "tcp://192.168.0..10:10940",
        f"tcp://{'a' * 70}:10940",
        "tcp://host:65536",
        f"tcp://host:{'9' * 5000}",
    ],
)
def test_what_is_no_address_says_how_one_looks(port: str) -> None:
    with pytest.raises(DeviceLost, match="10940"):
        parse_address(port)


def test_a_host_that_nobody_knows_is_said_to_be_unknown() -> None:
    async def unknown(*_: object, **__: object) -> None:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    async def main() -> None:
        asyncio.get_running_loop().getaddrinfo = unknown  # type: ignore[assignment]
        with pytest.raises(DeviceLost, match="tcp://lasr:10940: Name or service not known"):
            await TcpStream("tcp://lasr:10940").read()

    asyncio.run(main())
