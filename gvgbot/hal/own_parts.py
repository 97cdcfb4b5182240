"""Parts of the robot that its own laser sees: beams that end within it, scan after scan."""

import math
from collections.abc import Sequence

import numpy as np

from gvgbot.geometry import Array
from gvgbot.hal.messages import Scan

_FAR = 1e3  # m, for beams that measured nothing
_SCANS = 30  # of which more than half tell; who stood at the robot when it began has gone by then
_BEYOND_M = 0.02


def own_ranges(scans: Sequence[Scan], radius: float) -> Array:
    """The ranges (N,), m, of beams that as a rule end within the robot's radius (m)."""
    mount = scans[-1].base_laser
    ranges = np.median(
        [np.nan_to_num(scan.ranges, nan=_FAR, posinf=_FAR) for scan in scans], axis=0
    )
    near = np.flatnonzero(ranges < radius + math.hypot(mount.x, mount.y))
    bearings = mount.theta + scans[-1].bearings[near]
    x, y = mount.x + ranges[near] * np.cos(bearings), mount.y + ranges[near] * np.sin(bearings)
    return np.asarray(ranges[near][np.hypot(x, y) < radius])


def how_to_clear(own: Array) -> str:
    """What to do about beams that end at these ranges (N,), m."""
    return f"clear its view, or set laser.min_range_m={own.max() + _BEYOND_M:.2f}"


class OwnParts:
    """Looks at the first scans of a laser: what it takes for an obstacle goes wherever it goes."""

    def __init__(self, radius: float) -> None:
        """`radius` of the robot, m."""
        self._radius = radius
        self._scans: list[Scan] | None = []

    def note(self, scan: Scan) -> Array | None:
        """The ranges (N,), m, of beams that end within the robot; None until, and once, told."""
        if self._scans is None:
            return None
        if self._scans and len(self._scans[-1].ranges) != len(scan.ranges):
            self._scans.clear()  # it is another laser
        self._scans.append(scan)
        if len(self._scans) < _SCANS:
            return None
        scans, self._scans = self._scans, None
        return own_ranges(scans, self._radius)
