"""From how near something on a grid is in sight of ways."""

import math

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.geometry import Array
from gvgbot.maps.gaps import is_wall
from gvgbot.maps.occupancy import OccupancyGrid


def metres_in_sight(grid: OccupancyGrid, ways: Array, places: Array, within_m: float) -> Array:
    """How far places (N, 2) are from the nearest point of ways (M, 2) that sees them, m, map frame.

    That is (N,), inf where no wall of the grid hides it from none within `within_m`. What the grid
    says nothing of hides nothing.
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
