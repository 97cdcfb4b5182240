"""Two robots in one small world, through the twins of their devices."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest

from gvgbot.config import load_config
from gvgbot.expedition import explore_together

RADIUS = 0.177  # m, of either


SECONDS = 25.0  # as much as a test can afford


@pytest.mark.slow
@pytest.mark.timeout(200)
def test_two_robots_set_out_in_one_world_and_leave_their_maps(tmp_path: Path) -> None:
    settings = ["twin.world=rooms", "twin.laser.model=URG-04LX", f"twin.time_limit_s={SECONDS}"]
    run = tmp_path / "run"
    assert explore_together(load_config(None, settings), 2, out=run, real_time=False) == 1
    summary = json.loads((run / "summary.json").read_text())
    assert f"not explored after {SECONDS:g} s" in summary["reason"]
    assert summary["contacts"] == 0
    ways = []
    for name in summary["robots"]:
        assert json.loads((run / name / "summary.json").read_text())["distance_m"] > 2.0
        ways.append(np.loadtxt(run / name / "truth.tum", usecols=(0, 1, 2)))
    for a, b in itertools.combinations(ways, 2):
        both = np.intersect1d(np.round(a[:, 0], 1), np.round(b[:, 0], 1))
        x, y = (
            np.interp(both, a[:, 0], a[:, k]) - np.interp(both, b[:, 0], b[:, k]) for k in (1, 2)
        )
        assert np.hypot(x, y).min() > 2 * RADIUS
    assert json.loads((run / "map.geojson").read_text())["features"]
