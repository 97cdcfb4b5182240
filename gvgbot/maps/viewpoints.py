"""Viewpoints: from where a robot that keeps to its ways sees what lies off them."""

import numpy as np
from scipy import ndimage

from gvgbot.geometry import Array
from gvgbot.maps.gaps import Mask, is_floor, is_wall, reachable
from gvgbot.maps.occupancy import OccupancyGrid

_BESIDE_M = 0.2  # a place so near to a way is on it
_FAR_M = 8.0  # what is farther from all ways, on either axis, is not gone to
_NEIGHBOURS = np.array([(0, 1), (1, 0), (0, -1), (-1, 0)])


def viewpoints(
    grid: OccupancyGrid,
    ways: Array,
    places: Array,
    around: Array,
    passage_m: float,
    off_m: Array,
) -> Array:
    """Where to go (M, 2), m, map frame, for a look at places (N, 2) to which the floor leads.

    That is on the shortest path over the floor from the nearest way (points (K, 2), a cell or less
    apart) to the place, `off_m` (N,) off that way at most. The robot is at `around` (2,) and keeps
    `passage_m` from walls.
    """
    cell, corner = grid.resolution_m, np.array(grid.origin)
    walls = is_wall(grid.cells)
    has_room = ndimage.distance_transform_edt(~walls) * cell > passage_m
    floor = reachable(is_floor(grid.cells) & has_room, (around - corner)[::-1] / cell)
    near_ways = _cells_near(ways, grid, floor)
    found, far = [], round(_FAR_M / cell)
    cells = ((places - corner)[:, ::-1] / cell).astype(np.int64)
    for place, off in zip(cells, np.rint(off_m / cell).astype(int).tolist(), strict=True):
        first = np.maximum(place - far, 0)
        around_it = tuple(slice(a, b) for a, b in zip(first, place + far, strict=True))
        row, column = (place - first).tolist()
        view = _on_the_way_there((row, column), floor[around_it], near_ways[around_it], off)
        if view is not None:
            found.append(view + first)
    return corner + (np.array(found).reshape(-1, 2)[:, ::-1] + 0.5) * cell


def _cells_near(ways: Array, grid: OccupancyGrid, floor: Mask) -> Mask:
    """The cells of the floor beside ways."""
    near = np.zeros(floor.shape, np.bool_)
    rows, columns = ((ways - grid.origin) / grid.resolution_m).astype(np.int64).T[::-1]
    inside = (rows >= 0) & (columns >= 0) & (rows < floor.shape[0]) & (columns < floor.shape[1])
    near[rows[inside], columns[inside]] = True
    near = ndimage.binary_dilation(near, iterations=round(_BESIDE_M / grid.resolution_m))
    return np.asarray(near & floor)


def _on_the_way_there(
    place: tuple[int, int], floor: Mask, near_ways: Mask, off: int
) -> Array | None:
    """The (row, column) at most so many cells off the nearest way, on the path to a place."""
    floor, near_ways = np.pad(floor, 1), np.pad(near_ways, 1)  # every cell has four neighbours
    steps = np.full(floor.shape, -1)
    reached = np.zeros(floor.shape, np.bool_)
    reached[place[0] + 1, place[1] + 1] = floor[place[0] + 1, place[1] + 1]
    front, count = reached, 0
    while not (front & near_ways).any():
        if not front.any():
            return None
        steps[front] = count
        grown = ndimage.binary_dilation(reached, mask=floor)
        front, reached, count = grown & ~reached, grown, count + 1
    here = np.argwhere(front & near_ways)[0]
    for _ in range(min(off, count)):
        count -= 1
        here = next(there for there in here + _NEIGHBOURS if steps[tuple(there)] == count)
    return np.asarray(here - 1, np.float64)
