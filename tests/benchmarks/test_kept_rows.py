"""Rows that were kept are those of the same settings, older ones had none, and each counts once."""

import json
import sys
from argparse import Namespace
from dataclasses import asdict
from pathlib import Path

import pytest

from benchmarks import errands_table, kidnapping
from benchmarks.keep_results import RESULTS

SETTINGS = ["robot.radius_m=0.2"]


def keep(file: Path, *rows: dict[str, object]) -> None:
    file.write_text("".join(json.dumps(row) + "\n" for row in rows))


@pytest.mark.parametrize(("settings", "verdict"), [(SETTINGS, "right"), ([], "unsure")])
def test_who_wakes_with_other_settings_is_another_case(
    tmp_path: Path, settings: list[str], verdict: str
) -> None:
    row: dict[str, object] = {"world": "ring", "pose": 1}
    keep(
        tmp_path / kidnapping.RESULTS,
        row | {"settings": SETTINGS, "verdict": "right"},
        row | {"settings": ["robot.radius_m=0.3"], "verdict": "wrong"},
        row | {"verdict": "unsure"},
    )
    options = Namespace(worlds=["ring"], poses=1, only=None, overrides=settings, out=tmp_path)
    assert [found["verdict"] for found in kidnapping._rows(options)] == [verdict]


@pytest.mark.parametrize(("settings", "hits"), [(SETTINGS, 3), ([], 5)])
def test_errands_with_other_settings_are_others(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    settings: list[str],
    hits: int,
) -> None:
    out = tmp_path / "out.jsonl"
    older = asdict(errands_table.Score("ring", 1, explored="yes", contacts=5))
    del older["settings"]
    keep(out, older | {"settings": SETTINGS, "contacts": 3}, older)
    chosen = [word for text in settings for word in ("--set", text)]
    monkeypatch.setattr(sys, "argv", ["", "--worlds", "ring", "--out", str(out), *chosen])
    errands_table.main()
    heads, values = (line.split() for line in capsys.readouterr().out.splitlines())
    assert values[heads.index("hits")] == str(hits)


@pytest.mark.parametrize(
    ("kind", "case"),
    [
        ("consistency", "name"),
        ("policies", "name"),
        ("floor_plans", "command"),
        ("rough_floor_plans", "command"),
        ("teams", "command"),
        ("worlds", "command"),
    ],
)
def test_no_run_that_docs_tell_of_is_counted_twice(kind: str, case: str) -> None:
    lines = (RESULTS / f"{kind}.jsonl").read_text(encoding="utf-8").splitlines()
    cases = [json.loads(line)[case] for line in lines]
    assert sorted(set(cases)) == sorted(cases)
