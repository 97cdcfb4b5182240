"""What rings of edges go round: nothing (hollows), or no more than somebody who stood there."""

import numpy as np
from scipy import ndimage

from gvgbot.geometry import Array
from gvgbot.maps.distances import metres_to
from gvgbot.maps.gaps import is_floor, is_wall
from gvgbot.maps.occupancy import OccupancyGrid
from gvgbot.maps.viewpoints import marked

_DEPTH_M = 0.2  # less: edges side by side are one that is blurred; more: who stood by one of them
_BODY_M = 0.2, 0.7  # as wide as this, it may be somebody; legs of furniture are thinner
_NOT_OPEN = 0.9  # of the clearance in the open: there edges go round the floor


def hollows(grid: OccupancyGrid, ways: Array, open_m: float) -> Array:
    """Places (N, 2), m, map frame, in the middle of hollows.

    Ways (points (M, 2), a cell or less apart) of a GVG go round walls. What they go round is gone
    if there is nothing but floor, and no more that nobody has seen than somebody hides who stands
    there. Farther than `open_m` from walls there are no edges.
    """
    cell, drawn, is_walled = grid.resolution_m, marked(ways, grid), is_wall(grid.cells)
    areas, count = ndimage.label(~drawn)
    walls, others = (
        np.bincount(areas[some], minlength=count + 1) for some in (is_walled, ~is_floor(grid.cells))
    )
    is_full = (walls > 0) | (others * cell**2 > _BODY_M[1] ** 2)
    numbers = np.flatnonzero(~is_full[1:]) + 1
    if not len(numbers):
        return np.empty((0, 2))
    inside, clearance = metres_to(drawn, cell), metres_to(is_walled, cell)
    depth, room = (ndimage.maximum(away, areas, numbers) for away in (inside, clearance))
    numbers = numbers[(depth > _DEPTH_M) & (room < _NOT_OPEN * open_m)]
    places = np.array(ndimage.maximum_position(inside, areas, numbers)).reshape(-1, 2)
    return np.array(grid.origin) + (places[:, ::-1] + 0.5) * cell


def bodies(grid: OccupancyGrid, ways: Array) -> Array:
    """Places (N, 2), m, map frame, of what is as wide as somebody, and all that a ring holds.

    Ways (points (M, 2), a cell or less apart) of a GVG go round columns likewise.
    """
    areas, _ = ndimage.label(~marked(ways, grid))
    least, most = np.array(_BODY_M) / grid.resolution_m
    held = areas * is_wall(grid.cells)
    boxes, found = ndimage.find_objects(held), []
    for number in np.unique(held[held > 0]).tolist():
        box = boxes[number - 1]
        _, pieces = ndimage.label(held[box] == number, np.ones((3, 3)))
        if pieces == 1 and least <= max(side.stop - side.start for side in box) <= most:
            found.append([(side.start + side.stop) / 2 for side in box])
    middles = np.array(found).reshape(-1, 2)[:, ::-1]
    return np.array(grid.origin) + middles * grid.resolution_m
