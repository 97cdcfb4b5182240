"""What the audience hears of a robot that cannot be reached."""

import asyncio
import contextlib
from itertools import pairwise

import pytest

from gvgbot import client
from gvgbot.clock import run_in_virtual_time
from gvgbot.errors import GvgbotError
from gvgbot.web.feed import Feed
from gvgbot.web.viewers import Audience
from gvgbot.web.wire import Link

PAGE_PATIENCE = 4.0  # s without a word, after which a page takes the program for gone


class Slow:
    """A robot that cannot be reached, which takes long to find out."""

    async def __aenter__(self) -> None:
        await asyncio.sleep(30.0)
        raise GvgbotError("nobody answers")

    async def __aexit__(self, *_: object) -> None: ...


def test_a_page_hears_why_there_is_no_robot_however_long_it_takes_to_try(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As with a name server that is silent for half a minute at each attempt."""

    monkeypatch.setattr(client, "connect", lambda *_, **__: Slow())
    told: list[tuple[float, Link]] = []

    async def main() -> None:
        loop = asyncio.get_running_loop()
        feed = Feed(
            "karl",
            "tcp/robot.example:7447",
            None,
            Audience(),
            on_link=lambda link: told.append((loop.time(), link)),
        )
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(70.0):
                await feed.run()
        assert asyncio.all_tasks() == {asyncio.current_task()}

    run_in_virtual_time(main())
    moments = [0.0, *(moment for moment, _ in told), 70.0]
    assert max(b - a for a, b in pairwise(moments)) < PAGE_PATIENCE
    assert {link.word for _, link in told} == {"unreachable"}
    assert told[0][1].trouble == "looking for a robot at tcp/robot.example:7447"
    assert told[-1][1].trouble == "nobody answers"
