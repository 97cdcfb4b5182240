"""Over the robot's own way once more: not as it was driven then, but as well as it can be."""

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.autonomy.control.company import Companion, free_metres
from gvgbot.autonomy.control.edge_follower import Track
from gvgbot.autonomy.views import View
from gvgbot.geometry import Array, resampled

_STEP_M = 0.05  # between two points
_ASIDE_M = (0.05, 0.05, 0.025, 0.025, 0.0125, 0.0125)  # one step after another
_ROOM_M = 0.5  # from walls; who has more need not go aside
_ON_M = 0.1  # so near to a virtual wall the way leads over it


def own_way(way: Array, view: View, company: list[Companion]) -> Track:
    """A way (N, 2), local frame, as far as it is free now.

    It leads through the middle of what is narrow. Who came round a jamb as near to it as it may
    would be held there by the guard, for another way of turning.
    """
    tree = view.obstacles()
    walls = tree.data
    line = _as_far_as(view.virtual_walls, resampled(way, _STEP_M)) if len(way) else way
    if len(walls):
        for step in _ASIDE_M:
            away, nearest = (np.asarray(found) for found in tree.query(line))
            off = (line - walls[nearest]) / np.maximum(away, 1e-6)[:, None]
            line = line + np.clip(_ROOM_M - away, 0.0, step)[:, None] * off
    room = np.asarray(tree.query(line)[0])
    return Track.of(line, room).until(free_metres(line, room, company))


def _as_far_as(virtual_walls: Array, line: Array) -> Array:
    """A line (N, 2) until it comes to such a wall: somebody else may have driven over that."""
    if not len(virtual_walls):
        return line
    is_on = np.asarray(cKDTree(virtual_walls).query(line)[0]) < _ON_M
    return line[: max(1, int(is_on.argmax()))] if is_on.any() else line
