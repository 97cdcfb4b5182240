"""Explore many worlds and print a table: outcome, accuracy, path, speed, memory; then a summary.

    python -m benchmarks.explore_table [--worlds office floor_plan:7 PATH.yaml:X:Y:THETA ...]
        [--seeds 1 2 3] [--plans N] [--lasers UTM-30LX URG-04LX] [--rough] [--people N]
        [--set key=value ...] [--jobs N | --scheduler tcp://HOST:8786] [--out DIR]

Each world is explored with each seed and each laser, then each of the floor plans 1 to N, with its
own number as seed. Runs are scored against the true GVG of their worlds (benchmarks.score_run). DIR
keeps the run directories and a line for each in results.jsonl. A run that is in there already is
shown, but not run again unless it crashed: take another DIR when the program has changed.

With --scheduler the runs are shared out on a Dask cluster (`pip install 'gvgbot[cluster]'`), whose
workers are started in this directory of their machines: `dask worker tcp://HOST:8786 --nthreads 1`.
Rows come back here; run directories stay where they were made, unless DIR is on a common disk.

A run fails if it did not explore all, touched something or could not be scored. The exit status is
0 only if no run failed.
"""

import argparse
import importlib
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from pathlib import Path
from statistics import fmean, median

from benchmarks import campaign
from benchmarks.campaign import Row
from benchmarks.score_run import score_run
from gvgbot.drivers.hokuyo.models import MODELS
from gvgbot.errors import GvgbotError
from gvgbot.worlds import NAMES

RESULTS = "results.jsonl"
WORLDS = [name for name in NAMES if name != "floor_plan"]
ROUGH = ["twin.laser.range_sigma_m=0.03", "twin.laser.dropout_fraction=0.02"]
PEOPLE_EVERY = 10  # runs
INTERRUPTED = 130
CRASHED = "crashed"
COLUMNS = (
    ("recall", "recall", "{:.3f}"),
    ("precision", "prec", "{:.3f}"),
    ("edge_recall", "edges", "{:.3f}"),
    ("vertex_rmse_m", "rmse", "{:.3f}"),
    ("path_ratio", "ratio", "{:.3f}"),
    ("min_clearance_m", "clear", "{:.3f}"),
    ("ate_m", "ate", "{:.3f}"),
    ("mean_speed_mps", "m/s", "{:.2f}"),
    ("contacts", "hits", "{}"),
    ("loop_closures", "clos", "{}"),
    ("recoveries", "recov", "{}"),
    ("speed_factor", "x real", "{:.0f}"),
    ("memory_mb", "MB", "{:.0f}"),
)
HEAD = "world            laser    seed outcome  " + " ".join(f"{t:>6}" for _, t, _ in COLUMNS)

# The peak that a parent is told of a child includes the parent's own size when it started it.
_TELLS_PEAK = """
import atexit, pathlib, runpy, sys
peak = pathlib.Path(sys.argv.pop(1))
atexit.register(lambda: peak.write_text(pathlib.Path("/proc/self/status").read_text()))
runpy.run_module("gvgbot", run_name="__main__", alter_sys=True)
"""

