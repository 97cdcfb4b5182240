"""What is counted of a run."""

import json
from pathlib import Path

import pytest

from gvgbot.config import load_config
from gvgbot.geometry import Pose, Twist
from gvgbot.hal.messages import Odometry
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.session import Session


def test_a_run_lasts_as_long_as_it_did_though_its_clock_was_set_back(tmp_path: Path) -> None:
    """50 s before that, and 10 s after."""
    with RunDirectory(tmp_path) as directory:
        session = Session(load_config(), directory, None)
        for stamp in (1000.0, 1050.0, 20.0, 30.0):
            session.on_cycle(Odometry(stamp, Pose(), Twist(0.0, 0.0)), None)
        session.save()
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["duration_s"] == pytest.approx(60.0)
