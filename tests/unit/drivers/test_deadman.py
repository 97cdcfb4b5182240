"""A base is told to stand while the event loop hangs, and only then."""

import asyncio
import os
import socket
import struct
import threading
import tty
from collections.abc import Iterator

import pytest

from gvgbot.drivers.tcp import SCHEME, open_tcp
from gvgbot.drivers.transport import SerialStream
from gvgbot.errors import DeviceLost

LAST_WORDS = b"stand still"
PATIENCE_S = 0.1


@pytest.fixture
def ends() -> Iterator[tuple[int, str]]:
    """The base's end of a line, which never blocks, and the path of ours."""
    here, there = os.openpty()
    tty.setraw(there)
    os.set_blocking(here, False)
    yield here, os.ttyname(there)
    os.close(here)
    os.close(there)


def heard(end: int) -> bytes:
    try:
        return os.read(end, 10_000)
    except BlockingIOError:
        return b""


def hang(seconds: float) -> None:
    """Hold the event loop, as a disk that does not answer may."""
    threading.Event().wait(seconds)


def test_a_hung_loop_does_not_keep_the_base_going(ends: tuple[int, str]) -> None:
    end, path = ends

    async def drive() -> None:
        stream = SerialStream(path, 115200)
        stream.watch_over(LAST_WORDS, PATIENCE_S)
        stream.write(b"drive")
        hang(5 * PATIENCE_S)
        said = heard(end)
        assert said.startswith(b"drive" + LAST_WORDS)
        assert said.count(LAST_WORDS) >= 2  # as long as it lasts
        stream.close()

    asyncio.run(drive())


def test_a_loop_that_runs_is_left_alone_and_so_is_a_closed_port(ends: tuple[int, str]) -> None:
    end, path = ends

    async def drive() -> None:
        stream = SerialStream(path, 115200)
        stream.watch_over(LAST_WORDS, 10 * PATIENCE_S)
        await asyncio.sleep(3 * PATIENCE_S)  # while it looks, five times in its patience
        assert "deadman" in {thread.name for thread in threading.enumerate()}
        stream.close()
        assert "deadman" not in {thread.name for thread in threading.enumerate()}

    asyncio.run(drive())
    assert heard(end) == b""


def test_a_base_on_the_network_is_told_as_well() -> None:
    async def drive(listener: socket.socket) -> None:
        stream = await open_tcp(f"{SCHEME}127.0.0.1:{listener.getsockname()[1]}")
        base, _ = listener.accept()
        with base:
            stream.watch_over(LAST_WORDS, PATIENCE_S)
            stream.write(b"drive")
            hang(5 * PATIENCE_S)
            said = base.recv(10_000)
            assert said.startswith(b"drive" + LAST_WORDS)
            assert said.count(LAST_WORDS) >= 2
            stream.close()
            await asyncio.sleep(0)
            base.settimeout(10.0)  # which ends where something still holds the connection
            rest = b"".join(iter(lambda: base.recv(10_000), b""))
            assert not rest.replace(LAST_WORDS, b"")  # which may be said until it is closed
        assert "deadman" not in {thread.name for thread in threading.enumerate()}

    with socket.create_server(("127.0.0.1", 0)) as listener:
        asyncio.run(drive(listener))


def test_a_base_that_hangs_up_at_once_is_lost_and_not_watched() -> None:
    async def drive(listener: socket.socket) -> None:
        stream = await open_tcp(f"{SCHEME}127.0.0.1:{listener.getsockname()[1]}")
        base, _ = listener.accept()
        base.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        base.close()  # which resets the connection
        with pytest.raises(DeviceLost):
            await stream.read()
        with pytest.raises(DeviceLost, match="closed the connection"):
            stream.watch_over(LAST_WORDS, PATIENCE_S)
        assert "deadman" not in {thread.name for thread in threading.enumerate()}

    with socket.create_server(("127.0.0.1", 0)) as listener:
        asyncio.run(drive(listener))
