"""What walls a place lies between: a meetpoint is equally far from three or more."""

import math
from typing import NamedTuple

import numpy as np

from gvgbot.autonomy.gvg.local_map import LocalMap
from gvgbot.geometry import Array

_EQUAL_M = 0.1  # walls that are so much farther off count as equally near
_APART_RAD = 0.35  # directions to points of one wall are closer,
_APART_M = 0.1  # and so are the points


class Between(NamedTuple):
    """How far the nearest wall is from a place, m, and how many are as near."""

    clearance: float
    walls: int


def between(local_map: LocalMap, place: Array) -> Between:
    """What walls of a map a place (2,), local frame, lies between; a round one counts as many."""
    tree = local_map.tree()
    clearance = float(tree.query(place)[0])
    near = local_map.points()[tree.query_ball_point(place, clearance + _EQUAL_M)] - place
    if not len(near):
        return Between(clearance, 0)
    bearings = np.sort(np.arctan2(near[:, 1], near[:, 0]))
    gaps = np.diff(bearings, append=bearings[0] + 2.0 * np.pi)
    apart = max(_APART_RAD, 2.0 * math.atan2(_APART_M, clearance))
    last = np.flatnonzero(gaps > apart)  # of each wall
    first = (np.roll(last, 1) + 1) % len(bearings)
    widths = (bearings[last] - bearings[first]) % (2.0 * np.pi)
    flat = 2.0 * math.acos(clearance / (clearance + _EQUAL_M))  # as wide as such a wall is seen
    if not len(last):  # it is all around
        widths = np.array([2.0 * np.pi])
    return Between(clearance, int(np.sum(1 + widths // (2.0 * flat))))
