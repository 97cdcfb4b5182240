"""Virtual walls: lines on the map that the robot does not cross, though nothing stands there."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gvgbot.geometry import Array, resampled, sampled, stations_of
from gvgbot.ranges import Range

Coordinate = Annotated[float, Range(-1e4, 1e4)]  # m, map frame
_SPACING_M = 0.1  # of the points that stand for a wall: no robot fits between two
_CROSSING_M = 0.06  # so near to a point a way leads over the wall: half of that and a little
_ON_M = 0.1  # who stands so near to a point is on the wall
_FEW = 50  # places, that are asked about before all others
VirtualWall = tuple[tuple[Coordinate, Coordinate], ...]  # from corner to corner


def checked(walls: Sequence[VirtualWall]) -> None:
    """Raises ValueError for a wall that is no line."""
    for number, wall in enumerate(walls):
        if len(set(wall)) < 2:
            raise ValueError(f"virtual_walls[{number}]: a wall needs two different points, x and y")


def points_of(walls: Sequence[VirtualWall]) -> Array:
    """Points (N, 2) that stand for the walls, map frame."""
    return sampled(walls, _SPACING_M)


def crossings(walls: Array, lines: Sequence[Array]) -> list[tuple[float, ...]]:
    """Where each of the lines (N, 2) leads over walls, as points (M, 2): m along it."""
    if not lines:
        return []
    tree, ends = cKDTree(walls), np.cumsum([len(line) for line in lines])
    points = np.concatenate(lines)
    steps = np.hypot(*(points[1:] - points[:-1]).T)
    steps[ends[:-1] - 1] = 0.0  # from line to line
    reach = _CROSSING_M + float(steps.max(initial=0.0))  # of a crossing, both points are near
    is_near = np.isfinite(tree.query(points, distance_upper_bound=reach)[0])
    return [
        _crossings_of(tree, line) if near.any() else ()
        for line, near in zip(lines, np.split(is_near, ends[:-1]), strict=True)
    ]


def _crossings_of(walls: cKDTree, line: Array) -> tuple[float, ...]:
    line = resampled(line, _SPACING_M / 2)
    is_on = np.concatenate([[False], walls.query(line)[0] < _CROSSING_M])
    begins = np.flatnonzero(is_on[1:] & ~is_on[:-1])
    return tuple(stations_of(line)[begins].tolist())


def nearest_before(walls: Array, here: Array, places: Array, away: Array) -> int | None:
    """Which of places (N, 2) is the least `away` (N,) of those before walls, as points (M, 2).

    None if a straight way from here (2,) leads to none of them but over a wall.
    """
    if not len(walls):
        return int(away.argmin())
    order = np.argsort(away, kind="stable")
    for some in np.split(order, [1, _FEW]):  # it is hardly ever another one than the first
        before = some[~_are_beyond(walls, here, places[some])]
        if len(before):
            return int(before[0])
    return None


def _are_beyond(walls: Array, here: Array, places: Array) -> NDArray[np.bool_]:
    """Which of places (N, 2) are beyond walls; who stands on a wall is on neither side of it."""
    ways, walls = places - here, walls - here
    lengths, away = np.hypot(*ways.T), np.hypot(*walls.T)
    walls = walls[(away > _ON_M) & (away < lengths.max(initial=0.0) + _CROSSING_M)]
    share = np.clip(ways @ walls.T / np.maximum(lengths, 1e-6)[:, None] ** 2, 0.0, 1.0)
    x, y = (walls[:, k] - share * ways[:, k, None] for k in (0, 1))
    beyond: NDArray[np.bool_] = (np.hypot(x, y) < _CROSSING_M).any(axis=1)
    return beyond
