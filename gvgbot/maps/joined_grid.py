"""Occupancy grids of one building by several robots, laid on each other as one."""

from collections.abc import Sequence

import numpy as np

from gvgbot.geometry import Array, Pose
from gvgbot.maps.occupancy import UNKNOWN, Cells, OccupancyGrid, Seconds

_STRIP = 64  # rows that are worked on at a time


def joined_grid(grids: Sequence[tuple[OccupancyGrid, Pose]]) -> OccupancyGrid:
    """One grid of all, each with the pose of its frame in the frame of the result.

    Its cells are as large as the first one's, and it reaches as far as any. A cell is as likely a
    wall as the grid says that holds that most; so a wall may be a cell thicker, but has no gaps
    where the maps are bent against each other. `seen_s` counts from the first scan of each robot.
    """
    cell = grids[0][0].resolution_m
    corners = np.concatenate([pose.transform(_corners(grid)) for grid, pose in grids])
    column, row = np.floor(corners.min(axis=0) / cell + 1e-6).astype(int).tolist()
    columns, rows = np.ceil(corners.max(axis=0) / cell - 1e-6).astype(int) - (column, row)
    cells = np.full((rows, columns), UNKNOWN, np.int8)
    seen_s = np.full((rows, columns), np.inf, np.float32)
    x = cell * (column + np.arange(columns) + 0.5)
    for first in range(0, rows, _STRIP):
        strip = slice(first, first + _STRIP)
        y = cell * (row + np.arange(rows)[strip] + 0.5)
        _lay(grids, (x, y), cells[strip], seen_s[strip])
    return OccupancyGrid(cells, cell, (column * cell, row * cell), seen_s)


def _lay(
    grids: Sequence[tuple[OccupancyGrid, Pose]],
    at: tuple[Array, Array],
    cells: Cells,
    seen: Seconds,
) -> None:
    """Note what the grids say in cells, and since when, whose middles are at x and y, m."""
    x, y = np.meshgrid(*at)
    middles = np.stack([x.ravel(), y.ravel()], axis=1)
    for grid, pose in grids:
        local = (pose.inverse().transform(middles) - grid.origin) / grid.resolution_m
        j, i = np.floor(local).astype(int).T
        inside = (i >= 0) & (i < grid.cells.shape[0]) & (j >= 0) & (j < grid.cells.shape[1])
        there = inside.reshape(cells.shape)
        i, j = i[inside], j[inside]
        cells[there] = np.maximum(cells[there], grid.cells[i, j])
        if grid.seen_s is not None:
            seen[there] = np.minimum(seen[there], grid.seen_s[i, j])


def _corners(grid: OccupancyGrid) -> Array:
    """The outer corners (4, 2), m, of a grid in its own frame."""
    x, y = grid.origin
    height, width = (grid.resolution_m * n for n in grid.cells.shape)
    return np.array([(x, y), (x + width, y), (x, y + height), (x + width, y + height)])
