"""Break the robot on purpose, and see which oracle of the campaign notices.

    python -m benchmarks.sabotage [--seeds 40] [--only WORDS] [--keep]

Each sabotage changes one place in a copy of the project, in which the first seeds of
`benchmarks.reliability` are tried until one fails. A campaign that finds nothing proves nothing,
unless it finds these. `--keep` puts what was found into the place of what was found earlier, for
docs/reliability.md. The exit status is 1 if one stays unnoticed.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks import campaign
from benchmarks.campaign import Row

ROOT = Path(__file__).parents[1]
RESULTS = Path(__file__).parent / "results" / "sabotage.jsonl"
COPIED = ("gvgbot", "benchmarks", "tests")
FIRST_FAILURE = """\
import json, sys
import structlog
from benchmarks.faults import draw
from benchmarks.trial import trial
structlog.configure(wrapper_class=structlog.make_filtering_bound_logger("critical"))
for seed in range(1, int(sys.argv[1]) + 1):
    violations = trial(seed, draw(seed)).violations
    if violations:
        print(json.dumps({"seed": seed, "oracles": list(violations)}))
        break
"""


@dataclass(frozen=True)
class Sabotage:
    """A place in a module, and what stands there instead."""

    what: str  # is wrong then
    module: str
    before: str
    after: str

    def broken(self, text: str) -> str:
        """The module's text with the change. Raises ValueError if the place is not there."""
        if text.count(self.before) != 1:
            raise ValueError(f"{self.module} has no place, or several, for: {self.what}")
        return text.replace(self.before, self.after)


SABOTAGES = (
    Sabotage(
        "a snapshot is written without its last byte, and over the one before",
        "persistence/mission_files.py",
        "replace_file(self._snapshot, content, keep=self._before if self._is_whole else None)",
        "self._snapshot.write_bytes(content[:-1])",
    ),
    Sabotage(
        "a full disk is not expected",
        "persistence/keeper.py",
        "except OSError as error:",
        "except PermissionError as error:",
    ),
    Sabotage(
        "a task is started that nobody ends",
        "robot.py",
        'log.info("stopping", signal=await stopped)',
        "asyncio.get_running_loop().create_task(asyncio.sleep(3600.0)); await stopped",
    ),
    Sabotage(
        "one task does not hear that it shall end",
        "robot.py",
        "for task in serving:",
        "for task in serving[1:]:",
    ),
    Sabotage(
        "a cache keeps every robot that ever was",
        "persistence/keeper.py",
        "    def clock(self) -> LoopClock:",
        '    @__import__("functools").cache\n    def clock(self) -> LoopClock:',
    ),
    Sabotage(
        "no sign of life while the base is away",
        "robot.py",
        "if not stuck or self._devices.base.away is not None:",
        "if not stuck:",
    ),
    Sabotage(
        "the guard sees no obstacle",
        "hal/guard.py",
        "way = free_distance(points, wish, radius=self.radius, margin=limits.margin_m)",
        "way = 100.0",
    ),
    Sabotage(
        "the guard trusts a scan however old it is",
        "hal/guard.py",
        "return scan is None or stamp - scan.stamp > self.config.max_scan_age_s",
        "return scan is None",
    ),
    Sabotage(
        "nobody looks whether the wheels hang in the air",
        "hal/messages.py",
        "return self.wheel_drop_left or self.wheel_drop_right",
        "return False",
    ),
    Sabotage(
        "a pause is answered, but not made",
        "autonomy/errands/errands.py",
        "self.is_paused, self._command = True, None",
        "self._command = None",
    ),
    Sabotage(
        "scans are stamped 0.4 s too early",
        "drivers/hokuyo/driver.py",
        "stream.geometry.scan(ranges, now.host_stamp)",
        "stream.geometry.scan(ranges, now.host_stamp - 0.4)",
    ),
    Sabotage(
        "odometry counts every way a tenth too long",
        "drivers/kobuki/wheel_odometry.py",
        "travel = (left + right) / 2",
        "travel = 1.1 * (left + right) / 2",
    ),
    Sabotage(
        "any vertex is taken for the nearest that is known",
        "autonomy/recogniser.py",
        "best = self._beyond_doubt(belief, matches, sighting)",
        "best = matches[0] if matches else None",
    ),
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Try all, print a line for each; 1 if one was not noticed."""
    options = _options(arguments)
    rows = []
    for sabotage in SABOTAGES:
        if options.only in sabotage.what:
            rows.append(tried(sabotage, options.seeds))
            print(line(rows[-1]), flush=True)
            if options.keep:
                keep(rows)
    return int(any(row["seed"] is None for row in rows))


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=40, help="1 to this many")
    parser.add_argument("--only", default="", help="those with these words in them")
    parser.add_argument("--keep", action="store_true")
    return parser.parse_args(arguments)


def tried(sabotage: Sabotage, seeds: int) -> Row:
    """The first seed that fails with it, and the oracles that it hurts; None and none if none."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for name in COPIED:
            shutil.copytree(ROOT / name, copy / name)
        module = copy / "gvgbot" / sabotage.module
        module.write_text(sabotage.broken(module.read_text(encoding="utf-8")), encoding="utf-8")
        told = subprocess.run(
            [sys.executable, "-c", FIRST_FAILURE, str(seeds)],
            cwd=copy,
            env=os.environ | {"PYTHONPATH": str(copy), "OMP_NUM_THREADS": "1"},
            stdout=subprocess.PIPE,
            check=True,
        ).stdout
    found = json.loads(told) if told else {"seed": None, "oracles": []}
    return {"what": sabotage.what, "seeds": seeds, **found}


def line(row: Row) -> str:
    """What became of a sabotage."""
    if row["seed"] is None:
        return f"{row['what']}: NOT NOTICED in {row['seeds']} seeds"
    return f"{row['what']}: {', '.join(row['oracles'])} (seed {row['seed']})"


def table(rows: Sequence[Row]) -> Iterator[str]:
    """What was noticed, Markdown."""
    yield "| what was broken | what noticed it | in seed |"
    yield "|---|---|---|"
    for row in rows:
        seed = f"none of {row['seeds']}" if row["seed"] is None else row["seed"]
        yield f"| {row['what']} | {', '.join(row['oracles'])} | {seed} |"


def keep(rows: Sequence[Row]) -> None:
    """Put rows in the places of earlier ones, in the order of the table above."""
    kept = {row["what"]: row for row in [*campaign.read(RESULTS), *rows]}
    ordered = [kept[sabotage.what] for sabotage in SABOTAGES if sabotage.what in kept]
    RESULTS.write_text("".join(json.dumps(row) + "\n" for row in ordered), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
