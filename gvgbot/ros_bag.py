"""A recording as a bag that ROS 2 programs play: what ROS would have heard of that run."""

from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Final, Self

from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from gvgbot.autonomy.loop import Cycle
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.errors import GvgbotError, UsageError
from gvgbot.hal.messages import Scan
from gvgbot.live.past import CORRECTIONS
from gvgbot.live.ros import MAP_EVERY, LiveRos
from gvgbot.replay import Log, Wanted, open_log
from gvgbot.ros2.cdr import definition
from gvgbot.ros2.topics import Topic
from gvgbot.session import new_mind
from gvgbot.survey import survey

_VERSION: Final = 9  # of the format, as Iron and later write it
_LAST = 2**31 - 1  # s since 1970, as ROS counts
_FOR_EVER = QosTime(9_223_372_036, 854_775_807)


def export_bag(recording: Path, out: Path, *, sensors_only: bool) -> list[str]:
    """Write a bag directory, and say what is missing in it.

    The robot's mind lives through the recording once more for its map, unless only what the sensors
    said is wanted. Stamps are those of the robot's clock. One that cannot be finished leaves
    nothing. Raises UsageError for a recording that cannot be read or has a stamp that ROS has not,
    or a directory that exists; GvgbotError if it cannot be written.
    """
    if out.exists():
        raise UsageError(f"{out} exists already; name a new directory")
    log = open_log(Wanted(path=recording, config=None, overrides=[], no_echo_m=None))
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(prefix=".", dir=out.parent) as beside:
            whole = Path(beside) / out.name  # which names the files in it
            with _Bag(whole) as bag:
                _play(log, bag, sensors_only=sensors_only)
            whole.rename(out)
    except OSError as error:
        raise GvgbotError(f"cannot write {out}: {error.strerror}") from error
    return log.flaws()


def _play(log: Log, bag: "_Bag", *, sensors_only: bool) -> None:
    pipeline = _mind(log)
    live = LiveRos([bag], pipeline, log.config.autonomy.odometry_noise, unix=_unix)
    at = due = 0.0
    for at, message in log.messages:
        match message:
            case Scan():
                live.on_scan(message)
                if not sensors_only:
                    _perceive(pipeline, message, live)
            case Cycle():
                if not sensors_only:
                    pipeline.control(message.odometry, message.felt)
                live.on_odometry(message.odometry)
        if at >= due:
            _draw(live, at)
            due = at + MAP_EVERY
    live.doubt(at_last=True)
    _draw(live, at)


def _mind(log: Log) -> Pipeline:
    """The mind that is to live through a log, as that of a replay."""
    pipeline = new_mind(log.config, led=log.led)
    pipeline.mission.survey = partial(survey, pipeline)
    return pipeline


def _perceive(pipeline: Pipeline, scan: Scan, live: LiveRos) -> None:
    happened = pipeline.perceive(scan)
    if any(isinstance(event, CORRECTIONS) for event in happened):
        live.doubt()


def _unix(stamp: float) -> float:
    """The stamp itself. Raises UsageError if no message of ROS can have it."""
    if not 0.0 <= stamp < _LAST:
        raise UsageError(
            f"the recording has a message at {stamp:.10g} s, and ROS counts from 0 to {_LAST} s: "
            "it can only be replayed"
        )
    return stamp


def _draw(live: LiveRos, at: float) -> None:
    draw = live.draw(at)
    if draw is not None:
        draw()


class _Bag:
    """Takes down every message; a context manager that finishes the bag."""

    def __init__(self, path: Path) -> None:
        self._writer = Writer(path, version=_VERSION, storage_plugin=StoragePlugin.MCAP)
        self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        self._connections: dict[Topic, Connection] = {}

    def wants(self, topic: Topic) -> bool:
        """Every topic is wanted."""
        return True

    def send(self, topic: Topic, data: bytes, unix_ns: int) -> None:
        """Take down a message."""
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(
                topic.name,
                topic.message.ros_name,
                msgdef=definition(topic.message),
                rihs01=f"RIHS01_{topic.message.type_hash}",
                offered_qos_profiles=[_qos(topic)],
            )
        self._writer.write(self._connections[topic], unix_ns, data)

    def __enter__(self) -> Self:
        self._writer.open()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._writer.__exit__(kind, error, trace)


def _qos(topic: Topic) -> Qos:
    return Qos(
        QosHistory.KEEP_LAST,
        1 if topic.latched else 10,
        QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL if topic.latched else QosDurability.VOLATILE,
        _FOR_EVER,
        _FOR_EVER,
        QosLiveliness.AUTOMATIC,
        _FOR_EVER,
        avoid_ros_namespace_conventions=False,
    )
