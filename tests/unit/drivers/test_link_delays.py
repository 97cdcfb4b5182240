"""What a slow or late link does to the bytes of a device, each way by itself."""

import math
from collections.abc import Callable

import pytest

from gvgbot.drivers.link_faults import FaultyLink, LinkFaultConfig

MESSAGE = bytes(81)  # as long as a frame of the base


class Device:
    """Sends a message of its own every 20 ms, answers at once, and remembers what it heard."""

    def __init__(self, messages: float = math.inf, size: int = len(MESSAGE)) -> None:
        self.heard: list[tuple[float, bytes]] = []
        self.sent = 0
        self.messages = messages
        self.size = size

    def receive(self, data: bytes, now: float) -> bytes:
        self.heard.append((now, data))
        return b"!" if data.endswith(b"\n") else b""

    def advance(self, now: float) -> bytes:
        self.sent += 1
        return bytes(self.size)

    def next_due(self) -> float:
        return 0.02 * self.sent if self.sent < self.messages else math.inf


def arrivals(link: FaultyLink, until: float) -> list[tuple[float, int]]:
    """When how many bytes come to the host."""
    seen = []
    while (now := link.next_due()) <= until:
        data = link.advance(now)
        if data:
            seen.append((now, len(data)))
    return seen


def by_configuration(device: Device, config: LinkFaultConfig) -> FaultyLink:
    return FaultyLink(device, config, seed=1)


def by_call(device: Device, config: LinkFaultConfig) -> FaultyLink:
    link = FaultyLink(device, LinkFaultConfig(), seed=1)
    link.change(config)
    return link


@pytest.fixture(params=[by_configuration, by_call], ids=["configuration", "call"])
def linked(request: pytest.FixtureRequest) -> Callable[[Device, LinkFaultConfig], FaultyLink]:
    made: Callable[[Device, LinkFaultConfig], FaultyLink] = request.param
    return made


Linked = Callable[[Device, LinkFaultConfig], FaultyLink]


def test_latency_towards_the_host_does_not_delay_commands(linked: Linked) -> None:
    device = Device(messages=1)
    link = linked(device, LinkFaultConfig(latency_s=0.1))
    assert link.receive(b"x\n", 0.0) == b""
    assert device.heard == [(0.0, b"x\n")]
    assert arrivals(link, 1.0) == [(0.1, 1 + len(MESSAGE))]


def test_latency_towards_the_device_does_not_delay_its_messages(linked: Linked) -> None:
    device = Device(messages=1)
    link = linked(device, LinkFaultConfig(command_latency_s=0.1))
    assert link.receive(b"x\n", 0.0) == b""
    assert device.heard == []
    assert arrivals(link, 1.0) == [(0.0, len(MESSAGE)), (0.1, 1)]
    assert device.heard == [(0.1, b"x\n")]


@pytest.mark.parametrize("baud", [19200, 115200])
def test_a_serial_line_takes_its_time_for_each_byte(linked: Linked, baud: int) -> None:
    device = Device(messages=1)
    seen = arrivals(linked(device, LinkFaultConfig(baud=baud)), 1.0)
    (first, size), (last, _) = seen[0], seen[-1]
    assert size == 1
    assert first == pytest.approx(10 / baud)
    assert last == pytest.approx(len(MESSAGE) * 10 / baud)
    assert sum(size for _, size in seen) == len(MESSAGE)


def test_commands_are_slow_on_a_serial_line_too(linked: Linked) -> None:
    device = Device(messages=0)
    link = linked(device, LinkFaultConfig(baud=9600))
    link.receive(b"0123456789", 1.0)
    assert arrivals(link, 2.0) == []
    assert b"".join(data for _, data in device.heard) == b"0123456789"
    assert device.heard[-1][0] == pytest.approx(1.0 + 100 / 9600)


def test_a_device_that_sends_too_much_leaves_whole_messages_out(linked: Linked) -> None:
    link = linked(Device(), LinkFaultConfig(baud=19200))
    seen = arrivals(link, 10.0)
    received = sum(size for _, size in seen)
    assert received * 10 == pytest.approx(19200 * 10.0, rel=0.01)
    assert link.counts["dropped message"] == pytest.approx(500 - 19200 / 810 * 10.5, abs=3)


@pytest.mark.parametrize("timer_ms", [1, 16])
def test_a_converter_waits_for_its_timer_or_for_a_full_packet(
    linked: Linked, timer_ms: int
) -> None:
    timer = timer_ms / 1000
    link = linked(Device(messages=50), LinkFaultConfig(chip_timer_s=timer))
    seen = arrivals(link, 2.0)
    assert sum(size for _, size in seen) == 50 * len(MESSAGE)
    for now, size in seen:
        is_full = size >= 62 and size % 62 == 0
        is_on_timer = abs(now / timer - round(now / timer)) < 1e-6
        assert is_full or is_on_timer
    slowest = max(now - math.floor(now / 0.02 + 1e-9) * 0.02 for now, _ in seen)
    assert slowest <= timer + 1e-9


def test_jitter_keeps_the_order_and_its_bound_and_depends_on_the_seed_alone() -> None:
    def run(seed: int) -> list[tuple[float, int]]:
        config = LinkFaultConfig(latency_s=0.01, jitter_s=0.005)
        return arrivals(FaultyLink(Device(messages=500), config, seed), 20.0)

    late = [now - 0.02 * i for i, (now, _) in enumerate(run(1))]
    assert len(late) == 500
    assert 0.01 <= min(late) < 0.0105
    assert 0.0145 < max(late) <= 0.015
    assert run(1) == run(1) != run(2)


def test_what_is_under_way_is_lost_when_the_cable_is_pulled(linked: Linked) -> None:
    device = Device(messages=1)
    link = linked(device, LinkFaultConfig(command_latency_s=0.5, latency_s=0.5, baud=9600))
    link.receive(b"x\n", 0.0)
    link.advance(0.0)
    link.inject("unplug", 0.1)
    assert arrivals(link, 5.0) == []
    assert device.heard == []
