"""How far odometry scatters beside what is configured, learnt from how scan matching corrects it.

Wheels and floors differ, and what is configured is meant for most of them. Walls make good a known
share of each step's error; the squares of what they made good, beside those that were to be
expected, tell by how much the variance is larger or smaller: along the way, and of the heading.
"""

import numpy as np

from gvgbot.geometry import Array, Pose

_SURE = 3.0  # corrections that the configured noise counts for
_KEPT = 1.0 - 1.0 / 200.0  # of what is known, with every correction
_LEAST, _MOST = 0.05, 25.0  # the variance, beside the configured one
_SURPRISING = 25.0  # times the expected square; what is more tells no more
_LEAST_M2 = 1e-10  # variance of a correction where walls say nothing


class Spread:
    """Factors of the variance of odometry: along the way, and of the heading."""

    def __init__(self) -> None:
        self._A = _SURE * np.eye(2)
        self._b = _SURE * np.ones(2)
        self.factors: Array = np.ones(2)

    def honest(self, Q: Array) -> Array:
        """The covariance (3, 3) of a step for which Q is configured; frame of the base."""
        along, turn = self.factors
        sigma = np.sqrt([along, turn, turn])
        return np.asarray(Q * np.outer(sigma, sigma), np.float64)

    def learn(self, change: Pose, Q: Array, gain: Array, by_walls: Array) -> None:
        """Account for the change that walls made to a pose.

        Q (3, 3) is the configured covariance of the pose before, `gain` (3, 3) the share of an
        error that the change makes good, `by_walls` what the change itself errs by; all in the
        frame of the base.
        """
        self._A *= _KEPT
        self._b *= _KEPT
        for i, value in ((0, change.x), (2, change.theta)):
            of_walls = by_walls[i, i]
            by_turning = gain[i, 1:] @ Q[1:, 1:] @ gain[i, 1:]
            by_odometry = np.array([gain[i, 0] ** 2 * Q[0, 0], by_turning])
            expected = float(by_odometry.sum() + of_walls) + _LEAST_M2
            square = min(value**2, _SURPRISING * expected)
            weight = min(expected / float(Q[i, i]), 1.0) / expected**2
            self._A += weight * np.outer(by_odometry, by_odometry)
            self._b += weight * by_odometry * (square - of_walls)
        self.factors = np.clip(np.linalg.solve(self._A, self._b), _LEAST, _MOST)
