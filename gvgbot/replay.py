"""A recorded run, or a log of somebody else's robot, through the robot's mind once more."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from gvgbot.autonomy.loop import Cycle
from gvgbot.carmen import first_of, messages, read_carmen
from gvgbot.config import Config, config_in, load_config
from gvgbot.errors import ConfigError, UsageError
from gvgbot.hal.messages import Scan
from gvgbot.maps.picture import counts
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.recording import Lived, extra_needed
from gvgbot.session import Session
from gvgbot.words import counted

MCAP = b"\x89MCAP"
CARMEN_CONFIG = Path("carmen.yaml")
NO_ECHO_M = 80.0  # of the lasers that CARMEN logs were made with
_SPARSE_M = 1.0  # between two scans; what they show in common is too little to find slips by


@dataclass(slots=True)
class Log:
    """What is to be replayed: a title, a configuration, and messages by the time they came, s.

    `led` if somebody else drove. `flaws` says, after the last message, what was wrong with it.
    """

    title: str
    config: Config
    messages: Iterator[tuple[float, Lived]]
    led: bool
    flaws: Callable[[], list[str]] = field(default=list)


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """A file to replay, and how: `config` None is the recorded one, or that for CARMEN logs.

    `no_echo_m` is for CARMEN logs alone, and None that of most of them.
    """

    path: Path
    config: Path | None
    overrides: list[str]
    no_echo_m: float | None


def replay(wanted: Wanted, say: Callable[[str], None], *, out: Path | None) -> int:
    """Map a log again, say where the map is, and return the exit status.

    An error leaves no run in the way of the next attempt; Ctrl-C leaves what there is by then.
    Raises UsageError for a log or directory that cannot be used, ConfigError.
    """
    log = open_log(wanted)
    with (
        RunDirectory.create(out, world=log.title) as directory,
        directory.told_if_interrupted(say),
        directory.emptied_by_failure(),
    ):
        session = Session(log.config, directory, place=None, led=log.led)
        session.title, session.failure = log.title, "interrupted"
        try:
            for _, message in log.messages:
                take(session, message)
        except KeyboardInterrupt:
            session.save()
            raise
        session.failure = None
        session.save(unfinished="the log ends here")
    for line in conclusion(session, log):
        say(line)
    return 0


def take(session: Session, message: Lived) -> None:
    """Let a session see a scan, or live through a control cycle."""
    match message:
        case Scan():
            session.on_events(session.pipeline.perceive(message))
        case Cycle():
            session.pipeline.control(message.odometry, message.felt)
            session.on_cycle(message.odometry, message.felt.contact)


def conclusion(session: Session, log: Log) -> list[str]:
    """What came of it, for people."""
    pipeline = session.pipeline
    graph, mission = pipeline.mapper.graph, pipeline.mission
    outcome = f"{mission.outcome}: {mission.reason}; " if mission.outcome else ""
    found = counts(graph.vertices, graph.edges)
    return [
        f"replayed: {outcome}{found}, {pipeline.past.travelled:.0f} m",
        *log.flaws(),
        *session.directory.whereabouts,
    ]


def open_log(wanted: Wanted) -> Log:
    """The log in a file of either kind. Raises UsageError, ConfigError."""
    try:
        _check_kind(wanted.path)
        with wanted.path.open("rb") as file:
            start = file.read(len(MCAP))
    except OSError as error:
        hint = _recordings(wanted.path) if wanted.path.is_dir() else ""
        raise UsageError(f"cannot read {wanted.path}: {error.strerror}{hint}") from error
    if start != MCAP:
        return _carmen(wanted)
    if wanted.no_echo_m is not None:
        raise UsageError(f"--no-echo is about CARMEN logs, and {wanted.path} is none: leave it out")
    return _recording(wanted)


def _check_kind(path: Path) -> None:
    """Raises UsageError for what can be read only once, OSError."""
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise UsageError(f"{path} is a pipe or a device: write what comes of it to a file first")


def _recordings(path: Path) -> str:
    """What to say of the recordings in a directory."""
    if found := sorted(path.glob("*.mcap")):
        return f"; give {' or '.join(map(str, found))}"
    return ", with no recording in it: explore or run with --set recording.path=FILE.mcap makes one"


def _recording(wanted: Wanted) -> Log:
    with extra_needed():
        from gvgbot.recording.messages import CYCLE, SCAN
        from gvgbot.recording.reader import Recording
    recording = Recording(wanted.path)
    if wanted.config is None:
        config = _recorded_config(recording.about.config, wanted)
    else:
        config = load_config(wanted.config, wanted.overrides)

    def flaws() -> list[str]:
        found = {
            "the run went on with an earlier map, which is not here": recording.about.resumed,
            f"left out: {counted(recording.requests, 'request')} to the robot": recording.requests,
            f"{counted(recording.left_out, 'message')} lost to a slow disk": recording.left_out,
            f"damaged pieces that were passed over: {recording.damaged}": recording.damaged,
            "there is not one scan in it": SCAN.topic not in recording.topics,
            "there is nothing in it of how the robot moved": CYCLE.topic not in recording.topics,
            f"{recording.missing} is missing, and what follows it left out": recording.missing,
        }
        cut = [f"{path} ends in the middle, as when a program is killed" for path in recording.cut]
        joined = [f"{path} has another one after its end, left out" for path in recording.joined]
        flaws = [flaw for flaw, is_there in found.items() if is_there] + cut + joined
        return [f"but:     {flaw}" for flaw in flaws]

    return Log(recording.about.title, config, recording.messages(), False, flaws)


def _recorded_config(text: str, wanted: Wanted) -> Config:
    """Raises ConfigError that says what to do about a recording of which nobody can change it."""
    source = f"the configuration in {wanted.path}"
    try:
        return config_in(text, source, wanted.overrides)
    except ConfigError as error:
        if source not in str(error):
            raise
        hint = "--config FILE replays it with another one, such as that of the robot"
        raise ConfigError(f"{error}\n{hint}") from error


def _carmen(wanted: Wanted) -> Log:
    config = load_config(wanted.config or CARMEN_CONFIG, wanted.overrides)
    no_echo_m, base_laser = wanted.no_echo_m or NO_ECHO_M, config.laser.base_laser
    log = read_carmen(wanted.path, no_echo_m=no_echo_m, base_laser=base_laser)
    found = {
        "damaged lines that were passed over": log.damaged_lines,
        "a clock was set back, and later stamps moved on": log.set_back,
    }
    flaws = [f"but:     {first_of(flaw, lines)}" for flaw, lines in found.items() if lines]
    if log.pauses:
        flaws.append(f"but:     long pauses, or a clock that was set: {log.pauses}")
    if log.spacing_m > _SPARSE_M:
        flaws.append(
            f"but:     scans are {log.spacing_m:.1f} m apart: where wheels slipped between two of "
            "them, the map may be wrong"
        )
    if log.is_cut:
        flaws.append(
            "but:     the archive ends in the middle: copy it anew, if there is more of it"
        )
    if (range_m := log.likely_no_echo_m) is not None:
        flaws.append(
            f"but:     the greatest range, {range_m:g} m, comes again and again: if nothing was "
            f"hit there, give --no-echo {range_m:g}"
        )
    title = wanted.path.name.split(".")[0] or "log"
    return Log(title, config, messages(log), True, lambda: flaws)
