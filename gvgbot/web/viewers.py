"""Everybody who has the page open: what each is still to be sent, the newest of a kind only.

Some kinds have parts, as the grid has tiles: then it is the newest of each part.
"""

import asyncio
from collections import deque
from typing import TypeVar

from gvgbot.web.wire import KNOWN, Kind, Value, frame

_REPLIES = 16  # that wait to be sent

Part = tuple[int, int] | None
T = TypeVar("T")


class Viewer:
    """What one page is still to be sent; a slow one skips to the newest, and memory never grows."""

    def __init__(self) -> None:
        self._replies: deque[bytes] = deque(maxlen=_REPLIES)
        self._newest: dict[tuple[Kind, Part], bytes] = {}
        self._fresh = asyncio.Event()

    def put(self, kind: Kind, message: bytes, part: Part = None) -> None:
        """Send this instead of what waits of the same kind and part."""
        if kind == "reply":
            self._replies.append(message)
        else:
            self._newest[kind, part] = message
        self._fresh.set()

    def forget(self, kind: Kind) -> None:
        """Send nothing of a kind that waits."""
        self._newest = _without(kind, self._newest)

    @property
    def has_news(self) -> bool:
        """Whether there is something to send."""
        return bool(self._replies or self._newest)

    async def next(self) -> bytes:
        """The next message to send; waits for one. Replies come first, then what waits longest."""
        while not self.has_news:
            self._fresh.clear()
            await self._fresh.wait()
        if self._replies:
            return self._replies.popleft()
        return self._newest.pop(next(iter(self._newest)))


class Audience:
    """All viewers; who joins gets the newest of each kind. Nothing is encoded for nobody."""

    def __init__(self) -> None:
        self._viewers: set[Viewer] = set()
        self._latest: dict[tuple[Kind, Part], Value] = {}

    def __len__(self) -> int:
        return len(self._viewers)

    def show(self, kind: Kind, value: Value, part: Part = None) -> None:
        """Send a value to everybody."""
        self._latest[kind, part] = value
        if self._viewers:
            message = frame(kind, value)
            for viewer in self._viewers:
                viewer.put(kind, message, part)

    def forget(self, kind: Kind) -> None:
        """Send nothing more of what is known of a kind."""
        self._latest = _without(kind, self._latest)
        for viewer in self._viewers:
            viewer.forget(kind)

    def begin_anew(self, life: str) -> None:
        """Forget all that a robot has said, and say that another life of it begins."""
        for kind in KNOWN:
            self.forget(kind)
        self.show("life", life)

    def keep(self, kind: Kind, value: Value) -> None:
        """Let those who join from now on have a value; the others have it already."""
        self._latest[kind, None] = value

    def join(self, viewer: Viewer) -> None:
        """Send everything to a viewer from now on."""
        self._viewers.add(viewer)
        for (kind, part), value in self._latest.items():
            viewer.put(kind, frame(kind, value), part)

    def leave(self, viewer: Viewer) -> None:
        """Send nothing more to a viewer."""
        self._viewers.discard(viewer)


def _without(kind: Kind, known: dict[tuple[Kind, Part], T]) -> dict[tuple[Kind, Part], T]:
    return {slot: value for slot, value in known.items() if slot[0] != kind}
