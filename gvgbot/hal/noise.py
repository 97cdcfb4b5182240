"""How noisy a laser is, by what a scan shows."""

import math

import numpy as np

from gvgbot.geometry import Array

_MEDIAN = 0.6745  # sigma: half of the errors are smaller
_USUAL_M = 0.0125  # sigma of the ranges of lasers that are as good as their data sheets
_TELLING = 0.25  # of all beams; fewer may be edges of things that stand about


def range_noise(ranges: Array) -> float:
    """The noise, 1 sigma in m, by how ranges (N,) stray from the mean of their neighbours."""
    told = np.where(np.isfinite(ranges), ranges, np.nan)
    stray = np.abs(told[:-2] - 2.0 * told[1:-1] + told[2:])
    stray = stray[~np.isnan(stray)]
    stray.sort()  # for the median: np.median is slow
    if not len(stray):
        return 0.0
    median = float(stray[(len(stray) - 1) // 2] + stray[len(stray) // 2]) / 2
    return median / (_MEDIAN * math.sqrt(6.0))


def excess_noise(ranges: Array) -> float:
    """By how much the noise of ranges (N,) is more than usual, m; 0 where too few meet a wall."""
    if np.count_nonzero(np.isfinite(ranges)) <= _TELLING * len(ranges):
        return 0.0
    return max(0.0, range_noise(ranges) - _USUAL_M)
