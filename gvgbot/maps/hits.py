"""Hits of scans: how often, and for how long, there was something to be seen at places."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gvgbot.geometry import Array, Pose, resampled
from gvgbot.hal.packed_scan import AnyScan
from gvgbot.maps.gaps import is_wall
from gvgbot.maps.occupancy import OccupancyGrid

_STEP_M = 0.1  # between points of a way
_ON_M = 0.1  # nearer to a way than any wall beside it, a wall is on it
_DRIVEN_M = 0.3  # so near to where it has been, the robot may drive
_LOOKS = 3  # that hit a wall at one place; people who pass by are hit there once or twice
_IN_SIGHT_S = 5.0  # from look to look; later, somebody else may stand there

Scans = Sequence[tuple[Pose, AnyScan]]  # where each was taken (map_base)


class Hits(NamedTuple):
    """How many scans hit each of some places (N,), and for how long, s, it was in sight of them."""

    looks: NDArray[np.int64]
    seconds: Array


def hits(scans: Scans, places: Array, within_m: float) -> Hits:
    """The hits near places (N, 2), m, map frame: each counts for the nearest one.

    Scans come in the order of their stamps.
    """
    looks = np.zeros(len(places) + 1, np.int64)  # the last one for what is farther off
    seconds, latest = np.zeros(len(looks)), np.full(len(looks), -np.inf)
    tree = cKDTree(places)
    for map_base, scan in scans if len(places) else ():
        ends = map_base.compose(scan.base_laser).transform(scan.unpacked().ends)
        found = np.unique(tree.query(ends, distance_upper_bound=within_m)[1])
        since = scan.stamp - latest[found]
        looks[found] += 1
        seconds[found] += np.where((since > 0.0) & (since < _IN_SIGHT_S), since, 0.0)
        latest[found] = scan.stamp
    return Hits(looks[:-1], seconds[:-1])


def barred(
    scans: Scans, ways: Sequence[Array], grid: OccupancyGrid, driven: Array
) -> NDArray[np.bool_]:
    """Which ways (K,), each of points (N, 2), m, map frame, lead over floor where scans hit a wall.

    Head-on, glass looks like a wall, and from aside as if nothing were there. A wall that is in the
    grid is none of glass, and where the robot has been (M, 2) there is none.
    """
    lines = [resampled(way, _STEP_M) for way in ways]
    number = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    points = np.concatenate([np.empty((0, 2)), *lines])
    walls = grid.middles(is_wall(grid.cells))
    is_left = cKDTree(driven).query(points)[0] > _DRIVEN_M
    is_left &= cKDTree(walls).query(points)[0] > _ON_M
    is_hit = hits(scans, points[is_left], _ON_M).looks >= _LOOKS
    return np.isin(np.arange(len(lines)), number[is_left][is_hit])
