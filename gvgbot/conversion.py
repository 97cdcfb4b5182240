"""Plain values (mappings, lists, scalars) into typed, frozen dataclasses, noting every mistake."""

import dataclasses
import reprlib
import types
import typing
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Union

from gvgbot.errors import GvgbotError
from gvgbot.ranges import Range
from gvgbot.spelling import nearest
from gvgbot.yaml_text import is_finite

KeyPath = tuple[str, ...]

NAMES = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "text",
    Path: "a path",
    type(None): "null",
}


@dataclass(frozen=True, slots=True)
class Problem:
    """One mistake: where, the value that stands there, and what is allowed."""

    path: KeyPath
    value: Any
    allowed: str
    missing: bool = False

    def __str__(self) -> str:
        where = ".".join(self.path).replace(".[", "[") or "the whole"
        shown = (
            "" if self.missing or isinstance(self.value, Mapping) else f" = {shorten(self.value)}"
        )
        return f"{where}{shown}: {self.allowed}"


def shorten(value: Any) -> str:
    """The value as it may stand in one line."""
    brief = reprlib.Repr()
    brief.maxstring = brief.maxother = 60
    if isinstance(value, bool):
        return str(value).lower()
    return "null" if value is None else brief.repr(value)


def convert(kind: Any, value: Any, path: KeyPath, problems: list[Problem]) -> Any:
    """The value as the annotated kind; where it does not fit, `problems` grows and None returns."""
    origin = typing.get_origin(kind)
    if dataclasses.is_dataclass(kind):
        return _record(kind, value, path, problems)
    if origin in (Union, types.UnionType):
        return _union(kind, value, path, problems)
    if origin in (tuple, list):
        return _sequence(kind, value, path, problems)
    if origin is Annotated:
        return _ranged(kind, value, path, problems)
    if not _fits(kind, value):
        is_bare = kind is str and type(value) is int
        hint = f""": write "{shorten(value)}", in a shell '"{shorten(value)}"'""" if is_bare else ""
        problems.append(Problem(path, value, f"must be {describe(kind)}{hint}"))
        return None
    return kind(value) if kind in (float, Path) else value


def _fits(kind: Any, value: Any) -> bool:
    """Whether a plain value may stand for the kind: 1 for 1.0, but neither true nor "1"."""
    if typing.get_origin(kind) is Literal:
        return any(type(value) is type(one) and value == one for one in typing.get_args(kind))
    if kind is float:
        return type(value) in (int, float) and is_finite(value)
    if kind in (str, Path):
        return isinstance(value, str) and "\0" not in value and (kind is str or value != "")
    if kind in NAMES:
        return type(value) is kind
    raise TypeError(f"a configuration key cannot be a {kind!r}")


def _ranged(kind: Any, value: Any, path: KeyPath, problems: list[Problem]) -> Any:
    base, *notes = typing.get_args(kind)
    before = len(problems)
    converted = convert(base, value, path, problems)
    inside = all(_is_inside(converted, note) for note in notes if isinstance(note, Range))
    if len(problems) == before and inside:
        return converted
    problems[before:] = [Problem(path, value, f"must be {describe(kind)}")]
    return None


def _is_inside(value: Any, bounds: Range) -> bool:
    if not isinstance(value, int | float):
        return True
    above = bounds.minimum is None or value >= bounds.minimum
    return above and (bounds.maximum is None or value <= bounds.maximum)


def _union(kind: Any, value: Any, path: KeyPath, problems: list[Problem]) -> Any:
    """The first alternative that fits; the mistakes of the only one that is more than null."""
    options = [option for option in typing.get_args(kind) if option is not type(None)]
    if value is None and len(options) < len(typing.get_args(kind)):
        return None
    attempts: list[list[Problem]] = []
    for option in options:
        attempts.append([])
        converted = convert(option, value, path, attempts[-1])
        if not attempts[-1]:
            return converted
    if len(options) == 1 and dataclasses.is_dataclass(options[0]):
        problems.extend(attempts[0])
    else:
        problems.append(Problem(path, value, f"must be {describe(kind)}"))
    return None


