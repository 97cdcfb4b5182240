"""A run directory, read back."""

import shlex
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self, TypeVar

import msgspec
import structlog

from gvgbot.errors import UsageError
from gvgbot.geometry import Array, sampled
from gvgbot.maps import geojson
from gvgbot.maps.map_server import read_map_server
from gvgbot.maps.occupancy import OccupancyGrid
from gvgbot.maps.route_graph import RouteGraph
from gvgbot.maps.run_directory import ESTIMATE, EVENTS, EVENTS_BEFORE, MAP, ODOMETRY, SUMMARY
from gvgbot.maps.trajectory import Trajectory, decode_tum

T = TypeVar("T")

_SPACING_M = 0.1  # of the points of a virtual wall

log = structlog.get_logger()


class Happening(msgspec.Struct, frozen=True):
    """A line of the events: what the growth of the map needs of it, the rest is dropped."""

    event: str
    stamp: float  # s
    vertex: int | None = None
    start: int | None = None
    end: int | None = None
    length: float = 0.0  # m


_Line = Annotated[tuple[tuple[float, float], ...], msgspec.Meta(min_length=2)]


class Autonomy(msgspec.Struct, frozen=True):
    """What a map shows of this section of the configuration; corners in m, map frame."""

    virtual_walls: tuple[_Line, ...] = ()


class Settings(msgspec.Struct, frozen=True):
    """What a map shows of the configuration."""

    autonomy: Autonomy = Autonomy()


class Summary(msgspec.Struct, frozen=True):
    """How a run ended; distances in m, durations in s of the robot's clock."""

    outcome: str
    reason: str
    distance_m: float
    duration_s: float
    loop_closures: int | None = None  # of several robots that is not told
    config: Settings = Settings()


@dataclass(frozen=True, slots=True, eq=False)
class SavedRun:
    """What a run left, in the map frame; `summary` is None if it was killed before it wrote one.

    Of several robots it is their joined map: the ways of each are in its own directory in that.
    """

    name: str
    graph: RouteGraph
    grid: OccupancyGrid
    estimate: Trajectory
    odometry: Trajectory
    events: tuple[Happening, ...]
    summary: Summary | None

    @property
    def virtual_walls(self) -> Array:
        """Points (N, 2) of the lines that the robot did not cross, m."""
        walls = () if self.summary is None else self.summary.config.autonomy.virtual_walls
        return sampled(walls, _SPACING_M)

    @classmethod
    def read(cls, directory: Path) -> Self:
        """The run in a directory. Raises UsageError if a file is missing or damaged."""
        if directory.is_file():
            raise UsageError(
                f"{directory} is a file: give the directory of a run; of a recording, gvgbot "
                f"replay {shlex.quote(str(directory))} makes one"
            )
        if not (directory / MAP).exists():
            raise UsageError(_why_there_is_no_map(directory))
        is_joined = bool(robots_in(directory)) and not (directory / ESTIMATE).exists()
        estimate, odometry = (
            decode_tum("") if is_joined else _decoded(directory / name, decode_tum)
            for name in (ESTIMATE, ODOMETRY)
        )
        return cls(
            name=directory.resolve().name,
            graph=_decoded(directory / MAP, geojson.decode),
            grid=read_map_server(directory),
            estimate=estimate,
            odometry=odometry,
            events=_earlier_events(directory) + _events(directory / EVENTS),
            summary=_summary(directory / SUMMARY),
        )


def _why_there_is_no_map(directory: Path) -> str:
    if not directory.exists():
        return f"there is no directory {directory}"
    if (directory / EVENTS).exists():
        return (
            f"{directory} has no {MAP} yet: the robot saves its map with the first vertex, "
            "when it ends, and when asked with gvgbot ctl save"
        )
    return f"{directory} is no run directory: there is no {MAP} in it"


def robots_in(directory: Path) -> list[Path]:
    """The directories of the robots of a run of several, in order."""
    return sorted(path.parent for path in directory.glob(f"*/{MAP}"))


def _text(path: Path, errors: str = "strict") -> str:
    try:
        return path.read_text("utf-8", errors)
    except OSError as error:
        raise UsageError(f"cannot read {path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UsageError(f"cannot read {path}: not text in UTF-8") from error


def _decoded(path: Path, decode: Callable[[str], T]) -> T:
    """What a file's text says; errors name the file."""
    text = _text(path)
    try:
        return decode(text)
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from error


def _earlier_events(directory: Path) -> tuple[Happening, ...]:
    """Those of before the list of events began anew, if it did."""
    path = directory / EVENTS_BEFORE
    return _events(path) if path.exists() else ()


def _events(path: Path) -> tuple[Happening, ...]:
    """Those of all lines that can be read, with one warning if there are others.

    What follows the last whole line is none: a run that was killed may have cut it short.
    """
    *lines, _ = _text(path, "replace").split("\n")
    found = [_happening(line) for line in lines]
    if None in found:
        log.warning(
            "events that cannot be read are left out",
            path=str(path),
            first_line=found.index(None) + 1,
            lines=found.count(None),
        )
    return tuple(happening for happening in found if happening is not None)


def _happening(line: str) -> Happening | None:
    try:
        return msgspec.json.decode(line, type=Happening)
    except (msgspec.MsgspecError, RecursionError):
        return None


def _summary(path: Path) -> Summary | None:
    if not path.exists():
        return None
    try:
        return msgspec.json.decode(_text(path), type=Summary)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise UsageError(f"{path} is no summary of a run: {error}") from error
