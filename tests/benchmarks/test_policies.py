"""The table of choices from rows that are written by hand."""

from typing import Any

from benchmarks.policies import COLUMNS, explored_by_all, table


def row(plan: int, choice: str, value: float, outcome: str = "explored") -> dict[str, Any]:
    values = {key: value for key, _, _ in COLUMNS}
    return {"name": "", "plan": plan, "choice": choice, "outcome": outcome, **values}


ROWS = [
    row(1, "ears", 10.0),
    row(1, "nearest", 12.0),
    row(2, "ears", 20.0),
    row(2, "nearest", 26.0),
    row(3, "ears", 30.0),
    row(3, "nearest", 99.0, "failed"),
]


def test_only_plans_that_all_choices_have_explored_are_compared() -> None:
    found = explored_by_all(ROWS)
    assert {choice: [r["plan"] for r in rows] for choice, rows in found.items()} == {
        "ears": [1, 2],
        "nearest": [1, 2],
    }


def test_the_table_has_means_and_differences_with_their_standard_error() -> None:
    """Differences of 2 and 6: mean 4, deviation sqrt(8), of the mean 2."""
    _, _, _, _, ears, nearest = table(ROWS)
    assert ears.startswith("| ears | 15.0 |")
    assert nearest.startswith("| nearest | 19.0 (4.0 ± 2.0) |")


def test_nothing_in_common_is_said() -> None:
    assert list(table(ROWS[-2:])) == ["0 plans that were explored whatever the choice."]
