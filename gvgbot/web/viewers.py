"""Everybody who has the page open: what each is still to be sent, the newest of a kind only."""

import asyncio
from collections import deque

from gvgbot.web.wire import Kind, Value, frame

_REPLIES = 16  # that wait to be sent


class Viewer:
    """What one page is still to be sent; a slow one skips to the newest, and memory never grows."""

    def __init__(self) -> None:
        self._replies: deque[bytes] = deque(maxlen=_REPLIES)
        self._newest: dict[Kind, bytes] = {}
        self._fresh = asyncio.Event()

    def put(self, kind: Kind, message: bytes) -> None:
        """Send this instead of what waits of the same kind."""
        if kind == "reply":
            self._replies.append(message)
        else:
            self._newest[kind] = message
        self._fresh.set()

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
        self._latest: dict[Kind, Value] = {}

    def __len__(self) -> int:
        return len(self._viewers)

    def show(self, kind: Kind, value: Value) -> None:
        """Send a value to everybody."""
        self._latest[kind] = value
        if self._viewers:
            message = frame(kind, value)
            for viewer in self._viewers:
                viewer.put(kind, message)

    def keep(self, kind: Kind, value: Value) -> None:
        """Let those who join from now on have a value; the others have it already."""
        self._latest[kind] = value

    def join(self, viewer: Viewer) -> None:
        """Send everything to a viewer from now on."""
        self._viewers.add(viewer)
        for kind, value in self._latest.items():
            viewer.put(kind, frame(kind, value))

    def leave(self, viewer: Viewer) -> None:
        """Send nothing more to a viewer."""
        self._viewers.discard(viewer)
