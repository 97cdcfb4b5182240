"""Which explorations are kept to be quoted, and where."""

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks.keep_results import keep, main


def run_of(world: str, laser: str = "UTM-30LX", seed: int = 1, more: str = "") -> dict[str, Any]:
    command = f"gvgbot explore --world {world} --seed {seed} --set twin.laser.model={laser}{more}"
    return {"command": command, "world": world, "laser": laser, "seed": seed, "ate_m": 1 / 3}


def kept(path: Path) -> list[tuple[str, str, int]]:
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    return [(row["world"], row["laser"], row["seed"]) for row in rows]


def test_worlds_and_floor_plans_go_to_their_files_in_order(tmp_path: Path) -> None:
    drawn = [run_of("floor_plan:10", seed=10), run_of("floor_plan:9", seed=9)]
    keep([*drawn, run_of("ring", "URG-04LX"), run_of("ring"), run_of("office")], tmp_path)
    assert kept(tmp_path / "worlds.jsonl") == [
        ("office", "UTM-30LX", 1), ("ring", "UTM-30LX", 1), ("ring", "URG-04LX", 1),
    ]  # fmt: skip
    assert kept(tmp_path / "floor_plans.jsonl") == [
        ("floor_plan:9", "UTM-30LX", 9), ("floor_plan:10", "UTM-30LX", 10),
    ]  # fmt: skip


def test_a_file_for_which_there_is_no_run_stays(tmp_path: Path) -> None:
    keep([run_of("ring")], tmp_path)
    keep([run_of("floor_plan:1")], tmp_path)
    assert kept(tmp_path / "worlds.jsonl") == [("ring", "UTM-30LX", 1)]


def test_a_run_with_settings_of_its_own_is_left_out(tmp_path: Path) -> None:
    special = run_of("ring", more=" --set twin.people=5")
    assert set(keep([special, run_of("my_floor")], tmp_path).values()) == {0}
    assert list(tmp_path.iterdir()) == []


def test_runs_with_a_bad_laser_and_people_have_a_file_of_their_own(tmp_path: Path) -> None:
    noise = " --set twin.laser.range_sigma_m=0.03 --set twin.laser.dropout_fraction=0.02"
    rows = [
        run_of("floor_plan:2", seed=2, more=noise),
        run_of("floor_plan:1", seed=1, more=f"{noise} --set twin.people=3"),
        run_of("floor_plan:3", seed=3, more=f"{noise} --set exploration.policy=ears"),
        run_of("floor_plan:4", seed=4, more=" --set twin.people=3"),
        run_of("ring", more=noise),
    ]
    keep(rows, tmp_path)
    assert kept(tmp_path / "rough_floor_plans.jsonl") == [
        ("floor_plan:1", "UTM-30LX", 1), ("floor_plan:2", "UTM-30LX", 2),
    ]  # fmt: skip
    assert [path.name for path in tmp_path.iterdir()] == ["rough_floor_plans.jsonl"]


@pytest.mark.parametrize(("arguments", "status"), [([], 2), (["missing.jsonl"], 1)])
def test_what_cannot_be_kept_is_said_in_a_line(
    arguments: list[str], status: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == status
    assert len(capsys.readouterr().err.splitlines()) == 1
