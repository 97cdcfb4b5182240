"""Distances over the cells of a grid."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gvgbot.geometry import Array

_STRIP = 64  # rows that are worked on at a time


def cells_to(area: NDArray[np.bool_]) -> Array:
    """How far each cell of a grid is from the nearest one of an area, in cells, middle to middle.

    By SciPy, which finds the nearest ones, but would take twice the memory and the time to say how
    far they are.
    """
    nearest = ndimage.distance_transform_edt(~area, return_distances=False, return_indices=True)
    away = np.empty(area.shape)
    columns = np.arange(area.shape[1])
    for first in range(0, len(area), _STRIP):
        strip = slice(first, first + _STRIP)
        rows = np.arange(len(area))[strip, None]
        to_row, to_column = nearest[:, strip]
        np.sqrt((to_row - rows) ** 2 + (to_column - columns) ** 2, out=away[strip])
    return away


def metres_to(area: NDArray[np.bool_], cell: float) -> Array:
    """The same in metres, for cells of a side, m; in the memory of the first."""
    away = cells_to(area)
    away *= cell
    return away
