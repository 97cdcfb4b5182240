"""Gaps of a grid: where floor that the robot can reach borders on floor that nobody has seen."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gvgbot.geometry import Array
from gvgbot.maps.distances import metres_to
from gvgbot.maps.map_server import FREE_THRESH, OCCUPIED_THRESH
from gvgbot.maps.occupancy import UNKNOWN, Cells, OccupancyGrid

_DEPTH_M, _AREA_M2 = 1.0, 0.5  # so deep and so large is the unseen floor that is worth a drive
_JOINED_M = 0.1  # a brink is thickened by so much, to be in one piece

Mask = NDArray[np.bool_]


def gaps(grid: OccupancyGrid, around: Array, passage_m: float) -> Array:
    """Places (N, 2), m, map frame, on seen floor from which the robot could drive onto unseen.

    `around` (2,) is where the robot is; it keeps `passage_m` from walls. Shadows of furniture and
    slits between walls are no gaps. Floor behind them is not reached, and not told of.
    """
    cell = grid.resolution_m
    margin = math.ceil(_DEPTH_M / cell)  # what is beyond the grid is unseen as well
    cells = np.pad(grid.cells, margin, constant_values=UNKNOWN)
    corner = np.array(grid.origin) - margin * cell
    wall, seen = is_wall(cells), is_floor(cells)
    if not wall.any():
        return np.empty((0, 2))
    has_room = metres_to(wall, cell) > passage_m
    here = (around - corner)[::-1] / cell
    floor = reachable(seen & has_room, here)
    unseen = has_room & ~seen & ~wall
    brink = unseen & ndimage.binary_dilation(floor)
    joined = ndimage.binary_dilation(brink, iterations=max(1, round(_JOINED_M / cell)))
    labels, _ = ndimage.label(joined)
    found = []
    for number, box in enumerate(ndimage.find_objects(labels), start=1):
        wide = tuple(slice(max(0, s.start - margin), s.stop + margin) for s in box)
        own = brink[wide] & (labels[wide] == number)
        if _is_worth(own, unseen[wide], cell):
            first = [s.start for s in wide]
            found.append(_beside(own, floor[wide], here - 0.5 - first, margin) + first)
    return corner + (np.array(found).reshape(-1, 2)[:, ::-1] + 0.5) * cell


def is_wall(cells: Cells) -> Mask:
    """Which cells are a wall, as in a saved map."""
    return np.asarray(cells > 100.0 * OCCUPIED_THRESH)


def is_floor(cells: Cells) -> Mask:
    """Which cells are seen to be free, as in a saved map."""
    return np.asarray((cells >= 0) & (cells < 100.0 * FREE_THRESH))


def reachable(floor: Mask, here: Array) -> Mask:
    """The part of the floor that hangs together and is nearest to a (row, column)."""
    if not floor.any():
        return floor
    row, column = (np.arange(n) + 0.5 - at for n, at in zip(floor.shape, here, strict=True))
    nearest, least = (0, 0), math.inf
    for i in np.flatnonzero(floor.any(axis=1)).tolist():  # by rows: a large grid takes much memory
        away = np.where(floor[i], np.hypot(row[i], column), np.inf)
        j = int(away.argmin())
        if away[j] < least:
            nearest, least = (i, j), away[j]
    labels, _ = ndimage.label(floor)
    return np.asarray(labels == labels[nearest])


def _is_worth(brink: Mask, unseen: Mask, cell: float) -> bool:
    """Whether so much is unseen behind it that something may be there."""
    steps = math.ceil(_DEPTH_M / cell)
    behind = ndimage.binary_dilation(brink, iterations=steps, mask=unseen)
    return bool(behind.sum() * cell**2 >= _AREA_M2)


def _beside(brink: Mask, floor: Mask, here: Array, far: float) -> Array:
    """The (row, column) of seen floor that is nearest to the middle of the brink.

    A brink that bends may have that `far` inside, as all round an island in a hall: then it is the
    floor at the brink that is nearest to the robot.
    """
    nearest = _nearest(np.argwhere(floor), np.argwhere(brink).mean(axis=0))
    rim = np.argwhere(floor & ndimage.binary_dilation(brink))
    if np.hypot(*(rim - nearest).T).min() > far:
        nearest = _nearest(rim, here)
    return nearest


def _nearest(places: NDArray[np.intp], here: Array) -> Array:
    nearest: Array = places[np.argmin(np.hypot(*(places - here).T))].astype(np.float64)
    return nearest
