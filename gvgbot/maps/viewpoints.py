"""Viewpoints: from where a robot that keeps to its ways sees what lies off them."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from gvgbot.geometry import Array
from gvgbot.maps.distances import metres_to
from gvgbot.maps.gaps import Mask, is_floor, is_wall, reachable
from gvgbot.maps.occupancy import OccupancyGrid

_BESIDE_M = 0.2  # a place so near to a way is on it

Cell = NDArray[np.int64]  # its row and column


def viewpoints(
    grid: OccupancyGrid,
    ways: Array,
    places: Array,
    around: Array,
    passage_m: float,
    off_m: Array,
    within_m: float = np.inf,
) -> Array | None:
    """Where to go (M, 2), m, map frame, for a look at places (N, 2) to which the floor leads.

    That is on the shortest path over the floor from the nearest way (points (K, 2), a cell or less
    apart) to the place, `off_m` (N,) off that way at most, or farther, to within `within_m` of the
    place. The robot is at `around` (2,) and keeps `passage_m` from walls. None if no way is so far
    from them, anywhere.
    """
    cell, corner = grid.resolution_m, np.array(grid.origin)
    has_room, floor = _room(grid, around, passage_m)
    if not (marked(ways, grid) & has_room).any():
        return None
    near_ways = cells_near(ways, grid, floor)
    floor, near_ways = np.pad(floor, 1), np.pad(near_ways, 1)  # every cell has four neighbours
    found = []
    cells = ((places - corner)[:, ::-1] / cell).astype(np.int64) + 1
    for place, off in zip(cells, (off_m / cell).tolist(), strict=True):
        view = _on_the_way_there(place, floor, near_ways, off, within_m / cell)
        if view is not None:
            found.append(view - 1)
    views: Array = corner + (np.array(found).reshape(-1, 2)[:, ::-1] + 0.5) * cell
    return views


def floor_beside(grid: OccupancyGrid, places: Array, around: Array, passage_m: float) -> Array:
    """The floor (N, 2), m, map frame, nearest to places (N, 2) that the robot does not fit into.

    The robot is at `around` (2,) and keeps `passage_m` from walls.
    """
    if not len(places):
        return places
    _, floor = _room(grid, around, passage_m)
    middles = grid.middles(floor)
    return middles[cKDTree(middles).query(places)[1]] if len(middles) else np.empty((0, 2))


def _room(grid: OccupancyGrid, around: Array, passage_m: float) -> tuple[Mask, Mask]:
    """The cells that are so far from walls, and the floor of these that leads to `around` (2,)."""
    has_room = metres_to(is_wall(grid.cells), grid.resolution_m) > passage_m
    here = (around - np.array(grid.origin))[::-1] / grid.resolution_m
    return has_room, reachable(is_floor(grid.cells) & has_room, here)


def cells_near(ways: Array, grid: OccupancyGrid, floor: Mask) -> Mask:
    """The cells of the floor beside ways."""
    near = marked(ways, grid)
    near = ndimage.binary_dilation(near, iterations=round(_BESIDE_M / grid.resolution_m))
    return np.asarray(near & floor)


def marked(ways: Array, grid: OccupancyGrid) -> Mask:
    """The cells that ways (points (K, 2)) pass."""
    height, width = grid.cells.shape
    marked = np.zeros((height, width), np.bool_)
    rows, columns = ((ways - grid.origin) / grid.resolution_m).astype(np.int64).T[::-1]
    inside = (rows >= 0) & (columns >= 0) & (rows < height) & (columns < width)
    marked[rows[inside], columns[inside]] = True
    return marked


def _on_the_way_there(
    place: Cell, floor: Mask, near_ways: Mask, off: float, within: float
) -> Cell | None:
    """The (row, column) on the path to a place, `off` the nearest way at most, or `within` of it.

    Both are in cells.
    """
    width, is_floor_at, is_near = floor.shape[1], floor.ravel(), near_ways.ravel()
    beside = np.array([1, width, -1, -width])
    steps = np.full(floor.size, -1, np.int32)
    start = np.ravel_multi_index(tuple(place), floor.shape)
    front, count = np.array([start])[is_floor_at[[start]]], 0
    while not is_near[front].any():
        if not len(front):
            return None
        steps[front] = count
        around = np.unique(front[:, None] + beside)
        front, count = around[is_floor_at[around] & (steps[around] < 0)], count + 1
    here = front[is_near[front]][0]
    for _ in range(min(round(max(off, count - within)), count)):
        count -= 1
        here = next(there for there in here + beside if steps[there] == count)
    return np.array(np.divmod(here, width))
