"""Recordings as bags, read by an independent implementation."""

import math
import resource
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability

from gvgbot.autonomy.control.reflexes import Felt
from gvgbot.autonomy.events import (
    ClosureRevoked,
    DoubtSettled,
    Event,
    Finished,
    LoopClosed,
    Recovery,
)
from gvgbot.autonomy.loop import Cycle
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.cli import main
from gvgbot.geometry import Pose, Twist
from gvgbot.hal.messages import Odometry, Scan
from gvgbot.live.ros import LiveRos
from gvgbot.recording.config import RecordingConfig
from gvgbot.recording.recorder import Recorder
from gvgbot.replay import Wanted, open_log
from gvgbot.ros_bag import _mind, _perceive

STILL = Twist()
ROOM = 3.0  # m, half of a square room's side


def scan(stamp: float, x: float) -> Scan:
    """What a laser sees of the room at (x, 0) that looks along x."""
    bearings = -2.0 + 0.01 * np.arange(401)
    with np.errstate(divide="ignore"):
        to_x = np.where(np.cos(bearings) > 0, ROOM - x, ROOM + x) / np.abs(np.cos(bearings))
        to_y = ROOM / np.abs(np.sin(bearings))
    return Scan(stamp, np.minimum(to_x, to_y), -2.0, 0.01, 0.1, 10.0)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """It begins at 100 s."""
    return recorded(tmp_path / "run.mcap", 100.0)


def recorded(path: Path, start: float, *, cycles: int = 200) -> Path:
    """Four seconds straight ahead, at a quarter of a metre a second; then it stands."""
    about = {"title": "room", "config": "{}"}
    with Recorder(RecordingConfig(path=path), about, patient=True) as recorder:
        for k in range(cycles):
            stamp, x = start + 0.02 * k, 0.005 * min(k, 199)
            odometry = Odometry(stamp, Pose(x, 0.0, 0.0), Twist(0.25, 0.0))
            recorder.on_cycle(Cycle(odometry, Felt(), STILL, STILL), None)
            if k % 5 == 4:
                recorder.on_scan(scan(stamp - 0.01, x))
    return path


def messages(bag: Path) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    with AnyReader([bag]) as reader:
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            found.setdefault(connection.topic, []).append(message)
    return found


