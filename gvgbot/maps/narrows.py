"""Narrow ways of a grid: a robot might just fit through, but leaves them alone."""

import numpy as np
from scipy import ndimage

from gvgbot.geometry import Array
from gvgbot.maps.distances import cells_to, metres_to
from gvgbot.maps.gaps import is_floor, is_wall, reachable
from gvgbot.maps.occupancy import OccupancyGrid
from gvgbot.maps.viewpoints import cells_near

_AREA_M2 = 0.5  # beyond one that is worth telling of, where the middle of the robot could be


def narrows(
    grid: OccupancyGrid, ways: Array, around: Array, radius: float, passage_m: float
) -> Array:
    """Places (N, 2), m, map frame, where a narrow way leads to seen floor without a way.

    The robot is at `around` (2,) and keeps `passage_m` from walls, more than its radius, m. Floor
    with a way (points (M, 2)) on it was reached in spite of that, or by another door. Walls of a
    grid are one or two cells thicker than they are.
    """
    cell, corner = grid.resolution_m, np.array(grid.origin)
    clearance = metres_to(is_wall(grid.cells), cell)
    here = (around - corner)[::-1] / cell
    fits = reachable(is_floor(grid.cells) & (clearance > radius - 2 * cell), here)
    has_room = fits & (clearance > passage_m)
    del clearance  # a large grid's takes much memory
    areas, _ = ndimage.label(has_room)
    reached = np.unique(areas[reachable(has_room, here) | cells_near(ways, grid, has_room)])
    large = np.flatnonzero(np.bincount(areas.ravel()) * cell**2 >= _AREA_M2)
    known, necks = has_room & np.isin(areas, reached), fits & ~has_room
    to_known, places = cells_to(known)[necks], np.argwhere(necks)
    found = [
        places[np.argmin(np.maximum(to_known, cells_to(areas == area)[necks]))]
        for area in np.setdiff1d(large, [0, *reached])
    ]
    return corner + (np.array(found).reshape(-1, 2)[:, ::-1] + 0.5) * cell
