"""Explore many worlds with many seeds and print a table: outcome, accuracy, path, speed, memory.

    python benchmarks/explore_table.py [--worlds office floor_plan:7 PATH.yaml:X:Y:THETA ...]
                                       [--seeds 1 2 3] [--set key=value ...] [--jobs 2] [--scorer score.py]

The scorer is any program that is called as `score.py RUN_DIR WORLD.yaml X Y THETA` and prints JSON
with recall, precision, edge_recall, vertex_rmse_m, path_ratio and min_clearance_m; without it the
table has only what the run says of itself.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from gvgbot.worlds import builtin

WORLDS = ["office", "grid", "jittered", "rooms", "cave"]
COLUMNS = (
    ("recall", "recall", "{:.3f}"),
    ("precision", "prec", "{:.3f}"),
    ("edge_recall", "edges", "{:.3f}"),
    ("vertex_rmse_m", "rmse", "{:.3f}"),
    ("path_ratio", "ratio", "{:.3f}"),
    ("min_clearance_m", "clear", "{:.3f}"),
    ("estimate_ate_m", "ate", "{:.3f}"),
    ("mean_speed", "m/s", "{:.2f}"),
    ("contacts", "hits", "{}"),
    ("loop_closures", "clos", "{}"),
    ("recoveries", "recov", "{}"),
    ("speed_factor", "x real", "{:.0f}"),
    ("memory_mb", "MB", "{:.0f}"),
)


def main() -> int:
    """Run the table; 0 if every run explored its world."""
    options = _options()
    jobs = [(world, seed) for world in options.worlds for seed in options.seeds]
    print("world          seed outcome   " + " ".join(f"{t:>6}" for _, t, _ in COLUMNS))
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(options.jobs) as pool:
        out = Path(options.out or scratch)
        runs = pool.map(lambda job: _run(job[0], job[1], out, options), jobs)
        return 1 - min([_show(row) for row in runs], default=1)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--worlds", nargs="+", default=WORLDS)
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3, 4, 5])
    parser.add_argument("--set", dest="overrides", nargs="+", default=[])
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--scorer", type=Path)
    parser.add_argument("--out", help="keep the run directories here")
    return parser.parse_args()


def _run(world: str, seed: int, out: Path, options: argparse.Namespace) -> dict[str, Any]:
    path, *start = world.rsplit(":", 3) if world.count(":") > 2 else [world]
    name = Path(path).stem
    directory = out / f"{name}-{seed}"
    command = [sys.executable, "-m", "gvgbot", "explore", "--world", path, "--seed", str(seed)]
    command += ["--out", str(directory)]
    command += ["--start", *start] if start else []
    command += [word for item in options.overrides for word in ("--set", item)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert process.stdout is not None
    said = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    row: dict[str, Any] = {"world": name, "seed": seed, "status": status, "said": said.strip()}
    row["memory_mb"] = usage.ru_maxrss / 1024
    summary = directory / "summary.json"
    if summary.exists():
        row |= json.loads(summary.read_text(encoding="utf-8"))
        row["speed_factor"] = row["duration_s"] / row["wall_s"]
        row |= _score(directory, start or _start(path), options.scorer)
    return row


def _start(name: str) -> list[str]:
    pose = builtin(name)[1]
    return [str(pose.x), str(pose.y), str(pose.theta)]


def _score(directory: Path, start: list[str], scorer: Path | None) -> dict[str, Any]:
    if scorer is None:
        return {}
    command = [sys.executable, str(scorer), str(directory), str(directory / "world.yaml"), *start]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return json.loads(done.stdout) if done.returncode == 0 else {"said": done.stderr[-300:]}


def _show(row: dict[str, Any]) -> int:
    """Print a row; 1 if the world was explored."""
    cells = [form.format(row[key]) if row.get(key) is not None else "-" for key, _, form in COLUMNS]
    outcome = str(row.get("outcome", "crashed"))
    print(
        f"{row['world']:14} {row['seed']:4} {outcome:9} " + " ".join(f"{c:>6}" for c in cells),
        flush=True,
    )
    if outcome != "explored":
        print(
            f"    {row['said'].splitlines()[-1] if row['said'] else row.get('reason')}", flush=True
        )
    return int(outcome == "explored")


if __name__ == "__main__":
    sys.exit(main())
