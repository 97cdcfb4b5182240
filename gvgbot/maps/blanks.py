"""Blanks of a route graph: floor that was seen, but that none of its edges leads to."""

import math

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from gvgbot.geometry import Array
from gvgbot.maps.distances import metres_to
from gvgbot.maps.gaps import is_floor, is_wall, reachable
from gvgbot.maps.occupancy import OccupancyGrid

_PEAK_M = 1.0  # around a place, none is farther from the walls


def blanks(grid: OccupancyGrid, ways: Array, around: Array, passage_m: float) -> Array:
    """Places (N, 2), m, map frame, in the middle of blanks.

    A place that is farther from the walls than all others around it lies on the GVG. If no way
    (points (M, 2)) comes into the largest disc about it that is free, the graph lacks something.
    The robot is at `around` (2,) and keeps `passage_m` from walls.
    """
    cell, corner = grid.resolution_m, np.array(grid.origin)
    clearance = metres_to(is_wall(grid.cells) | (grid.cells < 0), cell)
    floor = reachable(
        is_floor(grid.cells) & (clearance > passage_m), (around - corner)[::-1] / cell
    )
    highest = ndimage.maximum_filter(clearance, size=2 * math.ceil(_PEAK_M / cell) + 1)
    peaks = np.argwhere(floor & (clearance >= highest))
    if not len(peaks) or not len(ways):
        return np.empty((0, 2))
    places = corner + (peaks[:, ::-1] + 0.5) * cell
    away, _ = cKDTree(ways).query(places)
    found: list[Array] = []
    for place in places[away > clearance[tuple(peaks.T)]]:
        if all(np.hypot(*(place - one)) > _PEAK_M for one in found):
            found.append(place)
    return np.array(found).reshape(-1, 2)
