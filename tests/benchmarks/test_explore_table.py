"""The table of explorations: what it runs, what it keeps, and what it says of it."""

import json
import os
import shutil
from pathlib import Path
from typing import Any

import distributed
import pytest

from benchmarks.campaign import Row
from benchmarks.explore_table import (
    CRASHED,
    RESULTS,
    _options,
    commands,
    executor,
    main,
    run,
    summary,
)
from gvgbot.cli import parser
from gvgbot.cli.explore import _overrides
from gvgbot.config import load_config
from gvgbot.drivers.world import save_world
from gvgbot.worlds.canvas import Canvas


def run_of(**changes: Any) -> Row:
    row = {
        "command": "gvgbot explore --world attic --seed 1",
        "world": "attic",
        "laser": "UTM-30LX",
        "seed": 1,
        "status": 0,
        "outcome": "explored",
        "reason": "no frontier is left",
        "contacts": 0,
        "recall": 1.0,
        "precision": 1.0,
        "edge_recall": 1.0,
        "path_ratio": 1.0,
        "mean_speed_mps": 0.4,
        "min_clearance_m": 0.5,
    }
    return row | changes


def test_each_command_is_one_that_the_program_takes() -> None:
    worlds = ["--worlds", "office", "floor.yaml:1:-2:0.5", "--seeds", "3", "4"]
    lasers = ["--lasers", "UTM-30LX", "URG-04LX", "--rough"]
    options = _options(
        [*worlds, *lasers, "--people", "2", "--set", "robot.limits.max_speed_mps=0.3"]
    )
    configs = []
    for command in commands(options):
        taken = parser().parse_args(command)
        configs.append(load_config(taken.config, _overrides(taken)))
    assert [(c.twin.world, c.twin.start, c.twin.seed, c.twin.laser.model) for c in configs] == [
        (world, start, seed, laser)
        for world, start in (("office", None), ("floor.yaml", (1.0, -2.0, 0.5)))
        for seed in (3, 4)
        for laser in ("UTM-30LX", "URG-04LX")
    ]
    for config in configs:
        assert config.twin.laser.range_sigma_m == 0.03
        assert config.twin.laser.dropout_fraction == 0.02
        assert config.robot.limits.max_speed_mps == 0.3


def test_the_memory_of_a_run_is_not_that_of_who_started_it(tmp_path: Path) -> None:
    ballast = b"\1" * (400 << 20)
    command = ("explore", "--world", "nowhere", "--seed", "1", "--set", "twin.laser.model=UTM-30LX")
    row = run(command, tmp_path / "run")
    assert len(ballast) == 400 << 20
    assert row["status"] == 2
    assert 10 < row["memory_mb"] < 300


def test_each_floor_plan_is_drawn_and_run_with_its_own_number() -> None:
    drawn = commands(_options(["--worlds", "--plans", "3"]))
    assert [c[1:5] for c in drawn] == [
        ("--world", f"floor_plan:{number}", "--seed", str(number)) for number in (1, 2, 3)
    ]


def test_people_are_in_a_tenth_of_the_runs_for_both_lasers() -> None:
    lasers = ["--lasers", "UTM-30LX", "URG-04LX"]
    drawn = commands(_options(["--worlds", "--plans", "40", "--people", "2", *lasers]))
    crowded = [c[2] for c in drawn if "twin.people=2" in c]
    assert crowded == [f"floor_plan:{n}" for n in (10, 10, 20, 20, 30, 30, 40, 40)]


def test_the_summary_has_means_and_extremes_of_each_laser() -> None:
    rows = [
        run_of(recall=1.0, path_ratio=1.0, min_clearance_m=0.5),
        run_of(recall=0.5, path_ratio=4.0, min_clearance_m=0.3, world="cellar", seed=7),
        run_of(recall=None, path_ratio=1.2, min_clearance_m=0.4),
        run_of(laser="URG-04LX"),
    ]
    text = "\n".join(summary(rows))
    assert "UTM-30LX: 3 of 3 runs explored all (100.0%)" in text
    assert "mean 0.750, worst 0.500 (cellar, seed 7)" in text
    assert "median way over shortest tour: 1.2\n" in text
    assert "least clearance, m: 0.3\n" in text
    assert "URG-04LX: 1 of 1" in text


@pytest.mark.parametrize(
    "changes",
    [
        {"status": 1, "outcome": "failed", "reason": "no wall in sight"},
        {"contacts": 2},
        {"status": -9, "outcome": "crashed", "contacts": None, "recall": None},
    ],
    ids=["unfinished", "touched", "killed"],
)
def test_a_failure_is_listed_with_the_command_that_repeats_it(changes: Row) -> None:
    command = "gvgbot explore --world cellar --seed 7"
    *_, failed, listed = summary([run_of(), run_of(command=command, **changes)])
    assert failed == "  failed: 1"
    assert listed.splitlines()[0].strip() == command


@pytest.mark.slow
def test_the_workers_of_a_cluster_run_what_threads_would(tmp_path: Path) -> None:
    """A process of its own; a world that does not exist takes it no time."""
    (wanted,) = commands(_options(["--worlds", "nowhere", "--seeds", "2"]))
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as far,
        executor(1, far.scheduler_address) as pool,
    ):
        row = pool.submit(run, wanted, tmp_path / "run").result()
        assert pool.submit(os.getpid).result() != os.getpid()
    assert (row["seed"], row["status"], row["outcome"]) == (2, 2, CRASHED)
    assert "unknown world 'nowhere'" in row["reason"]


def test_a_scheduler_that_is_not_there_is_said_in_a_line() -> None:
    with pytest.raises(SystemExit, match="no scheduler at nonsense"):
        executor(1, "nonsense").__enter__()


@pytest.mark.slow
def test_runs_are_scored_and_kept_and_not_run_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    canvas = Canvas(9.0, 9.0)
    canvas.carve_path([(2.0, 2.0), (7.0, 2.0), (7.0, 7.0)], 1.6)
    world = save_world(canvas.world("bend"), tmp_path)
    out = tmp_path / "out"
    arguments = ["--out", str(out), "--jobs", "1", "--worlds", f"{world}:3:2:0"]

    assert main(arguments) == 0
    (row,) = map(json.loads, (out / RESULTS).read_text().splitlines())
    assert (row["outcome"], row["status"], row["recall"], row["precision"]) == (
        "explored", 0, 1.0, 1.0,
    )  # fmt: skip
    (directory,) = (path for path in out.iterdir() if path.is_dir())
    shutil.rmtree(directory)
    capsys.readouterr()

    in_a_wall = f"{world}:1:1:0"
    assert main([*arguments, in_a_wall]) == 1
    assert not directory.exists()
    assert len((out / RESULTS).read_text().splitlines()) == 2
    printed = capsys.readouterr().out
    assert "1 of 2 runs explored all" in printed
    assert f"gvgbot explore --world {world} --start 1 1 0 --seed 1" in printed
    assert "inside a wall" in printed
