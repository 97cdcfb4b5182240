"""Score runs in simulation against the true GVG of their worlds: a line of JSON for each.

    python -m benchmarks.score_run RUN_DIR...

A vertex of the map and one of the reference are paired if they are near enough, so that there are
as many pairs as can be and they are as close as can be. `recall` is the share of the required
vertices that have a partner, `precision` the share of the map's vertices that have one, and
`edge_recall` the share of the edges between required vertices that join their partners in the map.
`roomy_recall` is the recall of what a robot would reach that had 3 cm to spare everywhere.
`path_ratio` is the way driven over the shortest open tour of all edges from the start. What there
is nothing to tell of is null.
"""

import argparse
import json
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import KDTree

from benchmarks.reference_gvg import Node, Reference, reference_gvg
from gvgbot.drivers.world import World, load_world
from gvgbot.errors import GvgbotError, WorldError
from gvgbot.geometry import Array, Pose
from gvgbot.maps import geojson
from gvgbot.maps.route_graph import RouteGraph
from gvgbot.worlds import open_world

MATCH = 1.5  # m: vertices that are further apart are not the same
FAR = 1e3  # m: what is worse than any pair
SPARE = 0.03  # m on each side of the robot, in ways that are wide enough

Score = dict[str, float | None]


def score_run(run: Path) -> Score:
    """The score of a run directory. Raises GvgbotError or OSError where files are missing."""
    config = json.loads((run / "summary.json").read_text(encoding="utf-8"))["config"]
    world, start = load_world(run / "world.yaml"), _start(config["twin"])
    reference = reference_gvg(world, (start.x, start.y), config["robot"]["radius_m"])
    route = geojson.decode((run / "map.geojson").read_text(encoding="utf-8"))
    tour = reference.tour_length((start.x, start.y))
    driven = score_trajectory(_read_tum(run / "truth.tum"), world)
    return {
        **score_map(route, reference, start),
        "roomy_recall": _roomy_recall(route, world, start, config["robot"]["radius_m"]),
        **driven,
        "ate_m": _ate(_read_tum(run / "truth.tum"), _read_tum(run / "estimate.tum"), start),
        "gvg_m": reference.length,
        "tour_m": tour,
        "path_ratio": _share(driven["driven_m"], tour),
    }


def score_map(route: RouteGraph, reference: Reference, start: Pose) -> Score:
    """Vertices and edges of a map, whose frame is the start pose, against the reference's."""
    graph = reference.graph
    nodes, required = list(graph), [n for n, wanted in graph.nodes(data="is_required") if wanted]
    truth = np.array([graph.nodes[node]["position"] for node in nodes]).reshape(-1, 2)
    places = start.transform(np.array([v.position for v in route.vertices]).reshape(-1, 2))
    gaps = np.hypot(*(places[:, None] - truth).transpose(2, 0, 1))
    pairs = [
        (i, j)
        for i, j in zip(*linear_sum_assignment(np.where(gaps < MATCH, gaps, FAR)), strict=True)
        if gaps[i, j] < MATCH
    ]
    partner = {route.vertices[i].id: nodes[j] for i, j in pairs}
    wanted = _ends((a, b) for a, b in graph.edges() if {a, b} <= set(required))
    mapped = _ends((partner.get(edge.start), partner.get(edge.end)) for edge in route.edges)
    return {
        "vertices_ref": len(required),
        "edges_ref": wanted.total(),
        "recall": _share(len(set(required) & set(partner.values())), len(required)),
        "precision": _share(len(pairs), len(route.vertices)),
        "edge_recall": _share((wanted & mapped).total(), wanted.total()),
        "vertex_rmse_m": _rms(np.array([gaps[i, j] for i, j in pairs])),
    }


def _roomy_recall(route: RouteGraph, world: World, start: Pose, radius: float) -> float | None:
    """The recall of what a robot of this radius, m, reaches with room to spare; None of nothing."""
    try:
        roomy = reference_gvg(world, (start.x, start.y), radius + SPARE)
    except WorldError:  # it starts in a narrower place
        return None
    return score_map(route, roomy, start)["recall"]


def score_trajectory(truth: Array, world: World) -> Score:
    """Metres driven, mean speed, and the least distance of the base's centre from a wall.

    `truth` has rows of t, x, y (s, m, m), the centre of the base in the world frame.
    """
    driven = float(np.hypot(*np.diff(truth[:, 1:], axis=0).T).sum())
    return {
        "driven_m": driven,
        "mean_speed_mps": _share(driven, float(np.ptp(truth[:, 0]))),
        "min_clearance_m": _least_clearance(truth[:, 1:], world),
    }


def _start(twin: dict[str, Any]) -> Pose:
    """world_map: where the run began, as its configuration says."""
    if twin["start"] is not None:
        return Pose(*twin["start"])
    return open_world(twin["world"])[1] or Pose()


def _read_tum(path: Path) -> Array:
    """Rows of t, x, y."""
    return np.loadtxt(path, usecols=(0, 1, 2), ndmin=2)


def _ends(edges: Any) -> Counter[frozenset[Node | None]]:
    """How many edges join each two vertices."""
    return Counter(frozenset(edge) for edge in edges)


def _share(part: float | None, whole: float) -> float | None:
    return None if part is None or whole == 0 else part / whole


def _rms(errors: Array) -> float | None:
    return float(np.sqrt(np.mean(errors**2))) if errors.size else None


def _ate(truth: Array, estimate: Array, start: Pose) -> float | None:
    """RMS error of the estimated positions at the stamps of the truth, m, without alignment."""
    there = start.transform(estimate[:, 1:])
    at = np.column_stack([np.interp(truth[:, 0], estimate[:, 0], axis) for axis in there.T])
    return _rms(np.hypot(*(at - truth[:, 1:]).T))


def _least_clearance(points: Array, world: World) -> float | None:
    """From points (N, 2) to the nearest wall, m: exact, the tree of cell centres only selects."""
    rows, columns = np.nonzero(world.occupied)
    if not len(rows):
        return None
    size = world.resolution_m
    walls = size * (np.column_stack((columns, rows)) + 0.5) + world.origin
    gaps = np.asarray(KDTree(walls).query(points)[0])
    reach = float(gaps.min()) + size
    return min(
        float(np.hypot(*world.wall_offsets(x, y, reach).T).min())
        for x, y in points[gaps <= reach].tolist()
    )


def print_scores(
    what: str | None, score: Callable[[Path], Mapping[str, object]], arguments: Sequence[str] | None
) -> int:
    """Print a line of JSON for every run directory of the command line; the exit status.

    `what` the program does is told by --help.
    """
    parser = argparse.ArgumentParser(
        description=what, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN_DIR")
    for run in parser.parse_args(arguments).runs:
        try:
            print(json.dumps({"run": str(run), **score(run)}))
        except (OSError, GvgbotError) as error:
            print(f"{run}: {error}", file=sys.stderr)
            return 2
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the score of every run directory of the command line."""
    return print_scores(__doc__, score_run, arguments)


if __name__ == "__main__":
    sys.exit(main())
