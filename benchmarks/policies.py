"""Which frontier next: each policy over the same floor plans, with what it drives and how certain.

    python -m benchmarks.policies [--plans FROM TO] [--policies ears nearest balanced]
        [--laser UTM-30LX] [--set key=value ...] [--out FILE]

One run after the other, in this process and in virtual time, each plan with its number as seed. A
line for each: outcome, metres driven, closures, standard deviation of the robot's position (largest
and at the end) and of the map's vertices (mean, at the end), and their RMSE against the truth. FILE
keeps them as lines of JSON; runs that are in there are not run again. Then a table of the means
over the plans that all policies have explored, and by how much each is better than the first, with
the standard error of that difference.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.consistency import known_rows, run
from gvgbot.errors import GvgbotError

POLICIES = ("ears", "nearest", "balanced")
COLUMNS = (
    ("driven_m", "way, m", "{:.1f}"),
    ("closures", "closures", "{:.1f}"),
    ("pose_peak_m", "robot's sigma, largest, m", "{:.3f}"),
    ("pose_last_m", "at the end, m", "{:.3f}"),
    ("vertex_sigma_m", "vertices' sigma at the end, m", "{:.3f}"),
    ("vertex_rmse_m", "vertex RMSE, m", "{:.3f}"),
)

Row = dict[str, Any]


def line(row: Row) -> str:
    """A run in a line."""
    values = (f"{title} {form.format(row[key])}" for key, title, form in COLUMNS)
    return f"{row['name']:36} {row['outcome'] or '-':10.10} " + "  ".join(values)


def explored_by_all(rows: Sequence[Row], policies: Sequence[str]) -> dict[str, list[Row]]:
    """The runs of each policy over the plans that every one has explored, in the same order."""
    done = {
        policy: {r["plan"]: r for r in rows if r["policy"] == policy and r["outcome"] == "explored"}
        for policy in policies
    }
    common = sorted(set.intersection(*(set(plans) for plans in done.values())))
    return {policy: [plans[plan] for plan in common] for policy, plans in done.items()}


def table(rows: Sequence[Row], policies: Sequence[str]) -> Iterator[str]:
    """The means as a table in Markdown; in brackets the mean difference to the first policy."""
    by_policy = explored_by_all(rows, policies)
    count = len(by_policy[policies[0]])
    yield f"{count} plans that all policies have explored."
    if not count:
        return
    yield ""
    yield "| policy | " + " | ".join(title for _, title, _ in COLUMNS) + " |"
    yield "|---" * (len(COLUMNS) + 1) + "|"
    for policy in policies:
        cells = (_cell(by_policy, policies[0], policy, key, form) for key, _, form in COLUMNS)
        yield f"| `{policy}` | " + " | ".join(cells) + " |"


def _cell(by_policy: dict[str, list[Row]], first: str, policy: str, key: str, form: str) -> str:
    mine, theirs = (np.array([row[key] for row in by_policy[p]]) for p in (policy, first))
    mean = form.format(mine.mean())
    if policy == first or len(mine) < 2:
        return mean
    off = mine - theirs
    error = off.std(ddof=1) / np.sqrt(len(off))
    return f"{mean} ({form.format(off.mean())} ± {form.format(error)})"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print a line for each and the table."""
    options = _options(arguments)
    low, high = options.plans
    kept, rows = known_rows(options.out), []
    for plan in range(low, high + 1):
        for policy in options.policies:
            name = f"floor_plan:{plan} {policy} {options.laser}"
            row = kept.get(name) or _row(name, plan, policy, options)
            rows.append(row)
            print(line(row), flush=True)
            if options.out is not None and name not in kept:
                with options.out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
    print("\n".join(table(rows, options.policies)))
    return 0


def _row(name: str, plan: int, policy: str, options: argparse.Namespace) -> Row:
    settings = [
        f"twin.world=floor_plan:{plan}",
        f"twin.seed={plan}",
        f"twin.laser.model={options.laser}",
        f"exploration.policy={policy}",
        *options.overrides,
    ]
    return {"name": name, "plan": plan, "policy": policy, **run(settings)}


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--plans", nargs=2, type=int, metavar=("FROM", "TO"), default=(1, 30))
    parser.add_argument("--policies", nargs="+", choices=POLICIES, default=POLICIES)
    parser.add_argument("--laser", default="UTM-30LX")
    parser.add_argument("--set", dest="overrides", nargs="+", default=[])
    parser.add_argument("--out", type=Path)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except GvgbotError as error:
        sys.exit(str(error))
