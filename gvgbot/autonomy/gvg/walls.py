"""Walls as the cells of a local map have them: the means of what beams met."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gvgbot.geometry import Array


class Walls(NamedTuple):
    """Mean hits (N, 2), how many there were (N,), and directions (N, 2) to where they were seen.

    `looks` (N,) are the numbers of the looks that hit, on average, and `spreads` (N,) the variances
    of these.
    """

    points: Array
    hits: Array
    sights: Array
    looks: Array
    spreads: Array


def merged(cells: NDArray[np.intp], columns: int, walls: Walls, reach: float) -> Walls:
    """The walls of ascending cells (N,), with one mean for two neighbours on the same face.

    Where a wall lies on the border of two rows of cells, both means are off, and only together
    they are right. With a reach of less than half a cell no mean has two others on one axis.
    """
    for step in (1, columns):
        points, hits, sights, looks, spreads = walls
        beside = np.minimum(cells.searchsorted(cells + step), len(cells) - 1)
        low = (cells.take(beside) == cells + step).nonzero()[0]
        high = beside.take(low)
        dx, dy = (points.take(high, axis=0) - points.take(low, axis=0)).T
        u, v = (sights.take(high, axis=0) * sights.take(low, axis=0)).T
        one = ((dx * dx + dy * dy < reach * reach) & (u + v > 0.0)).nonzero()[0]
        low, high = low.take(one), high.take(one)
        share = (hits[high] / (hits[low] + hits[high]))[:, None]
        for means in (points, sights):
            first, second = means.take(low, axis=0), means.take(high, axis=0)
            means[low] = first + share * (second - first)
        part, gap = share[:, 0], looks[high] - looks[low]
        spreads[low] += part * (spreads[high] - spreads[low]) + part * (1.0 - part) * gap**2
        looks[low] += part * gap
        hits[low] += hits[high]
        is_kept = np.ones(len(cells), bool)
        is_kept[high] = False
        kept = is_kept.nonzero()[0]
        cells = cells.take(kept)
        walls = Walls(*(values.take(kept, axis=0) for values in walls))
    return walls
