"""Time and memory of what is written at the end of a run: grid, graph, picture."""

import math
import resource
from collections.abc import Callable
from time import process_time

import numpy as np

from benchmarks.report import report_fact
from gvgbot.geometry import Pose
from gvgbot.hal.messages import Scan
from gvgbot.maps import geojson
from gvgbot.maps.map_server import encode_map_server
from gvgbot.maps.occupancy import OccupancyGrid, occupancy_grid
from gvgbot.maps.picture import draw_map
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode
from gvgbot.maps.trajectory import Trajectory, encode_tum

SIDE = 60.0  # m
SCANS, BEAMS = 600, 1081
VERTICES = 200


def scans() -> list[tuple[Pose, Scan]]:
    rng = np.random.default_rng(1)
    step = math.radians(270.0) / (BEAMS - 1)
    return [
        (
            Pose.from_array(rng.uniform([0.0, 0.0, -3.0], [SIDE, SIDE, 3.0])),
            Scan(0.0, rng.uniform(2.0, 12.0, BEAMS), -math.radians(135.0), step, 0.1, 30.0),
        )
        for _ in range(SCANS)
    ]


def graph() -> RouteGraph:
    rng = np.random.default_rng(2)
    places = rng.uniform(0.0, SIDE, (VERTICES, 2))
    vertices = [
        RouteNode(
            id=number,
            kind="meetpoint",
            position=(float(x), float(y)),
            degree=3,
            bearings=(0.0, 2.0, 4.0),
            clearance=1.0,
            covariance=(0.02, 0.0, 0.0, 0.01),
        )
        for number, (x, y) in enumerate(places)
    ]
    edges = [
        RouteEdge(
            start=number,
            end=number + 1,
            polyline=np.linspace(places[number], places[number + 1], 100),
            min_clearance=0.5,
        )
        for number in range(VERTICES - 1)
    ]
    return RouteGraph(tuple(vertices), tuple(edges))


def trajectory() -> Trajectory:
    turns = np.linspace(0.0, 200.0, 40_000)
    radius = SIDE / 2 * turns / 200.0
    poses = np.column_stack(
        [SIDE / 2 + radius * np.cos(turns), SIDE / 2 + radius * np.sin(turns), turns]
    )
    return Trajectory(turns * 10.0, poses)


def timed(name: str, action: Callable[[], object]) -> None:
    before, start = peak_mb(), process_time()
    action()
    report_fact(name, process_time() - start, "s of CPU")
    report_fact(f"{name}: peak memory, more than before", peak_mb() - before, "MB")


def peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    taken, routes, path = scans(), graph(), trajectory()
    grids: list[OccupancyGrid] = []
    timed(f"grid of {SCANS} scans", lambda: grids.append(occupancy_grid(taken)))
    timed("map.pgm and map.yaml", lambda: encode_map_server(grids[0]))
    timed("map.geojson", lambda: geojson.encode(routes))
    timed(f"a .tum of {len(path.stamps)} poses", lambda: encode_tum(path))
    timed("map.png", lambda: draw_map(routes, grid=grids[0], estimate=path, odometry=path))
    report_fact("peak memory of the process", peak_mb(), "MB")


if __name__ == "__main__":
    main()
