"""Whether the laser sees on its left what is on the left of the robot: turning tells.

What a laser sees goes round against the turn of the robot. One that hangs upside down, and is not
said to, or is said to and does not, sees it go round with the robot.
"""

import math

import numpy as np

from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan

_LEAST_TURN_RAD, _LARGEST_TURN_RAD = 0.05, 0.6  # between two sweeps that tell
_MOVED_M = 0.1  # between them, at most
_TURNED_RAD = 1.0  # by all that tell, before it is decided
_BEAMS = 128  # of a sweep that are compared, about
_LEAST_BEAMS = 32
_FAR_M = 10.0  # what is farther is as good as out of range
_OFF_M = 0.5  # beams that are off by more tell no more: there is an edge, or somebody walks
_UNLIKE_M = 0.1  # mean distance between sweeps that do not agree, at least
_CLEARLY = 3.0  # times as far off, one way as the other


class Handedness:
    """Adds up how well sweeps agree as they are, and how well as those of a mirrored laser.

    Where it is all the same round the robot, nothing is decided until it comes elsewhere.
    """

    def __init__(self) -> None:
        self.is_settled = False  # nothing more is to be learnt
        self.is_mirrored = False
        self._before: tuple[Scan, Pose] | None = None  # with odom_base
        self._pairs, self._turned = 0, 0.0
        self._off = np.zeros(2)  # m, as they are and mirrored, the sum over pairs

    def note(self, scan: Scan, odom_base: Pose, wished: float) -> None:
        """Learn from a sweep; `wished` is how fast the robot means to turn just now, rad/s.

        If it is turned by hand, or its odometry has it turn the other way, that tells nothing.
        """
        if self.is_settled:
            return
        before, self._before = self._before, (scan, odom_base)
        if before is None:
            return
        motion = before[1].to(odom_base)
        is_turn = _LEAST_TURN_RAD <= abs(motion.theta) <= _LARGEST_TURN_RAD
        if not is_turn or motion.theta * wished <= 0.0 or math.hypot(motion.x, motion.y) > _MOVED_M:
            return
        off = _off(before[0], scan, motion.theta)
        if off is not None:
            self._pairs, self._off = self._pairs + 1, self._off + off
            self._turned += abs(motion.theta)
            self._decide()

    def _decide(self) -> None:
        less, more = sorted(self._off.tolist())
        is_clear = more >= max(_CLEARLY * less, _UNLIKE_M * self._pairs)
        self.is_settled = is_clear and self._turned >= _TURNED_RAD
        self.is_mirrored = self.is_settled and bool(self._off[0] > self._off[1])
        if self.is_settled:
            self._before = None


def what_to_set(scan: Scan) -> str:
    """What is wrong with a laser that is mirrored, and what to set, for people."""
    hangs = "false" if scan.time_increment < 0.0 else "true"  # one that hangs turns the other way
    return (
        "what is on the left of the robot counts as being on the right: "
        f"set laser.upside_down: {hangs}, and restart the program"
    )


def _off(before: Scan, now: Scan, turn: float) -> Array | None:
    """Mean distances (2,), m, between sweeps before and after a turn: as they are, and mirrored.

    None if there is too little to compare.
    """
    count, shift = len(now.ranges), round(turn / now.angle_increment)
    length, step = count - 2 * abs(shift), max(1, count // _BEAMS)
    if len(before.ranges) != count or length < _LEAST_BEAMS * step:
        return None
    here, as_is, mirrored = (
        np.minimum(scan.ranges[abs(shift) + by :][:length:step], _FAR_M)
        for scan, by in ((now, 0), (before, shift), (before, -shift))
    )
    off = np.abs(np.stack([as_is - here, mirrored - here]))
    told = np.isfinite(off[0] + off[1])
    if np.count_nonzero(told) < _LEAST_BEAMS:
        return None
    mean: Array = np.minimum(off, _OFF_M)[:, told].mean(axis=1)
    return mean
