"""What the network hears of what happened: the newest events, numbered from the first."""

from collections import deque

from gvgbot.autonomy import events
from gvgbot.maps.run_directory import record_of
from gvgbot.topics import EVENTS_KEPT, Event, Events


class LiveEvents:
    """Keeps the newest events for those who watch."""

    def __init__(self) -> None:
        self._happened, self._told = 0, 0  # events; and those of them that were published
        self._latest: deque[Event] = deque(maxlen=EVENTS_KEPT)

    def note(self, event: events.Event) -> None:
        """Something happened."""
        record = record_of(event)
        kind, stamp = record.pop("event"), record.pop("stamp")
        self._latest.append(Event(number=self._happened, stamp=stamp, kind=kind, details=record))
        self._happened += 1

    def news(self) -> Events | None:
        """All that are kept, to be published; None if none is newer than the last time."""
        if self._told == self._happened:
            return None
        self._told = self._happened
        return Events(events=tuple(self._latest))
