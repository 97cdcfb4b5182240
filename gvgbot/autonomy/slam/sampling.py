"""The points of a scan that are matched."""

import numpy as np
from scipy.ndimage import uniform_filter1d

from gvgbot.geometry import Array
from gvgbot.hal.messages import Scan

_RANGE_M = 24.0  # of the beams that are matched
_LONGEST_GAP_M = 0.5  # between two beams, for their even spacing
_SMOOTHED = 9  # beams, to tell where the next point is due


def sampled(scan: Scan, count: int) -> Array:
    """About so many end points (N, 2), evenly spaced along what the beams hit; base frame.

    Evenly in space, not in angle: far walls tell most about the heading, and have few beams. The
    way along the walls is smoothed: where beams are dense, each point's own noise would decide
    which is taken, in the order of the sweep, and turn the walls a little.
    """
    hit = (scan.ranges < _RANGE_M).nonzero()[0]
    points = scan.ranges.take(hit)[:, None] * scan.directions.take(hit, axis=0)
    if len(points) == 0:
        return points
    way = uniform_filter1d(points, _SMOOTHED, axis=0, mode="nearest")
    gaps = np.hypot(*(way[1:] - way[:-1]).T)
    along = np.concatenate([[0.0], np.minimum(gaps, _LONGEST_GAP_M).cumsum()])
    step = max(float(along[-1]) / count, 1e-6)
    due = np.floor(along / step)
    is_next = np.concatenate([[True], due[1:] > due[:-1]])
    return scan.base_laser.transform(points[is_next])
