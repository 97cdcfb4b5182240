"""The directory that a run writes: whole files at once, events line by line."""

import contextlib
import io
import json
import math
import os
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Self

import numpy as np

from gvgbot.atomic_files import is_disk_full, write_all, write_files
from gvgbot.errors import GvgbotError, UsageError
from gvgbot.maps.map_server import DESCRIPTION, IMAGE, SEEN

EVENTS, EVENTS_BEFORE = "events.jsonl", "events-before.jsonl"
SUMMARY, MAP, PICTURE = "summary.json", "map.geojson", "map.png"
ESTIMATE, ONLINE = "estimate.tum", "online.tum"  # at the end, and as it was thought on the way
ODOMETRY, TRUTH = "odometry.tum", "truth.tum"
_REPLACED = (MAP, PICTURE, DESCRIPTION, IMAGE, SEEN, "world.yaml", "world.png")  # when it is saved
_MOST_EVENTS = 10_000_000  # bytes, of each of these files


class RunDirectory:
    """Where a run leaves its map; closes its list of events as a context manager or by `close`."""

    def __init__(self, path: Path) -> None:
        """Open the directory of a run, made if it is missing; its events go on where they ended.

        What a power cut has left of an event is cut off. Raises UsageError if the
        directory cannot be written to.
        """
        self.path = path
        self.on_made_again: Callable[[], None] = lambda: None  # when it had been removed
        try:
            path.mkdir(parents=True, exist_ok=True)
            self._device = path.parent.stat().st_dev
            self._events = _list_of_events(path / EVENTS)
        except OSError as error:
            raise _unfit(path, error) from error

    @classmethod
    def create(
        cls,
        out: Path | None = None,
        *,
        world: str,
        runs: Path = Path("runs"),
        after_all: bool = False,
    ) -> Self:
        """The directory of a new run: `out`, or the next `runs/<world>-<n>`.

        The number is greater than that of any run of this world, or of any at all if it shall come
        `after_all`.

        Raises UsageError if the directory cannot be written to, or holds an earlier run, or a map
        of somebody else that this one would replace.
        """
        if out is not None:
            _check_room(out)
        if out is None:
            others = numbers(runs, None if after_all else world)
            out = _next_free(runs, world, 1 + max(others.values(), default=0))
        return cls(out)

    def write(self, contents: Mapping[str, bytes | str]) -> None:
        """Replace these files together; if that fails (GvgbotError), the old ones stand."""
        self._make_again()
        write_files(self.path, contents)

    def write_summary(self, summary: Mapping[str, object]) -> None:
        """Replace `summary.json`; a number that is not finite becomes null."""
        text = json.dumps(plain(summary), indent=2, ensure_ascii=False, allow_nan=False)
        self.write({SUMMARY: text + "\n"})

    def append_event(self, event: object) -> None:
        """Add a line to `events.jsonl`: the fields of a dataclass after its name as `event`.

        When that has become long, it takes the place of the older ones, and a new one begins. Where
        a disk was pulled out and put in again it goes on in the list that is there.
        Raises TypeError if the event is no dataclass, GvgbotError if the line cannot be written.
        """
        line = json.dumps(record_of(event), ensure_ascii=False, allow_nan=False) + "\n"
        try:
            if not _is_at(self._events, self.path / EVENTS):
                self._make_again()
                before, self._events = self._events, _list_of_events(self.path / EVENTS)
                before.close()
            _append(self._events, line.encode())
            if self._events.tell() > _MOST_EVENTS:
                self._turn_over()
        except OSError as error:
            raise GvgbotError(f"cannot write {self.path / EVENTS}: {error.strerror}") from error

    def _make_again(self) -> None:
        """Make the directory, if somebody has removed it and not pulled out its disk."""
        with contextlib.suppress(OSError, UsageError):  # whoever writes there tells
            if self.path.parent.stat().st_dev == self._device:
                self.path.mkdir()
                self.on_made_again()

    def _turn_over(self) -> None:
        """Begin a new list of events; go on with the old one if that is not possible."""
        before = self._events
        with contextlib.suppress(OSError):
            with contextlib.suppress(FileNotFoundError):  # an earlier attempt got so far
                (self.path / EVENTS).replace(self.path / EVENTS_BEFORE)
            self._events = (self.path / EVENTS).open("ab", buffering=0)
            before.close()

    @property
    def is_blank(self) -> bool:
        """Whether no event was ever written here."""
        return self._events.tell() == 0

    def remove_blank(self) -> None:
        """Remove the directory, if nothing is in it but a list of events that is blank."""
        with self._events, contextlib.suppress(OSError):
            if self.is_blank and _is_at(self._events, self.path / EVENTS):
                (self.path / EVENTS).unlink()
                self.path.rmdir()

    @property
    def whereabouts(self) -> list[str]:
        """Where the map is, for people."""
        return [f"map:     {self.path / MAP}", f"picture: {self.path / PICTURE}"]

    @contextlib.contextmanager
    def told_if_interrupted(self, say: Callable[[str], None]) -> Iterator[None]:
        """Say where the map is if Ctrl-C ends the work on it, and a map has been saved."""
        try:
            yield
        except KeyboardInterrupt:
            if (self.path / MAP).exists():
                with contextlib.suppress(OSError):  # whoever read it has gone
                    say("\n".join(self.whereabouts))
            raise

    @contextlib.contextmanager
    def emptied_by_failure(self) -> Iterator[None]:
        """Remove what was written if an error or Ctrl-C ends the work on it, and nothing else."""
        before = set(self.path.iterdir())
        if self.is_blank:
            before.discard(self.path / EVENTS)
        try:
            yield
        except BaseException:
            self.close()
            with contextlib.suppress(OSError):  # the first error is the one to tell
                for path in set(self.path.iterdir()) - before:
                    path.unlink()
                if not before:
                    self.path.rmdir()
            raise

    def close(self) -> None:
        """No more events."""
        self._events.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _list_of_events(path: Path) -> io.FileIO:
    """The file at a path, made if it is missing, to be added to. Raises OSError."""
    _cut_to_lines(path)
    return path.open("ab", buffering=0)


