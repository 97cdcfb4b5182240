"""A daemon whose laser sees a post of the robot says so, and what leaves that out."""

from pathlib import Path

import numpy as np
import pytest
import structlog

from benchmarks.rigs.run_rig import Daemon
from gvgbot.hal.messages import Scan

pytestmark = pytest.mark.twin


@pytest.mark.parametrize(("post_m", "told"), [(0.14, ["laser.min_range_m=0.16"]), (0.30, [])])
def test_a_post_in_view_is_told_of(tmp_path: Path, post_m: float, told: list[str]) -> None:
    daemon = Daemon(tmp_path)
    with structlog.testing.capture_logs() as logs, daemon.session.directory:
        for k in range(100):
            ranges = np.full(682, 2.0)
            ranges[600:611] = post_m
            daemon.robot._show_scan(Scan(0.1 * k, ranges, -2.09, 0.00614, 0.02, 5.6))
    lines = [line for line in logs if line["event"] == "laser sees a part of the robot"]
    assert [line["remedy"].split(" set ")[1] for line in lines] == told
    assert all(line["beams"] == 11 for line in lines)
