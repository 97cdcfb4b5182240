"""The Delaunay triangulation of points in the plane."""

from typing import Any, NamedTuple

import numpy as np
import pythoncdt
from numpy.typing import NDArray

from gvgbot.geometry import Array

_ORDER = pythoncdt.VertexInsertionOrder.AUTO
_EDGES = pythoncdt.IntersectingConstraintEdges.NOT_ALLOWED  # there are none
_AROUND = 3  # corners of a triangle around all points come first; the library is slow to erase it
_OPPOSITE = (1, 2, 0)  # which of the neighbours that it gives lie opposite to the corners


class Triangulation(NamedTuple):
    """Points (N, 2), and triangles (T, 3) of them, counterclockwise.

    `neighbours` (T, 3) are the triangles opposite to each corner, -1 beyond the hull.
    """

    points: Array
    triangles: NDArray[np.int32]
    neighbours: NDArray[np.int32]


def delaunay(points: Array) -> Triangulation | None:
    """The triangulation of finite points (N, 2), each taken once; None if they lie on one line."""
    try:
        cdt = _inserted(points)
    except RuntimeError:  # a point is there twice
        points = np.unique(points, axis=0)
        cdt = _inserted(points)
    found = cdt.triangles_array()
    corners, beyond = (found[part].view(np.int32) for part in ("vertices", "neighbors"))
    a, b, c = corners.T
    inner = (np.minimum(np.minimum(a, b), c) >= _AROUND).nonzero()[0]
    if not len(inner):
        return None
    number = np.full(len(corners) + 1, -1, np.int32)  # of what is kept; the last is of beyond, -1
    number[inner] = np.arange(len(inner))
    opposite = beyond.take(_OPPOSITE, axis=1).take(inner, axis=0)
    return Triangulation(points, corners.take(inner, axis=0) - _AROUND, number.take(opposite))


def _inserted(points: Array) -> pythoncdt.Triangulation:
    cdt = pythoncdt.Triangulation(_ORDER, _EDGES, 0.0)
    buffer: Any = np.ascontiguousarray(points, np.float64)  # typed as one from Python 3.12 on
    cdt.insert_vertices(buffer)
    return cdt
