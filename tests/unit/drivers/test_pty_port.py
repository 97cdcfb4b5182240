"""Pseudo-terminals of twins, as programs meet them that open, leave, share and disturb them."""

import asyncio
import fcntl
import os
import select
import termios
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import serial

from gvgbot.drivers.pty import PtyPort
from gvgbot.drivers.transport import SerialStream
from gvgbot.errors import DeviceLost, UsageError

EVERY_BYTE = bytes(range(256))
LOCAL_FLAGS = 3  # places in the list that termios gives
INPUT_FLAGS, OUTPUT_FLAGS = 0, 1


@contextmanager
def opened(path: str | Path | None) -> Iterator[int]:
    """A client that changes no setting."""
    assert path is not None
    client = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        yield client
    finally:
        os.close(client)


def waiting(client: int) -> bytes:
    """What a client can read just now."""
    data = b""
    while select.select([client], [], [], 0.05)[0]:
        data += os.read(client, 4096)
    return data


def settings(client: int) -> list[int]:
    attributes = termios.tcgetattr(client)
    return [int(attributes[place]) for place in (INPUT_FLAGS, OUTPUT_FLAGS, LOCAL_FLAGS)]


def test_the_terminal_is_raw_from_the_moment_its_name_is_there(tmp_path: Path) -> None:
    """The name is made last: whoever sees it finds the settings made."""
    made = []

    class Watched(type(tmp_path)):  # type: ignore[misc]  # the class depends on the system
        def replace(self, target: Path) -> Path:
            with opened(self) as client:
                made.append(settings(client))
            return Path(super().replace(target))

        def with_name(self, name: str) -> "Watched":
            return Watched(super().with_name(name))

    async def main() -> None:
        PtyPort(Watched(tmp_path / "port")).close()

    asyncio.run(main())
    ((input_flags, output_flags, local_flags),) = made
    assert not local_flags & (termios.ECHO | termios.ICANON | termios.ISIG)
    assert not input_flags & (termios.ICRNL | termios.IXON | termios.ISTRIP)
    assert not output_flags & termios.OPOST


def test_every_byte_passes_both_ways_unchanged() -> None:
    async def main() -> None:
        port = PtyPort()
        with opened(port.path) as client:
            port.write(EVERY_BYTE)
            assert waiting(client) == EVERY_BYTE
            os.write(client, EVERY_BYTE)
            assert await port.read() == EVERY_BYTE
        port.close()

    asyncio.run(main())


def test_clients_come_and_go_and_find_what_was_sent_meanwhile() -> None:
    async def main() -> None:
        port = PtyPort()
        path = port.path
        for word in (b"one", b"two", b"three"):
            with opened(path) as client:
                os.write(client, word)
                assert await port.read() == word
                port.write(word + b"!")
                assert waiting(client) == word + b"!"
            port.write(b"nobody reads this yet")
            with opened(path) as client:
                assert waiting(client) == b"nobody reads this yet"
        assert port.path == path
        port.close()

    asyncio.run(main())


def test_a_client_of_pyserial_sets_the_terminal_up_as_it_likes() -> None:
    async def main() -> None:
        port = PtyPort()
        with serial.Serial(port.path, 115200, timeout=1) as client:
            client.write(b"?")
            assert await port.read() == b"?"
            port.write(EVERY_BYTE)
            assert client.read(256) == EVERY_BYTE
        with serial.Serial(port.path, 19200, bytesize=7, parity="E", timeout=1) as client:
            client.write(b"!")
            assert await port.read() == b"!"
        with opened(port.path) as client:
            assert not settings(client)[2] & termios.ECHO
        port.close()

    asyncio.run(main())


def test_two_clients_at_once_share_what_comes_and_both_are_heard() -> None:
    """As on any terminal: a byte goes to one reader, and nothing is lost."""

    async def main() -> None:
        port = PtyPort()
        with opened(port.path) as first, opened(port.path) as second:
            port.write(b"abcdef")
            assert os.read(first, 3) + os.read(second, 3) == b"abcdef"
            os.write(first, b"1")
            assert await port.read() == b"1"
            os.write(second, b"2")
            assert await port.read() == b"2"
        port.close()

    asyncio.run(main())


