"""Walls with known geometry, and what a laser sees of them."""

import math
from collections.abc import Iterable

import numpy as np

from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.gvg.reduction import ReductionConfig, reduce_graph
from gvgbot.autonomy.gvg.voronoi import FineGraph, fine_graph
from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan

CELL = 0.02  # m
MARGIN = 1.0  # m of wall around everything
RADIUS = 0.2  # m that the robot needs to each side
BEAMS = 1081
ALL_ROUND = math.tau  # the last beam looks where the first one does
LASER_270 = 1.5 * math.pi

Rectangle = tuple[float, float, float, float]  # x0, y0, x1, y1 in m


def carved(free: Iterable[Rectangle], walls: Iterable[Rectangle] = ()) -> World:
    """Solid wall but for free rectangles, with further walls built into those."""
    free = list(free)
    low = np.array([r[:2] for r in free]).min(axis=0) - MARGIN
    high = np.array([r[2:] for r in free]).max(axis=0) + MARGIN
    width, height = np.round((high - low) / CELL).astype(int)
    occupied = np.ones((height, width), bool)
    for rectangles, value in ((free, False), (walls, True)):
        for x0, y0, x1, y1 in rectangles:
            i0, j0, i1, j1 = np.round((np.array([x0, y0, x1, y1]) - [*low, *low]) / CELL).astype(
                int
            )
            occupied[j0:j1, i0:i1] = value
    return World(occupied, CELL, (float(low[0]), float(low[1])))


def sweep(
    world: World,
    world_laser: Pose,
    *,
    field_of_view: float = ALL_ROUND,
    sigma: float = 0.0,
    rng: np.random.Generator | None = None,
    reach: float = 30.0,
) -> Scan:
    """A scan of the world; with noise (sigma, m) if a generator is given."""
    bearings = np.linspace(-field_of_view / 2, field_of_view / 2, BEAMS)
    ranges = world.cast(world_laser, bearings, reach)
    if rng is not None:
        ranges = ranges + rng.normal(0.0, sigma, len(ranges))
    increment = field_of_view / (BEAMS - 1)
    return Scan(0.0, ranges, -field_of_view / 2, increment, 0.1, reach)


def looked(
    world: World,
    path: Iterable[Pose],
    *,
    local_world: Pose | None = None,
    config: LocalMapConfig | None = None,
    sigma: float = 0.0,
    rng: np.random.Generator | None = None,
    field_of_view: float = ALL_ROUND,
) -> LocalMap:
    """The local map after a scan at each pose of a path (world_laser)."""
    local_map = LocalMap(config or LocalMapConfig(half_width_m=10.0))
    travelled, last = 0.0, None
    for pose in path:
        travelled += 0.0 if last is None else last.distance(pose)
        last = pose
        scan = sweep(world, pose, sigma=sigma, rng=rng, field_of_view=field_of_view)
        local_laser = (local_world or Pose()).compose(pose)
        local_map.insert(scan, local_laser, travelled)
    return local_map


def fine(local_map: LocalMap, robot: tuple[float, float]) -> FineGraph:
    """The fine Voronoi graph around the robot, for a robot of RADIUS."""
    roughness = ReductionConfig().roughness_m
    return fine_graph(local_map, np.array(robot), min_clearance=RADIUS, roughness=roughness)


def seen(local_map: LocalMap, robot: tuple[float, float]) -> LocalGvg:
    """The local GVG around the robot."""
    return reduce_graph(fine(local_map, robot), ReductionConfig())


def meetpoints(gvg: LocalGvg) -> Array:
    """Positions (N, 2) of the meetpoints."""
    return np.array([n.position for n in gvg.nodes.values() if n.is_meetpoint]).reshape(-1, 2)


def endpoints(gvg: LocalGvg) -> Array:
    """Positions (N, 2) of the endpoints."""
    return np.array([n.position for n in gvg.nodes.values() if n.is_endpoint]).reshape(-1, 2)


def all_points(gvg: LocalGvg) -> Array:
    """The points (N, 2) of all edges."""
    return np.concatenate([e.polyline for e in gvg.edges.values()])


def line(x0: float, y0: float, x1: float, y1: float, theta: float, count: int = 5) -> list[Pose]:
    """Poses along a straight line, all with one heading."""
    return [
        Pose(float(x), float(y), theta)
        for x, y in zip(np.linspace(x0, x1, count), np.linspace(y0, y1, count), strict=True)
    ]
