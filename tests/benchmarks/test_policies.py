"""The table of choices from rows that are written by hand."""

from typing import Any

from benchmarks.policies import COLUMNS, explored_as_well, table


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


def test_a_choice_is_compared_over_the_plans_that_it_and_the_first_have_explored() -> None:
    found = explored_as_well([*ROWS, row(3, "balanced", 31.0)])
    assert {choice: [r["driven_m"] for r in mine] for choice, (mine, _) in found.items()} == {
        "ears": [10.0, 20.0, 30.0],
        "nearest": [12.0, 26.0],
        "balanced": [31.0],
    }
    assert all(
        [r["plan"] for r in mine] == [r["plan"] for r in his] for mine, his in found.values()
    )


def test_the_table_has_means_and_differences_with_their_standard_error() -> None:
    """Differences of 2 and 6: mean 4, deviation sqrt(8), of the mean 2."""
    _, _, ears, nearest = table(ROWS)
    assert ears.startswith("| ears | 3 | 20.0 |")
    assert nearest.startswith("| nearest | 2 | 19.0 (4.0 ± 2.0) |")


def test_where_nothing_is_in_common_there_is_no_mean() -> None:
    *_, nearest = table(ROWS[-2:])
    assert nearest.startswith("| nearest | 0 | – | – |")
