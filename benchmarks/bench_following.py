"""Explore the office and print how straight and how smoothly the robot drives.

    python -m benchmarks.bench_following [SEED]

On the office's corridors without doors the GVG is the centre line, from 2 m after a crossing to 2 m
before the next. Acceleration is that of the true motion, by differences over 0.1 s.
"""

import subprocess
import sys
import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.report import report, report_fact
from gvgbot.geometry import Array
from gvgbot.worlds.buildings import OFFICE_CORRIDORS

WITHOUT_DOORS = (2, 3)  # of the corridors: the cross passage and the long branch
AWAY_M = 2.0  # from crossings
BESIDE_M = 0.5  # from the centre line, one drives along the corridor


def main() -> int:
    """Explore, and print the figures; the exit status of the exploration."""
    seed = sys.argv[1] if len(sys.argv) > 1 else "1"
    with tempfile.TemporaryDirectory() as directory:
        command = [sys.executable, "-m", "gvgbot", "explore", "--seed", seed, "--out", directory]
        status = subprocess.run(command, stdout=subprocess.DEVNULL, check=False).returncode
        rows = np.loadtxt(Path(directory) / "truth.tum")
    stamps, path = rows[:, 0], rows[:, 1:3]
    heading = np.unwrap(2 * np.arctan2(rows[:, 6], rows[:, 7]))
    beside = np.concatenate([_offsets(path, *line) for line in _centre_lines()])
    report("off the centre line, rms", 1e3 * float(np.sqrt(np.mean(beside**2))), "mm", at_most=30)
    report_fact("off the centre line, worst", 1e3 * float(np.abs(beside).max()), "mm")
    dt = np.diff(stamps)
    speed, turn = np.hypot(*np.diff(path, axis=0).T) / dt, np.diff(heading) / dt
    for name, rate, unit in (("acceleration", speed, "m/s^2"), ("turning", turn, "rad/s^2")):
        change = np.abs(np.diff(rate) / dt[1:])
        report_fact(f"{name}, p99", float(np.percentile(change, 99)), unit)
        report_fact(f"{name}, most", float(change.max()), unit)
    return status


def _centre_lines() -> list[tuple[Array, Array]]:
    lines = []
    for index in WITHOUT_DOORS:
        for start, end in pairwise(OFFICE_CORRIDORS[index][1]):
            lines.append((np.array(start), np.array(end)))
    return lines


def _offsets(path: Array, start: Array, end: Array) -> Array:
    """How far poses (N, 2) that lie along a corridor are off its centre line, m."""
    length = float(np.hypot(*(end - start)))
    along = (end - start) / length
    station = (path - start) @ along
    aside = (path - start) @ np.array([-along[1], along[0]])
    within = (station > AWAY_M) & (station < length - AWAY_M) & (np.abs(aside) < BESIDE_M)
    found: Array = aside[within]
    return found


if __name__ == "__main__":
    if status := main():
        sys.exit(status)
