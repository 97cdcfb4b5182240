"""Score what `gvgbot explore --robots N` left, as one robot's run is scored, and its frames.

    python -m benchmarks.score_team RUN_DIR...

Prints a JSON object for each. A merge is wrong if a frame lies more than half a metre or 0.1 rad
from the true one, taken in the middle of the map; `closest_m` is the least gap between two robots.
"""

import itertools
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.reference_gvg import reference_gvg
from benchmarks.score_run import print_scores, score_map, score_trajectory
from gvgbot.drivers.world import load_world
from gvgbot.geometry import Array, Pose, wrap_angle
from gvgbot.maps import geojson

WRONG_M, WRONG_RAD = 0.5, 0.1


def score_team(run: Path) -> dict[str, Any]:
    """The score of a run of several robots. Raises OSError where files are missing."""
    summary = json.loads((run / "summary.json").read_text(encoding="utf-8"))
    names = summary["robots"]
    each = {name: json.loads((run / name / "summary.json").read_text("utf-8")) for name in names}
    starts = {name: Pose(*each[name]["config"]["twin"]["start"]) for name in names}
    radius = each[names[0]]["config"]["robot"]["radius_m"]
    world, start = load_world(run / "world.yaml"), starts[summary["joined"][0]]
    route = geojson.decode((run / "map.geojson").read_text(encoding="utf-8"))
    ways = [np.loadtxt(run / name / "truth.tum", usecols=(0, 1, 2), ndmin=2) for name in names]
    clearances = [score_trajectory(way, world)["min_clearance_m"] for way in ways]
    middle = np.array([vertex.position for vertex in route.vertices]).mean(axis=0)
    wrong = sum(
        _is_wrong(Pose(*pose), start.to(starts[name]), middle)
        for name, pose in summary["frames"].items()
    )
    return {
        "outcome": summary["outcome"],
        "robots": len(names),
        "joined": len(summary["joined"]),
        "wrong_merges": wrong,
        "duration_s": summary["duration_s"],
        "driven_m": summary["distance_m"],
        "contacts": summary["contacts"],
        "min_clearance_m": min(c for c in clearances if c is not None),
        "closest_m": min(
            (_gap(a, b) - 2 * radius for a, b in itertools.combinations(ways, 2)), default=None
        ),
        **score_map(route, reference_gvg(world, (start.x, start.y), radius), start),
    }


def _is_wrong(pose: Pose, true: Pose, middle: Array) -> bool:
    theirs = true.inverse().transform(middle)
    off = np.hypot(*(pose.transform(theirs) - middle))
    return bool(off > WRONG_M or abs(wrap_angle(pose.theta - true.theta)) > WRONG_RAD)


def _gap(a: Array, b: Array) -> float:
    """The least distance of two ways at the same time (rows of t, x, y); both stay at the end."""
    stamps = np.union1d(a[:, 0], b[:, 0])
    x, y = (
        np.interp(stamps, a[:, 0], a[:, k]) - np.interp(stamps, b[:, 0], b[:, k]) for k in (1, 2)
    )
    return float(np.hypot(x, y).min())


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the score of each run directory."""
    return print_scores(__doc__, score_team, arguments)


if __name__ == "__main__":
    sys.exit(main())
