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


def is_at_start(belief: Belief, clearance: float) -> bool:
    """Whether the robot is where it started: the map's origin, inside its own maximal disc.

    The covariance of the robot is that of its pose against the start.
    """
    away = belief.x[:2]
    near = float(np.hypot(*away)) < min(_FAR_M, clearance)
    return near and mahalanobis(away, belief.P[:2, :2] + np.eye(2) * _AT_M**2) < _GATE
