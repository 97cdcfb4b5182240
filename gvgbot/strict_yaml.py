"""YAML files and `key=value` overrides into frozen dataclasses: all mistakes in one error."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

import yaml

from gvgbot.conversion import KeyPath, Problem, convert, shorten
from gvgbot.errors import ConfigError
from gvgbot.spelling import nearest
from gvgbot.yaml_text import read_yaml

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class _Override:
    """One `a.b=c`: where it goes and what it puts there."""

    text: str
    path: KeyPath
    value: Any


def packaged(path: Path | str) -> Path:
    """The path itself if it exists, else the packaged file of that name if there is one."""
    inside = _packaged_configs() / Path(path).name
    is_bare_name = Path(path).name == str(path)
    return inside if is_bare_name and not Path(path).exists() and inside.exists() else Path(path)


def _packaged_configs() -> Path:
    return Path(str(files("gvgbot") / "configs"))


def load(cls: type[T], path: Path | None, overrides: Sequence[str] = ()) -> T:
    """The dataclass tree that the file (None: its defaults) and the overrides describe.

    Overrides read `a.b=c` with a YAML value; they win over the file, later ones over earlier.
    Raises ConfigError with a line for every mistake: source, key path, value, what is allowed.
    """
    content, lines = ({}, []) if path is None else _read(path)
    return _loaded(cls, content, lines, str(path), overrides)


def load_text(cls: type[T], text: str, source: str, overrides: Sequence[str] = ()) -> T:
    """As `load`, of YAML that is at hand; `source` is what mistakes in it are blamed on."""
    content, lines = _parse(text, source)
    return _loaded(cls, content, lines, source, overrides)


def has_section(name: str, path: Path, overrides: Sequence[str] = ()) -> bool:
    """Whether a file or an override says anything in a section."""
    content, _ = _read(path)
    return bool(content.get(name)) or any(one.strip().startswith(f"{name}.") for one in overrides)


def _loaded(
    cls: type[T],
    content: dict[Any, Any],
    lines: list[str],
    source: str,
    overrides: Sequence[str],
) -> T:
    assigned: list[_Override] = []
    for text in overrides:
        parsed = _parse_override(text)
        if isinstance(parsed, str):
            lines.append(parsed)
        else:
            assigned.append(parsed)
    in_file: list[Problem] = []
    in_all: list[Problem] = []
    convert(cls, content, (), in_file)
    result = convert(cls, _merged(content, assigned), (), in_all)
    lines += _lost(assigned)
    lines += [f"{source}: {one}" for one in in_file if not one.missing or _has(in_all, one)]
    blamed = [_blame(cls, content, one, assigned) for one in in_all if not _has(in_file, one)]
    if lines + blamed:
        raise ConfigError("\n".join(lines + blamed))
    assert isinstance(result, cls)
    return result


def _has(problems: Sequence[Problem], wanted: Problem) -> bool:
    """Whether one of them reads the same: a value may be NaN, which does not equal itself."""
    return str(wanted) in map(str, problems)


def _lost(assigned: Sequence[_Override]) -> list[str]:
    """A line for each plain value that a later override, of a key in it, would silently replace."""
    lines = []
    for number, one in enumerate(assigned):
        inside = (
            later.text
            for later in assigned[number + 1 :]
            if later.path != one.path and later.path[: len(one.path)] == one.path
        )
        other = None if isinstance(one.value, Mapping | None) else next(inside, None)
        if other is not None:
            lines.append(f"--set {one.text}: cannot go with --set {other}, a key in it")
    return lines


def _blame(
    cls: type, content: dict[Any, Any], problem: Problem, assigned: Sequence[_Override]
) -> str:
    """The line for a mistake that the file alone does not have: the last override that made it."""
    for number in reversed(range(len(assigned))):
        before: list[Problem] = []
        convert(cls, _merged(content, assigned[:number]), (), before)
        if not _has(before, problem):
            return f"--set {assigned[number].text}: {problem}"
    return str(problem)


def _read(path: Path) -> tuple[dict[Any, Any], list[str]]:
    """The mapping of a YAML file, and the lines that say why it could not be read."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        names = [file.stem for file in _packaged_configs().glob("*.yaml")]
        meant = None if path.exists() else nearest(str(path.with_suffix("")), names)
        hint = f"; did you mean {meant}.yaml?" if meant else ""
        return {}, [f"{path}: cannot read the file: {error.strerror}{hint}"]
    except UnicodeDecodeError:
        return {}, [f"{path}: not text in UTF-8"]
    return _parse(text, str(path))


def _parse(text: str, source: str) -> tuple[dict[Any, Any], list[str]]:
    """The mapping in a YAML text, and the lines that say what is wrong with it."""
    try:
        content = read_yaml(text)
    except ValueError as error:
        return {}, [f"{source}: not valid YAML: {error}"]
    if content is None:
        return {}, []
    if not isinstance(content, dict):
        return {}, [f"{source}: {shorten(content)}: must be a mapping (key: value)"]
    return content, []


def _parse_override(text: str) -> _Override | str:
    """The override, or the line that says what is wrong with it."""
    key, equals, value = text.partition("=")
    path = tuple(key.strip().split("."))
    if not equals or not all(path):
        return f"--set {text}: must be key=value, such as robot.name=frida"
    try:
        return _Override(text, path, read_yaml(value))
    except ValueError as error:
        return f"--set {text}: the value is not valid YAML: {error}"


def _merged(content: Mapping[Any, Any], assigned: Sequence[_Override]) -> dict[Any, Any]:
    """The content with every override put in its place."""
    merged = dict(content)
    for override in assigned:
        merged = _put(merged, override.path, override.value)
    return merged


def _put(content: Any, path: KeyPath, value: Any) -> dict[Any, Any]:
    """A copy of the mapping with the value at the path."""
    base = dict(content) if isinstance(content, Mapping) else {}
    head, *rest = path
    base[head] = _put(base.get(head), tuple(rest), value) if rest else value
    return base


def as_mapping(value: Any) -> Any:
    """A dataclass tree as plain mappings, lists and scalars, ready for JSON or YAML."""
    if dataclasses.is_dataclass(value):
        return {
            field.name: as_mapping(getattr(value, field.name))
            for field in dataclasses.fields(value)
        }
    if isinstance(value, list | tuple):
        return [as_mapping(item) for item in value]
    return str(value) if isinstance(value, Path) else value


def dump(value: Any) -> str:
    """A dataclass tree as YAML that `load` reads back."""
    return yaml.safe_dump(as_mapping(value), sort_keys=False, allow_unicode=True)
