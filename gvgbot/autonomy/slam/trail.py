"""Old poses of the robot in the EKF's state, on whose walls its scans are laid.

A scan that is laid onto walls errs as the poses from which these were seen. So whoever comes back
to where it was before is as sure as it was then, which no covariance of a single step can say.
Poses are kept as in stochastic cloning (Roumeliotis and Burdick): the newest look by look, older
ones for more and more looks together, as their mean. Before them the state has the three errors
of odometry that `Calibration` learns: no closure tells anything of these, but the pose errs with
them at every step (Schmidt).
"""

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gvgbot.autonomy.slam import ekf
from gvgbot.autonomy.slam.ekf import Belief, Clone
from gvgbot.geometry import Array, Pose, rotated_covariance, rows_of, turn_matrix, wrap_angle

MOST = 16  # old poses
_SIZE = 3 + 3 * MOST  # of the trail's part of the state


class Laid(NamedTuple):
    """How a scan was laid onto walls, in the frame of the base where that has put it.

    Its error is the sum of `gains` (M, 3, 3) times the mean ones of the poses from which walls were
    seen in some `looks`, the first of them and the next one after them (M, 2), what these gains
    leave of the error before, `by_odometry` (3, 3) times the three of odometry, and what is new:
    odometry's `noise` and the scan's own, covariances (3, 3). The walls that the scan draws do not
    err by its own noise: it lies on those that were there.
    """

    local_base: Pose
    look: int  # number of the one that is taken from there
    looks: NDArray[np.int64]
    gains: Array
    by_odometry: Array
    noise: Array
    scan_noise: Array
    left: Array  # (3, 3) of odometry's errors, by what has been learnt since the last motion,
    P: Array  # and their covariance (3, 3)


def move(belief: Belief, motion: Pose, covariance: Array, laid: Laid | None) -> Belief:
    """The belief after a motion, in the covariance of the old one, which is valid no more.

    `covariance` (3, 3), in the frame of its start, is that of the motion by itself. Without a match
    that is all there is: walls may be elsewhere for the robot, and a new trail begins.
    """
    if laid is None:
        return ekf.predict_in_place(ekf.without_trail(belief), motion, covariance)
    if not belief.trail:
        belief = _begun(belief, laid.local_base.compose(motion.inverse()), laid.look - 1)
    belief = _followed(belief, motion, laid)
    scan_noise = rotated_covariance(laid.scan_noise, belief.map_base.theta)
    return _cloned(belief, laid.local_base, laid.look, scan_noise)


def _begun(belief: Belief, local_base: Pose, look: int) -> Belief:
    """The belief with room for a trail, and the robot's own pose as the first of it."""
    n = len(belief.x)
    x, P = np.zeros(n + _SIZE), np.zeros((n + _SIZE, n + _SIZE))
    x[:n], P[:n, :n] = belief.x, belief.P
    return _cloned(replace(belief, x=x, P=P), local_base, look, np.zeros((3, 3)))


def _followed(belief: Belief, motion: Pose, laid: Laid) -> Belief:
    """The belief of a robot that has laid a scan onto the walls seen from its old poses."""
    x, P, end = belief.x.copy(), belief.P, belief.end
    odometry = slice(end, end + 3)
    x[odometry] = 0.0  # and its covariance is put right below: no closure tells of it
    P[odometry] = laid.left @ P[odometry]
    P[:, odometry] = P[odometry].T
    P[odometry, odometry] = laid.P
    moved, F, _ = ekf.composed(belief.map_base, motion)
    R = turn_matrix(moved.theta)
    by_before = F - R @ laid.gains.sum(axis=0) @ R.T @ F
    by_trail = np.concatenate([R @ laid.by_odometry, _by_clones(belief, laid, R)], axis=1)
    row = by_before @ P[:3] + by_trail @ P[end:]
    own = row[:, :3] @ by_before.T + row[:, end:] @ by_trail.T
    own += R @ (laid.noise + laid.scan_noise) @ R.T
    P[:3], P[:, :3] = row, row.T
    P[:3, :3] = (own + own.T) / 2
    x[:3] = moved.x, moved.y, moved.theta
    return replace(belief, x=x)


