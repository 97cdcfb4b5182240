"""Error and time of a CARMEN log against hand-made relations, beside yag-slam if that is installed.

    python -m benchmarks.relations intel.log.gz intel.relations [--keep]

A relation is a line `t1 t2 dx dy dz roll pitch yaw`: where the robot was at t2, seen from t1. The
relations of the usual logs, and the metric, are those of Kuemmerle et al. (2009).
`pip install yag-slam opencv-python-headless` adds the last row; nothing else needs them.
"""

import argparse
import importlib
import importlib.util
import json
import math
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from gvgbot.carmen import CarmenLog, read_carmen
from gvgbot.geometry import Array, Pose, rows_of
from gvgbot.maps.trajectory import decode_tum
from gvgbot.replay import NO_ECHO_M, Wanted, replay

Row = dict[str, Any]
RESULTS = Path(__file__).parent / "results" / "relations.json"
HEAD = "mapper     pairs   mean m median m    max m mean deg    CPU s"
REACH_M = 30.0  # of the beams that yag-slam uses


def relation_errors(relations: Array, stamps: Array, poses: Array) -> tuple[Array, Array]:
    """Errors in m and rad of the relations that a trajectory covers, poses taken in between."""
    poses = np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])
    covered = ((relations[:, :2] >= stamps[0]) & (relations[:, :2] <= stamps[-1])).all(axis=1)
    metres, turns = [], []
    for t1, t2, dx, dy, *_, yaw in relations[covered].tolist():
        a, b = (
            Pose(*(float(np.interp(t, stamps, column)) for column in poses.T)) for t in (t1, t2)
        )
        off = a.to(b)
        metres.append(math.hypot(off.x - dx, off.y - dy))
        turns.append(abs(math.remainder(off.theta - yaw, math.tau)))
    return np.array(metres), np.array(turns)


def by_gvgbot(log: Path) -> tuple[Array, Array]:
    with tempfile.TemporaryDirectory() as directory:
        wanted = Wanted(path=log, config=None, overrides=[], no_echo_m=NO_ECHO_M)
        replay(wanted, lambda _: None, out=Path(directory))
        estimate = decode_tum((Path(directory) / "estimate.tum").read_text(encoding="utf-8"))
    return estimate.stamps, estimate.poses


def by_odometry(log: Path) -> tuple[Array, Array]:
    recorded = _read(log)
    return _rows([(o.stamp, o.odom_base) for o in recorded.odometry])


def by_yag_slam(log: Path) -> tuple[Array, Array]:
    """Its poses at the scans; what odometry is wrong by in between is spread over the time."""
    graph_slam = importlib.import_module("yag_slam.graph_slam")
    matcher = importlib.import_module("yag_slam.scan_matching").Scan2DMatcherCpp
    models = importlib.import_module("yag_slam.models")
    recorded = _read(log)
    heard = {o.stamp: o.odom_base for o in recorded.odometry}
    slam, scans = graph_slam.GraphSlam(matcher({}), matcher({}, loop=True)), []
    for scan in recorded.scans:
        ranges = np.where(np.isfinite(scan.ranges), scan.ranges, NO_ECHO_M)
        first, step = scan.angle_min, scan.angle_increment
        last, at = first + step * (len(ranges) - 1), heard[scan.stamp]
        known = models.LocalizedRangeScan(
            ranges, first, last, step, 0.0, NO_ECHO_M, REACH_M, at.x, at.y, at.theta
        )
        slam.process_scan(known)
        scans.append(known)
    slam.run_opt()
    found = [scan.corrected_pose for scan in scans]
    corrected = [Pose(p.x, p.y, p.euler[2]) for p in found]
    stamps = np.array([scan.stamp for scan in recorded.scans])
    rows = []
    for o in recorded.odometry:
        k = max(0, int(np.searchsorted(stamps, o.stamp, side="right")) - 1)
        by_scans = [
            corrected[i].compose(heard[float(stamps[i])].to(o.odom_base))
            for i in (k, min(k + 1, len(stamps) - 1))
        ]
        share = float(np.interp(o.stamp, stamps[k : k + 2], [0.0, 1.0][: len(stamps) - k]))
        rows.append((o.stamp, by_scans[0].towards(by_scans[1], share)))
    return _rows(rows)


def _read(log: Path) -> CarmenLog:
    return read_carmen(log, no_echo_m=NO_ECHO_M, base_laser=Pose())


def _rows(poses: list[tuple[float, Pose]]) -> tuple[Array, Array]:
    return np.array([t for t, _ in poses]), rows_of(p for _, p in poses)


def measure(
    name: str, mapper: Callable[[Path], tuple[Array, Array]], log: Path, relations: Array
) -> Row:
    """Print how well a mapper does, and return it."""
    start = time.process_time()
    stamps, poses = mapper(log)
    seconds = time.process_time() - start
    metres, turns = relation_errors(relations, stamps, poses)
    row: Row = {
        "mapper": name,
        "pairs": len(metres),
        "mean_m": float(metres.mean()),
        "median_m": float(np.median(metres)),
        "most_m": float(metres.max()),
        "mean_deg": math.degrees(turns.mean()),
        "cpu_s": seconds,
    }
    print(line(row), flush=True)
    return row


def line(row: Row) -> str:
    """A mapper in a line."""
    return (
        f"{row['mapper']:10} {row['pairs']:5d} {row['mean_m']:8.4f} {row['median_m']:8.4f} "
        f"{row['most_m']:8.3f} {row['mean_deg']:8.3f} {row['cpu_s']:8.1f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("log", type=Path)
    parser.add_argument("relations", type=Path)
    parser.add_argument("--keep", action="store_true", help="for docs/benchmarks.md to quote")
    options = parser.parse_args()
    for path in (options.log, options.relations):
        if not path.is_file():
            parser.error(f"there is no file {path}: docs/how-to/recordings.md says what it is")
    relations = np.loadtxt(options.relations, ndmin=2)
    mappers = {"odometry": by_odometry, "gvgbot": by_gvgbot}
    if importlib.util.find_spec("yag_slam"):
        mappers["yag-slam"] = by_yag_slam
    print(HEAD)
    rows = [measure(name, mapper, options.log, relations) for name, mapper in mappers.items()]
    if options.keep:
        text = json.dumps({"log": options.log.name, "rows": rows}, indent=1)
        RESULTS.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