Command = tuple[str, ...]  # arguments of `gvgbot`, but for the run directory


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print the table and the summary; 0 if no run failed."""
    options = _options(arguments)
    out = _out(options.out)
    print(f"results: {out / RESULTS}")
    print(HEAD)
    rows = []
    try:
        with executor(options.jobs, options.scheduler) as pool:
            for row in _rows(commands(options), out, pool):
                rows.append(row)
                print(line(row), flush=True)
    except KeyboardInterrupt:
        print(f"interrupted; --out {out} goes on from here", file=sys.stderr)
        return INTERRUPTED
    print("\n".join(summary(rows)))
    return int(any(has_failed(row) for row in rows))


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--worlds", nargs="*", default=WORLDS)
    parser.add_argument("--seeds", nargs="+", type=int, default=[1])
    parser.add_argument("--plans", type=int, default=0, help="how many floor plans")
    parser.add_argument("--lasers", nargs="+", choices=tuple(MODELS), default=["UTM-30LX"])
    parser.add_argument("--rough", action="store_true", help=f"sets {' '.join(ROUGH)}")
    parser.add_argument(
        "--people", type=int, default=0, help=f"how many, in one of {PEOPLE_EVERY} runs"
    )
    parser.add_argument("--set", dest="overrides", nargs="+", default=[])
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--scheduler", help="of a Dask cluster, as tcp://HOST:PORT")
    parser.add_argument("--out", type=Path, help="default: a new directory in runs/")
    return parser.parse_args(arguments)


def _out(wanted: Path | None) -> Path:
    parent = Path("runs") if wanted is None else wanted
    parent.mkdir(parents=True, exist_ok=True)
    return Path(tempfile.mkdtemp(prefix="table-", dir=parent)) if wanted is None else wanted


def commands(options: argparse.Namespace) -> list[Command]:
    """What to run. The lasers take turns, each in the same worlds with the same seeds and people.

    Seed and laser are always in a command, so that it repeats its run whatever the defaults.
    """
    worlds = [(world, seed) for world in options.worlds for seed in options.seeds]
    worlds += [(f"floor_plan:{number}", number) for number in range(1, options.plans + 1)]
    return [
        _command(world, seed, [f"twin.laser.model={laser}", *_settings(options, number)])
        for number, (world, seed) in enumerate(worlds, start=1)
        for laser in options.lasers
    ]


def _settings(options: argparse.Namespace, number: int) -> list[str]:
    """What all runs have in common, and the people in some of them."""
    has_people = options.people and number % PEOPLE_EVERY == 0
    people = [f"twin.people={options.people}"] if has_people else []
    return [*(ROUGH if options.rough else []), *people, *options.overrides]


def _command(world: str, seed: int, settings: list[str]) -> Command:
    path, *start = world.rsplit(":", 3) if world.count(":") > 2 else [world]
    place = ["--world", path, *(["--start", *start] if start else []), "--seed", str(seed)]
    return "explore", *place, *(word for item in settings for word in ("--set", item))


@contextmanager
def executor(jobs: int, scheduler: str | None) -> Iterator[Executor]:
    """What runs work: threads here, as many as `jobs`, or the workers of a Dask cluster."""
    if scheduler is None:
        with ThreadPoolExecutor(jobs) as pool:
            yield pool
        return
    try:
        distributed = importlib.import_module("distributed")
    except ImportError:
        raise SystemExit("--scheduler needs pip install 'gvgbot[cluster]'") from None
    try:
        client = distributed.Client(scheduler)
    except (OSError, ValueError) as error:
        raise SystemExit(f"no scheduler at {scheduler}: {error}") from None
    with client, client.get_executor(pure=False) as workers:
        yield workers


def _rows(wanted: list[Command], out: Path, pool: Executor) -> Iterator[Row]:
    """The results that are in `out`, then the others as they come."""
    by_text = {_text(command): command for command in wanted}

    def run_all(texts: list[str]) -> Iterator[Row]:
        runs = [pool.submit(run, by_text[text], out / _slug(by_text[text])) for text in texts]
        try:
            for done in as_completed(runs):
                yield done.result()
        finally:
            pool.shutdown(cancel_futures=True)

    return campaign.rows(
        out / RESULTS,
        by_text,
        run_all,
        case_of=lambda row: str(row["command"]),
        is_good=lambda row: row["outcome"] != CRASHED,
    )


def _text(command: Command) -> str:
    return shlex.join(["gvgbot", *command])


def _slug(command: Command) -> str:
    return re.sub(r"[^\w.]+", "-", " ".join(command[1:])).strip("-")


def run(command: Command, directory: Path) -> Row:
    """Explore once, as a process of its own, and score what it leaves."""
    shutil.rmtree(directory, ignore_errors=True)  # of an attempt that crashed
    with tempfile.NamedTemporaryFile("r", encoding="utf-8") as peak:
        done = subprocess.run(
            [sys.executable, "-c", _TELLS_PEAK, peak.name, *command, "--out", str(directory)],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=os.environ | campaign.ONE_CORE,
            check=False,
        )
        row = _named(command) | {"status": done.returncode, "memory_mb": _peak_mb(peak.read())}
    said = done.stdout.strip().splitlines() or [""]
    try:
        row |= _outcome(directory)
    except OSError:
        return row | {"outcome": CRASHED, "reason": said[-1]}
    try:
        return row | score_run(directory)
    except (GvgbotError, OSError) as error:
        return row | {"reason": f"not scored: {error}"}


def _peak_mb(status: str) -> float | None:
    """The most memory that a process had (MiB) by its /proc/PID/status; None if it was killed."""
    found = re.search(r"^VmHWM:\s*(\d+) kB$", status, re.MULTILINE)
    return None if found is None else int(found[1]) / 1024


def _outcome(directory: Path) -> Row:
    """What a run says of itself."""
    found: Row = json.loads((directory / "summary.json").read_text(encoding="utf-8"))
    del found["config"]
    return found | {"speed_factor": found["duration_s"] / found["wall_s"]}


def _named(command: Command) -> Row:
    """What a row says of the run before it has run."""
    world, seed = (command[command.index(key) + 1] for key in ("--world", "--seed"))
    laser = next(word.partition("=")[2] for word in command if word.startswith("twin.laser.model"))
    return {"command": _text(command), "world": Path(world).stem, "laser": laser, "seed": int(seed)}


def has_failed(row: Row) -> bool:
    """Whether the run did not explore all, touched something, or could not be scored."""
    return row["status"] != 0 or row.get("contacts") != 0 or "recall" not in row


def line(row: Row) -> str:
    """A row of the table."""
    cells = [form.format(row[key]) if row.get(key) is not None else "-" for key, _, form in COLUMNS]
    outcome = row["outcome"].removeprefix("explored_with_")
    name = f"{row['world']:16} {row['laser']:8} {row['seed']:4} {outcome:8}"
    return f"{name} " + " ".join(f"{cell:>6}" for cell in cells)


def summary(rows: list[Row]) -> list[str]:
    """For each laser what its runs have in common, the worst of them, and those that failed."""
    lasers = dict.fromkeys(row["laser"] for row in rows)
    return [text for laser in lasers for text in _of_laser(laser, rows)]


def _of_laser(laser: str, rows: list[Row]) -> Iterator[str]:
    rows = [row for row in rows if row["laser"] == laser]
    explored = sum(row["status"] == 0 for row in rows)
    yield f"\n{laser}: {explored} of {len(rows)} runs explored all ({explored / len(rows):.1%})"
    for key in ("recall", "precision", "edge_recall"):
        if scored := [row for row in rows if row.get(key) is not None]:
            worst = min(scored, key=lambda row: float(row[key]))
            mean = fmean(row[key] for row in scored)
            yield f"  {key:11} mean {mean:.3f}, worst {worst[key]:.3f} ({_title(worst)})"
    for key, name, pick in (
        ("contacts", "contacts, all together", sum),
        ("path_ratio", "median way over shortest tour", median),
        ("mean_speed_mps", "mean speed, m/s", fmean),
        ("min_clearance_m", "least clearance, m", min),
    ):
        if values := [row[key] for row in rows if row.get(key) is not None]:
            yield f"  {name}: {pick(values):.3g}"
    failed = [row for row in rows if has_failed(row)]
    yield f"  failed: {len(failed)}"
    for row in failed:
        hits = f"{row['contacts']} contacts; " if row.get("contacts") else ""
        yield f"    {row['command']}\n      {hits}{row['outcome']}: {row['reason']}"


def _title(row: Row) -> str:
    return f"{row['world']}, seed {row['seed']}"


if __name__ == "__main__":
    sys.exit(main())
