"""Who sees something on a grid from nearer by."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gvgbot.geometry import Array
from gvgbot.maps.gaps import is_wall
from gvgbot.maps.occupancy import OccupancyGrid

_NEARER_M = 0.25  # who sees it from so much nearer need not be followed


def are_nearer_to(
    others: Array, own: Sequence[Array], places: Array, grid: OccupancyGrid, within_m: float
) -> NDArray[np.bool_]:
    """Which of places (N, 2), map frame, others see from nearer by than this robot.

    `others` are points (M, 2) that they see from, and `own` several such of this robot: what one of
    them sees from farther off only is theirs. What is seen from as near by all is not, or each
    would leave it to the other.
    """
    if not (len(others) and len(places)):
        return np.zeros(len(places), bool)
    theirs, *ours = (metres_in_sight(grid, some, places, within_m) for some in (others, *own))
    nearer: NDArray[np.bool_] = theirs < np.max(ours, axis=0) - _NEARER_M
    return nearer


def metres_in_sight(grid: OccupancyGrid, ways: Array, places: Array, within_m: float) -> Array:
    """How far places (N, 2) are from the nearest point of ways (M, 2) that sees them, m, map frame.

    That is (N,), inf where walls of the grid hide it from all of them within `within_m`. What the
    grid says nothing of hides nothing.
    """
    found, wall = np.full(len(places), np.inf), np.pad(is_wall(grid.cells), 1)
    shares = np.linspace(0.0, 1.0, math.ceil(within_m / grid.resolution_m) + 1)[:, None, None]
    tree, corner = cKDTree(ways), np.array(grid.origin) - grid.resolution_m
    for i, place in enumerate(places):
        near = ways[tree.query_ball_point(place, within_m)]
        cells = ((place + shares * (near - place) - corner) / grid.resolution_m).astype(np.int64)
        columns, rows = np.clip(cells, 0, np.array(wall.shape[::-1]) - 1).transpose(2, 0, 1)
        is_seen = ~wall[rows, columns].any(axis=0)
        found[i] = np.hypot(*(near[is_seen] - place).T).min(initial=np.inf)
    return found
