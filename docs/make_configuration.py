"""Writes reference/configuration.md, all keys of the configuration, from the dataclasses.

    python -m docs.make_configuration

What a key means is the comment that it has in the source.
"""

import dataclasses
import inspect
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from docs.source import fields_of, table
from gvgbot.config import Config
from gvgbot.conversion import describe, describe_range
from gvgbot.ranges import Range

PAGE = Path(__file__).parent / "reference" / "configuration.md"
UNITS = {
    "m": "m",
    "s": "s",
    "ms": "ms",
    "rad": "rad",
    "deg": "degrees",
    "hz": "Hz",
    "mps": "m/s",
    "radps": "rad/s",
    "mps2": "m/s²",
    "radps2": "rad/s²",
    "mb": "MB",
    "v": "V",
    "ppm": "ppm",
    "per_h": "per hour",
    "v_per_h": "V per hour",
    "per_kb": "per kB",
    "per_k": "per 1000",
    "baud": "bit/s",
    "m_per_m": "m/m",
    "m_per_sqrt_m": "m/√m",
    "m_per_sqrt_rad": "m/√rad",
    "rad_per_sqrt_rad": "rad/√rad",
    "rad_per_sqrt_m": "rad/√m",
    "rad_per_sqrt_s": "rad/√s",
}
TOP = "Top level"  # heading of the keys that are in no section
HEAD = """\
# Configuration

<!-- Written by docs/make_configuration.py from the dataclasses: change those. -->

A configuration is a YAML file with any of these keys; what it leaves out has its default, which
suits a TurtleBot 2. `--set key=value` overrides a key on the command line, and `summary.json` of
a run has all of them as they were. A key that does not exist, a value of the wrong type or one
out of range stops the program, which lists all such mistakes at once. Devices are simulated unless
`twin.enabled` is `false`; `gvgbot run` warns if the file it is given says nothing about that, as
one does that a power cut has emptied.

```yaml
robot:
  name: turtlebot2
  limits:
    max_speed_mps: 0.4
laser:
  port: /dev/gvgbot-laser
twin:
  enabled: false          # real devices
```

The unit of a key is the end of its name. Angles turn anticlockwise; x points ahead and y to the
left.
"""


@dataclasses.dataclass(frozen=True, slots=True)
class Key:
    """A key of the configuration: its whole name, type, default, and what it means."""

    name: str
    kind: Any
    default: Any
    meaning: str


@dataclasses.dataclass(frozen=True, slots=True)
class Section:
    """A mapping of the configuration, and the class that describes it."""

    name: str
    cls: type
    keys: tuple[Key, ...]


def page() -> str:
    """The whole page, Markdown."""
    return "\n".join([HEAD, *map(_text, sections())])


def sections() -> list[Section]:
    """All sections that have keys of their own, in the order of the tree."""
    return [section for section in _sections(Config(), "") if section.keys]


def _sections(part: Any, prefix: str) -> Iterator[Section]:
    cls, found = type(part), fields_of(type(part))
    hints = get_type_hints(cls, include_extras=True)
    keys, below = [], []
    for field in dataclasses.fields(part):
        value, name = getattr(part, field.name), f"{prefix}{field.name}"
        if dataclasses.is_dataclass(value):
            below.append((value, f"{name}."))
        else:
            keys.append(Key(name, hints[field.name], value, found[field.name].comment))
    yield Section(prefix.rstrip("."), cls, tuple(keys))
    for value, name in below:
        yield from _sections(value, name)


def _text(section: Section) -> str:
    rows = [
        (
            f"`{key.name.removeprefix(section.name + '.')}`",
            _shown(key.default),
            _allowed(key),
            key.meaning.replace("None", "null"),
        )
        for key in section.keys
    ]
    about = re.sub(r"\s*\n\s*", " ", inspect.getdoc(section.cls) or "")
    heading = f"`{section.name}`" if section.name else TOP
    keys = table(("key", "default", "allowed", "meaning"), rows)
    return f"## {heading}\n\n{about}\n\n{keys}"


def _shown(value: Any) -> str:
    """A default as it stands in a file."""
    if isinstance(value, tuple):
        return f"`[{', '.join(map(str, value))}]`"
    if value is None or isinstance(value, bool):
        return f"`{json.dumps(value)}`"
    return f"`{value:.6g}`" if isinstance(value, float) else f"`{value or repr(value)}`"


def _allowed(key: Key) -> str:
    """The values in words, with the unit that the name ends in."""
    low_high = [note for note in _notes(key.kind) if isinstance(note, Range)]
    unit = unit_of(key.name)
    if not low_high or get_origin(key.kind) is tuple:
        return f"{describe(key.kind)}{f', {unit}' if unit else ''}"
    words = describe_range(low_high[0]).removeprefix("from ")
    return f"{words}{f' {unit}' if unit else ''}{' or null' if _may_be_null(key.kind) else ''}"


def unit_of(name: str) -> str:
    """The unit that a key's name ends in, "" if it has none."""
    words = name.rpartition(".")[2].split("_")
    endings = ("_".join(words[start:]) for start in range(1 if len(words) > 1 else 0, len(words)))
    return next((UNITS[ending] for ending in endings if ending in UNITS), "")


def _notes(kind: Any) -> tuple[Any, ...]:
    if get_origin(kind) is Annotated:
        return get_args(kind)[1:]
    return tuple(note for part in get_args(kind) for note in _notes(part))


def _may_be_null(kind: Any) -> bool:
    return type(None) in get_args(kind) or any(_may_be_null(part) for part in get_args(kind))


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