def _is_at(file: io.FileIO, path: Path) -> bool:
    """Whether it is this file that is at a path. Raises OSError."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False


def _cut_to_lines(path: Path) -> None:
    """Cut off what follows the last whole line of a file, made if it is missing. Raises OSError."""
    with path.open("a+b", buffering=0) as file:
        length = file.seek(0, io.SEEK_END)
        file.seek(0)
        lines = file.read(length).rfind(b"\n") + 1
        if lines < length:
            file.truncate(lines)


def _append(file: io.FileIO, content: bytes) -> None:
    """Add all of it to a file, or nothing. Raises OSError."""
    end = file.seek(0, io.SEEK_END)
    try:
        write_all(file.fileno(), content)
    except OSError:
        with contextlib.suppress(OSError):
            file.truncate(end)
        raise


def numbers(runs: Path, world: str | None = None) -> dict[Path, int]:
    """The numbers of the runs in a directory, by their paths: of a world, or all there are."""
    name = ".+" if world is None else re.escape(world)
    found = ((path, re.fullmatch(rf"{name}-(\d+)", path.name)) for path in runs.glob("*"))
    return {path: int(match[1]) for path, match in found if match is not None}


def record_of(event: object) -> dict[str, Any]:
    """An event as its line has it: the fields of the dataclass after its name as `event`."""
    return {"event": event_name(type(event))} | _fields(event)


def event_name(event: type) -> str:
    """What a line calls an event of this type: its name in snake_case."""
    return re.sub(r"(?<=.)([A-Z])", r"_\1", event.__name__).lower()


def plain(value: object) -> Any:
    """The value as JSON has it: dataclasses as objects, arrays as lists, paths as text.

    Numbers that are not finite become null, since JSON has no word for them.
    """
    match value:
        case Enum():
            return plain(value.value)
        case float() | np.floating():
            return float(value) if math.isfinite(value) else None
        case None | str() | bool() | int():
            return value
        case np.generic() | np.ndarray():
            return plain(value.tolist())
        case Mapping():
            return {str(key): plain(item) for key, item in value.items()}
        case list() | tuple():
            return [plain(item) for item in value]
        case _ if is_dataclass(value):
            return _fields(value)
        case _:
            return str(value)


def _fields(value: Any) -> dict[str, Any]:
    return {field.name: plain(getattr(value, field.name)) for field in fields(value)}


def _check_room(path: Path) -> None:
    """Raises UsageError if a run would take the place of another, or of a map that is none."""
    if _holds_run(path):
        raise UsageError(f"{path} holds a run already: choose another directory, or remove it")
    for file in (path / name for name in _REPLACED):
        if file.is_file():
            raise UsageError(f"a run would replace {file}: choose another directory")


def _holds_run(path: Path) -> bool:
    """Whether a run has left anything there: at the end, as it went, or only to go on with."""
    try:
        if any((path / name).exists() for name in (SUMMARY, MAP)) or any(path.glob("*.gvg")):
            return True
        return (path / EVENTS).stat().st_size > 0
    except FileNotFoundError:
        return False
    except OSError as error:
        raise _unfit(path, error) from error


def _next_free(runs: Path, world: str, number: int) -> Path:
    """The first `<world>-<n>` from a number on that did not exist; making it is what claims it."""
    path = runs
    try:
        runs.mkdir(parents=True, exist_ok=True)
        while True:
            path = runs / f"{world}-{number}"
            with contextlib.suppress(FileExistsError):
                path.mkdir()
                return path
            number += 1
    except OSError as error:
        raise _unfit(path, error) from error


def _unfit(path: Path, error: OSError) -> UsageError:
    why, found = error.strerror, Path(error.filename or path)
    if isinstance(error, FileExistsError) and found.is_symlink():
        why = f"{found} is a link to {found.readlink()}, which is not there"
    elif isinstance(error, FileExistsError | NotADirectoryError):
        why = "it is a file"
    remedy = "make room" if is_disk_full(error) else "choose another directory"
    return UsageError(f"cannot write a run to {path}: {why}, {remedy}")
