"""Blanks of a route graph: floor that was seen, but that none of its edges leads to."""

import math

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from gvgbot.geometry import Array
from gvgbot.maps.gaps import Mask, is_floor, is_wall, reachable
from gvgbot.maps.occupancy import OccupancyGrid

_PEAK_M = 1.0  # around a place, none is farther from the walls
_BESIDE_M = 0.2  # a way to an edge ends so far from it
_AHEAD_M = 1.2  # the robot goes so far off an edge, to face what it looks at


def blanks(grid: OccupancyGrid, ways: Array, around: Array, passage_m: float) -> Array:
    """Places (N, 2), m, map frame, beside ways from where blanks are to be seen.

    A place that is farther from the walls than all others around it lies on the GVG. If no way
    (points (M, 2), a cell or less apart) comes into the largest disc about it that is free, the
    graph lacks something. The robot is at `around` (2,) and keeps `passage_m` from walls.
    """
    cell, corner = grid.resolution_m, np.array(grid.origin)
    clearance = ndimage.distance_transform_edt(~is_wall(grid.cells) & (grid.cells >= 0)) * cell
    floor = reachable(
        is_floor(grid.cells) & (clearance > passage_m), (around - corner)[::-1] / cell
    )
    highest = ndimage.maximum_filter(clearance, size=2 * math.ceil(_PEAK_M / cell) + 1)
    places = np.argwhere(floor & (clearance >= highest))
    if not len(places) or not len(ways):
        return np.empty((0, 2))
    away, _ = cKDTree(ways).query(corner + (places[:, ::-1] + 0.5) * cell)
    near_ways = _cells_near(ways, grid, floor)
    found: list[Array] = []
    for place in places[away > clearance[tuple(places.T)]]:
        beside = _on_the_way_there(place, floor, near_ways, round(_AHEAD_M / cell))
        if beside is not None and all(np.hypot(*(beside - one)) * cell > _PEAK_M for one in found):
            found.append(beside)
    return corner + (np.array(found).reshape(-1, 2)[:, ::-1] + 0.5) * cell


def _cells_near(ways: Array, grid: OccupancyGrid, floor: Mask) -> Mask:
    """The cells of the floor beside ways."""
    near = np.zeros(floor.shape, np.bool_)
    rows, columns = ((ways - grid.origin) / grid.resolution_m).astype(np.int64).T[::-1]
    inside = (rows >= 0) & (columns >= 0) & (rows < floor.shape[0]) & (columns < floor.shape[1])
    near[rows[inside], columns[inside]] = True
    near = ndimage.binary_dilation(near, iterations=round(_BESIDE_M / grid.resolution_m))
    return np.asarray(near & floor)


def _on_the_way_there(place: Array, floor: Mask, near_ways: Mask, ahead: int) -> Array | None:
    """The (row, column) so many cells off the way that is nearest to a place over the floor."""
    steps = np.full(floor.shape, -1)
    reached = np.zeros(floor.shape, np.bool_)
    reached[tuple(place)] = True
    front, count = reached, 0
    while not (front & near_ways).any():
        steps[front] = count
        grown = ndimage.binary_dilation(reached, mask=floor)
        front, reached, count = grown & ~reached, grown, count + 1
        if not front.any():
            return None
    here = np.argwhere(front & near_ways)[0]
    for _ in range(min(ahead, count)):
        count -= 1
        here = next(there for there in here + _BESIDE if steps[tuple(there)] == count)
    return np.asarray(here, np.float64)


_BESIDE = np.array([(0, 1), (1, 0), (0, -1), (-1, 0)])
