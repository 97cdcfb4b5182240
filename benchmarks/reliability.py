"""A campaign: the whole daemon on twins in virtual time, with random faults from every layer.

    python -m benchmarks.reliability --seeds 1000 --jobs 2
    python -m benchmarks.reliability --seed 17

Each seed draws a schedule of faults (`benchmarks.faults`), and what must not happen in spite of
them is judged by the truth of the simulation (`benchmarks.trial`). A seed that fails is tried
again with ever fewer faults, and its shortest schedule that still fails is printed. Results stay
in `--out`, and a second call goes on from there; `--write` puts the table into docs/reliability.md.
The exit status is 1 if a seed failed.
"""

import argparse
import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path

import structlog

from benchmarks import campaign
from benchmarks.campaign import Row
from benchmarks.faults import FAULTS, LAYER, Fault, draw
from benchmarks.trial import trial

RESULTS = "reliability.jsonl"
PAGE = Path("docs/reliability.md")
ORACLES = {
    "contact at speed": "touches a wall or a person faster than 0.12 m/s",
    "does not stop": "moves, though it is blind, deaf, dead, lifted, touched or asked to stand",
    "false vertex": "has a vertex in its map 0.6 m or more from every true one",
    "wrong closure": "has closed a loop and is 0.75 m or more from where it believes",
    "wrong place": "is 0.75 m or more from where it believes, ten seconds after the last fault",
    "map unreadable": "leaves a map or a mission that cannot be read",
    "exception": "ends with an exception",
    "task left": "leaves a task running",
    "memory": "keeps more memory or disk than its way is worth",
    "cycles late": "gives its service manager no sign of life for 5 s",
}
GROWTH = 1.3  # times the memory of the second trial of a process: something leaks
ONE_CORE = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print a line for each seed, then the table; 1 if one failed."""
    options = _options(arguments)
    seeds = [options.seed] if options.seed is not None else range(1, options.seeds + 1)
    rows = []
    for row in _rows(seeds, options):
        rows.append(row)
        print(line(row), flush=True)
        for text in row["shortest"]:
            print(f"    {text}")
    text = "\n".join(table(rows))
    print(text)
    if options.write:
        PAGE.write_text(page(text), encoding="utf-8")
    return int(any(row["violations"] for row in rows))


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=20, help="1 to this many")
    parser.add_argument("--seed", type=int, help="this one alone, anew")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, help="default: nothing is kept")
    parser.add_argument("--write", action="store_true", help=f"the table to {PAGE}")
    return parser.parse_args(arguments)


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
    os.environ.update(ONE_CORE)
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(one, seeds)


_blocks: list[int] = []  # of memory after each trial of this process


def one(seed: int) -> Row:
    """A seed's result."""
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(50))
    began, faults = time.process_time(), draw(seed)
    verdict = trial(seed, faults)
    _blocks.append(verdict.blocks)
    if len(_blocks) > 2 and verdict.blocks > GROWTH * _blocks[1]:
        verdict.hurt("memory", f"{verdict.blocks} blocks, after {_blocks[1]} in the second trial")
    cpu = time.process_time() - began
    least = shrunk(seed, faults, set(verdict.violations)) if verdict.violations else []
    return asdict(verdict) | {
        "seed": seed,
        "cpu_s": cpu,
        "faults": [fault.name for fault in faults],
        "shortest": [str(fault) for fault in least],
    }


def shrunk(seed: int, faults: list[Fault], oracles: set[str]) -> list[Fault]:
    """A schedule in which no fault can be left out, if one of the oracles shall be hurt."""
    if oracles == {"memory"}:
        return faults
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


def table(rows: list[Row]) -> Iterator[str]:
    """Faults by class, and the seeds that hurt each oracle."""
    count = Counter(name for row in rows for name in row["faults"])
    bad = {oracle: [r["seed"] for r in rows if oracle in r["violations"]] for oracle in ORACLES}
    failed = sum(bool(row["violations"]) for row in rows)
    yield (
        f"{len(rows)} seeds, {count.total()} faults, {sum(row['lives'] for row in rows)} lives, "
        f"{sum(row['duration_s'] for row in rows) / 3600:.1f} h of the robot's time, "
        f"{sum(row['driven_m'] for row in rows) / 1000:.1f} km; {failed} seeds failed."
    )
    yield ""
    yield "| layer | faults |"
    yield "|---|---|"
    for layer, names in FAULTS.items():
        number = sum(n for name, n in count.items() if LAYER[name] == layer)
        listed = ", ".join(f"{name} {count[name]}" for name in names)
        yield f"| {layer} | {number}: {listed} |"
    yield ""
    yield "| what must not happen: the robot | seeds |"
    yield "|---|---|"
    for oracle, meaning in ORACLES.items():
        listed = f": {', '.join(map(str, bad[oracle][:10]))}" if bad[oracle] else ""
        yield f"| {meaning} | {len(bad[oracle])}{listed} |"


def page(text: str) -> str:
    """docs/reliability.md."""
    return (
        "# Reliability\n\n"
        "`make reliability` drives the whole daemon through a small world on simulated devices,\n"
        "in virtual time, with three to eight random faults from every layer. A seed decides all\n"
        "of it, and `python -m benchmarks.reliability --seed N` repeats one alone. A seed that\n"
        "fails prints the shortest schedule of its faults that still fails.\n\n"
        "This page is written by `python -m benchmarks.reliability --write`. Others look closer\n"
        "at one thing each: `python -m benchmarks.kills` kills explorations with damage to their\n"
        "files and compares the maps, `benchmarks.process_kills` does so with real processes,\n"
        "`benchmarks.kidnapping` puts a robot down anywhere on a map that it knows,\n"
        "`benchmarks.errands_table` asks it for vertices and points, and `benchmarks.patrol` lets\n"
        "it patrol for many hours while doors close and open.\n\n"
        f"{text}\n"
    )


if __name__ == "__main__":
    sys.exit(main())
