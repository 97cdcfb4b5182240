"""What to do next: each choice over the same floor plans, with what it drives and how certain.

    python -m benchmarks.policies [--plans FROM TO] [--choices nearest ears ...]
        [--laser URG-04LX] [--set key=value ...] [--out FILE]

The choices are which frontier comes next, and when the robot goes back to what it knows. One run
after the other, in this process and in virtual time, each plan with its number as seed. A line for
each: outcome, metres driven, closures, standard deviation of the robot's position (largest and at
the end) and of the map's vertices (mean, at the end), and their RMSE against the truth. FILE keeps
them as lines of JSON; runs that are in there are not run again. Then a table of the means of each
choice over the plans that the first choice has explored as well, and by how much they differ from
its, with the standard error of that difference.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks import campaign
from benchmarks.campaign import Row
from benchmarks.consistency import run
from gvgbot.errors import GvgbotError

CHOICES = {  # the default comes first: the others are compared with it
    "nearest": "exploration.policy=nearest",
    "ears": "exploration.policy=ears",
    "balanced": "exploration.policy=balanced",
    "p_explore 0.9": "exploration.certainty.p_explore=0.9",
    "p_explore 0.7": "exploration.certainty.p_explore=0.7",
    "pose_sigma 0.1 m": "exploration.certainty.pose_sigma_m=0.1",
    "pose_sigma 0.05 m": "exploration.certainty.pose_sigma_m=0.05",
}
COLUMNS = (
    ("driven_m", "way, m", "{:.1f}"),
    ("closures", "closures", "{:.1f}"),
    ("pose_peak_m", "robot's sigma, largest, m", "{:.3f}"),
    ("pose_last_m", "at the end, m", "{:.3f}"),
    ("vertex_sigma_m", "vertices' sigma at the end, m", "{:.3f}"),
    ("vertex_rmse_m", "vertex RMSE, m", "{:.3f}"),
)


def line(row: Row) -> str:
    """A run in a line."""
    values = (f"{title} {form.format(row[key])}" for key, title, form in COLUMNS)
    return f"{row['name']:36} {row['outcome'] or '-':10.10} " + "  ".join(values)


def explored_as_well(rows: Sequence[Row]) -> dict[str, tuple[list[Row], list[Row]]]:
    """The runs of each choice over the plans that the first one has explored as well, and its."""
    done: dict[str, dict[int, Row]] = {row["choice"]: {} for row in rows}
    for row in rows:
        if row["outcome"] == "explored":
            done[row["choice"]][row["plan"]] = row
    first = next(iter(done.values()))
    common = {choice: sorted(plans.keys() & first.keys()) for choice, plans in done.items()}
    return {
        choice: ([done[choice][plan] for plan in plans], [first[plan] for plan in plans])
        for choice, plans in common.items()
    }


def table(rows: Sequence[Row]) -> Iterator[str]:
    """The means as a table in Markdown; in brackets the mean difference to the first choice."""
    by_choice = explored_as_well(rows)
    first = next(iter(by_choice))
    yield (
        f"| choice | plans that `{first}` explored as well | "
        + " | ".join(title for _, title, _ in COLUMNS)
        + " |"
    )
    yield "|---" * (len(COLUMNS) + 2) + "|"
    for choice, (mine, theirs) in by_choice.items():
        others = [] if choice == first else theirs
        cells = (_cell(mine, others, key, form) for key, _, form in COLUMNS)
        yield f"| {choice} | {len(mine)} | " + " | ".join(cells) + " |"


def _cell(mine: list[Row], theirs: list[Row], key: str, form: str) -> str:
    if not mine:
        return "–"
    values = np.array([row[key] for row in mine])
    mean = form.format(values.mean())
    if len(theirs) < 2:
        return mean
    off = values - [row[key] for row in theirs]
    error = off.std(ddof=1) / np.sqrt(len(off))
    return f"{mean} ({form.format(off.mean())} ± {form.format(error)})"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print a line for each and the table."""
    options = _options(arguments)
    low, high = options.plans
    cases = {
        f"floor_plan:{plan} {choice} {options.laser}": (plan, choice)
        for plan, choice in product(range(low, high + 1), options.choices)
    }
    names, rows = list(cases), []
    for row in campaign.rows(
        options.out,
        names,
        lambda some: (_row(name, *cases[name], options) for name in some),
        case_of=lambda row: str(row["name"]),
        is_good=lambda row: row.get("settings", []) == options.overrides,
    ):
        rows.append(row)
        print(line(row), flush=True)
    rows.sort(key=lambda row: names.index(row["name"]))
    print("\n".join(table(rows)))
    return 0


def _row(name: str, plan: int, choice: str, options: argparse.Namespace) -> Row:
    settings = [
        f"twin.world=floor_plan:{plan}",
        f"twin.seed={plan}",
        f"twin.laser.model={options.laser}",
        CHOICES[choice],
        *options.overrides,
    ]
    found = run(settings)
    kept = {key: found[key] for key in ("outcome", *(key for key, _, _ in COLUMNS))}
    named = {"name": name, "plan": plan, "choice": choice, "settings": options.overrides}
    return named | kept


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--plans", nargs=2, type=int, metavar=("FROM", "TO"), default=(1, 30))
    parser.add_argument("--choices", nargs="+", choices=CHOICES, default=list(CHOICES))
    parser.add_argument("--laser", default="URG-04LX")
    parser.add_argument("--set", dest="overrides", nargs="+", default=[])
    parser.add_argument("--out", type=Path)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except GvgbotError as error:
        sys.exit(str(error))
