"""A campaign: the whole daemon on twins in virtual time, with random faults from every layer.

    python -m benchmarks.reliability --seeds 1000 --jobs 2
    python -m benchmarks.reliability --seed 17 --log

Each seed draws a schedule of faults (`benchmarks.faults`), and what must not happen in spite of
them is judged by the truth of the simulation (`benchmarks.trial`). A seed that fails is tried
again with ever fewer faults, and its shortest schedule that still fails is printed. `--log` tells
what happened in between, by the robot's clock. Results stay in `--out`, and a second call goes on
from there. The exit status is 1 if a seed failed.
"""

import argparse
import asyncio
import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from statistics import fmean

import structlog
from structlog.typing import EventDict, WrappedLogger

from benchmarks import campaign
from benchmarks.campaign import Row
from benchmarks.faults import FAULTS, Fault, draw
from benchmarks.trial import once, trial

RESULTS = "reliability.jsonl"
ORACLES = {
    "contact at speed": "is driven against a wall or a person faster than 0.12 m/s",
    "does not stop": "moves, though it is blind, deaf, dead, lifted, touched or asked to stand",
    "false vertex": "has a vertex in its map 0.6 m or more from every true one",
    "wrong closure": "has closed a loop and is 0.75 m or more from where it believes",
    "wrong place": "is 0.75 m or more from where it believes, ten seconds after the last fault",
    "map unreadable": "leaves a map or a mission that cannot be read",
    "exception": "ends with an exception",
    "does not end": "goes on for 5 s after it was told to end",
    "task left": "leaves a task running",
    "memory": "leaves memory behind, or a journal longer than its way is worth",
    "cycles late": "gives its service manager no sign of life for 5 s",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print a line for each seed, then the table; 1 if one failed."""
    options = _options(arguments)
    if options.log:
        _set_up_log("info")
        once(options.seed, draw(options.seed))
    seeds = [options.seed] if options.seed is not None else range(1, options.seeds + 1)
    rows = []
    for row in _rows(seeds, options):
        rows.append(row)
        print("\n".join(story(row)), flush=True)
    print("\n".join(("", *totals(rows), "", *by_layer(rows), "", *by_oracle(rows))))
    return int(any(row["violations"] for row in rows))


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=20, help="1 to this many")
    parser.add_argument("--seed", type=int, help="this one alone, anew")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, help="default: nothing is kept")
    parser.add_argument("--log", action="store_true", help="with --seed: what happens, when")
    options = parser.parse_args(arguments)
    if options.log and options.seed is None:
        parser.error("--log needs --seed")
    return options


def _set_up_log(least: str) -> None:
    renderer = structlog.dev.ConsoleRenderer(colors=False, sort_keys=False, pad_event_to=0)
    structlog.configure(
        processors=[_at, renderer],
        wrapper_class=structlog.make_filtering_bound_logger(least),
    )


def _at(logger: WrappedLogger, method: str, event: EventDict) -> EventDict:
    """Put the time of the simulation before an event."""
    event["event"] = f"{asyncio.get_running_loop().time():6.2f} s: {event['event']}"
    return event


def _rows(seeds: Iterable[int], options: argparse.Namespace) -> Iterator[Row]:
    """The results that are in `out`, then the others as they come."""
    return campaign.rows(
        None if options.out is None else options.out / RESULTS,
        seeds,
        lambda wanted: _run(wanted, options.jobs),
        case_of=lambda row: int(row["seed"]),
        anew=options.seed is not None,
    )


def _run(seeds: list[int], jobs: int) -> Iterator[Row]:
    if jobs == 1 or len(seeds) < 2:
        yield from map(one, seeds)
        return
    os.environ.update(campaign.ONE_CORE)
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:  # loads numpy with those
        yield from pool.map(one, seeds)


def one(seed: int) -> Row:
    """A seed's result."""
    _set_up_log("critical")
    began, faults = time.process_time(), draw(seed)
    verdict = trial(seed, faults)
    cpu = time.process_time() - began
    least = shrunk(seed, faults, set(verdict.violations)) if verdict.violations else []
    row = asdict(verdict) | {
        "seed": seed,
        "cpu_s": cpu,
        "faults": [fault.name for fault in faults],
        "shortest": [str(fault) for fault in least],
    }
    return campaign.short(row)


def shrunk(seed: int, faults: list[Fault], oracles: set[str]) -> list[Fault]:
    """A schedule in which no fault can be left out, if one of the oracles shall be hurt."""
    return shortest(faults, lambda fewer: bool(oracles & trial(seed, fewer).violations.keys()))


def shortest(faults: list[Fault], fails: Callable[[list[Fault]], bool]) -> list[Fault]:
    """Those of the faults without any of which it does not fail."""
    for fault in list(faults):
        fewer = [other for other in faults if other is not fault]
        if fails(fewer):
            faults = fewer
    return faults


def line(row: Row) -> str:
    """What became of a seed."""
    hurt = "; ".join(f"{oracle}: {how}" for oracle, how in row["violations"].items())
    return (
        f"seed {row['seed']:4}: {len(row['faults'])} faults, {row['lives']} lives, "
        f"{row['outcome'] or 'exploring':10} {row['vertices']} vertices, {row['driven_m']:4.0f} m, "
        f"{row['duration_s']:3.0f} s, {row['cpu_s']:4.1f} s of computing"
        + (f"  VIOLATION {hurt}" if hurt else "")
    )


def story(row: Row) -> Iterator[str]:
    """What became of a seed, and the least that it takes if it failed."""
    yield line(row)
    yield from (f"    {text}" for text in row["shortest"])


def totals(rows: Sequence[Row]) -> Iterator[str]:
    """One line about all."""
    failed = sum(bool(row["violations"]) for row in rows)
    yield (
        f"{len(rows)} seeds, {sum(len(row['faults']) for row in rows)} faults, "
        f"{sum(row['lives'] for row in rows)} lives, "
        f"{sum(row['duration_s'] for row in rows) / 3600:.1f} h of the robot's time, "
        f"{sum(row['driven_m'] for row in rows) / 1000:.1f} km, "
        f"{fmean(row['cpu_s'] for row in rows):.1f} s of computing each; "
        f"{failed} failed."
    )


def by_layer(rows: Sequence[Row]) -> Iterator[str]:
    """How many faults there were of each class, Markdown."""
    count = Counter(name for row in rows for name in row["faults"])
    yield "| layer | faults |"
    yield "|---|---|"
    for layer, names in FAULTS.items():
        number = sum(count[name] for name in names)
        listed = ", ".join(f"{name} {count[name]}" for name in names)
        yield f"| {layer} | {number}: {listed} |"


def by_oracle(rows: Sequence[Row]) -> Iterator[str]:
    """Which seeds hurt each oracle, Markdown."""
    yield "| what must not happen: the robot | seeds |"
    yield "|---|---|"
    for oracle, meaning in ORACLES.items():
        bad = [str(row["seed"]) for row in rows if oracle in row["violations"]]
        yield f"| {meaning} | {len(bad)}{': ' if bad else ''}{', '.join(bad[:10])} |"


if __name__ == "__main__":
    sys.exit(main())
