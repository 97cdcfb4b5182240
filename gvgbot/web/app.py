"""The page as a program: watches one robot and serves its page until a signal ends it."""

import asyncio
from collections.abc import Callable
from pathlib import Path

from gvgbot import client
from gvgbot.errors import GvgbotError, UsageError
from gvgbot.service import StopSignals
from gvgbot.web.feed import Feed
from gvgbot.web.server import Web
from gvgbot.web.viewers import Audience

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
    client.connect(robot or "any", endpoint, zenoh_file=zenoh_file)  # complains of wrong arguments
    with StopSignals() as signals:
        try:
            asyncio.run(_serve(signals, robot, endpoint, zenoh_file, (host, port), say))
        except* GvgbotError as errors:
            raise errors.exceptions[0] from None
    return 0


async def _serve(
    signals: StopSignals,
    robot: str | None,
    endpoint: str,
    zenoh_file: Path | None,
    address: tuple[str, int],
    say: Callable[[str], None],
) -> None:
    audience = Audience()
    feed = Feed(robot, endpoint, zenoh_file, audience)
    page = Web(*address, audience, feed.fulfil)
    async with await page.open() as server, asyncio.TaskGroup() as tasks:
        trouble = await asyncio.to_thread(_trouble, endpoint, zenoh_file) if robot is None else None
        port = next(iter(server.sockets)).getsockname()[1]  # the one it got, if it asked for any
        say(f"the map is at http://{_shown(address[0])}:{port}/ (Ctrl-C ends)")
        if trouble is not None:
            say(f"{trouble} (trying again)")
        watching = tasks.create_task(feed.run())
        await signals.wait()
        watching.cancel()


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
    if host in ("", "0.0.0.0", "::"):
        return "localhost"
    return f"[{host}]" if ":" in host else host
