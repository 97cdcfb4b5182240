"""The measure of consistency against errors that are drawn from their covariances."""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.consistency import (
    Watched,
    _mean_nees,
    explore,
    made_worse,
    main,
    revisits,
)
from benchmarks.consistency_report import Row, line, summary, table
from gvgbot.clock import run_in_virtual_time
from gvgbot.config import load_config
from gvgbot.drivers.kobuki.odometry_error import PROFILES, ErringSensors
from gvgbot.errors import ConfigError
from gvgbot.geometry import Pose


def drawn(scale: float, size: int) -> float:
    """The mean NEES of errors that are `scale` times as large as their covariance says."""
    rng = np.random.default_rng(size)
    root = rng.normal(size=(size, size))
    covariance = root @ root.T + 0.1 * np.eye(size)
    errors = scale * rng.multivariate_normal(np.zeros(size), covariance, 20_000)
    found = _mean_nees([(error, covariance) for error in errors])
    assert found is not None
    return found


@pytest.mark.parametrize("size", [2, 3])
def test_honest_errors_have_as_much_nees_as_degrees_of_freedom(size: int) -> None:
    assert drawn(1.0, size) == pytest.approx(size, rel=0.03)
    assert drawn(3.0, size) == pytest.approx(9 * size, rel=0.03)


def test_who_was_far_away_and_comes_back_revisits_and_must_see_the_vertex() -> None:
    there, passing, away = 0.5, 3.0, 12.0
    gaps = np.array([5, there, passing, away, away, passing, there, 2, away, passing, away, there])
    assert revisits(gaps, [1, 2, 7]) == [True, False]  # seen when it was back, not at the end
    assert revisits(gaps, [1, 2, 5, 11]) == [True, True]
    assert revisits(gaps, [6, 7]) == [False]  # the first sight is no revisit
    assert revisits(gaps[:3], [1]) == []


def test_nothing_seen_has_no_nees() -> None:
    assert _mean_nees([]) is None


ROW: Row = {
    "name": "floor_plan:7 7 worn UTM-30LX",
    "odometry": "worn",
    "closures": 3,
    "wrong": 1,
    "twice": 2,
    "vertex_rmse_m": 0.1,
    "end_error_m": 0.2,
    "pose_nees": 3.0,
    "vertex_nees": 2.0,
    "filter_vertex_nees": None,
    "closure_nees": None,
}


def test_the_summary_counts_what_all_runs_did_wrong_and_gives_the_band() -> None:
    """100 runs of 2 degrees of freedom: chi-square with 200, 162.7 to 241.1 in 95 %."""
    said = "\n".join(summary([ROW] * 100))
    assert "band 1.63 to 2.41" in said
    assert "closures 300, wrong 100, vertices twice 200" in said


def test_the_table_has_a_line_for_each_kind_of_world_laser_and_odometry() -> None:
    grid = ROW | {"name": "grid 1 kobuki URG-04LX", "vertex_rmse_m": 0.3}
    counted = {"revisits": 9, "recognised": 8}  # and not in the other row, which is older
    other = ROW | counted | {"name": "floor_plan:8 8 worn UTM-30LX", "vertex_rmse_m": 0.2}
    _, _, plans, streets = table([ROW, grid, other])
    assert plans.startswith("| `floor_plan` | UTM-30LX | `worn` | 2 | 3.00 (0.6 to 7.2) | 2.00 (")
    assert plans.endswith("| – | 6, 2 | 4 | 8 of 9 | 0.150, 0.200 | 0.200 |")
    assert streets.startswith("| `grid` | URG-04LX | `kobuki` | 1 |")
    assert streets.endswith("| 3, 1 | 2 | – | 0.300, 0.300 | 0.200 |")


def test_a_run_with_other_settings_is_another_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, settings = tmp_path / "out.jsonl", ["localisation=paper"]
    row = ROW | {"outcome": "explored", "cpu_s": 9.0}
    with_settings = row | {"settings": settings, "closures": 7}
    rows = [with_settings, row]  # older rows do not say that there were none
    out.write_text("".join(json.dumps(one) + "\n" for one in rows))
    world, seed, odometry, laser = str(ROW["name"]).split()
    usual = ["--worlds", world, "--seeds", seed, "--odometry", odometry, "--lasers", laser]
    usual += ["--out", str(out)]
    main([*usual, "--set", *settings])
    assert capsys.readouterr().out.startswith(line(with_settings))
    main(usual)
    assert capsys.readouterr().out.startswith(line(row))
    with pytest.raises(ConfigError):  # it is run, as it was not yet
        main([*usual, "--set", "localisation=none"])
    assert out.read_text().count("\n") == len(rows)


def driven(*settings: str) -> list[Pose]:
    """odom_base at the keyframes of the first seconds with wheels alone."""
    usual = ["twin.world=ring", "twin.laser.model=URG-04LX", "twin.time_limit_s=8"]
    config = load_config(None, [*usual, "twin.base.odometry=wheels", *settings])
    pipeline = Watched(config)
    run_in_virtual_time(explore(config, pipeline, []))
    return [keyframe.odom_base for keyframe in pipeline.past.keyframes]


def test_a_base_without_a_gyro_is_measured_by_its_wheels() -> None:
    poses = driven()
    assert len(poses) > 5
    assert poses == driven("base.heading=wheels")


def felt_scatter(metres: float = 1.0, tries: int = 2000) -> float:
    """The standard deviation, m, of what a worn base feels of a stretch of so many metres."""
    felt = [
        ErringSensors(PROFILES["worn"], np.random.default_rng(seed)).feel(metres, metres, 0.0, 1.0)
        for seed in range(tries)
    ]
    return float(np.std([left for left, _, _ in felt]))


def test_a_profile_is_made_worse_for_a_while() -> None:
    """0.025 of scale and 0.06 m per root metre, so 0.065 m in a metre, but for what slips add."""
    usual = felt_scatter()
    with made_worse("worn", 4.0):
        assert felt_scatter() == pytest.approx(4.0 * 0.065, rel=0.05)
    assert felt_scatter() == usual == pytest.approx(0.065, rel=0.05)
