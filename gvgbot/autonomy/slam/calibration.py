"""What is constantly wrong with odometry, learnt from how scan matching corrects it.

A scale of all distances, a scale of all turns, and a turn rate that is felt while there is none.
Walls correct each step only in part, so what is left of a constant error would add up. How far the
corrections scatter tells how noisy odometry is, by driving, by turning and by time: wheels wear,
gyros differ, and no floor is like another. A good base is doubted all the same, as the next floor
may be another, but errs no more for that.
"""

import numpy as np

from gvgbot.autonomy.small_systems import solved
from gvgbot.geometry import Array, Pose

_SIGMA = np.array([0.02, 0.01, 0.0005])  # before anything is known: 1, 1, rad/s
_WANDER = np.diag(np.array([1e-5, 1e-5, 1e-6]) ** 2)  # of each with every step
_SURPRISING = 16.0  # squared Mahalanobis distance of a correction that tells of a slip
_NOISE = (0.002, 25.0)  # variances of odometry, least and most, in units of what is expected
_LEAST_DOUBTED = 0.5  # by so much of it motions are doubted, however good: floors have surprises
_RATE = 0.02  # at which they are learnt with each step; faster at first,
_FEW = 4.0  # as if so many steps had told of what is expected: each base has its own
_ODDEST = 9.0  # a correction says no more than one of three sigmas
_LEAST_SHARE = 0.1  # of its own covariance, that a step has in every direction
_TELLING = 0.1  # of an error along the way: less is made good by the roughness of side walls only
_ONE = np.eye(3)
_LEAST = 1e-10 * np.eye(3)  # variance of a correction where walls say nothing, m^2 and rad^2


class Calibration:
    """Belief about the three errors: mean and covariance.

    `shared` (3, 3) is the covariance of the pose, in the frame of the base, with the three: what
    is wrong with odometry is wrong at every step, so where walls do not tell, errors of steps do
    not cancel but add up. (Schmidt-Kalman filter: they are considered and not estimated there.)
    `noise` (4,) are the variances of odometry's parts (`OdometryNoise.parts`), in units of what is
    expected, and `told` (4,) how many steps told of each.
    """

    def __init__(self) -> None:
        self.x = np.zeros(3)
        self.P = np.diag(_SIGMA**2)
        self.shared = np.zeros((3, 3))
        self.noise, self.told = np.ones(4), np.zeros(4)

    def corrected(self, motion: Pose, duration: float) -> Pose:
        """A motion that odometry felt in some seconds, as it most probably was."""
        distance, turn, rate = self.x
        return Pose(
            motion.x * (1.0 + distance),
            motion.y * (1.0 + distance),
            motion.theta * (1.0 + turn) + rate * duration,
        )

    def scattered(self, parts: Array) -> Array:
        """The covariance (3, 3) by which a motion is doubted whose parts (4, 3, 3) are expected."""
        noise = np.maximum(self.noise, _LEAST_DOUBTED)
        return np.asarray((noise @ parts.reshape(4, 9)).reshape(3, 3), np.float64)

    def as_felt(self, parts: Array) -> Array:
        """The parts (4, 3, 3) of its covariance that a motion has proved to err by."""
        return np.asarray(self.noise[:, None, None] * parts, np.float64)

    def adds_up(self, motion: Pose, duration: float, left: Array, drift: Array) -> Array:
        """The covariance `drift` (3, 3) of one more step, with what all steps err in common.

        Both are in the frame of the base after it. Of what odometry errs in it, walls leave the
        share `left` (3, 3). What a way back makes good again is left out: a step has no negative
        covariance, and more may have been learnt on the way.
        """
        B = left @ per_unit(motion, duration)
        before = _seen_after(motion) @ self.shared
        added = before @ B.T
        self.shared = before + B @ self.P
        added = added + added.T + B @ self.P @ B.T
        added.flat[::4] = np.maximum(added.flat[::4], 0.0)  # its diagonal
        # in units of what is new, as metres and radians do not compare
        L = np.asarray(np.linalg.cholesky(drift), np.float64)
        values, axes = np.linalg.eigh(solved(L, solved(L, added).T))
        axes = L @ axes
        return np.asarray(axes * np.maximum(1.0 + values, _LEAST_SHARE) @ axes.T)

    def learn(
        self,
        motion: Pose,
        duration: float,
        change: Pose,
        parts: Array,
        C: Array,
        walls: float,
    ) -> Array:
        """Account for the change that walls made to the pose after a corrected motion.

        What is left (3, 3) of the three errors, as whoever knows their covariance with other things
        must account for it as well.

        The change is in the frame of the base after it. In the same frame are the `parts`
        (4, 3, 3) of the noise that was expected and the covariance C (3, 3) of the pose after it,
        which was doubted by Q before: 1 - C Q^-1 is the share g of an error that the change makes
        good. `walls` is the variance of what walls say, in units of what C takes it for. What
        bare side walls seem to say of the way along them holds back as much as it tells: it is
        left out.
        """
        g = _ONE - C @ np.linalg.inv(self.scattered(parts))
        told = np.array([g[0, 0] > _TELLING, 1.0, 1.0])
        r, both = told * [change.x, change.y, change.theta], np.outer(told, told)
        gC, g = both * (g @ C), both * g
        H = g @ per_unit(motion, duration)
        P = self.P + _WANDER
        felt = g @ self.as_felt(parts) @ g.T
        S = H @ P @ H.T + felt.sum(axis=0) + walls * gC + _LEAST  # g V g' = g C
        self._learn_noise(r, S, felt)
        if r @ np.linalg.solve(S, r) > _SURPRISING:
            return _ONE
        K = np.linalg.solve(S, H @ P).T
        self.x = self.x + K @ r
        left = _ONE - K @ H
        P -= K @ S @ K.T
        self.P, self.shared = (P + P.T) / 2, self.shared @ left.T
        return left

    def _learn_noise(self, r: Array, S: Array, felt: Array) -> None:
        """Let the noise follow the squares of corrections r (3,) over their variances in S (3, 3).

        They are 1 on average if it is right. A step counts for each part by the share of that in
        what was expected, of which `felt` (4, 3, 3) is odometry's.
        """
        expected = np.diag(S)
        counts = (np.diagonal(felt, axis1=1, axis2=2) / expected) ** 2
        self.told = self.told + counts.sum(axis=1)
        rate = np.maximum(_RATE, 1.0 / (_FEW + self.told))
        odd = np.minimum(r**2 / expected, _ODDEST)
        self.noise = np.clip(self.noise * (1.0 + rate * (counts @ (odd - 1.0))), *_NOISE)


def per_unit(motion: Pose, duration: float) -> Array:
    """How the pose after a motion errs with each of the three (3, 3), in the frame of the base."""
    c, s = np.cos(motion.theta), np.sin(motion.theta)
    return np.array(
        [
            [c * motion.x + s * motion.y, 0.0, 0.0],
            [c * motion.y - s * motion.x, 0.0, 0.0],
            [0.0, motion.theta, duration],
        ]
    )


def _seen_after(motion: Pose) -> Array:
    """An error (3,) of the pose before a motion, as one of the pose after it: (3, 3)."""
    c, s = np.cos(motion.theta), np.sin(motion.theta)
    return np.array(
        [
            [c, s, s * motion.x - c * motion.y],
            [-s, c, c * motion.x + s * motion.y],
            [0.0, 0.0, 1.0],
        ]
    )
