"""Where a run begins: in a new directory, in the one where it ended, or with the map of another."""

import fcntl
import os
import shlex
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import structlog

from gvgbot.config import Config
from gvgbot.errors import UsageError
from gvgbot.maps.map_server import DESCRIPTION
from gvgbot.maps.run_directory import RunDirectory, numbers
from gvgbot.persistence.mission_files import SNAPSHOT, SNAPSHOT_BEFORE, MissionFiles
from gvgbot.persistence.mission_state import Saved
from gvgbot.persistence.records import Damaged

log = structlog.get_logger()


@dataclass(frozen=True, slots=True)
class Wanted:
    """What was asked for: a directory for the run, a run whose map is known, a new map.

    And whether the robot is simulated; None if that makes no difference.
    """

    out: Path | None = None
    known: Path | None = None
    anew: bool = False
    state_dir: Path | None = None
    simulated: bool | None = None


@dataclass(frozen=True, slots=True)
class Start:
    """The directory of the run, the files of its mission, and what is known already."""

    directory: RunDirectory
    files: MissionFiles
    saved: Saved | None = None


def state_directory(config: Config, environment: Mapping[str, str]) -> Path | None:
    """The state directory: the configured one, or the service manager's; None: there is none."""
    given = config.service.state_dir or environment.get("STATE_DIRECTORY", "").partition(":")[0]
    return Path(given) if given else None


def wanted(
    config: Config,
    environment: Mapping[str, str],
    *,
    out: Path | None = None,
    known: Path | None = None,
    anew: bool = False,
) -> Wanted:
    """What options ask for, and the configuration where they say nothing."""
    state_dir, known = state_directory(config, environment), known or config.service.map
    return Wanted(out, known, anew, state_dir, config.twin.enabled)


def begin(wanted: Wanted, *, world: str, stack: ExitStack) -> Start:
    """Where to begin; until the stack is left, no other program may write to that directory.

    What was begun with a known map goes on when that is asked for again. A mission that cannot be
    read is left where it is, and a new one begun: nobody may be there to decide. So is one of a
    simulated robot if this one is real, or the other way round, but for an older one of its kind.
    Raises UsageError if a directory cannot be used or has no map to begin with.
    """
    again = None if wanted.anew or wanted.out is not None else _resumed(wanted, stack)
    if again is not None:
        return again
    known = None if wanted.known is None else _known(wanted.known)
    directory = stack.enter_context(_new(wanted, world))
    directory.on_made_again = stack.enter_context(held(directory.path))
    return Start(directory, MissionFiles(directory.path), known)


def _resumed(wanted: Wanted, stack: ExitStack) -> Start | None:
    """The newest mission of this kind of robot, if it is to go on."""
    begun_with = None if wanted.known is None else _named(wanted.known)
    for path in _newest_first(wanted.state_dir):
        with ExitStack() as held_here:
            hold = held_here.enter_context(held(path))  # first: what is read may grow otherwise
            files = MissionFiles(path)
            try:
                saved = files.read()
            except Damaged as error:
                log.warning("mission cannot be read, a new one begins", reason=str(error))
                return None
            if saved is not None and _is_of_the_other_kind(saved, wanted):
                kind = "a real" if wanted.simulated else "a simulated"
                log.warning("mission passed over", reason=f"it is of {kind} robot", path=str(path))
                continue
            if begun_with is not None and (saved is None or saved.known != begun_with):
                return None
            directory = held_here.enter_context(RunDirectory(path))
            directory.on_made_again = hold
            stack.enter_context(held_here.pop_all())
            return Start(directory, files, saved)
    return None


def _named(path: Path) -> str:
    """The whole path, whatever leads there; one of links in a ring stays as it is."""
    return os.path.realpath(path)


@contextmanager
def held(path: Path) -> Iterator[Callable[[], None]]:
    """Keep other programs from writing a run to this directory meanwhile.

    What is yielded does so once more, where the directory has been removed and made again.
    Raises UsageError if one does so already. The kernel lets go of it whatever ends this program.
    """
    with ExitStack() as holds:
        hold = partial(_hold, path, holds)
        hold()
        yield hold


def _hold(path: Path, holds: ExitStack) -> None:
    directory = os.open(path, os.O_RDONLY)
    holds.callback(os.close, directory)
    try:
        fcntl.flock(directory, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise UsageError(f"{path} is in use: another gvgbot run writes to it; stop that") from error
    except OSError as error:  # not every network file system can do this
        log.debug("run directory not held", reason=str(error))


def _new(wanted: Wanted, world: str) -> RunDirectory:
    if wanted.state_dir is None:
        return RunDirectory.create(wanted.out, world=world)
    runs = wanted.state_dir / "runs"
    return RunDirectory.create(wanted.out, world=world, runs=runs, after_all=True)


def _known(path: Path) -> Saved:
    """The mission of a run, to begin with. Raises UsageError if there is none to be read."""
    if path.is_file():
        raise UsageError(f"cannot begin with {path}: it is a file; {_beside(path)}")
    if not path.exists():
        raise UsageError(f"cannot begin with {path}: there is no such directory")
    try:
        saved = MissionFiles(path).read()
    except Damaged as error:
        raise UsageError(f"cannot begin with {error}; {_other(path)}") from error
    if saved is None:
        raise UsageError(f"cannot begin with {path}: there is no {SNAPSHOT} in it; {_other(path)}")
    return replace(saved, known=_named(path))


def _beside(file: Path) -> str:
    """What may have been meant by a file."""
    if (file.parent / SNAPSHOT).exists():
        return f"give the directory of the run, {file.parent}"
    return f"if it is the map of a map_server, try {_importing(file, file.stem)}"


def _other(path: Path) -> str:
    """What may have been meant by a directory without a mission, or with one that is damaged."""
    if (path / DESCRIPTION).exists():
        return f"try {_importing(path / DESCRIPTION, f'{path}-imported')}"
    runs = sorted(found.parent for found in path.glob(f"*/{SNAPSHOT}"))
    return f"give the directory of a run{f', such as {runs[-1]}' if runs else ''}"


def _importing(file: Path, out: str) -> str:
    """The command that makes a run of a map, as a shell takes it."""
    return shlex.join(["gvgbot", "map", "import", str(file), "--out", out])


def _is_of_the_other_kind(saved: Saved, wanted: Wanted) -> bool:
    """Whether a mission is of a simulated robot and a real one is to go on, or the other way round.

    The truth is known of a simulated one. Of a mission without a journey nobody can tell.
    """
    journey = saved.journey
    if wanted.simulated is None or not journey.stamps:
        return False
    return bool(journey.world_base) != wanted.simulated


def _newest_first(state_dir: Path | None) -> list[Path]:
    """The runs that have left a mission; the one that was begun last has the highest number.

    Times of files would not tell: the clock of a robot may go back when its power is cut.
    """
    if state_dir is None:
        return []
    found = [
        (number, path)
        for path, number in numbers(state_dir / "runs").items()
        if any((path / name).exists() for name in (SNAPSHOT, SNAPSHOT_BEFORE))
    ]
    return [path for _, path in sorted(found, reverse=True)]
