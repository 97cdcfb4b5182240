"""The edge on which the robot started: half of it is driven before any vertex is known.

Its first vertex keeps the half-edge of arrival as a frontier. Whoever later comes over the rest of
the edge, from its other end, closes it at the start and need not drive the first half again.
"""

from dataclasses import dataclass

import numpy as np

from gvgbot.autonomy.slam.ekf import Belief, mahalanobis
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.geometry import Array

_GATE = 9.2  # squared Mahalanobis distance, 2 degrees of freedom
_FAR_M = 0.8  # from the start, whatever the uncertainty
_AT_M = 0.25  # so near, standard deviation, one is at a place and not on the way to it


@dataclass(frozen=True, slots=True, eq=False)
class StartEdge:
    """The way from the start to the first vertex, line (N, 2) in that vertex's frame."""

    end: HalfEdgeId
    line: Array
    narrowest: float


def is_at_start(belief: Belief, start: Array, clearance: float) -> bool:
    """Whether the robot is where it came onto its first edge (2,), map frame, in its maximal disc.

    That is near the map's origin, against which the covariance of its pose is.
    """
    away = belief.x[:2] - start
    near = float(np.hypot(*away)) < min(_FAR_M, clearance)
    return near and mahalanobis(away, belief.P[:2, :2] + np.eye(2) * _AT_M**2) < _GATE
