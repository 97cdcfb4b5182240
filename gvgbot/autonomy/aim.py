"""Whether the laser looks where it is said to: a base that drives straight ahead tells.

What a base drives past goes straight back. If it goes aside as well, in the frame that the laser's
mount makes the base's, the mount is turned by that angle. That it goes less far than its wheels
tell is no defect: they may spin for a while.
"""

import math

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.autonomy.agreement import Agreement
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig, register_coarsely
from gvgbot.geometry import Array, Pose, thinned, wrap_angle
from gvgbot.hal.messages import Scan

_PIECE_M, _STRAIGHT_RAD = 0.2, 0.04  # between two sweeps that tell
_LONGEST_M = 1.0
_CURVE_RAD = 0.4  # likewise, of a laser that looks quite elsewhere:
_ELSEWHERE_RAD = 0.4  # farther off than one seems on curves that is a little beside its place
_FIRST = 3  # pieces that show it, before the robot runs into what it does not see
_MOST, _MOST_CURVED = 40, 10  # pieces that are looked at altogether
_TURNED_RAD = math.radians(3.0)  # a mount that is off by less does no harm
_BEHIND_RAD = 0.75 * math.pi  # a laser that looks astern is as likely off to either side
_FAR_M = 8.0  # what is farther has few beams on it
_CELL_M = 0.1
_ANY_WAY = np.diag([0.3**2, 0.3**2, 0.05**2])
_CLEAR_M, _SHARE = 0.02, 0.2  # sigma to the side, and share of a sweep that finds its walls
_CAME_ON = 0.5  # of what its wheels tell; a base that stands while they spin goes no way at all
_COARSE_M = 0.5  # as far off as a sweep may lie at first


class Aim:
    """Adds up which way the base drives, as the laser has it."""

    def __init__(self, matching: ScanMatchingConfig) -> None:
        self._matching = matching
        self._before: tuple[cKDTree, Pose] | None = None  # what was seen, with odom_base
        self._angle = Agreement(_TURNED_RAD)
        self._rough = Agreement(_ELSEWHERE_RAD, _FIRST)  # by curves, too
        self._left, self._curves_left = _MOST, _MOST_CURVED  # pieces to be looked at

    @property
    def off(self) -> float | None:
        """By how much the laser's yaw is too large, rad; None if it may be right."""
        return self._rough.off if self._angle.off is None else self._angle.off

    def note(self, scan: Scan, odom_base: Pose) -> None:
        """Learn from a sweep, until enough of them are as they should be, or enough were seen."""
        if self._angle.is_settled or not self._left or self.off is not None:
            return
        motion = self._ahead_to(odom_base)
        if motion is not None and motion.x < _PIECE_M:
            return
        points = seen(scan)
        if motion is not None:
            self._compare(points, motion)
        is_enough = len(points) >= self._matching.min_pairs
        self._before = (walls_of(points), odom_base) if is_enough else None

    def _ahead_to(self, odom_base: Pose) -> Pose | None:
        """The motion from the sweep before, if it went ahead and not far; None if not."""
        if self._before is None:
            return None
        motion = self._before[1].to(odom_base)
        minds_curves = self._curves_left > 0 and not self._rough.is_settled
        most = _CURVE_RAD if minds_curves else _STRAIGHT_RAD
        is_ahead = 0.0 <= motion.x < _LONGEST_M and abs(motion.theta) < most
        return motion if is_ahead else None

    def _compare(self, points: Array, motion: Pose) -> None:
        assert self._before is not None, "the motion is from there"
        is_straight = abs(motion.theta) < _STRAIGHT_RAD
        if is_straight:
            self._left -= 1
        else:
            self._curves_left -= 1
        some = points[:: max(1, len(points) // self._matching.points)]
        found = register_coarsely(
            some, self._before[0], motion, _ANY_WAY, self._matching, (_COARSE_M,)
        )
        if found is None or found.inliers < _SHARE or found.covariance[1, 1] > _CLEAR_M**2:
            return
        if math.hypot(found.pose.x, found.pose.y) < _CAME_ON * motion.x:
            return
        angle = math.atan2(found.pose.y, found.pose.x) - math.atan2(motion.y, motion.x)
        angle = (angle + _BEHIND_RAD) % math.tau - _BEHIND_RAD
        self._rough.note(angle)
        if is_straight:
            self._angle.note(angle)


def how_to_aim(scan: Scan, off: float) -> str:
    """What is wrong with a laser whose yaw is too large by so much (rad), and what to set."""
    yaw_deg = round(math.degrees(wrap_angle(scan.base_laser.theta - off)))
    return (
        f"the laser is turned by {abs(math.degrees(off)):.0f} degrees from where it is said to "
        f"look: set laser.yaw_deg: {yaw_deg}, and restart the program"
    )


def seen(scan: Scan) -> Array:
    """What is not far away (N, 2), m, base frame."""
    near = np.flatnonzero(scan.ranges < _FAR_M)
    return scan.base_laser.transform(scan.ranges[near, None] * scan.directions[near])


def walls_of(points: Array) -> cKDTree:
    """The means in cells of points (N, 2), m: from beam to beam noise tells how walls lie."""
    return cKDTree(thinned(points, _CELL_M))
