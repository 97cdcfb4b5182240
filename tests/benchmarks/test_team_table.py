"""The table of several robots calls a failure what must not happen, and compares with one robot."""

import json
from pathlib import Path

import pytest

from benchmarks import team_table
from benchmarks.campaign import Row
from benchmarks.team_table import has_failed, line, main, summary

GOOD: Row = {
    "command": "gvgbot explore --world office --seed 1 --robots 2",
    "world": "office",
    "seed": 1,
    "robots": 2,
    "settings": [],
    "status": 0,
    "outcome": "explored",
    "reason": "no frontier is left",
    "recall": 1.0,
    "precision": 1.0,
    "edge_recall": 1.0,
    "vertex_rmse_m": 0.02,
    "duration_s": 250.0,
    "share": 0.5,
    "joined": 2,
    "wrong_merges": 0,
    "contacts": 0,
    "closest_m": 0.2,
    "sent_kbps": 7.2,
}


@pytest.mark.parametrize(
    "bad",
    [
        {"status": 1},
        {"contacts": 1},
        {"wrong_merges": 1},
        {"closest_m": 0.09},
        {"closest_m": None},
    ],
)
def test_what_must_not_happen_is_a_failure(bad: Row) -> None:
    assert not has_failed(GOOD)
    assert has_failed(GOOD | bad)


def test_a_row_has_what_was_set_at_its_end() -> None:
    words = line(GOOD | {"settings": ["twin.people=3"], "share": None}).split()
    assert words[:4] == ["office", "2", "1", "explored"]
    assert words[-1] == "twin.people=3"
    assert "-" in words  # there is no run of one robot to compare with


def test_the_summary_counts_and_names_failures() -> None:
    bad = GOOD | {"robots": 4, "contacts": 3, "share": 0.7, "command": "gvgbot explore --robots 4"}
    silent = GOOD | {"settings": ["twin.team.silent_s=60"], "share": 0.9}
    told = "\n".join(summary([GOOD, bad, silent]))
    assert "2 robots, 1 runs: 1 explored all" in told
    assert "2 robots, twin.team.silent_s=60, 1 runs: 1 explored all" in told
    assert "mean 0.90, median 0.90, worst 0.90" in told
    assert "contacts 3" in told
    assert "median 0.70, worst 0.70" in told
    assert told.index("failed: 1") < told.index("gvgbot explore --robots 4")


def test_a_run_that_is_kept_is_shown_and_not_run_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / team_table.RESULTS).write_text(json.dumps(GOOD) + "\n", encoding="utf-8")
    assert main(["--worlds", "office", "--out", str(tmp_path)]) == 0
    assert "office" in capsys.readouterr().out
    assert [file.name for file in tmp_path.iterdir()] == [team_table.RESULTS]
