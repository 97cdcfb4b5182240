"""Fills what README and docs quote from benchmarks/results: python -m docs.make_tables.

What stands between these two lines is written from the file, by the view that is named in brackets
with its arguments:

    <!-- from: benchmarks/results/worlds.jsonl (summary) -->
    <!-- end -->
"""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path

from benchmarks import (
    consistency_report,
    explore_table,
    patrol,
    policies,
    relations,
    reliability,
    sabotage,
    team_table,
)
from benchmarks.campaign import Row
from benchmarks.faults import draw

ROOT = Path(__file__).parents[1]
QUOTE = re.compile(
    r"^(?P<head><!-- from: (?P<file>\S+) \((?P<view>[^()]+)\) -->\n).*?^(?P<tail><!-- end -->)$",
    re.M | re.S,
)


def pages() -> Iterator[Path]:
    """README and what is in docs."""
    yield ROOT / "README.md"
    yield from sorted((ROOT / "docs").rglob("*.md"))


def filled(text: str) -> str:
    """The text with all that it quotes as it is in the files now."""
    return QUOTE.sub(lambda m: f"{m['head']}\n{_quote(m['file'], m['view'])}\n\n{m['tail']}", text)


def _quote(file: str, view: str) -> str:
    name, *arguments = view.split()
    return VIEWS[name](_rows(ROOT / file), *arguments)


def _rows(path: Path) -> list[Row]:
    """Of a file with a row a line, or of one object with all of them as `rows`."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".jsonl":
        return [json.loads(line) for line in text.splitlines()]
    found: list[Row] = json.loads(text)["rows"]
    return found


def summary(rows: list[Row]) -> str:
    """What the runs with each laser have in common."""
    last = rows[-1]["world"].partition(":")[2]
    where = f"the buildings 1 to {last}" if last else "the built-in worlds"
    told = "\n".join(explore_table.summary(rows)).strip().splitlines()
    return f"Of {len(rows)} runs, in {where}:\n\n{_block(told)}"


def last_words(rows: list[Row], world: str, directory: str) -> str:
    """What the first run in a world prints at its end, if it writes to the directory."""
    row = next(row for row in rows if row["world"] == world)
    return _block(
        [
            f"{row['outcome']}: {row['reason']}; {row['vertices']} vertices, {row['edges']} edges, "
            f"{row['distance_m']:.0f} m driven",
            f"map:     {directory}/map.geojson",
            f"picture: {directory}/map.png",
        ]
    )


def mappers(rows: list[Row]) -> str:
    """Errors and time of each mapper of a log."""
    return _block([relations.HEAD, *map(relations.line, rows)])


def teams(rows: list[Row]) -> str:
    """A line for each run of several robots, and what these have in common."""
    lines = [team_table.HEAD, *map(team_table.line, rows)]
    return _block([*lines, *"\n".join(team_table.summary(rows)).splitlines()])


def choices(rows: list[Row]) -> str:
    """What each choice of what to do next costs, and what it is good for."""
    return "\n".join(policies.table(rows))


def nees(rows: list[Row]) -> str:
    """How honest the covariances are, by kind of world, laser and odometry."""
    return "\n".join(consistency_report.table(rows))


def hours(rows: list[Row], every: str) -> str:
    """A line for the first hour of a patrol, and for every so manieth."""
    shown = [row for row in rows if row["hour"] == 1 or row["hour"] % int(every) == 0]
    return _block([patrol.HEAD, *map(patrol.line, shown)])


def totals(rows: list[Row]) -> str:
    """How much a campaign was."""
    return "\n".join(reliability.totals(rows))


def faults(rows: list[Row]) -> str:
    """The faults of a campaign by class."""
    return "\n".join(reliability.by_layer(rows))


def oracles(rows: list[Row]) -> str:
    """What must not happen in a campaign, and where it did."""
    return "\n".join(reliability.by_oracle(rows))


def trial(rows: list[Row], seed: str) -> str:
    """What befell one robot of a campaign, and what became of it."""
    row = next(row for row in rows if row["seed"] == int(seed))
    return _block([*map(str, draw(int(seed))), *reliability.story(row)])


def sabotages(rows: list[Row]) -> str:
    """Which oracles noticed what was broken on purpose."""
    return "\n".join(sabotage.table(rows))


def _block(lines: list[str]) -> str:
    return "\n".join(["```", *lines, "```"])


VIEWS: dict[str, Callable[..., str]] = {
    "summary": summary,
    "last_words": last_words,
    "mappers": mappers,
    "teams": teams,
    "hours": hours,
    "choices": choices,
    "nees": nees,
    "totals": totals,
    "faults": faults,
    "oracles": oracles,
    "trial": trial,
    "sabotages": sabotages,
}


if __name__ == "__main__":
    for page in pages():
        text = page.read_text(encoding="utf-8")
        if (new := filled(text)) != text:
            page.write_text(new, encoding="utf-8")
