"""A campaign that is interrupted goes on where it was."""

import json
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from benchmarks.campaign import Row, read, rows


class Squares:
    """A campaign that is interrupted at a case."""

    def __init__(self, results: Path | None, interrupted_at: int | None = None) -> None:
        self._results, self._interrupted_at = results, interrupted_at
        self.ran: list[int] = []

    def run(self, cases: list[int]) -> Iterator[Row]:
        for case in cases:
            if case == self._interrupted_at:
                raise KeyboardInterrupt
            self.ran.append(case)
            yield {"case": case, "square": case * case, "ok": case != 3}

    def __call__(self, cases: Iterable[int], *, anew: bool = False) -> list[int]:
        found = rows(
            self._results,
            cases,
            self.run,
            case_of=lambda row: int(row["case"]),
            is_good=lambda row: bool(row["ok"]),
            anew=anew,
        )
        return [row["square"] for row in found]


def test_what_was_done_is_not_done_again(tmp_path: Path) -> None:
    results = tmp_path / "new" / "squares.jsonl"
    first = Squares(results, interrupted_at=5)
    with pytest.raises(KeyboardInterrupt):
        first(range(2, 8))
    assert [json.loads(line)["case"] for line in results.read_text().splitlines()] == [2, 3, 4]
    second = Squares(results)
    assert second(range(2, 8)) == [4, 16, 9, 25, 36, 49]  # what was kept comes first
    assert second.ran == [3, 5, 6, 7]  # 3 was not good
    assert len(read(results)) == 7


def test_what_nobody_asks_for_stays_in_the_file(tmp_path: Path) -> None:
    results = tmp_path / "squares.jsonl"
    Squares(results)([2, 4])
    assert Squares(results)([4]) == [16]
    assert len(read(results)) == 2


def test_anew_is_anew_and_the_newest_counts(tmp_path: Path) -> None:
    results = tmp_path / "squares.jsonl"
    results.write_text('{"case": 2, "square": 5, "ok": true}\n')
    assert Squares(results)([2], anew=True) == [4]
    assert Squares(results)([2]) == [4]


def test_without_a_file_nothing_is_kept() -> None:
    assert Squares(None)([2]) == [4]
    assert read(None) == []
