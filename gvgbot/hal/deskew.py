"""A sweep as one instant: each beam as it would be seen from where the first was taken."""

from dataclasses import replace

import numpy as np

from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan

_STILL_M, _STILL_RAD = 1e-3, 2e-4  # less motion than this during a sweep does not show
_SLANT = 12.0  # of a wall between two beams, which sees it at five degrees: longer than wide


def deskewed(scan: Scan, motion: Pose) -> Scan:
    """The scan as if taken at its stamp; `motion` is that of the base during the whole sweep.

    The base is taken to move evenly. Directions that no beam looked into are NaN.
    """
    if abs(motion.x) + abs(motion.y) < _STILL_M and abs(motion.theta) < _STILL_RAD:
        return replace(scan, time_increment=0.0)
    share = np.arange(len(scan.ranges)) / len(scan.ranges)
    turn = share * motion.theta
    c, s = np.cos(turn), np.sin(turn)
    mount, seen = scan.base_laser, np.isfinite(scan.ranges)
    far = np.where(seen, scan.ranges, 0.0)
    bearings = scan.bearings + mount.theta
    x, y = mount.x + far * np.cos(bearings), mount.y + far * np.sin(bearings)
    moved_x = share * motion.x + c * x - s * y - mount.x
    moved_y = share * motion.y + s * x + c * y - mount.y
    ranges = np.where(seen, np.hypot(moved_x, moved_y), scan.ranges)
    towards = np.where(seen, np.arctan2(moved_y, moved_x), bearings + turn) - mount.theta
    away = np.remainder(towards - scan.bearings + np.pi, 2 * np.pi) - np.pi
    index = np.arange(len(ranges)) + away / scan.angle_increment
    return replace(scan, ranges=_at_beams(index, ranges, scan), time_increment=0.0)


def _at_beams(index: Array, ranges: Array, scan: Scan) -> Array:
    """Ranges (N,) at the scan's own directions, of ones that are known between them.

    Where two neighbours lie on one wall, it is straight between them; elsewhere the nearer counts.
    A wall that is only ever moved to the nearest beam is turned a little.
    """
    order = index.argsort(kind="stable")
    index, ranges = index.take(order), ranges.take(order)
    wanted = np.arange(len(ranges), dtype=np.float64)
    after = np.minimum(np.maximum(index.searchsorted(wanted), 1), len(index) - 1)
    before = after - 1
    near, far = ranges.take(before), ranges.take(after)
    start, end = index.take(before), index.take(after)
    share = (wanted - start) / np.maximum(end - start, 1e-9)
    nearest = after - (share < 0.5)
    taken = np.abs(index.take(nearest) - wanted) <= 1.0
    width = scan.angle_increment * np.where(np.isfinite(near), near, 0.0)
    with np.errstate(invalid="ignore"):
        on_wall = (np.abs(far - near) < _SLANT * width) & (share >= 0.0) & (share <= 1.0)
        straight = near * far / ((1.0 - share) * far + share * near)
    return np.where(taken, np.where(on_wall, straight, ranges.take(nearest)), np.nan)
