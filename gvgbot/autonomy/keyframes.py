"""The way of the robot as it is kept: where scans were used, and what lies between."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan
from gvgbot.ranges import Range

# covariance of a way on which the robot was carried, or that is not kept
UNKNOWN_WAY = np.diag([1.0, 1.0, 0.3**2])


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyframeConfig:
    """How much motion makes a new look worth its cost."""

    distance_m: Annotated[float, Range(0.02, 2.0)] = 0.25  # driven since the last one
    turn_rad: Annotated[float, Range(0.02, 2.0)] = 0.25  # turned since the last one
    interval_s: Annotated[float, Range(0.1, 10.0)] = 1.0  # since the last one
    latest: Annotated[int, Range(1, 1_000_000)] = 1000  # kept of errands that showed nothing new


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """The motion from one keyframe to the next, and its covariance (3, 3), in the first frame."""

    motion: Pose
    covariance: Array

    @property
    def is_unknown(self) -> bool:
        """Whether the way is not known: the robot was carried, or what it drove was forgotten."""
        return bool(self.covariance[0, 0] >= UNKNOWN_WAY[0, 0] / 2)


@dataclass(frozen=True, slots=True, eq=False)
class Keyframe:
    """The poses at which a scan was used; the scan itself only where it shows something new."""

    stamp: float
    odom_base: Pose
    local_base: Pose
    map_base: Pose
    scan: Scan | None
