"""A whole exploration is recorded; what is replayed from the file is the same run again."""

import json
import math
from collections import deque
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.rigs.run_rig import Network, at_once
from gvgbot.autonomy.loop import Cycle
from gvgbot.cli import main
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.drivers.world import save_world
from gvgbot.hal.messages import Scan
from gvgbot.links import Links
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.maps.trajectory import decode_tum
from gvgbot.playback import PlayedRobot
from gvgbot.recording.config import RecordingConfig
from gvgbot.recording.reader import Recording
from gvgbot.recording.recorder import Recorder
from gvgbot.replay import Wanted, open_log
from gvgbot.session import Session
from gvgbot.tiles import Grid
from tests.twin.lollipop_rig import LOLLIPOP, START

pytestmark = pytest.mark.slow

SAME = ["map.geojson", "map.pgm", "map.yaml", "map.png", "seen.png", "events.jsonl"]
SAME += ["estimate.tum", "online.tum", "odometry.tum"]


@dataclass(frozen=True)
class Recorded:
    """A run directory, and the recording of the run."""

    run: Path
    recording: Path


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """An exploration that bumps into nothing, but goes round a ring; with what was on the wires."""
    directory = tmp_path_factory.mktemp("recorded")
    save_world(LOLLIPOP, directory)
    run, recording = directory / "run", directory / "run.mcap"
    arguments = ["explore", "--world", str(directory / f"{LOLLIPOP.name}.yaml"), "--out", str(run)]
    arguments += ["--start", str(START.x), str(START.y), str(START.theta)]
    arguments += ["--set", f"recording.path={recording}", "--set", "recording.raw_bytes=true"]
    assert main(arguments) == 0
    return Recorded(run, recording)


