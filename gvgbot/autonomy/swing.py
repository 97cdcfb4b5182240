"""Whether a base that turns on the spot turns as far as it tells, and round its own middle.

A laser that is not where it is said to be swings round another point: the base seems to go aside.
"""

import math

import numpy as np

from gvgbot.autonomy.agreement import Agreement
from gvgbot.autonomy.aim import seen, walls_of
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig, register_coarsely
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan

_LEAST_RAD, _MOST_RAD = 0.15, 0.6  # between two sweeps that tell
_MOVED_M = 0.02  # between them, at most
_MOST = 40  # turns that are looked at altogether
_TURNED = math.log(1.15)  # less is learnt as it goes
_ELSEWHERE_M = 0.15  # less does little harm, and who turns about one wheel seems to be as far off
_ANY_SWING = np.diag([0.3**2, 0.3**2, 0.3**2])
_COARSE_M = 0.5  # as far off as a sweep may lie at first
_CLEAR_M, _CLEAR_RAD = 0.015, 0.01  # sigmas of a motion that tells
_SHARE = 0.3  # share of a sweep that finds its walls
_CAME_ROUND = 1 / 3  # of what its wheels tell; a base that stands while they spin has no middle


class Swing:
    """Adds up how sweeps before and after a turn on the spot lie on each other."""

    def __init__(self, matching: ScanMatchingConfig) -> None:
        self._matching = matching
        self._before: tuple[Array, Pose] | None = None  # what was seen, with odom_base
        self._ahead, self._aside = Agreement(_ELSEWHERE_M), Agreement(_ELSEWHERE_M)
        self._turned = Agreement(_TURNED)
        self._left = _MOST

    @property
    def stretch(self) -> float | None:
        """How many times as far the base turns as it tells; None if that may be right."""
        off = self._turned.off
        return None if off is None else math.exp(off)

    @property
    def place(self) -> tuple[float, float] | None:
        """How far ahead and to the left of the laser it is said to be, m; None if it may be."""
        x, y = self._ahead.off, self._aside.off
        return None if x is None and y is None else (x or 0.0, y or 0.0)

    def note(self, scan: Scan, odom_base: Pose) -> None:
        """Learn from a sweep, until enough of them are as they should be, or enough were seen."""
        all_three = self._ahead, self._aside, self._turned
        if not self._left or all(one.is_settled for one in all_three):
            return
        before, self._before = self._before, (seen(scan), odom_base)
        if before is None:
            return
        motion = before[1].to(odom_base)
        is_turn = _LEAST_RAD <= abs(motion.theta) <= _MOST_RAD
        if is_turn and math.hypot(motion.x, motion.y) < _MOVED_M:
            self._compare(before[0], self._before[0], motion)

    def _compare(self, before: Array, now: Array, motion: Pose) -> None:
        matching = self._matching
        if min(len(before), len(now)) < matching.min_pairs:
            return
        self._left -= 1
        some = now[:: max(1, len(now) // matching.points)]
        found = register_coarsely(
            some, walls_of(before), motion, _ANY_SWING, matching, (_COARSE_M,)
        )
        if found is None or found.inliers < _SHARE:
            return
        if found.pose.theta / motion.theta < _CAME_ROUND:
            return
        spread = np.sqrt(np.diag(found.covariance))
        if spread[2] < _CLEAR_RAD:
            self._turned.note_scale(found.pose.theta, motion.theta)
        if max(spread[:2]) < _CLEAR_M:
            x, y = _centre(found.pose)
            self._ahead.note(x)
            self._aside.note(y)


def _centre(motion: Pose) -> tuple[float, float]:
    """The point that stays where it is in a motion that turns."""
    half = 0.5 / math.tan(motion.theta / 2)
    return motion.x / 2 - half * motion.y, motion.y / 2 + half * motion.x


def how_to_place(scan: Scan, place: tuple[float, float]) -> str:
    """What is wrong with a laser that is said to be so far ahead and to the left of its place."""
    x, y = (np.round(scan.base_laser.position - np.array(place), 2) + 0.0).tolist()  # no -0
    return (
        f"the laser is {math.hypot(*place):.2f} m from where it is said to be: "
        f"set laser.x_m: {x:.2f} and laser.y_m: {y:.2f}, and restart the program"
    )


def how_to_turn(stretch: float) -> str:
    """What is wrong with a base that turns so many times as far as it tells."""
    return (
        f"the base turns {stretch:.2f} times as far as it tells: its gyro is out of order, or with "
        "base.heading=wheels divide base.wheel_base_m by that, and restart the program"
    )
