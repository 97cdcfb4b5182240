"""Writes reference/events.md, what the lines of events.jsonl say, from autonomy/events.py.

python -m docs.make_events
"""

import dataclasses
import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

from docs.source import fields_of, table
from gvgbot.autonomy import events
from gvgbot.maps.run_directory import event_name

PAGE = Path(__file__).parent / "reference" / "events.md"
HEAD = """\
# Events

<!-- Written by docs/make_events.py from gvgbot/autonomy/events.py: change the classes there. -->

Each line of `events.jsonl` is a JSON object: `event` names what happened, `stamp` says when (s,
the robot's monotonic clock), the other fields what it was. Lengths are in metres, angles in
radians, places in the map frame as it was known then. The same events travel [over the
network](../topics.md).
"""


def page() -> str:
    """The whole page, Markdown."""
    return "\n".join([HEAD, *map(_section, get_args(events.Event))])


def _section(event: type) -> str:
    rows = list(_rows(event))
    columns = 3 if any(comment for _, _, comment in rows) else 2
    head = ("field", "type", "meaning")[:columns]
    text = table(head, (row[:columns] for row in rows))
    return f"## `{event_name(event)}`\n\n{inspect.getdoc(event)}\n\n{text}"


def _rows(event: type) -> Iterator[tuple[str, str, str]]:
    found = fields_of(event)
    for field in dataclasses.fields(event):
        yield f"`{field.name}`", f"`{found[field.name].annotation}`", found[field.name].comment


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
