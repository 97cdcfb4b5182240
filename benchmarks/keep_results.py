"""Keep the rows of a table of explorations, for README and docs to quote.

    python -m benchmarks.keep_results RESULTS.jsonl

The runs in named worlds go to benchmarks/results/worlds.jsonl, those in floor plans to
floor_plans.jsonl beside it, each in the place of what was there; a file for which there is no run
stays. Only plain runs count: a world, a seed, a laser, and the default for all the rest. Those of
`explore_table --rough --people N` in floor plans go to rough_floor_plans.jsonl.
"""

import json
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.campaign import Row, short
from benchmarks.explore_table import ROUGH
from gvgbot.worlds import NAMES

RESULTS = Path(__file__).parent / "results"
PLANS = "floor_plan"
LONG = "UTM-30LX"  # the laser that comes first
PLAIN = ["gvgbot", "explore", "--world", "", "--seed", "", "--set", ""]  # as many words
PEOPLE = "twin.people="


def keep(rows: list[Row], to: Path = RESULTS) -> dict[str, int]:
    """Write the plain runs to their files, worlds in order; how many went to each."""
    known = sorted((row for row in rows if _family(row) in NAMES), key=_order)
    worlds = [row for row in known if _family(row) != PLANS]
    plans = [row for row in known if _family(row) == PLANS]
    kept = {
        "worlds.jsonl": [row for row in worlds if not _extras(row)],
        "floor_plans.jsonl": [row for row in plans if not _extras(row)],
        "rough_floor_plans.jsonl": [row for row in plans if is_rough(row)],
    }
    for name, some in kept.items():
        if some:
            lines = (json.dumps(short(row)) for row in some)
            (to / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    return {name: len(some) for name, some in kept.items()}


def is_rough(row: Row) -> bool:
    """Whether only the laser was made worse, and people walked about, if anything."""
    extras = [extra for extra in _extras(row) if not extra.startswith(PEOPLE)]
    return extras == ROUGH


def _extras(row: Row) -> list[str]:
    """What was chosen beside world, seed and laser."""
    return [word for word in shlex.split(row["command"])[len(PLAIN) :] if word != "--set"]


def _family(row: Row) -> str:
    return str(row["world"]).partition(":")[0]


def _order(row: Row) -> tuple[int, int, int, bool]:
    """The order of the built-in worlds, of what they are drawn from, of seeds and lasers."""
    number = row["world"].partition(":")[2]
    is_short = row["laser"] != LONG
    return NAMES.index(_family(row)), int(number or 0), row["seed"], is_short


def main(arguments: Sequence[str]) -> int:
    """Keep what is in the file of the command line."""
    if len(arguments) != 1:
        print("give one file: python -m benchmarks.keep_results RESULTS.jsonl", file=sys.stderr)
        return 2
    try:
        lines = Path(arguments[0]).read_text(encoding="utf-8").splitlines()
    except OSError as error:
        print(f"{arguments[0]}: {error.strerror}", file=sys.stderr)
        return 1
    rows = [json.loads(line) for line in lines]
    kept = keep(rows)
    for name, count in kept.items():
        print(f"{RESULTS / name}: {f'{count} runs' if count else 'as it was'}")
    print(f"left out: {len(rows) - sum(kept.values())}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
