"""The page as a program: watches one robot and serves its page until a signal ends it."""

import asyncio
from collections.abc import Callable
from pathlib import Path

from gvgbot import client
from gvgbot.errors import GvgbotError, UsageError, underlying
from gvgbot.stop_signals import StopSignals
from gvgbot.web.feed import Feed
from gvgbot.web.server import Web
from gvgbot.web.viewers import Audience
from gvgbot.web.wire import Link

_PATIENCE = 1.0  # s for a connection, before it is said that there is none


def web(
    robot: str | None,
    endpoint: str,
    zenoh_file: Path | None,
    *,
    host: str,
    port: int,
    say: Callable[[str], None],
) -> int:
    """Serve the page of a robot, or of the only one there is, until Ctrl-C or another signal; 0.

    Raises UsageError if an argument cannot be right, or if several robots are there and none is
    named, GvgbotError if the address cannot be had.
    """
    client.connect(robot or "any", endpoint)  # complains of wrong arguments
    with StopSignals() as signals:
        try:
            asyncio.run(_serve(signals, robot, endpoint, zenoh_file, (host, port), say))
        except* GvgbotError as errors:
            raise underlying(errors) from None
    return 0


async def _serve(
    signals: StopSignals,
    robot: str | None,
    endpoint: str,
    zenoh_file: Path | None,
    address: tuple[str, int],
    say: Callable[[str], None],
) -> None:
    audience, spoken = Audience(), Spoken(say)
    feed = Feed(robot, endpoint, zenoh_file, audience, on_link=spoken.tell)
    page = Web(*address, audience, feed.fulfil)
    async with await page.open() as server, asyncio.TaskGroup() as tasks:
        trouble = await asyncio.to_thread(_trouble, endpoint, zenoh_file) if robot is None else None
        port = next(iter(server.sockets)).getsockname()[1]  # the one it got, if it asked for any
        say(f"the map is at http://{_shown(address[0])}:{port}/ (Ctrl-C ends)")
        if trouble is not None:
            spoken.say(f"{trouble} (trying again)")
        watching = tasks.create_task(feed.run())
        await signals.wait()
        watching.cancel()


class Spoken:
    """Says in the terminal how things are with the robot, whenever that has changed."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say, self._last = say, ""

    def tell(self, link: Link) -> None:
        """Say what there is to know of a link, unless that was said last."""
        self.say(_words(link))

    def say(self, text: str) -> None:
        """Say something, unless it was said last."""
        if text != self._last:
            self._last = text
            self._say(text)


def _words(link: Link) -> str:
    match link.word:
        case "alive":
            return f"connected to {link.robot}"
        case "doubled":
            return f"several robots are named {link.robot}: give one another robot.name"
        case "quiet":
            return f"{link.robot} says nothing: its program hangs"
        case "gone":
            return f"{link.robot} has gone (waiting for it)"
        case "absent":
            return f"no robot named {link.robot} here; there is {', '.join(link.others) or 'none'}"
        case "unreachable":
            return f"{link.trouble} (trying again)"
        case "cut off":
            return f"connection to {link.robot} lost (trying again)"


def _trouble(endpoint: str, zenoh_file: Path | None) -> str | None:
    """Why there is no robot to watch yet. Raises UsageError if there are several."""
    try:
        client.only_robot(endpoint, _PATIENCE, zenoh_file)
    except UsageError:
        raise
    except GvgbotError as error:
        return str(error)
    return None


def _shown(host: str) -> str:
    """A host as a browser takes it."""
    if host in ("0.0.0.0", "::"):
        return "localhost"
    return f"[{host}]" if ":" in host else host