def test_a_client_may_keep_others_out_and_leaves_the_terminal_free() -> None:
    async def main() -> None:
        port = PtyPort()
        assert port.path is not None
        held = SerialStream(port.path, 115200)
        with pytest.raises(DeviceLost, match="another program uses it"):
            SerialStream(port.path, 115200)
        held.close()
        SerialStream(port.path, 115200).close()
        port.close()

    asyncio.run(main())


def test_a_client_that_locks_the_terminal_can_be_served() -> None:
    """Some drivers lock the port for writing: the twin's own descriptor must not be in the way."""

    async def main() -> None:
        port = PtyPort()
        with opened(port.path) as client:
            fcntl.lockf(client, fcntl.LOCK_EX | fcntl.LOCK_NB)
            os.write(client, b"?")
            assert await port.read() == b"?"
            port.write(b"!")
            assert waiting(client) == b"!"
        port.close()

    asyncio.run(main())


def test_a_flush_drops_what_is_old_and_nothing_that_comes_later() -> None:
    async def main() -> None:
        port = PtyPort()
        with opened(port.path) as client:
            port.write(b"old")
            termios.tcflush(client, termios.TCIFLUSH)
            port.write(b"new")
            assert waiting(client) == b"new"
        port.close()

    asyncio.run(main())


def test_unplugging_hangs_up_on_clients_and_takes_the_name_away(tmp_path: Path) -> None:
    async def main() -> None:
        link = tmp_path / "port"
        port = PtyPort(link)
        with opened(link) as client:
            port.plug(False)
            assert not link.is_symlink()
            with pytest.raises(OSError, match="Input/output"):
                os.write(client, b"?")
        port.plug(True)
        with opened(link) as client:
            os.write(client, b"?")
            assert await port.read() == b"?"
        port.close()
        assert not link.is_symlink()

    asyncio.run(main())


def test_a_link_to_a_device_that_is_there_is_not_taken_and_one_to_nowhere_is(
    tmp_path: Path,
) -> None:
    async def main() -> None:
        link = tmp_path / "port"
        link.symlink_to("/dev/pts/of-a-twin-that-was-killed")
        first = PtyPort(link)
        with pytest.raises(UsageError, match="perhaps of another twin"):
            PtyPort(link)
        with opened(link) as client:
            os.write(client, b"?")
            assert await first.read() == b"?"
        first.close()

    asyncio.run(main())


class OldChip(serial.Serial):
    """A port of which the driver takes the nearest rate that its chip has, without a word."""

    def __setattr__(self, name: str, value: Any) -> None:
        super().__setattr__(name, min(value, 115_200) if name == "baudrate" else value)


@pytest.mark.parametrize("baud", [19_200, 57_600, 115_200, 250_000, 500_000, 750_000])
def test_a_rate_that_a_port_has_is_taken_and_another_one_refused(baud: int) -> None:
    async def main() -> None:
        port = PtyPort()
        assert port.path is not None
        able = SerialStream(port.path, 19_200)
        able.set_baud(baud)
        able.close()
        old = SerialStream(port.path, 19_200, OldChip(port.path, 19_200))
        if baud > 115_200:
            with pytest.raises(DeviceLost, match=f"takes 115200 bit/s instead of {baud}: set"):
                old.set_baud(baud)
        else:
            old.set_baud(baud)
        old.close()
        port.close()

    asyncio.run(main())


@pytest.mark.parametrize("name", ["file/link", "nowhere/link", "", "file"])
def test_a_link_that_cannot_be_made_is_one_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.chdir(tmp_path)

    async def main() -> None:
        with pytest.raises(UsageError, match="link"):
            PtyPort(Path(name))

    asyncio.run(main())
    assert [one.name for one in tmp_path.iterdir()] == ["file"]
