"""How far the robot can go straight over what it knows to be free."""

from functools import cache

import numpy as np

from gvgbot.autonomy.gvg.local_map import LocalMap
from gvgbot.geometry import Array, Pose, Twist
from gvgbot.hal.sweep import free_distance, seen_from

_GRAIN_M = 0.05  # of what must be known to be free


def room_ahead(
    local_map: LocalMap, others: Array, pose: Pose, farthest: float, *, radius: float, margin: float
) -> float:
    """So far, m, a robot of a radius, m, can go straight ahead from a pose in the local frame.

    In its way are walls, `others` (N, 2), local frame, and what is unknown, no farther than
    `farthest`; from all it keeps a margin, m.
    """
    ahead = pose.transform(_ahead(radius, farthest))
    unknown = ahead[~local_map.known(ahead)]
    seen = seen_from(pose, np.concatenate([local_map.points(), others, unknown]))
    return free_distance(seen, Twist(1.0, 0.0), radius=radius, margin=margin)


@cache
def _ahead(radius: float, metres: float) -> Array:
    """Points (N, 2) of the base frame that a robot of a radius, m, sweeps on so many metres."""
    x, y = -np.mgrid[-radius - metres : 0.0 : _GRAIN_M, -radius:radius:_GRAIN_M]
    outside = np.hypot(x, y) > radius
    return np.stack([x[outside], y[outside]], axis=1)
