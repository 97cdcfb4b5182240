"""Spots of a grid: where something stood of which nobody knows whether it is there still."""

import numpy as np

from gvgbot.geometry import Array
from gvgbot.maps.distances import metres_to
from gvgbot.maps.gaps import Mask, is_floor, is_wall, reachable
from gvgbot.maps.occupancy import OccupancyGrid

_ASIDE_M = 1.0  # the floor beside a spot is nearer than that


def spots(
    grid: OccupancyGrid, places: Array, radii: Array, around: Array, passage_m: float
) -> Array:
    """Floor (M, 2), m, map frame, beside those discs that the grid says nothing of.

    It tells of who has been let into the map, and of the floor where somebody has gone. The robot
    is at `around` (2,) and keeps `passage_m` from walls, and from them.
    """
    if not len(places):
        return np.empty((0, 2))
    cell, corner = grid.resolution_m, np.array(grid.origin)
    wall, floor = is_wall(grid.cells), is_floor(grid.cells)
    has_room = metres_to(wall, cell) > passage_m
    to_drive = reachable(floor & has_room, (around - corner)[::-1] / cell)
    found = []
    for place, radius in zip((places - corner)[:, ::-1] / cell, radii / cell, strict=True):
        first = np.maximum(np.floor(place - radius - _ASIDE_M / cell), 0).astype(int)
        last = np.ceil(place + radius + _ASIDE_M / cell).astype(int)
        box = tuple(slice(a, max(a, b)) for a, b in zip(first, last, strict=True))
        beside = np.argwhere(to_drive[box]) + first + 0.5
        away = np.hypot(*(beside - place).T)
        away[away < radius + passage_m / cell] = np.inf
        is_told_of = _is_told_of(wall[box], floor[box], place - first, float(radius))
        if np.isfinite(away).any() and not is_told_of:
            found.append(beside[np.argmin(away)])
    return corner + np.array(found).reshape(-1, 2)[:, ::-1] * cell


def _is_told_of(wall: Mask, floor: Mask, middle: Array, radius: float) -> bool:
    """Whether there is a wall in a disc, by its (row, column), or floor in most of it; cells."""
    rows, columns = np.indices(wall.shape) + 0.5
    disc = np.hypot(rows - middle[0], columns - middle[1]) < radius
    return bool(wall[disc].any() or 2 * floor[disc].sum() > disc.sum())
