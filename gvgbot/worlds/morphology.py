"""Widths of passages and walls in a bitmap."""

import numpy as np
from scipy import ndimage

from gvgbot.drivers.ray_casting import Mask

LEAST_WALL = 0.2  # m
LEAST_ISLAND = 1.5  # m^2: smaller islands of wall are taken away


def has_wide_passages(occupied: Mask, width: float, resolution: float) -> bool:
    """Whether a disc of this diameter (m) gets along every way through one connected free space."""
    depth = ndimage.distance_transform_edt(~occupied) * resolution
    ways, wide_ways = _topology(depth > 0.0), _topology(depth > width / 2)
    return ways == wide_ways and ways[0] == 1


def _topology(free: Mask) -> tuple[int, int]:
    """Connected free spaces, and islands of wall with the outer wall."""
    return ndimage.label(free)[1], ndimage.label(~free, np.ones((3, 3)))[1]


def without_thin_walls(occupied: Mask, resolution: float) -> Mask:
    """The walls without what is thin, or small and alone."""
    least = round(LEAST_WALL / resolution)
    across = np.arange(least) - (least - 1) / 2
    disc = np.hypot(across, across[:, None]) <= least / 2
    padded = np.pad(occupied, least, constant_values=True)
    thick = ndimage.binary_opening(padded, disc)[least:-least, least:-least]
    islands, _ = ndimage.label(thick)
    large = np.bincount(islands.ravel()) * resolution**2 >= LEAST_ISLAND
    large[0] = False
    left: Mask = large[islands]
    return left
