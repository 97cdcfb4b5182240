"""What is counted of a run, and what is written of it."""

import contextlib
import json
from pathlib import Path

import pytest
import structlog

from gvgbot.autonomy.events import LoopClosed, Recovery
from gvgbot.config import load_config
from gvgbot.errors import GvgbotError
from gvgbot.geometry import Pose, Twist
from gvgbot.hal.messages import Contact, Odometry
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.session import Session
from tests.unit.persistence.test_mission_files import full_disk

STUCK = Recovery(1.0, "look around", "no edge in sight")


def test_a_run_lasts_as_long_as_it_did_though_its_clock_was_set_back(tmp_path: Path) -> None:
    """50 s before that, and 10 s after."""
    with RunDirectory(tmp_path) as directory:
        session = Session(load_config(), directory, None)
        for stamp in (1000.0, 1050.0, 20.0, 30.0):
            session.on_cycle(Odometry(stamp, Pose(), Twist(0.0, 0.0)), None)
        session.save()
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["duration_s"] == pytest.approx(60.0)


def test_each_press_of_a_bumper_is_counted_once_however_long_it_lasts(tmp_path: Path) -> None:
    felt = [
        Contact(0.0),
        None,
        *3 * [Contact(0.0, bumper_left=True)],
        Contact(0.0, cliff_left=True),
    ]
    with RunDirectory(tmp_path) as directory:
        session = Session(load_config(), directory, None)
        for stamp, contact in enumerate(2 * felt):
            session.on_cycle(Odometry(float(stamp), Pose(), Twist(0.0, 0.0)), contact)
        session.save()
    assert json.loads((tmp_path / "summary.json").read_text())["contacts"] == 2


def test_events_are_counted_at_once_and_written_when_there_is_room(tmp_path: Path) -> None:
    closed = LoopClosed(2.0, 3, 25.0, 1.0, 0.1, 0.9)
    with RunDirectory(tmp_path) as directory:
        session = Session(load_config(), directory, None)
        with structlog.testing.capture_logs() as logs, full_disk(10):
            session.on_events([STUCK])
            session.on_events([closed])
        assert [log["event"] for log in logs] == ["events not written, exploring on"]
        assert (session.tally.recoveries, session.tally.closures) == (1, 1)
        assert (tmp_path / "events.jsonl").read_bytes() == b""
        session.on_events([STUCK])
    kinds = [
        json.loads(line)["event"] for line in (tmp_path / "events.jsonl").read_text().splitlines()
    ]
    assert kinds == ["recovery", "loop_closed", "recovery"]


def test_the_map_is_saved_though_events_cannot_be_written(tmp_path: Path) -> None:
    with RunDirectory(tmp_path / "run") as directory:
        session = Session(load_config(), directory, None)
        (directory.path / "events.jsonl").unlink()
        (directory.path / "events.jsonl").mkdir()
        session.on_events([STUCK])
        with pytest.raises(GvgbotError, match=r"cannot write .*events\.jsonl"):
            session.save()
    assert {"map.geojson", "summary.json"} <= {path.name for path in directory.path.iterdir()}


@pytest.mark.parametrize(
    "left", ["nothing", "an event", "an event for which there was no room", "a failure"]
)
def test_only_where_nothing_happened_nothing_is_left_to_keep(tmp_path: Path, left: str) -> None:
    with RunDirectory(tmp_path) as directory:
        session = Session(load_config(), directory, None)
        with contextlib.ExitStack() as stack:
            if "no room" in left:
                stack.enter_context(structlog.testing.capture_logs())
                stack.enter_context(full_disk(0))
            if "event" in left:
                session.on_events([STUCK])
        session.failure = left if left == "a failure" else None
        assert session.is_blank == (left == "nothing")
