"""Two robots in one small world, through the twins of their devices."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gvgbot.geometry import Array
from gvgbot.team.troubles import Troubles, TroublesConfig

RADIUS = 0.177  # m, of either
LEAST_GAP = 0.1  # m between both
SECONDS = 11.0  # as much as a test can afford
LATE = 6.0  # s


def explore(run: Path, *settings: str, hash_seed: int = 0) -> dict[str, object]:
    """The summary of two robots' first seconds in `rooms`, in a process of its own."""
    texts = ["twin.laser.model=URG-04LX", f"twin.time_limit_s={SECONDS}", *settings]
    options = [word for text in texts for word in ("--set", text)]
    command = [sys.executable, "-m", "gvgbot", "explore", "--world", "rooms", "--robots", "2"]
    done = subprocess.run(
        [*command, *options, "--out", str(run)],
        env=os.environ | {"PYTHONHASHSEED": str(hash_seed)},
        capture_output=True,
        check=False,
    )
    assert done.returncode == 1, done.stderr
    found: dict[str, object] = json.loads((run / "summary.json").read_text())
    return found


def way(run: Path, name: str) -> Array:
    """Where a robot was (N, 3): s, m, m."""
    return np.loadtxt(run / name / "truth.tum", usecols=(0, 1, 2))


def gap(one: Array, two: Array) -> float:
    """The least distance between both bodies."""
    stamps = np.union1d(one[:, 0], two[:, 0])
    x, y = (
        np.interp(stamps, one[:, 0], one[:, k]) - np.interp(stamps, two[:, 0], two[:, k])
        for k in (1, 2)
    )
    return float(np.hypot(x, y).min()) - 2 * RADIUS


@pytest.mark.slow
def test_equal_seeds_leave_equal_maps_to_the_byte(tmp_path: Path) -> None:
    """Also where the interpreter orders its sets otherwise."""
    first, second = tmp_path / "first", tmp_path / "second"
    summary = explore(first, hash_seed=1)
    explore(second, hash_seed=2)
    assert f"not explored after {SECONDS:g} s" in str(summary["reason"])
    assert summary["contacts"] == 0
    ways = [way(first, f"robot-{number}") for number in (1, 2)]
    assert all(np.ptp(w[:, 1:], axis=0).max() > 1.0 for w in ways)
    assert gap(*ways) >= LEAST_GAP
    assert json.loads((first / "map.geojson").read_text())["features"]
    files = ["map.geojson", "map.pgm", "truth.tum", "online.tum", "events.jsonl"]
    names = ["map.geojson", *(f"robot-{number}/{file}" for number in (1, 2) for file in files)]
    for name in names:
        assert (first / name).read_bytes() == (second / name).read_bytes(), name


@pytest.mark.slow
def test_one_robot_may_come_late_and_one_break_down(tmp_path: Path) -> None:
    run = tmp_path / "run"
    troubles = [f"twin.team.late_s={LATE}", "twin.team.breaks_down=true", "twin.team.within_s=9"]
    troubles += ["twin.team.silent_s=5", "twin.seed=2"]  # with which these are two
    summary = explore(run, *troubles, "twin.time_limit_s=15")
    reasons = str(summary["reason"]).split("; ")
    broken = [f"robot-{n}" for n, reason in enumerate(reasons, 1) if "broke down" in reason]
    assert len(broken) == 1
    ways = {name: way(run, name) for name in ("robot-1", "robot-2")}
    begins = sorted(w[0, 0] for w in ways.values())
    assert begins[1] - begins[0] == pytest.approx(LATE, abs=1.0)
    stops = ways[broken[0]]
    assert stops[-1, 0] - stops[0, 0] < 9.0
    (other,) = ways.keys() - set(broken)
    assert ways[other][-1, 0] - ways[other][0, 0] > 14.0
    assert gap(*ways.values()) >= LEAST_GAP


@pytest.mark.slow
def test_who_comes_late_breaks_down_no_later_for_it(tmp_path: Path) -> None:
    run, seed = tmp_path / "run", 5  # with which the late one breaks down on its way
    troubles = ["twin.team.late_s=3", "twin.team.breaks_down=true", "twin.team.within_s=9"]
    explore(run, *troubles, f"twin.seed={seed}", "twin.time_limit_s=7")
    config = TroublesConfig(late_s=3.0, breaks_down=True, within_s=9.0)
    moment = Troubles(config, 2, seed).breaks_down_s(0)
    late, other = way(run, "robot-1"), way(run, "robot-2")
    assert late[0, 0] - other[0, 0] == pytest.approx(3.0, abs=1.0)
    assert late[-1, 0] - other[0, 0] == pytest.approx(moment, abs=0.5)
