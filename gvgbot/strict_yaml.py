"""YAML files and `key=value` overrides into frozen dataclasses: all mistakes in one error."""

import dataclasses
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

import yaml

from gvgbot.conversion import KeyPath, Problem, convert, shorten
from gvgbot.errors import ConfigError

T = TypeVar("T")

EXPONENT = re.compile(r"[-+]?\d[\d_]*(\.[\d_]*)?[eE][-+]?\d+$")


class _Loader(yaml.SafeLoader):
    """Safe YAML that refuses a key given twice, and reads 1e-3 as a number."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode) and key.value in keys - {"<<"}:
                raise yaml.MarkedYAMLError(
                    problem=f"the key {key.value} is given twice", problem_mark=key.start_mark
                )
            keys.add(str(key.value))
        return super().construct_mapping(node, deep)


_Loader.add_implicit_resolver("tag:yaml.org,2002:float", EXPONENT, list("-+0123456789"))


@dataclass(frozen=True, slots=True)
class _Override:
    """One `a.b=c`: where it goes and what it puts there."""

    text: str
    path: KeyPath
    value: Any

    def concerns(self, path: KeyPath) -> bool:
        """Whether a mistake at this path can come from the override."""
        common = min(len(path), len(self.path))
        return path[:common] == self.path[:common]


def packaged(path: Path | str) -> Path:
    """The path itself if it exists, else the packaged file of that name if there is one."""
    inside = Path(str(files("gvgbot") / "configs")) / Path(path).name
    is_bare_name = Path(path).name == str(path)
    return inside if is_bare_name and not Path(path).exists() and inside.exists() else Path(path)


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
    lines += [f"{source}: {one}" for one in in_file if not one.missing or one in in_all]
    lines += [_blame(one, assigned) for one in in_all if one not in in_file]
    if lines:
        raise ConfigError("\n".join(lines))
    assert isinstance(result, cls)
    return result


def _blame(problem: Problem, assigned: Sequence[_Override]) -> str:
    """The line for a mistake that the file alone does not have."""
    culprits = [one.text for one in reversed(assigned) if one.concerns(problem.path)]
    return f"--set {culprits[0]}: {problem}" if culprits else str(problem)


def _read(path: Path) -> tuple[dict[Any, Any], list[str]]:
    """The mapping of a YAML file, and the lines that say why it could not be read."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        return {}, [f"{path}: cannot read the file: {error.strerror}"]
    except UnicodeDecodeError:
        return {}, [f"{path}: not a text file"]
    return _parse(text, str(path))


def _parse(text: str, source: str) -> tuple[dict[Any, Any], list[str]]:
    """The mapping in a YAML text, and the lines that say what is wrong with it."""
    try:
        content = yaml.load(text, _Loader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        return {}, [f"{source}: not valid YAML: {_syntax(error)}"]
    if content is None:
        return {}, []
    if not isinstance(content, dict):
        return {}, [f"{source}: {shorten(content)}: must be a mapping (key: value)"]
    return content, []


def _syntax(error: Exception) -> str:
    """What is wrong with the YAML, in one line with its place."""
    mark = getattr(error, "problem_mark", None)
    what = getattr(error, "problem", None) or str(error).partition("\n")[0]
    return what if mark is None else f"line {mark.line + 1}, column {mark.column + 1}: {what}"


def _parse_override(text: str) -> _Override | str:
    """The override, or the line that says what is wrong with it."""
    key, equals, value = text.partition("=")
    path = tuple(key.strip().split("."))
    if not equals or not all(path):
        return f"--set {text}: must be key=value, such as robot.name=frida"
    try:
        return _Override(text, path, yaml.load(value, _Loader))
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        return f"--set {text}: the value is not valid YAML: {_syntax(error)}"


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
