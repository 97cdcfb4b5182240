"""Hits of scans: how often something was seen at places, and for how long it has stood there."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gvgbot.autonomy.on_bodies import is_seen_through
from gvgbot.geometry import Array, Pose, resampled
from gvgbot.hal.messages import Scan
from gvgbot.hal.packed_scan import AnyScan
from gvgbot.maps.gaps import is_wall
from gvgbot.maps.occupancy import OccupancyGrid

_STEP_M = 0.1  # between points of a way
_ON_M = 0.1  # nearer to a way than any wall beside it, a wall is on it
_DRIVEN_M = 0.3  # so near to where it has been, the robot may drive
_LOOKS = 3  # that hit a wall at one place; people who pass by are hit there once or twice
_CORE_M = 0.1  # of somebody: who sees through it sees that he has gone

Scans = Sequence[tuple[Pose, AnyScan]]  # where each was taken (map_base)


def hits(scans: Scans, places: Array, within_m: float) -> NDArray[np.int64]:
    """How many scans hit something near places (N, 2), m, map frame; each hit is the nearest's."""
    looks = np.zeros(len(places), np.int64)
    for _, _, found in _with_hits(scans, places, within_m):
        looks[found] += 1
    return looks


def stood_s(scans: Scans, places: Array, within_m: float) -> Array:
    """For how long (N,), s, something has stood near places (N, 2), m, map frame.

    From the first scan that hit it to the last one, also where nobody looked in between; but not
    if a scan sees through the place: then it was somebody else before. Scans come as they were
    taken; where stamps go back the clock began anew, and nobody knows how long that took.
    """
    first, last = np.full(len(places), np.nan), np.full(len(places), np.nan)
    before = -np.inf
    for map_base, scan, found in _with_hits(scans, places, within_m):
        if scan.stamp < before:
            first[:] = np.nan
        before = scan.stamp
        is_hit = np.zeros(len(places), np.bool_)
        is_hit[found] = True
        for place in np.flatnonzero(
            (np.isfinite(first) | is_hit) & _in_view(scan, map_base, places)
        ):
            if is_seen_through(scan, map_base, (places[place], _CORE_M)):
                first[place], is_hit[place] = np.nan, False  # it was the wall behind
        first[is_hit & np.isnan(first)] = scan.stamp
        last[is_hit] = scan.stamp
    return np.asarray(np.nan_to_num(last - first))


def _in_view(scan: Scan, map_base: Pose, places: Array) -> NDArray[np.bool_]:
    """Whether beams towards each of the places (N, 2), map frame, get as far as that."""
    x, y = map_base.compose(scan.base_laser).inverse().transform(places).T
    beam = np.round((np.arctan2(y, x) - scan.angle_min) % math.tau / scan.angle_increment)
    beside = np.add.outer([-1, 0, 1], beam.astype(np.intp)).clip(0, len(scan.ranges) - 1)
    told = np.fmax.reduce(scan.ranges[beside])  # one of them may have no echo
    return np.asarray((beam < len(scan.ranges)) & (told > np.hypot(x, y)))


def _with_hits(
    scans: Scans, places: Array, within_m: float
) -> Iterator[tuple[Pose, Scan, NDArray[np.intp]]]:
    """All scans, with where they were taken and which of the places (N, 2) they hit."""
    tree = cKDTree(places)
    for map_base, packed in scans if len(places) else ():
        scan = packed.unpacked()
        ends = map_base.compose(scan.base_laser).transform(scan.ends)
        near = np.asarray(tree.query(ends, distance_upper_bound=within_m)[1])
        yield map_base, scan, np.unique(near[near < len(places)])


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
    is_hit = hits(scans, points[is_left], _ON_M) >= _LOOKS
    return np.isin(np.arange(len(lines)), number[is_left][is_hit])