def _sequence(kind: Any, value: Any, path: KeyPath, problems: list[Problem]) -> Any:
    items = typing.get_args(kind)
    open_ended = typing.get_origin(kind) is list or items[-1:] == (...,)
    if open_ended and value not in (None, [], ()) and _converts(items[0], value):
        hint = f"write [{value}]" if isinstance(value, str) else f"write [{shorten(value)}]"
        problems.append(Problem(path, value, f"must be {describe(kind)}: {hint}"))
        return None
    if not isinstance(value, list | tuple) or not (open_ended or len(value) == len(items)):
        problems.append(Problem(path, value, f"must be {describe(kind)}"))
        return None
    kinds = [items[0]] * len(value) if open_ended else items
    return tuple(
        convert(one, item, (*path, f"[{index}]"), problems)
        for index, (one, item) in enumerate(zip(kinds, value, strict=True))
    )


def _converts(kind: Any, value: Any) -> bool:
    """Whether a value fits without any mistake."""
    mistakes: list[Problem] = []
    convert(kind, value, (), mistakes)
    return not mistakes


def _record(kind: Any, value: Any, path: KeyPath, problems: list[Problem]) -> Any:
    if value is None:  # a section whose keys are all commented out
        value = {}
    if not isinstance(value, Mapping):
        problems.append(Problem(path, value, f"must be {describe(kind)}"))
        return None
    before = len(problems)
    fields = {field.name: field for field in dataclasses.fields(kind) if field.init}
    problems += _unknown(value, path, kind, list(fields))
    problems += [
        Problem((*path, name), None, "is missing", missing=True)
        for name, field in fields.items()
        if name not in value and _is_required(field)
    ]
    hints = typing.get_type_hints(kind, include_extras=True)
    keys = [name for name in fields if name in value]
    parts = {name: convert(hints[name], value[name], (*path, name), problems) for name in keys}
    return _built(kind, parts, path, problems) if len(problems) == before else None


def _built(kind: Any, parts: dict[str, Any], path: KeyPath, problems: list[Problem]) -> Any:
    try:
        return kind(**parts)
    except (ValueError, GvgbotError) as error:  # the class compares its fields with each other
        problems.append(Problem(path, {}, str(error)))
        return None


def _is_required(field: "dataclasses.Field[Any]") -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def _unknown(
    value: Mapping[Any, Any], path: KeyPath, kind: Any, names: list[str]
) -> Iterator[Problem]:
    """The mistakes of keys that do not exist, with those that do and may be meant."""
    hint = f"; here are {', '.join(names)}"
    for key in (key for key in value if key not in names):
        near = nearest(str(key), names)
        inside = list(_places(kind, str(key))) or ([] if near is None else [near])
        meant = " or ".join(".".join((*path, one)) for one in inside)
        help_ = f"; did you mean {meant}?" if meant else hint
        hint = hint if meant else ""  # once is enough
        yield Problem((*path, str(key)), value[key], f"no such key{help_}")


def _places(kind: Any, name: str) -> Iterator[str]:
    """Where in the sections below a dataclass there are keys of that name."""
    for section, inner in typing.get_type_hints(kind).items():
        if dataclasses.is_dataclass(inner):
            if name in typing.get_type_hints(inner):
                yield f"{section}.{name}"
            yield from (f"{section}.{place}" for place in _places(inner, name))


def describe(kind: Any) -> str:
    """What is allowed, in words that follow "must be"."""
    origin, items = typing.get_origin(kind), typing.get_args(kind)
    if dataclasses.is_dataclass(kind):
        return f"a mapping with keys of {', '.join(f.name for f in dataclasses.fields(kind))}"
    if origin is Annotated:
        bounds = [describe_range(note) for note in items[1:] if isinstance(note, Range)]
        return " ".join([describe(items[0]), *bounds])
    if origin is Literal:
        return f"one of {', '.join(str(item) for item in items)}"
    if origin is list or items[-1:] == (...,):
        return f"a list, each {describe(items[0])}"
    if origin is tuple:
        return f"a list of {len(items)} ({', '.join(describe(item) for item in items)})"
    if items:
        return " or ".join(describe(item) for item in items)
    return NAMES.get(kind, str(kind))


def describe_range(bounds: Range) -> str:
    """The bounds in words."""
    low, high = bounds.minimum, bounds.maximum
    if low is None:
        return "" if high is None else f"of at most {high:.10g}"
    return f"of at least {low:.10g}" if high is None else f"from {low:.10g} to {high:.10g}"