def test_a_second_recording_of_that_name_is_told_by_its_own(
    recorded: Recorded, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is there stays, and whoever replays should not replay that by mistake."""
    again = [f"recording.path={recorded.recording}", "twin.time_limit_s=5"]
    out = tmp_path / "run"
    main(["explore", "--out", str(out), *(word for one in again for word in ("--set", one))])
    second = recorded.recording.with_name("run-2.mcap")
    assert f"recording: {second}" in capsys.readouterr().out.splitlines()
    assert json.loads((out / "summary.json").read_text())["recording"] == str(second)
    assert second.exists()


def test_a_recording_is_replayed_to_the_same_map_byte_for_byte(
    recorded: Recorded, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(recorded.recording), "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.startswith("replayed: explored")
    for name in SAME:
        assert (tmp_path / name).read_bytes() == (recorded.run / name).read_bytes(), name
    was, now = (json.loads((d / "summary.json").read_text()) for d in (recorded.run, tmp_path))
    for key in ("outcome", "reason", "distance_m", "duration_s", "contacts", "vertices", "config"):
        assert now[key] == was[key]


@pytest.fixture
def cut(recorded: Recorded, tmp_path: Path) -> Path:
    """The first part of the recording, as a killed program leaves it."""
    whole = recorded.recording.read_bytes()
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole[: int(0.4 * len(whole))])
    return path


def test_a_recording_that_was_cut_is_replayed_to_the_cut(
    recorded: Recorded, cut: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(cut), "--out", str(tmp_path / "run")]) == 0
    assert "ends in the middle" in capsys.readouterr().out
    for name in ("odometry.tum", "online.tum"):
        original = (recorded.run / name).read_text()
        again = (tmp_path / "run" / name).read_text()
        assert 0.2 * len(original) < len(again) < 0.6 * len(original)
        assert original.startswith(again)


def test_a_replay_with_another_mind_is_another_run(
    recorded: Recorded, cut: Path, tmp_path: Path
) -> None:
    other = ["--set", "autonomy.keyframe.distance_m=0.5"]
    assert main(["replay", str(cut), "--out", str(tmp_path / "run"), *other]) == 0
    again = (tmp_path / "run" / "online.tum").read_text()
    assert not (recorded.run / "online.tum").read_text().startswith(again)
    config = json.loads((tmp_path / "run" / "summary.json").read_text())["config"]
    assert config["autonomy"]["keyframe"]["distance_m"] == 0.5
    assert config["twin"]["world"].endswith(".yaml")


def test_a_clock_that_was_set_back_meanwhile_changes_no_way(
    recorded: Recorded, tmp_path: Path
) -> None:
    """Whoever reads the stamps of a device of his own may have such a recording."""
    original, path, out = Recording(recorded.recording), tmp_path / "back.mcap", tmp_path / "run"
    about = {"title": original.about.title, "config": original.about.config}
    with Recorder(RecordingConfig(path=path), about, patient=True) as to:
        for at, message in original.messages():
            back = 1000.0 if at > 20.0 else 0.0
            match message:
                case Scan(stamp=stamp):
                    to.on_scan(replace(message, stamp=stamp - back))
                case Cycle(odometry=odometry):
                    told = replace(odometry, stamp=odometry.stamp - back)
                    to.on_cycle(replace(message, odometry=told), None)
    assert main(["replay", str(path), "--out", str(out)]) == 0
    was, now = (json.loads((d / "summary.json").read_text()) for d in (recorded.run, out))
    assert now["distance_m"] == pytest.approx(was["distance_m"], abs=0.01)
    for key in ("outcome", "vertices", "edges"):
        assert now[key] == was[key]


def test_what_is_about_carmen_logs_is_refused_for_a_recording(
    recorded: Recorded, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["replay", str(recorded.recording), "--no-echo", "5"]
    assert main([*words, "--out", str(tmp_path / "run")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "--no-echo is about CARMEN logs" in line
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("size", [3, 8, 30])
def test_a_recording_without_a_beginning_is_one_clear_line(
    size: int, recorded: Recorded, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(recorded.recording.read_bytes()[:size])
    assert main(["replay", str(cut), "--out", str(tmp_path / "run")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert not (tmp_path / "run").exists()


def played(path: Path, out: Path, speed: float, seconds: float) -> Network:
    """What the network gets while a recording is played for so long."""
    log = open_log(Wanted(path=path, config=None, overrides=[], no_echo_m=None))
    network = Network()
    with RunDirectory.create(out, world=log.title) as directory:
        session = Session(log.config, directory, place=None)
        robot = PlayedRobot(session, network, log, speed, at_once)

        async def live() -> None:
            clock = LoopClock()

            async def told() -> str:
                await clock.sleep_until(clock.now() + seconds)
                answer = await network.ask("pause")
                assert not answer.done
                assert "it can only be watched" in answer.text
                return "SIGINT"

            await robot.serve(told(), Links(log.config, clock, None))

        run_in_virtual_time(live())
        session.write_events()
    deque(log.messages, maxlen=0)  # a file that is read to its end is closed
    return network


def test_a_recording_is_played_at_the_pace_of_life_or_faster(
    recorded: Recorded, cut: Path, tmp_path: Path
) -> None:
    online = decode_tum((recorded.run / "online.tum").read_text(encoding="utf-8"))
    states = played(cut, tmp_path / "run", speed=2.0, seconds=5.0).states
    assert states[-1].stamp - states[0].stamp == pytest.approx(10.0, abs=0.3)
    for state in states:
        assert state.cycle_age is None or 0.0 <= state.cycle_age < 0.2
        if state.phase != "exploring":
            continue
        k = int(np.abs(online.stamps - state.stamp).argmin())
        assert np.hypot(*(online.positions[k] - state.pose[:2])) < 0.15
    assert sum(state.phase == "exploring" for state in states) > 0.8 * len(states)


def test_what_is_asked_of_a_recording_is_told_by_its_own_time(cut: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    last = played(cut, out, speed=2.0, seconds=5.0).states[-1]
    events = map(json.loads, (out / "events.jsonl").read_text(encoding="utf-8").splitlines())
    (asked,) = (event for event in events if event["event"] == "requested")
    assert asked["stamp"] == pytest.approx(last.stamp, abs=0.3)


def test_when_a_recording_is_over_the_robot_stands_and_is_still_there(
    cut: Path, tmp_path: Path
) -> None:
    network = played(cut, tmp_path / "run", speed=10.0, seconds=6.0)
    last = network.states[-1]
    assert last.cycle_age is not None
    assert last.cycle_age < 0.2
    assert last.pose == network.states[-20].pose
    assert network.maps[-1].vertices
    assert isinstance(network.whole_grid, Grid)
    assert np.count_nonzero(network.whole_grid.raster().cells > 65) > 100  # walls
    way = network.trajectories[-1]
    assert math.dist(way.map_base[-1, :2], last.pose[:2]) < 0.5
    cycles = {state.stamp: state.cycles for state in network.states}
    assert [health.cycles == cycles[health.stamp] for health in network.healths[-5:]] == [True] * 5
    assert (tmp_path / "run" / "map.geojson").exists()


def test_a_recording_that_is_played_to_its_end_ends_as_the_run_did(
    recorded: Recorded, tmp_path: Path
) -> None:
    last = played(recorded.recording, tmp_path / "run", speed=100.0, seconds=4.0).states[-1]
    assert (last.phase, last.outcome) == ("finished", "explored")
    played_once = (tmp_path / "run" / "map.geojson").read_bytes()
    assert played_once == (recorded.run / "map.geojson").read_bytes()
