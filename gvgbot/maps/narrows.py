"""Narrow ways of a grid: a robot might just fit through, but leaves them alone."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gvgbot.geometry import Array
from gvgbot.maps.gaps import is_floor, is_wall, reachable
from gvgbot.maps.occupancy import OccupancyGrid

_AREA_M2 = 0.5  # beyond one that is worth telling of, where the middle of the robot could be

Mask = NDArray[np.bool_]


def narrows(
    grid: OccupancyGrid, ways: Array, around: Array, radius: float, passage_m: float
) -> Array:
    """Places (N, 2), m, map frame, where a narrow way leads to seen floor without a way.

    The robot is at `around` (2,) and keeps `passage_m` from walls, more than its radius, m. Floor
    with a way (points (M, 2)) on it was reached in spite of that, or by another door. Walls of a
    grid are one or two cells thicker than they are.
    """
    cell, corner = grid.resolution_m, np.array(grid.origin)
    clearance = ndimage.distance_transform_edt(~is_wall(grid.cells)) * cell
    here = (around - corner)[::-1] / cell
    fits = reachable(is_floor(grid.cells) & (clearance > radius - 2 * cell), here)
    areas, _ = ndimage.label(fits & (clearance > passage_m))
    rows, columns = ((ways - corner) / cell).astype(int).T[::-1]
    reached = {*areas[reachable(areas > 0, here)], *areas[rows, columns]} - {0}
    sizes = np.bincount(areas.ravel())
    left = set(np.flatnonzero(sizes * cell**2 >= _AREA_M2)) - reached - {0}
    known, necks = np.isin(areas, list(reached)), fits & (areas == 0)
    found = [_between(known, areas == area, necks) for area in left]
    return corner + (np.array(found).reshape(-1, 2)[:, ::-1] + 0.5) * cell


def _between(one: Mask, other: Mask, necks: Mask) -> Array:
    """The (row, column) in the middle of the shortest neck from one area to another."""
    away = np.maximum(*(ndimage.distance_transform_edt(~area) for area in (one, other)))
    places = np.argwhere(necks)
    nearest: Array = places[np.argmin(away[necks])].astype(np.float64)
    return nearest
