"""What single beams of a scan say, beside their neighbours: for the local map."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gvgbot.geometry import Array
from gvgbot.hal.messages import Scan

_MIXED_M = 0.15  # from what is nearer and from what is farther, and from the lines of both
_LONE_M = 0.3  # an echo nearer than both its neighbours by this is one of dust on glass


def without_single_dropouts(ranges: Array) -> Array:
    """Ranges with each lone NaN between two readings replaced by the nearer of them."""
    filled = ranges.copy()
    inner, left, right = ranges[1:-1], ranges[:-2], ranges[2:]
    lone = np.isnan(inner) & ~np.isnan(left) & ~np.isnan(right)
    filled[1:-1][lone] = np.minimum(left[lone], right[lone])
    return filled


def without_mixed_pixels(scan: Scan) -> Scan:
    """The scan without what may be mixed pixels: between near and far where a beam meets an edge.

    On a straight wall the reciprocal of the range is linear in small angles, so a reading that is
    on the line of the two on either side is of a wall seen at a low angle. A beam that goes on
    alone, between two on one wall, may have gone through glass and end in mid-air behind it. Beams
    that failed are passed over.
    """
    told = (~np.isnan(scan.ranges)).nonzero()[0]
    if not len(told):
        return scan
    depth = scan.ranges.take(told).take(np.arange(-2, len(told) + 2), mode="clip")
    before, here, after = depth[1:-3], depth[2:-2], depth[3:-1]
    nearest, farthest = np.minimum(before, after), np.maximum(before, after)
    is_mixed = (nearest + _MIXED_M < here) & (here < farthest - _MIXED_M)
    is_mixed |= (farthest < nearest + _MIXED_M) & (farthest + _MIXED_M < here)
    if not is_mixed.any():
        return scan
    with np.errstate(divide="ignore", invalid="ignore"):
        for near, far in ((before, depth[:-4]), (after, depth[4:])):
            is_mixed &= ~(np.abs(1.0 / (2.0 / near - 1.0 / far) - here) < _MIXED_M)
    ranges = scan.ranges.copy()
    ranges[told[is_mixed]] = np.nan
    return replace(scan, ranges=ranges)


def least_of_three(ranges: Array) -> Array:
    """The least (N,) of each range and its neighbours'."""
    least = ranges.copy()
    np.minimum(least[1:], ranges[:-1], out=least[1:])
    np.minimum(least[:-1], ranges[1:], out=least[:-1])
    return least


def is_lone(ranges: Array) -> NDArray[np.bool_]:
    """Which ranges (N,) are echoes much nearer than those on either side.

    Beams that failed are passed over.
    """
    told = (~np.isnan(ranges)).nonzero()[0]
    deep = ranges.take(told)
    inner = deep[1:-1] + _LONE_M
    lone = np.zeros(len(ranges), np.bool_)
    lone[told[1:-1][(inner < deep[:-2]) & (inner < deep[2:])]] = True
    return lone


def bridged(points: Array, gap: float) -> Array:
    """The points with intermediate ones wherever neighbours are close enough to be one wall."""
    step = points[1:] - points[:-1]
    length = np.hypot(step[:, 0], step[:, 1])
    near = ((length < gap) & (length > gap / 4)).nonzero()[0]
    start, step = points.take(near, axis=0), step.take(near, axis=0)
    return np.concatenate([points, *(start + f * step for f in (0.25, 0.5, 0.75))])


def range_towards(
    scan: Scan,
    see: NDArray[np.floating],
    dx: NDArray[np.floating],
    dy: NDArray[np.floating],
    theta: float,
) -> NDArray[np.floating]:
    """How far the scan sees in the direction of each offset; 0 outside its field of view."""
    turn = np.float32(2 * np.pi)
    bearing = np.arctan2(dy, dx)
    bearing -= np.float32(theta + scan.angle_min)
    bearing -= turn * np.floor(bearing / turn)
    bearing *= np.float32(1 / scan.angle_increment)
    bearing += np.float32(0.5)
    beyond_last = np.concatenate([see, np.zeros(1, see.dtype)])
    towards: NDArray[np.floating] = beyond_last.take(bearing.astype(np.int32), mode="clip")
    return towards
