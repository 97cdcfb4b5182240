"""What is constantly wrong with odometry, learnt from how scan matching corrects it.

A scale of all distances, a scale of all turns, and a turn rate that is felt while there is none.
Walls correct each step only in part, so what is left of a constant error would add up. How far the
corrections scatter tells how noisy odometry is: wheels wear, and no floor is like another.
"""

from typing import NamedTuple

import numpy as np

from gvgbot.geometry import Array, Pose

_SIGMA = np.array([0.02, 0.01, 0.0005])  # before anything is known: 1, 1, rad/s
_WANDER = np.array([1e-5, 1e-5, 1e-6])  # of each with every step
_SURPRISING = 16.0  # squared Mahalanobis distance of a correction that tells of a slip
_NOISE = (0.02, 25.0)  # variance of odometry, least and most, in units of what is expected
_LEAST_TRUSTED = 0.5  # the least that walls are weighed against: the next doorstep comes unforeseen
_RATE, _FEW = 0.02, 20.0  # at which it is learnt with each step, and the steps until it is that low
_ODDEST = 9.0  # a correction says no more than one of three sigmas
_LEAST_SHARE = 0.1  # of its own covariance, that a step has in every direction
_LEAST = 1e-10 * np.eye(3)  # variance of a correction where walls say nothing, m^2 and rad^2


class Correction(NamedTuple):
    """What walls made of a corrected motion of some seconds.

    The change that they made to the pose after it, in the frame of the base there, as the
    covariances (3, 3) of that pose: `expected` before, as it was weighed, `covariance` after. What
    odometry truly `scattered` may be less, and so may the variance of the walls: by `noise`.
    """

    motion: Pose
    duration: float
    change: Pose
    expected: Array
    scattered: Array
    covariance: Array
    noise: float


class Calibration:
    """Belief about the three errors: mean and covariance.

    `shared` (3, 3) is the covariance of the pose, in the frame of the base, with the three: what
    is wrong with odometry is wrong at every step, so where walls do not tell, errors of steps do
    not cancel but add up. (Schmidt-Kalman filter: they are considered and not estimated there.)
    `noise` (2,) is the variance of distances and of turns, in units of what is expected, and `told`
    (2,) how many steps told of it.
    """

    def __init__(self) -> None:
        self.x = np.zeros(3)
        self.P = np.diag(_SIGMA**2)
        self.shared = np.zeros((3, 3))
        self.noise, self.told = np.ones(2), np.zeros(2)

    def corrected(self, motion: Pose, duration: float) -> Pose:
        """A motion that odometry felt in some seconds, as it most probably was."""
        distance, turn, rate = self.x
        return Pose(
            motion.x * (1.0 + distance),
            motion.y * (1.0 + distance),
            motion.theta * (1.0 + turn) + rate * duration,
        )

    def scattered(self, Q: Array) -> Array:
        """The covariance (3, 3) of a motion, which is expected to be Q, as it has proved to be.

        Sideways as along the way: wheels that slip in a turn move the base sideways.
        """
        return _scaled(Q, self.noise)

    def trusted(self, Q: Array) -> Array:
        """The same, but no less than is good to weigh against walls."""
        return _scaled(Q, np.maximum(self.noise, _LEAST_TRUSTED))

    def adds_up(self, motion: Pose, duration: float, left: Array, drift: Array) -> Array:
        """The covariance `drift` (3, 3) of one more step, with what all steps err in common.

        Both are in the frame of the base after it. Of what odometry errs in it, walls leave the
        share `left` (3, 3). What a way back makes good again is left out: a step has no negative
        covariance, and more may have been learnt on the way.
        """
        B = left @ _per_unit(motion, duration)
        before = _seen_after(motion) @ self.shared
        added = before @ B.T
        self.shared = before + B @ self.P
        added = added + added.T + B @ self.P @ B.T
        added += np.diag(np.maximum(-np.diag(added), 0.0))
        L = np.linalg.cholesky(drift)  # in its units, as metres and radians do not compare
        values, axes = np.linalg.eigh(np.linalg.solve(L, np.linalg.solve(L, added).T))
        axes = L @ axes
        return np.asarray(axes * np.maximum(1.0 + values, _LEAST_SHARE) @ axes.T)

    def learn(self, told: Correction) -> None:
        """Account for what walls made of a motion.

        Of an error before it they make good the share g = 1 - C Q^-1, and add g V g' = g C of their
        own, if V is their covariance by itself.
        """
        Q, C = told.expected, told.covariance
        g = np.eye(3) - np.linalg.solve(Q, C).T
        H = g @ _per_unit(told.motion, told.duration)
        r = np.array([told.change.x, told.change.y, told.change.theta])
        P = self.P + np.diag(_WANDER**2)
        by_errors = H @ P @ H.T + _LEAST
        truly = g @ told.scattered @ g.T + told.noise * g @ C
        self._learn_noise(r, by_errors + truly, g)
        S = by_errors + Q - C  # as odometry was trusted
        if r @ np.linalg.solve(S, r) > _SURPRISING:
            return
        K = np.linalg.solve(S, H @ P).T
        self.x = self.x + K @ r
        left = np.eye(3) - K @ H
        P -= K @ S @ K.T
        self.P, self.shared = (P + P.T) / 2, self.shared @ left.T

    def _learn_noise(self, r: Array, S: Array, g: Array) -> None:
        """Let the noise follow the squares of corrections r (3,) over their variances in S (3, 3).

        They are 1 on average if it is right; a step counts by the share g (3, 3) of an error that
        it makes good.
        """
        axes = [0, 2]  # along the way, and the heading
        counts = np.maximum(0.0, g[axes, axes]) ** 2
        self.told = self.told + counts
        rate = np.maximum(_RATE, 1.0 / (_FEW + self.told)) * counts
        odd = np.minimum(r[axes] ** 2 / S[axes, axes], _ODDEST)
        self.noise = np.clip(self.noise * np.exp(rate * (odd - 1.0)), *_NOISE)


def _scaled(Q: Array, noise: Array) -> Array:
    """The covariance Q (3, 3) of a motion, with the variance of distances and turns times (2,)."""
    sigmas = np.sqrt(noise[[0, 0, 1]])
    return np.asarray(Q * np.outer(sigmas, sigmas), np.float64)


def _per_unit(motion: Pose, duration: float) -> Array:
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
