"""Writes topics.md, the reference of what travels on the network, from gvgbot/topics.py.

    python -m docs.make_topics

Fields are explained by the comments that they have in the source.
"""

import inspect
from pathlib import Path
from typing import Literal, TypeGuard, get_args, get_origin, get_type_hints

import msgspec

from docs.source import fields_of, table
from gvgbot.requests import REQUESTS, request_key
from gvgbot.telemetry_config import TelemetryConfig
from gvgbot.topics import (
    SCAN,
    TEAM_PARTS,
    TOPICS,
    Topic,
    alive_key,
    team_key,
)

PAGE = Path(__file__).with_name("topics.md")
HEAD = """\
# Topics

<!-- Written by docs/make_topics.py from gvgbot/topics.py: change the table there, not here. -->

What a robot says over zenoh. `ROBOT` is its `robot.name`; `*` in that place listens to all of
them. A payload is one MessagePack map from field name to value; the encoding of each sample carries
its type and version. Units are SI, angles are in radians.

A `stamp` is of the robot's monotonic clock, the same for all topics. A robot that goes on with a
mission, or begins with a map, goes on where the clock of that had stopped: from one start of the
program to another stamps may jump, also back, and `uptime` of the state begins anew. The time of
day there is zenoh's timestamp of each sample, and of a reply, when
it was given; a router puts its own in its place if the robot's clock is more than half a second
ahead of it.

Only the robot writes its topics; the files in `configs/zenoh` see to that. What is sent on change
is sent again to a subscriber that has lost it (`heartbeat` of an advanced subscriber).

A queryable topic answers a `get` with its newest sample, and in JSON to `KEY?format=json`, where
raw bytes are in base64. While there is none yet, as of events at first, the reply is an error.
A router that keeps maps and states ([Several robots on one network](fleet.md)) answers for a robot
that is away or has only just begun: always in MessagePack, as the encoding of its reply says.

What is kept for latecomers is what an advanced subscriber gets when it
joins. `gvgbot.client` does all of this for programs in Python.

Other programs set zenoh's `mode` to `client`: as a peer, which is zenoh's default, they hear a
robot that they connect to, but nothing of one that they meet at a router.
"""
ALIVE = """\
## `{key}`

A liveliness token, without payload: there as long as the robot is on the network. A robot that
hangs can keep it, so look at `cycles` and `cycle_age` of its state, too.
"""
REQUEST = """\
## `{key}`: requests

A query to exactly one of these keys asks the robot for something: {names}. What each does, its
arguments, and the answer are under [Command a robot from elsewhere](how-to/remote.md).
"""


def page() -> str:
    """The whole page, Markdown."""
    return "\n".join([HEAD, _overview(), *map(_section, TOPICS), _alive(), _requests()])


def _alive() -> str:
    return ALIVE.format(key=alive_key("ROBOT"))


def _requests() -> str:
    names = ", ".join(f"`{name}`" for name in REQUESTS)
    return REQUEST.format(key=request_key("ROBOT", "REQUEST"), names=names)


def _overview() -> str:
    rows = [
        "| key | payload | sent | priority | kept for latecomers | queryable | who may write |",
        "|---|---|---|---|---|---|---|",
    ]
    for topic in TOPICS:
        cells = (
            f"`{topic.key('ROBOT')}`",
            f"`{topic.encoding}`",
            _sent(topic),
            topic.priority,
            str(topic.history or "none"),
            "yes" if topic.queryable else "no",
            "the robot",
        )
        rows.append(f"| {' | '.join(cells)} |")
    rows.append(
        f"| `{alive_key('ROBOT')}` | liveliness token | while it is there | | | | the robot |"
    )
    rows += [
        f"| `{team_key('ROBOT', part)}` | for robots of a team alone, and may change | "
        "with `team.enabled` | | | | the robot |"
        for part in TEAM_PARTS
    ]
    rows.append(
        f"| `{request_key('ROBOT', 'REQUEST')}` | query, see below | when asked | | | | "
        "whom the access control lets; `telemetry.requests` permits |"
    )
    return "\n".join(rows) + "\n"


def _sent(topic: Topic) -> str:
    """When samples are sent."""
    if topic is SCAN:
        return f"at most {TelemetryConfig().scan_rate_hz:g} Hz: `telemetry.scan_rate_hz`"
    return f"{'on change, at most ' if topic.on_change else ''}{topic.rate_hz:g} Hz"


def _section(topic: Topic) -> str:
    parts = [f"## `{topic.key('ROBOT')}`: {topic.payload.__name__}\n\n{_explained(topic.payload)}"]
    hints = get_type_hints(topic.payload).values()
    within = dict.fromkeys(part for hint in hints for part in (hint, *get_args(hint)))
    parts += [f"### {part.__name__}\n\n{_explained(part)}" for part in within if _is_struct(part)]
    return "\n".join(parts)


def _is_struct(part: object) -> TypeGuard[type[msgspec.Struct]]:
    return isinstance(part, type) and issubclass(part, msgspec.Struct)


def _explained(payload: type[msgspec.Struct]) -> str:
    rows = table(("field", "type", "meaning"), _fields(payload))
    return f"{inspect.getdoc(payload) or ''}\n\n{rows}"


def _fields(payload: type[msgspec.Struct]) -> list[tuple[str, str, str]]:
    """Name, type and comment of each field, as the source has them."""
    found, hints = fields_of(payload), get_type_hints(payload)
    rows = []
    for name in payload.__struct_fields__:
        kind, comment = found[name].annotation, found[name].comment
        if get_origin(hints[name]) is Literal:
            kind, comment = "str", comment or ", ".join(get_args(hints[name]))
        rows.append((f"`{name}`", f"`{kind}`", comment))
    return rows


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
