"""The last second of odometry: where the base was at the stamp of a scan, and how it moved then."""

from collections import deque
from itertools import pairwise

from gvgbot.geometry import Pose
from gvgbot.hal.messages import Odometry, Scan

_KEPT = 64  # messages
_LONGEST_GAP_S = 0.3  # without odometry; nobody knows what the base did in a longer one
_LEAST_SPAN_S = 0.04  # over which odometry tells a velocity
_FELT_S = 2.0  # in which a gyro that drifts shows it, in steps of 0.01 degrees


class OdometryLog:
    """The newest odometry messages, oldest first."""

    def __init__(self) -> None:
        self._kept: deque[Odometry] = deque(maxlen=_KEPT)
        self._turned_at = 0.0  # stamp; when the heading was last another one
        self.unturned_s = 0.0  # in which the heading was the same: no gyro drifts then

    def append(self, odometry: Odometry) -> None:
        """Keep a message, and let the oldest go; all of them where the clock was set back."""
        before = self.newest
        if before is not None and odometry.stamp < before.stamp:
            self._kept.clear()
            before = None
        if before is None or before.odom_base.theta != odometry.odom_base.theta:
            self._turned_at = odometry.stamp
        elif odometry.stamp - self._turned_at > _FELT_S:
            since = max(before.stamp, self._turned_at + _FELT_S)
            self.unturned_s += max(0.0, odometry.stamp - since)
        self._kept.append(odometry)

    @property
    def newest(self) -> Odometry | None:
        """The newest message, None before the first."""
        return self._kept[-1] if self._kept else None

    def odom_base_at(self, stamp: float) -> Pose | None:
        """`odom_base` at a stamp, between two messages; the oldest one before what is kept.

        None if the odometry nearest in time is too far from it, as in an outage of the base.
        """
        if self.newest is None or stamp - self.newest.stamp > _LONGEST_GAP_S:
            return None
        later: Odometry | None = None
        for earlier in reversed(self._kept):
            if earlier.stamp <= stamp:
                if later is not None and later.stamp - earlier.stamp > _LONGEST_GAP_S:
                    return None
                return earlier.odom_base if later is None else _between(earlier, later, stamp)
            later = earlier
        return None if later is None else later.odom_base

    def has_gap_since(self, stamp: float) -> bool:
        """Whether the base was not heard for a while after a stamp: its way then is not known."""
        return any(
            later.stamp > stamp and later.stamp - earlier.stamp > _LONGEST_GAP_S
            for earlier, later in pairwise(self._kept)
        )

    def motion_during(self, scan: Scan) -> Pose:
        """Motion of the base from the first beam to the last, by the odometry nearest in time.

        The last beam is the earlier one of a laser that is mounted upside down.
        """
        duration = scan.time_increment * len(scan.ranges)
        if duration == 0.0 or self.newest is None:
            return Pose()
        span = max(abs(duration), _LEAST_SPAN_S)
        end = min(max(scan.stamp, scan.stamp + duration), self.newest.stamp)
        before, after = self.odom_base_at(end - span), self.odom_base_at(end)
        if before is None or after is None:
            return Pose()
        motion = before.to(after) if duration > 0.0 else after.to(before)
        return motion.part(abs(duration) / span)


def _between(earlier: Odometry, later: Odometry, stamp: float) -> Pose:
    share = (stamp - earlier.stamp) / (later.stamp - earlier.stamp)
    return earlier.odom_base.towards(later.odom_base, share)
