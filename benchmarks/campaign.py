"""Results that outlive a campaign: a line of JSON each, in a file that a later call adds to."""

import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar

ONE_CORE = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # so that --jobs counts cores
DIGITS = 5  # that are kept of a number

Row = dict[str, Any]
Case = TypeVar("Case")


def rows(
    results: Path | None,
    cases: Iterable[Case],
    run: Callable[[list[Case]], Iterable[Row]],
    *,
    case_of: Callable[[Row], Case],
    is_good: Callable[[Row], bool] = lambda row: True,
    anew: bool = False,
) -> Iterator[Row]:
    """The results in the file that belong to the cases, then those of the others from `run`.

    Each new one is kept at once. Of several of one case the last one counts. What is not good is
    run again, and so is everything with `anew`. Without a file nothing is kept.
    """
    kept = {} if anew else {case_of(row): row for row in read(results) if is_good(row)}
    cases = list(cases)
    yield from (kept[case] for case in cases if case in kept)
    for row in run([case for case in cases if case not in kept]):
        if results is not None:
            _append(results, row)
        yield row


def read(results: Path | None) -> list[Row]:
    """What a file of results holds; nothing if there is none."""
    if results is None or not results.exists():
        return []
    return [json.loads(line) for line in results.read_text(encoding="utf-8").splitlines()]


def short(row: Row) -> Row:
    """A row with no more digits than are kept."""
    return {key: _short(value) for key, value in row.items()}


def _short(value: object) -> object:
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def _append(results: Path, row: Row) -> None:
    results.parent.mkdir(parents=True, exist_ok=True)
    with results.open("a", encoding="utf-8") as file:
        file.write(json.dumps(row) + "\n")
