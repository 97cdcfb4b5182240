"""Events of a robot, each once, for whoever takes them one after another."""

from collections.abc import AsyncIterator, Iterator

from gvgbot.client.newest import Newest
from gvgbot.topics import Event, Events


class EventStream:
    """Each event once, with `for` or `async for`; those that a slow reader missed are left out."""

    def __init__(self, newest: Newest[Events]) -> None:
        self._newest = newest

    @property
    def latest(self) -> tuple[Event, ...]:
        """The latest events, oldest first."""
        newest = self._newest.latest
        return () if newest is None else newest.events

    def __iter__(self) -> Iterator[Event]:
        """Wait for events in this thread."""
        fresh = _Fresh()
        for sent in self._newest:
            yield from fresh.of(sent.events)

    async def __aiter__(self) -> AsyncIterator[Event]:
        """Wait for events in the running loop."""
        fresh = _Fresh()
        async for sent in self._newest:
            for event in fresh.of(sent.events):
                yield event


class _Fresh:
    """Tells which events of a message were not in those before it."""

    def __init__(self) -> None:
        self._last: Event | None = None

    def of(self, events: tuple[Event, ...]) -> tuple[Event, ...]:
        last, self._last = self._last, events[-1] if events else self._last
        if last is None or not events:
            return events
        same = [event for event in events if event.number == last.number]
        has_restarted = events[-1].number < last.number or (same and same[0] != last)
        return tuple(event for event in events if has_restarted or event.number > last.number)
