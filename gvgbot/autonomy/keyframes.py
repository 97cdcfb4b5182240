"""The way of the robot as it is kept: where scans were used, and what lies between."""

import copy
import math
from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np

from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan
from gvgbot.hal.packed_scan import PackedScan, Sweep
from gvgbot.ranges import Range

# covariance of a way on which the robot was carried, or that is not kept
UNKNOWN_WAY = np.diag([1.0, 1.0, 0.3**2])
_SCAN_EVERY_M, _SCAN_EVERY_RAD = 0.7, 0.5  # scans that are kept for the occupancy grid


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
    scan: PackedScan | None

    def local_base_at(self, odom_base: Pose) -> Pose:
        """Where odometry has the base now, in the local frame."""
        return self.local_base.compose(self.odom_base.to(odom_base))


class Past:
    """What the robot has lived through, as far as it is kept: the map hangs on it."""

    def __init__(self) -> None:
        self.keyframes: list[Keyframe] = []
        self.steps: list[Step] = []  # from each keyframe to the next
        self.lasting = 0  # keyframes that are kept for good
        self.lent = 0  # keyframes that came with another's map: it has not driven there
        self.travelled = self.lent_m = 0.0  # the latter by who made that map
        self.sought_m = 0.0  # driven to find its place on it
        self.with_scan: Pose | None = None  # local_base of the last keyframe that has its scan

    @property
    def last(self) -> Keyframe | None:
        """The newest keyframe, if there is one."""
        return self.keyframes[-1] if self.keyframes else None

    @property
    def driven(self) -> float:
        """Metres that the robot has driven itself, whoever made the map that it began with."""
        return self.travelled - self.lent_m + self.sought_m

    def old(self, metres: float) -> list[Keyframe]:
        """Those that are kept for good, since which the robot has driven so far or farther."""
        lengths = [math.hypot(step.motion.x, step.motion.y) for step in reversed(self.steps)]
        recent = int(np.searchsorted(np.cumsum(lengths), metres)) + 1
        return self.keyframes[: min(self.lasting, len(self.keyframes) - recent)]

    def still(self) -> Self:
        """A copy that does not grow as the robot goes on."""
        copied = copy.copy(self)
        copied.keyframes, copied.steps = self.keyframes.copy(), self.steps.copy()
        return copied

    def keep(
        self,
        scan: Scan,
        odom_base: Pose,
        local_base: Pose,
        map_base: Pose,
        sweep: Sweep | None = None,
    ) -> None:
        """Add a keyframe, with its scan if that was taken far enough from the last one kept.

        The scan was made of a `sweep` by leaving out some beams.
        """
        is_kept = has_come_on(self.with_scan, local_base, _SCAN_EVERY_M, _SCAN_EVERY_RAD)
        if is_kept:
            self.with_scan = local_base
        kept = PackedScan(scan, sweep) if is_kept else None
        self.keyframes.append(Keyframe(scan.stamp, odom_base, local_base, map_base, kept))

    def leave_out(self) -> int:
        """Leave out the way after what lasts, but its end; how many keyframes that were."""
        before, last = self.keyframes[self.lasting - 1], self.keyframes[-1]
        left_out = len(self.keyframes) - 1 - self.lasting
        self.keyframes[self.lasting :] = [last]
        self.steps[self.lasting - 1 :] = [Step(before.map_base.to(last.map_base), UNKNOWN_WAY)]
        self.lent = min(self.lent, self.lasting)
        return left_out


def has_come_on(before: Pose | None, now: Pose, metres: float, turn: float) -> bool:
    """Whether a pose is so far, m, or so much turned, rad, from one before, or there was none."""
    if before is None:
        return True
    moved = before.to(now)
    return math.hypot(moved.x, moved.y) >= metres or abs(moved.theta) >= turn