def test_a_bag_holds_what_ros_would_have_heard(recording: Path, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    assert main(["map", "export", str(recording), str(bag), "--ros-bag"]) == 0
    found = messages(bag)
    assert {topic: len(heard) for topic, heard in found.items() if topic[:4] != "/gvg"} == {
        "/scan": 40,
        "/odom": 200,
        "/tf": 200,
        "/tf_static": 1,
        "/map": 1,  # every five seconds, and what has changed then at the end
    }
    assert found["/scan"][7].ranges == pytest.approx(scan(0.0, 0.195).ranges, rel=1e-6)
    assert found["/odom"][-1].pose.pose.position.x == pytest.approx(0.995)
    children = {t.child_frame_id for t in found["/tf"][-1].transforms}
    assert children == {"odom", "base_link"}
    grid = found["/map"][-1]
    cells = grid.data.reshape(grid.info.height, grid.info.width)
    walls = np.argwhere(cells > 65)[:, ::-1] * grid.info.resolution
    walls += grid.info.origin.position.x, grid.info.origin.position.y
    sides = np.abs(walls + grid.info.resolution / 2).max(axis=1)
    assert len(walls) > 300
    assert sides == pytest.approx(ROOM, abs=0.08)


def test_the_end_of_a_bag_has_what_is_known_then(tmp_path: Path) -> None:
    """Though nothing has happened since the map was drawn last."""
    recording, bag = recorded(tmp_path / "run.mcap", 100.0, cycles=253), tmp_path / "bag"
    assert main(["map", "export", str(recording), str(bag), "--ros-bag"]) == 0
    found = messages(bag)
    told = [array.markers[0].header.stamp for array in found["/gvg/markers"]]
    assert told[-1] == found["/odom"][-1].header.stamp


def test_what_comes_late_is_kept_for_latecomers(recording: Path, tmp_path: Path) -> None:
    assert main(["map", "export", str(recording), str(tmp_path / "bag"), "--ros-bag"]) == 0
    with AnyReader([tmp_path / "bag"]) as reader:
        kept = {
            connection.topic: connection.ext.offered_qos_profiles[0].durability  # type: ignore[union-attr]
            for connection in reader.connections
        }
    latched = {topic for topic, how in kept.items() if how is QosDurability.TRANSIENT_LOCAL}
    assert latched == {"/tf_static", "/map", "/gvg/markers"}


def test_programs_that_map_get_what_the_sensors_said_only(recording: Path, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    command = ["map", "export", str(recording), str(bag), "--ros-bag", "--sensors-only"]
    assert main(command) == 0
    found = messages(bag)
    assert set(found) == {"/scan", "/odom", "/tf", "/tf_static"}
    assert {t.child_frame_id for tf in found["/tf"] for t in tf.transforms} == {"base_link"}


@pytest.mark.parametrize("start", [-0.1, 2.0**31, 3e9])
def test_a_stamp_that_ros_has_not_is_one_line_and_no_bag(
    start: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = recorded(tmp_path / "run.mcap", start)
    assert main(["map", "export", str(path), str(tmp_path / "bag"), "--ros-bag"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"a message at {start:.10g} s" in line
    assert list(tmp_path.iterdir()) == [path]


def test_a_bag_replaces_nothing(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "bag").mkdir()
    assert main(["map", "export", str(recording), str(tmp_path / "bag"), "--ros-bag"]) == 2
    assert "exists already" in capsys.readouterr().err


def test_a_bag_for_which_there_is_no_room_leaves_nothing(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = set(tmp_path.iterdir())
    _, hard = limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, hard))
    try:
        assert main(["map", "export", str(recording), str(tmp_path / "bag"), "--ros-bag"]) == 1
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert "File too large" in capsys.readouterr().err
    assert set(tmp_path.iterdir()) == before


def test_the_mind_of_a_bag_looks_where_something_may_be_missing(recording: Path) -> None:
    """As the one that drove: without that it would be through too soon."""
    log = open_log(Wanted(path=recording, config=None, overrides=[], no_echo_m=None))
    pipeline = _mind(log)
    assert pipeline.mission.survey is not None
    for _, message in log.messages:
        if isinstance(message, Scan):
            pipeline.perceive(message)
        elif isinstance(message, Cycle):
            pipeline.control(message.odometry, message.felt)
    assert pipeline.mission.survey() is not None


class Recogniser(Pipeline):
    """A mind to which each scan brings the same event."""

    def __init__(self, event: Event) -> None:
        self.event = event

    def perceive(self, scan: Scan) -> list[Event]:
        return [self.event]


class Counting(LiveRos):
    """Counts how often the past was doubted."""

    def __init__(self) -> None:
        self.doubts = 0

    def doubt(self, *, at_last: bool = False) -> None:
        self.doubts += 1


@pytest.mark.parametrize(
    ("event", "doubts"),
    [
        (LoopClosed(1.0, 1, 9.0, 0.5, 0.3, 0.9), 1),
        (DoubtSettled(1.0, 2, 1, 9.0, 0.3), 1),
        (ClosureRevoked(1.0, 1), 1),
        (Finished(1.0, "explored", "no frontier is left"), 1),
        (Recovery(1.0, "turned", "stuck"), 0),
    ],
)
def test_the_map_of_a_bag_follows_when_the_past_is_known_better(event: Event, doubts: int) -> None:
    live = Counting()
    _perceive(Recogniser(event), scan(1.0, 0.0), live)
    assert live.doubts == doubts


def test_sensors_only_is_about_bags(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["map", "export", str(tmp_path), "map.svg", "--sensors-only"]) == 2
    assert "--ros-bag" in capsys.readouterr().err


def test_the_room_is_a_room() -> None:
    """The oracle's own check: straight ahead and to the side."""
    seen = scan(0.0, 1.0)
    ahead, left = (int(np.argmin(np.abs(seen.bearings - a))) for a in (0.0, math.pi / 2))
    assert seen.ranges[ahead] == pytest.approx(2.0)
    assert seen.ranges[left] == pytest.approx(3.0, abs=1e-4)
