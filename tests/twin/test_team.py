"""Two robots in one small world, through the twins of their devices."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest

from gvgbot.config import load_config
from gvgbot.expedition import explore_together

RADIUS = 0.177  # m, of either


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_two_robots_explore_a_world_without_touching_each_other(tmp_path: Path) -> None:
    config = load_config(None, ["twin.world=rooms", "twin.laser.model=URG-04LX"])
    assert explore_together(config, 2, out=tmp_path / "run", real_time=False) == 0
    run = tmp_path / "run"
    summary = json.loads((run / "summary.json").read_text())
    assert summary["outcome"] == "explored"
    assert summary["contacts"] == 0
    ways = []
    for name in summary["robots"]:
        assert json.loads((run / name / "summary.json").read_text())["outcome"] == "explored"
        ways.append(np.loadtxt(run / name / "truth.tum", usecols=(0, 1, 2)))
    for a, b in itertools.combinations(ways, 2):
        both = np.intersect1d(np.round(a[:, 0], 1), np.round(b[:, 0], 1))
        x, y = (
            np.interp(both, a[:, 0], a[:, k]) - np.interp(both, b[:, 0], b[:, k]) for k in (1, 2)
        )
        assert np.hypot(x, y).min() > 2 * RADIUS
    features = json.loads((run / "map.geojson").read_text())["features"]
    assert sum(feature["geometry"]["type"] == "Point" for feature in features) >= 4
