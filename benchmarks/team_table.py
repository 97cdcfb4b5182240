"""Explore worlds with several robots and print a table, each time beside that of one robot.

    python -m benchmarks.team_table [--worlds office floor_plan:7 ...] [--robots 2 4] [--seed N]
        [--plans FIRST LAST] [--set key=value ...] [--out DIR]

Each world is explored by each number of robots, the floor plans FIRST to LAST with their own
numbers as seeds. Runs are scored by benchmarks.score_team, and their duration is compared with
that of one robot in benchmarks/results, if the same world was explored with the same seed. DIR
keeps the run directories and a line for each in results.jsonl. A run that is in there already is
shown, but not run again unless it crashed.

A run fails if it did not explore all, touched something, joined two maps wrongly, or came nearer
than a decimetre to another robot. The exit status is 0 only if no run failed.
"""

import argparse
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from statistics import fmean, median

from benchmarks import campaign
from benchmarks.campaign import Row
from benchmarks.explore_table import CRASHED
from benchmarks.keep_results import RESULTS as KEPT
from benchmarks.score_team import score_team
from gvgbot.errors import GvgbotError

RESULTS = "results.jsonl"
LEAST_GAP_M = 0.1  # between two robots
LASER = "UTM-30LX"
COLUMNS = (
    ("recall", "recall", "{:.3f}"),
    ("precision", "prec", "{:.3f}"),
    ("edge_recall", "edges", "{:.3f}"),
    ("vertex_rmse_m", "rmse", "{:.3f}"),
    ("duration_s", "s", "{:.0f}"),
    ("share", "share", "{:.2f}"),
    ("joined", "joined", "{}"),
    ("wrong_merges", "wrong", "{}"),
    ("contacts", "hits", "{}"),
    ("closest_m", "gap", "{:.2f}"),
    ("sent_kbps", "kB/s", "{:.1f}"),
)
HEAD = "world            robots seed outcome  " + " ".join(f"{t:>6}" for _, t, _ in COLUMNS)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print the table and the summary; 0 if no run failed."""
    options = _options(arguments)
    out = options.out or Path(tempfile.mkdtemp(prefix="team-", dir="runs"))
    commands = {shlex.join(["gvgbot", *c]): c for c in _commands(options)}
    found = campaign.rows(
        out / RESULTS,
        commands,
        lambda texts: (run(commands[text], out) for text in texts),
        case_of=lambda row: str(row["command"]),
        is_good=lambda row: row["outcome"] != CRASHED,
    )
    print(f"results: {out / RESULTS}")
    print(HEAD)
    rows = []
    for row in found:
        rows.append(row)
        print(line(row), flush=True)
    print("\n".join(summary(rows)))
    return int(any(has_failed(row) for row in rows))


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--worlds", nargs="*", default=[])
    parser.add_argument("--robots", nargs="+", type=int, default=[2])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--plans", nargs=2, type=int, default=(1, 0), metavar=("FIRST", "LAST"))
    parser.add_argument("--set", dest="overrides", nargs="+", default=[])
    parser.add_argument("--out", type=Path, help="default: a new directory in runs/")
    return parser.parse_args(arguments)


def _commands(options: argparse.Namespace) -> Iterator[tuple[str, ...]]:
    first, last = options.plans
    worlds = [(world, options.seed) for world in options.worlds]
    worlds += [(f"floor_plan:{number}", number) for number in range(first, last + 1)]
    settings = [word for item in options.overrides for word in ("--set", item)]
    for world, seed in worlds:
        for robots in options.robots:
            place = ("--world", world, "--seed", str(seed), "--robots", str(robots))
            yield ("explore", *place, *settings)


def run(command: tuple[str, ...], out: Path) -> Row:
    """Explore once, as a process of its own, and score what it leaves."""
    directory = out / re.sub(r"[^\w.]+", "-", " ".join(command[1:])).strip("-")
    shutil.rmtree(directory, ignore_errors=True)  # of an attempt that crashed
    done = subprocess.run(
        [sys.executable, "-m", "gvgbot", *command, "--out", str(directory)],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | campaign.ONE_CORE,
    )
    world, seed, robots = (
        command[command.index(key) + 1] for key in ("--world", "--seed", "--robots")
    )
    row: Row = {
        "command": shlex.join(["gvgbot", *command]),
        "world": world,
        "seed": int(seed),
        "robots": int(robots),
        "settings": [text for word, text in pairwise(command) if word == "--set"],
        "status": done.returncode,
    }
    try:
        row |= _said(directory) | score_team(directory)
    except (GvgbotError, OSError) as error:
        return row | {"outcome": CRASHED, "reason": (done.stderr.strip() or str(error))[-200:]}
    alone = _alone_s(world, int(seed))
    return row | {"share": None if alone is None else row["duration_s"] / alone}


def _said(directory: Path) -> Row:
    """What a run says of itself; traffic of the robot that sent most, in kB/s."""
    found = json.loads((directory / "summary.json").read_text(encoding="utf-8"))
    rates = [
        sent / duration
        for sent, duration in zip(found["sent_bytes"], found["durations_s"], strict=True)
        if duration > 0
    ]
    return {"reason": found["reason"], "sent_kbps": max(rates, default=0.0) / 1000}


def _alone_s(world: str, seed: int) -> float | None:
    """How long one robot took in the same world with the same seed, if that is kept."""
    kept = [row for name in ("worlds", "floor_plans") for row in campaign.read(_kept(name))]
    wanted = world, seed, LASER
    found = (row for row in kept if (row["world"], row["seed"], row["laser"]) == wanted)
    return next((float(row["duration_s"]) for row in found), None)


def _kept(name: str) -> Path:
    return KEPT / f"{name}.jsonl"


def has_failed(row: Row) -> bool:
    """Whether the run did not explore all, touched something, or joined or came too close."""
    return (
        row["status"] != 0
        or row.get("contacts") != 0
        or row.get("wrong_merges") != 0
        or (row.get("closest_m") or 0.0) < LEAST_GAP_M
    )


def line(row: Row) -> str:
    """A row of the table."""
    cells = [form.format(row[key]) if row.get(key) is not None else "-" for key, _, form in COLUMNS]
    outcome = row["outcome"].removeprefix("explored_with_")
    words = [f"{row['world']:16} {row['robots']:6} {row['seed']:4} {outcome:8}"]
    return " ".join([*words, *(f"{cell:>6}" for cell in cells), *row["settings"]])


def summary(rows: list[Row]) -> list[str]:
    """What runs with as many robots and the same settings have in common, and those that failed."""
    told = []
    for robots, settings in sorted({(row["robots"], tuple(row["settings"])) for row in rows}):
        kind = (robots, list(settings))
        some = [r for r in rows if (r["robots"], r["settings"]) == kind and "recall" in r]
        shares = [row["share"] for row in some if row.get("share") is not None]
        name = ", ".join([f"{robots} robots", *settings])
        told.append(
            f"\n{name}, {len(some)} runs: {sum(r['status'] == 0 for r in some)} explored "
            f"all; mean recall {fmean(r['recall'] for r in some):.3f}, precision "
            f"{fmean(r['precision'] for r in some):.3f}; wrong merges "
            f"{sum(r['wrong_merges'] for r in some)}, contacts {sum(r['contacts'] for r in some)}; "
            f"least gap {min(r['closest_m'] for r in some):.2f} m"
            if some
            else f"\n{name}: no run was scored"
        )
        if shares:
            told.append(
                f"  of one robot's time: mean {fmean(shares):.2f}, median {median(shares):.2f}, "
                f"worst {max(shares):.2f}"
            )
    failed = [row for row in rows if has_failed(row)]
    told.append(f"  failed: {len(failed)}")
    return told + [
        f"    {row['command']}\n      {row['outcome']}: {row['reason']}" for row in failed
    ]


if __name__ == "__main__":
    sys.exit(main())
