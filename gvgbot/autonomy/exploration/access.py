"""Access: from a place off the GVG, in a wide space or beside it, onto the nearest edge."""

import math

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.autonomy.views import View
from gvgbot.geometry import Array

NEAR_M = 1.5  # from an edge, one is as good as on it
_ROOM_M = 0.35  # from the walls, on the way
_SPACING_M = 0.1


def way_to_edge(view: View) -> tuple[Array, Array] | None:
    """The straight way to the nearest edge of the local GVG to which there is one.

    The very nearest edge may be behind a wall. As `straight_way` has it.
    """
    base = view.local_base.position
    lines = (edge.polyline for edge in view.gvg.edges.values())
    nearest = [line[int(np.argmin(np.hypot(*(line - base).T)))] for line in lines]
    nearest.sort(key=lambda point: float(np.hypot(*(point - base))))
    ways = (straight_way(view, goal, _ROOM_M) for goal in nearest)
    return next((way for way in ways if way is not None), None)


def straight_way(view: View, goal: Array, least_room: float) -> tuple[Array, Array] | None:
    """The straight way to a point (2,), local frame; None if it is not known to be free.

    Its points (N, 2), local frame, and their distances (N,) from the walls, m.
    """
    base = view.local_base.position
    distance = float(np.hypot(*(goal - base)))
    line = np.linspace(base, goal, math.ceil(distance / _SPACING_M) + 1)
    room = np.asarray(cKDTree(view.local_map.points()).query(line)[0])
    narrow = room < min(least_room, float(room[0]))  # where it stands, it may stand close
    if narrow.any() or not view.local_map.known(line).all():
        return None
    return line, room