def _by_clones(belief: Belief, laid: Laid, R: Array) -> Array:
    """How the pose after a match errs with each slot of the trail, (3, 3 MOST), map frame."""
    trail = belief.trail
    borders = np.array([-np.inf, *(clone.first for clone in trail[1:]), np.inf])[:, None]
    first, after = laid.looks.T.astype(np.float64)
    shared = np.minimum(after, borders[1:]) - np.maximum(first, borders[:-1])
    share = np.maximum(shared, 0.0) / (after - first)
    gains = R @ (share @ laid.gains.reshape(-1, 9)).reshape(-1, 3, 3) @ R.T
    slots = [clone.slot for clone in trail]
    map_clone = belief.x[belief.end + 3 :].reshape(MOST, 3)[slots]
    local_clone = rows_of(clone.local_base for clone in trail)
    turn = map_clone[:, 2] - local_clone[:, 2]
    c, s = np.cos(turn), np.sin(turn)
    x, y = laid.local_base.x - local_clone[:, 0], laid.local_base.y - local_clone[:, 1]
    # by its heading each moves the base that it sees at (x, y) sideways
    gains[:, :, 2] += (c * x - s * y)[:, None] * gains[:, :, 1]
    gains[:, :, 2] -= (s * x + c * y)[:, None] * gains[:, :, 0]
    by_slot = np.zeros((3, MOST, 3))
    by_slot[:, slots] = gains.swapaxes(0, 1)
    return by_slot.reshape(3, -1)


def _cloned(belief: Belief, local_base: Pose, look: int, scan_noise: Array) -> Belief:
    """The belief with the robot's pose as the newest of the trail, in its own mean and covariance.

    What of its error is the noise of its scan, map frame, the new one does not have.
    If there are too many, two neighbours become one: those for the fewest looks by their age.
    """
    trail, slot = list(belief.trail), len(belief.trail)
    if slot == MOST:
        ages = [look - clone.first for clone in trail]
        looks = [older.looks + newer.looks for older, newer in pairwise(trail)]
        i = min(range(MOST - 1), key=lambda i: looks[i] / ages[i])
        slot = trail[i + 1].slot
        trail[i : i + 2] = [_merged(belief, trail[i], trail[i + 1])]
    at = _rows(belief, slot)
    belief.x[at] = belief.x[:3]
    belief.P[at] = belief.P[:3]
    belief.P[:, at] = belief.P[:, :3]
    for rows, columns in ((at, slice(3)), (slice(3), at), (at, at)):
        belief.P[rows, columns] -= scan_noise
    return replace(belief, trail=(*trail, Clone(local_base, look, 1, slot)))


def _merged(belief: Belief, older: Clone, newer: Clone) -> Clone:
    """The mean of two old poses in the place of the older one, as that would have it from each."""
    x, P, q, r = belief.x, belief.P, _rows(belief, older.slot), _rows(belief, newer.slot)
    share = newer.looks / (older.looks + newer.looks)
    seen, F, _ = ekf.composed(Pose.from_array(x[r]), newer.local_base.to(older.local_base))
    off = seen.x - x[q.start], seen.y - x[q.start + 1], wrap_angle(seen.theta - x[q.start + 2])
    x[q] += share * np.array(off)
    row = (1.0 - share) * P[q] + share * F @ P[r]
    own = (1.0 - share) * row[:, q] + share * row[:, r] @ F.T
    P[q], P[:, q] = row, row.T
    P[q, q] = (own + own.T) / 2
    return older._replace(looks=older.looks + newer.looks)


def _rows(belief: Belief, slot: int) -> slice:
    """The part of the state that is a slot of the trail."""
    start = belief.end + 3 + 3 * slot
    return slice(start, start + 3)
