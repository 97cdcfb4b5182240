"""What a round robot's footprint sweeps: how far it can drive on an arc before it touches."""

from collections.abc import Sequence
from math import cos, hypot, inf, sin

import numpy as np

from gvgbot.geometry import Array, Pose, Twist, wrap_angle
from gvgbot.hal.messages import Odometry, Scan
from gvgbot.hal.noise import excess_noise

STRAIGHT = 1e-3  # 1/m; a flatter arc departs less than a millimetre from a line in a metre
SAME_M = 0.05  # in range from beam to beam, on one surface
_SAME_SIGMAS = 6.0  # and for all noise that is more than usual
_MOST_SAME_M = 0.15  # whatever the noise
_TRUSTED_SHARE = 0.5  # a scan with a smaller share of trusted beams sees nothing: a covered laser
LEAST = 1.0 / 3.0  # share of the margin that is kept when the robot is within it already


def no_points() -> Array:
    """An empty point set (0, 2)."""
    return np.empty((0, 2))


def has_sight(scan: Scan) -> bool:
    """Whether enough of the beams are trusted (a range, or nothing within range)."""
    trusted = len(scan.ranges) - int(np.count_nonzero(np.isnan(scan.ranges)))
    return trusted > 0 and trusted >= _TRUSTED_SHARE * len(scan.ranges)


def obstacle_points(scan: Scan, track: Sequence[Odometry], *, reach: float) -> Array:
    """Where the scan saw something within `reach` (m) of the base: (N, 2), m, odom frame.

    Each beam counts from where the base was when it was measured, by the `track` of odometry.
    """
    mount = scan.base_laser
    near = np.flatnonzero(scan.ranges < reach + hypot(mount.x, mount.y))
    ranges = evened(scan.ranges)[near]
    bearings = mount.theta + scan.angle_min + scan.angle_increment * near
    x = mount.x + ranges * np.cos(bearings)
    y = mount.y + ranges * np.sin(bearings)
    first = pose_at(track, scan.stamp)
    last = pose_at(track, scan.stamp + len(scan.ranges) * scan.time_increment)
    return _placed(x, y, first, last, near / len(scan.ranges))


def evened(ranges: Array) -> Array:
    """Ranges (N,), m, each as the mean of it and two neighbours on either side on its surface.

    Of many beams on a wall the shortest is too short by two or three sigma. What only one beam
    shows has no such neighbours and stays as it is, unless it may be noise.
    """
    total, count = ranges.copy(), np.ones(len(ranges))
    most = min(SAME_M + _SAME_SIGMAS * excess_noise(ranges), _MOST_SAME_M)
    with np.errstate(invalid="ignore"):  # of beams without an echo
        is_same = np.abs(np.diff(ranges)) < most
    are_same = is_same[:-1] & is_same[1:]
    near, far = slice(None, -1), slice(1, None)
    for beams, others, same in (
        (near, far, is_same),
        (far, near, is_same),
        (slice(None, -2), slice(2, None), are_same),
        (slice(2, None), slice(None, -2), are_same),
    ):
        total[beams] += np.where(same, ranges[others], 0.0)
        count[beams] += same
    return total / count


def _placed(x: Array, y: Array, first: Pose, last: Pose, share: Array) -> Array:
    """Points of a base that moves evenly from one pose to another, at each point's share of it."""
    theta = first.theta + share * wrap_angle(last.theta - first.theta)
    c, s = np.cos(theta), np.sin(theta)
    points = np.empty((len(x), 2))
    points[:, 0] = first.x + share * (last.x - first.x) + c * x - s * y
    points[:, 1] = first.y + share * (last.y - first.y) + s * x + c * y
    points.setflags(write=False)
    return points


def pose_at(track: Sequence[Odometry], stamp: float) -> Pose:
    """`odom_base` at the stamp (s), between the neighbours on the track; never beyond its ends."""
    later = track[-1]
    if stamp >= later.stamp:
        return later.odom_base
    for earlier in reversed(track):
        if earlier.stamp <= stamp:
            share = (stamp - earlier.stamp) / (later.stamp - earlier.stamp)
            return earlier.odom_base.towards(later.odom_base, share)
        later = earlier
    return later.odom_base


def seen_from(odom_base: Pose, points: Array) -> tuple[Array, Array]:
    """Points (N, 2) of the odom frame as x (N,) and y (N,) in the base frame, m."""
    c, s = cos(odom_base.theta), sin(odom_base.theta)
    x, y = points[:, 0] - odom_base.x, points[:, 1] - odom_base.y
    return c * x + s * y, c * y - s * x


def free_distance(
    points: tuple[Array, Array], twist: Twist, *, radius: float, margin: float
) -> float:
    """How far (m) the base can go on the twist's arc until a point is within radius + margin.

    `points` are x (N,) and y (N,) in the base frame, m. When something ahead is nearer than that
    already, radius + LEAST * margin is enough, so that a robot close to a wall can go along it
    and leave it. inf if nothing is in the way. `twist.linear` must not be 0.
    """
    x, y = points
    if twist.linear < 0.0:
        x, twist = -x, Twist(-twist.linear, -twist.angular)
    ahead = x > 0.0  # the robot leaves everything else behind, for a quarter of a turn at least
    x, y = x[ahead], y[ahead]
    if not len(x):
        return inf
    is_close = float(np.min(x * x + y * y)) < (radius + margin) ** 2
    reach = radius + (LEAST * margin if is_close else margin)
    curvature = twist.angular / twist.linear
    if abs(curvature) < STRAIGHT:
        return _free_line(x, y, reach)
    return _free_arc(x, y if curvature > 0.0 else -y, reach, 1.0 / abs(curvature))


def _free_line(x: Array, y: Array, reach: float) -> float:
    """Free distance (m) straight ahead, where no point may come nearer than `reach` (m)."""
    hit = np.abs(y) < reach
    if not hit.any():
        return inf
    x, y = x[hit], y[hit]
    return max(0.0, float(np.min(x - np.sqrt(reach * reach - y * y))))


def _free_arc(x: Array, y: Array, reach: float, turn: float) -> float:
    """Free distance (m) on a left arc of radius `turn` (m), likewise."""
    below = turn - y  # the arc's centre is at (0, turn)
    away = np.sqrt(x * x + below * below)
    hit = np.abs(away - turn) < reach
    if not hit.any():
        return inf
    x, below, away = x[hit], below[hit], away[hit]
    abreast = np.arctan2(x, below)  # angle along the arc to where the point is abreast
    cosine = (away * away + (turn - reach) * (turn + reach)) / (2.0 * turn * away)
    half = np.arccos(np.clip(cosine, -1.0, 1.0))  # how much of that angle the disc spans
    return turn * max(0.0, float(np.min(abreast - half)))
