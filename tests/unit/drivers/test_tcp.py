"""Addresses of devices on Ethernet, good and bad."""

import pytest

from gvgbot.drivers.tcp import parse_address
from gvgbot.errors import DeviceLost


@pytest.mark.parametrize(
    ("port", "host", "number"),
    [
        ("tcp://192.168.0.10:10940", "192.168.0.10", 10940),
        ("tcp://laser.local:80", "laser.local", 80),
        ("tcp://[fe80::1]:10940", "fe80::1", 10940),
    ],
)
def test_an_address_names_host_and_number(port: str, host: str, number: int) -> None:
    assert parse_address(port) == (host, number)


@pytest.mark.parametrize("port", ["tcp://", "tcp://host", "tcp://host:", "/dev/x", "tcp://:1"])
def test_what_is_no_address_says_how_one_looks(port: str) -> None:
    with pytest.raises(DeviceLost, match="10940"):
        parse_address(port)
