"""A run of ten seconds down a corridor, written by hand into a directory.

The robot drives from (0, 0) to (10, 0) at 1 m/s and sees two metres ahead. Meetpoints are at x = 0
(found at once), 5 (after 8 s) and 10 (after 4 s), a dead end at (10, 1). The edge from the first to
the last was joined after 6 s, before the one in the middle cut it; the dead end's after 9 s.
"""

import json
import math
from pathlib import Path

import numpy as np

from gvgbot.atomic_files import write_files
from gvgbot.maps import geojson
from gvgbot.maps.map_server import encode_map_server
from gvgbot.maps.occupancy import OccupancyGrid
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode, VertexKind
from gvgbot.maps.trajectory import Trajectory, encode_tum

BEGIN = 1000.0  # s, the stamp of the first row
UP = math.pi / 2


def vertex(
    number: int, x: float, y: float, bearings: tuple[float, ...], open_: tuple[float, ...] = ()
) -> RouteNode:
    kind: VertexKind = "endpoint" if len(bearings) == 1 else "meetpoint"
    covariance = (0.0004 * number**2, 0.0, 0.0, 0.0001)  # sigma 2 cm times the number
    return RouteNode(
        id=number,
        kind=kind,
        position=(x, y),
        degree=len(bearings),
        bearings=bearings,
        clearance=1.0,
        covariance=covariance,
        frontiers=open_,
    )


def edge(start: int, end: int, *points: tuple[float, float]) -> RouteEdge:
    line = np.array(points)
    return RouteEdge(start=start, end=end, polyline=line, min_clearance=0.9)


GRAPH = RouteGraph(
    (
        vertex(1, 0.0, 0.0, (0.0, UP, -UP), (UP, -UP)),
        vertex(2, 5.0, 0.0, (0.0, math.pi, UP), (UP,)),
        vertex(3, 10.0, 0.0, (math.pi, UP, -UP), (-UP,)),
        vertex(4, 10.0, 1.0, (-UP,)),
    ),
    (
        edge(1, 2, (0.0, 0.0), (2.5, 0.0), (5.0, 0.0)),
        edge(2, 3, (5.0, 0.0), (10.0, 0.0)),
        edge(3, 4, (10.0, 0.0), (10.0, 1.0)),
    ),
)

EVENTS = [
    {"event": "vertex_added", "stamp": BEGIN, "vertex": 1, "kind": "meetpoint"},
    {"event": "vertex_added", "stamp": BEGIN + 4.0, "vertex": 3, "kind": "meetpoint"},
    {"event": "edge_joined", "stamp": BEGIN + 6.0, "start": 3, "end": 1, "length": 10.1},
    {"event": "decision", "stamp": BEGIN + 6.0, "vertex": None, "bearing": None, "reason": "ear"},
    {"event": "vertex_added", "stamp": BEGIN + 8.0, "vertex": 2, "kind": "meetpoint"},
    {"event": "vertex_added", "stamp": BEGIN + 9.0, "vertex": 4, "kind": "endpoint"},
    {"event": "edge_joined", "stamp": BEGIN + 9.0, "start": 3, "end": 4, "length": 1.0},
]

SUMMARY = {
    "outcome": "explored",
    "reason": "no frontier is left",
    "distance_m": 10.0,
    "duration_s": 10.0,
    "loop_closures": 0,
}


def corridor() -> OccupancyGrid:
    """From (-1, -2) to (11, 2) in cells of 10 cm: free inside, with a wall on both long sides."""
    cells = np.zeros((40, 120), np.int8)
    cells[[0, -1]] = 100
    ahead = np.maximum(np.arange(120) * 0.1 - 1.0 - 2.0, 0.0)  # s until two metres before the cell
    seen_s = np.broadcast_to(ahead, cells.shape).astype(np.float32)
    return OccupancyGrid(cells, 0.1, (-1.0, -2.0), seen_s)


def path() -> Trajectory:
    time = np.linspace(0.0, 10.0, 101)
    return Trajectory(BEGIN + time, np.column_stack([time, 0.0 * time, 0.0 * time]))


def write_run(directory: Path) -> Path:
    """The run, in a new directory."""
    directory.mkdir()
    (directory / "map.geojson").write_text(geojson.encode(GRAPH))
    write_files(directory, encode_map_server(corridor()))
    for name in ("estimate.tum", "odometry.tum"):
        (directory / name).write_text(encode_tum(path()))
    lines = "".join(json.dumps(event) + "\n" for event in EVENTS)
    (directory / "events.jsonl").write_text(lines)
    (directory / "summary.json").write_text(json.dumps(SUMMARY))
    return directory
