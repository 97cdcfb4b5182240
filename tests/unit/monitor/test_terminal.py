"""The keyboard, against a pseudo-terminal of the kernel."""

import asyncio
import os
import pty
from collections.abc import Iterator

import pytest

from gvgbot.monitor.terminal import keys


@pytest.fixture
def keyboard(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Where a person types what the process reads from its standard input."""
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "r") as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        yield ours
    os.close(ours)


def test_a_key_arrives_although_ctrl_c_follows_at_once(keyboard: int) -> None:
    async def typed() -> str:
        arrived: asyncio.Queue[str] = asyncio.Queue()
        with keys(arrived.put_nowait):
            os.write(keyboard, b"x\x03")
            return await asyncio.wait_for(arrived.get(), 10)

    assert asyncio.run(typed()) == "x"
