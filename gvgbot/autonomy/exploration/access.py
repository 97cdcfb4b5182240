"""Access: from a place off the GVG, in a wide space or beside it, onto the nearest edge."""

import math

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.autonomy.views import View
from gvgbot.geometry import Array

NEAR_M = 1.5  # from an edge, one is as good as on it
_ROOM_M = 0.35  # from the walls, on the way
_SPACING_M = 0.1
_BEARINGS, _STEP_M, _FARTHEST_M = 16, 0.5, 4.0  # of places to go to where no edge is in sight
_ROOM_ENOUGH_M = 5.0  # from the walls: more says nothing
_SOUGHT_M = 1.5  # so near, one has been


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


def way_into_the_open(view: View, sought: list[Array]) -> tuple[Array, Array] | None:
    """The straight way away from the walls, to where most room is known and nobody has been.

    There an edge may come into sight, or a wall. `sought` are the places (2,), local frame, where
    none was. As `straight_way` has it.
    """
    base = view.local_base
    bearings = base.theta + np.linspace(0.0, math.tau, _BEARINGS, endpoint=False)
    metres = np.arange(_FARTHEST_M, 0.9, -_STEP_M)
    goals = base.position + (
        metres[:, None, None] * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    ).reshape(-1, 2)
    room = np.asarray(cKDTree(view.local_map.points()).query(goals)[0])
    for goal in goals[np.argsort(-np.minimum(room, _ROOM_ENOUGH_M), kind="stable")]:
        if all(math.dist(goal, place) > _SOUGHT_M for place in sought):
            way = straight_way(view, goal, _ROOM_M)
            if way is not None:
                return way
    return None


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
