"""Hollows of a route graph: rings of its edges that go round nothing."""

import numpy as np
from scipy import ndimage

from gvgbot.geometry import Array
from gvgbot.maps.distances import metres_to
from gvgbot.maps.gaps import is_floor, is_wall
from gvgbot.maps.occupancy import OccupancyGrid
from gvgbot.maps.viewpoints import marked

_DEPTH_M = 0.35  # edges that lie side by side are one that is blurred; who is driven round is wider
_NOT_OPEN = 0.9  # of the clearance in the open: there edges go round the floor


def hollows(grid: OccupancyGrid, ways: Array, open_m: float) -> Array:
    """Places (N, 2), m, map frame, in the middle of hollows.

    Ways (points (M, 2), a cell or less apart) of a GVG go round walls. What they go round is gone
    if there is nothing but floor. Farther than `open_m` from walls there are no edges.
    """
    cell, drawn = grid.resolution_m, marked(ways, grid)
    areas, count = ndimage.label(~drawn)
    is_full = np.bincount(areas[~is_floor(grid.cells)], minlength=count + 1) > 0
    numbers = np.flatnonzero(~is_full[1:]) + 1
    if not len(numbers):
        return np.empty((0, 2))
    inside, clearance = metres_to(drawn, cell), metres_to(is_wall(grid.cells), cell)
    depth, room = (ndimage.maximum(away, areas, numbers) for away in (inside, clearance))
    numbers = numbers[(depth > _DEPTH_M) & (room < _NOT_OPEN * open_m)]
    places = np.array(ndimage.maximum_position(inside, areas, numbers)).reshape(-1, 2)
    return np.array(grid.origin) + (places[:, ::-1] + 0.5) * cell
