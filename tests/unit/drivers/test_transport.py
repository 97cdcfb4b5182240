"""Byte streams in memory, twins served on them, and what cannot be opened as a port."""

import asyncio
import os
from math import inf
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.drivers.transport import ByteStream, NoSerialPort, open_port, pipe, serve_twin
from gvgbot.errors import DeviceLost


class Metronome:
    """A device that sends a byte every 0.1 s and echoes what it hears."""

    def __init__(self, start: float = 0.0) -> None:
        self.beats, self._start = 0, start
        self.heard: list[tuple[float, bytes]] = []

    def receive(self, data: bytes, now: float) -> bytes:
        self.heard.append((now, data))
        return b"<" + data + b">"

    def advance(self, now: float) -> bytes:
        self.beats += 1
        return b"."

    def next_due(self) -> float:
        return self._start + 0.1 * (self.beats + 1)


class Silent(Metronome):
    """A device that speaks only when spoken to."""

    def next_due(self) -> float:
        return inf


async def read_all(stream: ByteStream) -> bytes:
    """Everything up to the end of the link."""
    received = b""
    while True:
        try:
            received += await stream.read()
        except DeviceLost:
            return received


async def read_until(stream: ByteStream, stamp: float) -> list[tuple[float, bytes]]:
    log: list[tuple[float, bytes]] = []
    clock = LoopClock()
    try:
        async with asyncio.timeout_at(stamp):
            while True:
                data = await stream.read()
                log.append((round(clock.now(), 6), data))
    except TimeoutError:
        return log


@given(st.lists(st.binary(min_size=1), max_size=10))
def test_what_is_written_to_one_end_is_read_from_the_other(chunks: list[bytes]) -> None:
    async def run() -> bytes:
        here, there = pipe()
        for chunk in chunks:
            here.write(chunk)
        here.close()
        return await read_all(there)

    assert run_in_virtual_time(run()) == b"".join(chunks)


def test_both_directions_are_independent() -> None:
    async def run() -> tuple[bytes, bytes]:
        here, there = pipe()
        here.write(b"question")
        there.write(b"answer")
        return await there.read(), await here.read()

    assert run_in_virtual_time(run()) == (b"question", b"answer")


def test_reading_waits_until_something_arrives() -> None:
    async def run() -> tuple[float, bytes]:
        here, there = pipe()
        asyncio.get_running_loop().call_later(2.0, here.write, b"late")
        return LoopClock().now(), await there.read()

    start, data = run_in_virtual_time(run())
    assert (start, data) == (0.0, b"late")


def test_writing_nothing_wakes_nobody() -> None:
    async def run() -> None:
        here, there = pipe()
        here.write(b"")
        async with asyncio.timeout(1.0):
            await there.read()

    with pytest.raises(TimeoutError):
        run_in_virtual_time(run())


@pytest.mark.parametrize("closer", [0, 1], ids=["own end", "other end"])
def test_a_closed_link_is_lost_for_reading_and_writing_at_both_ends(closer: int) -> None:
    async def run() -> None:
        ends = pipe()
        ends[closer].close()
        ends[closer].close()
        for end in ends:
            with pytest.raises(DeviceLost):
                end.write(b"x")
            with pytest.raises(DeviceLost):
                await end.read()

    run_in_virtual_time(run())


def test_a_reader_that_waits_learns_at_once_that_the_link_was_closed() -> None:
    async def run() -> float:
        here, there = pipe()
        asyncio.get_running_loop().call_later(3.0, here.close)
        with pytest.raises(DeviceLost):
            await there.read()
        return LoopClock().now()

    assert run_in_virtual_time(run()) == pytest.approx(3.0)


async def with_twin(twin: Metronome, until: float, ahead: float = 0.0) -> list[tuple[float, bytes]]:
    here, there = pipe()
    loop = asyncio.get_running_loop()
    loop.call_later(0.25, here.write, b"hi")
    async with asyncio.TaskGroup() as tasks:
        server = tasks.create_task(serve_twin(twin, there, LoopClock(ahead)))
        log = await read_until(here, until)
        server.cancel()
    return log


def test_a_served_twin_sends_when_it_is_due_and_answers_at_once() -> None:
    log = run_in_virtual_time(with_twin(Metronome(), 0.45))
    assert log == [(0.1, b"."), (0.2, b"."), (0.25, b"<hi>"), (0.3, b"."), (0.4, b".")]


@pytest.mark.parametrize("ahead", [-0.35, 98.33])
def test_a_served_twin_keeps_its_own_time_on_a_clock_that_is_ahead(ahead: float) -> None:
    log = run_in_virtual_time(with_twin(Metronome(ahead), 0.45, ahead))
    assert log == [(0.1, b"."), (0.2, b"."), (0.25, b"<hi>"), (0.3, b"."), (0.4, b".")]


def test_a_twin_with_nothing_to_send_still_answers() -> None:
    assert run_in_virtual_time(with_twin(Silent(), 1.0)) == [(0.25, b"<hi>")]


def test_a_twin_hears_the_bytes_at_the_time_they_were_sent() -> None:
    twin = Metronome()
    run_in_virtual_time(with_twin(twin, 0.45))
    assert [(round(stamp, 6), data) for stamp, data in twin.heard] == [(0.25, b"hi")]


def test_serving_ends_quietly_when_the_other_end_goes() -> None:
    async def run() -> float:
        here, there = pipe()
        asyncio.get_running_loop().call_later(5.05, here.close)
        await serve_twin(Metronome(), there, LoopClock())
        return LoopClock().now()

    assert 5.0 <= run_in_virtual_time(run()) <= 5.2


@pytest.mark.parametrize("name", ["file", os.devnull])
def test_what_is_no_serial_port_is_told_from_a_port_that_is_lost(name: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(NoSerialPort, match=r"cannot open .*: check its name"):
        open_port(str(tmp_path / name), 115_200)


def test_a_port_that_is_absent_may_be_one() -> None:
    with pytest.raises(DeviceLost, match="plug it in") as lost:
        open_port("/dev/absent", 115_200)
    assert not isinstance(lost.value, NoSerialPort)
