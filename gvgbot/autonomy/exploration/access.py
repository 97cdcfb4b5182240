"""Access: from a place off the GVG, in a wide space or beside it, onto the nearest edge."""

import math

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.autonomy.gvg.local import Place
from gvgbot.autonomy.views import View
from gvgbot.geometry import Array

NEAR_M = 1.5  # from an edge, one is as good as on it
_ROOM_M = 0.35  # from the walls, on the way
_SPACING_M = 0.1


def way_to_edge(view: View, place: Place) -> tuple[Array, Array] | None:
    """The straight way to the nearest point of the local GVG; None if it is not free.

    Its points (N, 2), local frame, and their distances (N,) from the walls, m.
    """
    base, edge = view.local_base.position, view.gvg.edges[place.edge]
    goal = [float(np.interp(place.station, edge.stations, edge.polyline[:, k])) for k in (0, 1)]
    line = np.linspace(base, goal, math.ceil(place.distance / _SPACING_M) + 1)
    room = np.asarray(cKDTree(view.local_map.points()).query(line)[0])
    narrow = room < min(_ROOM_M, float(room[0]))  # where it stands, it may stand close
    if narrow.any() or not view.local_map.known(line).all():
        return None
    return line, room
