"""Back over the robot's own way to a part of the map that no known way leads to any more.

The robot has come from there, so it can get there; it keeps its way in the local frame, which does
not leap when a loop closes.
"""

from collections import deque

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.autonomy.control.company import Companion
from gvgbot.autonomy.control.edge_follower import Track
from gvgbot.autonomy.own_way import own_way
from gvgbot.autonomy.views import Correspondence, View
from gvgbot.geometry import Array

_STEP_M = 0.1  # from point to point of the way
_SHORTCUT_M, _DETOUR_M = 0.25, 0.5  # where it comes so near to itself, after so much, or more
_AT_M = 0.35  # so near to a vertex, it is there, and not behind something
_BEYOND = 4  # points of the way: there it was before it came to the vertex
_MOST = 5000  # points that are kept
_THERE_M = 0.15  # from the end of the way
_AHEAD_M = 3.0  # of the way is driven before the robot looks again


class Retracing:
    """Once to each vertex. `note` where the robot is and what it sees, at every view."""

    def __init__(self) -> None:
        # where it was (2,), local frame, and the vertices that it was at there
        self._way: deque[tuple[Array, frozenset[int]]] = deque(maxlen=_MOST)
        self._in_sight = set[int]()  # vertices, in the present view
        self._been = set[int]()  # where it has gone back to
        self._back: Array | None = None  # (N, 2), what is driven

    @property
    def is_on(self) -> bool:
        """Whether the robot is on its way back."""
        return self._back is not None

    def note(self, view: View, known: Correspondence) -> None:
        """The robot has come on."""
        here = view.local_base.position
        self._in_sight = set(known.vertex_of.values())
        if self._way and np.hypot(*(here - self._way[-1][0])) < _STEP_M:
            return
        near = (
            vertex
            for node, vertex in known.vertex_of.items()
            if np.hypot(*(view.gvg.nodes[node].position - here)) < _AT_M
        )
        self._way.append((here, frozenset(near)))

    def begin(self, lost: set[int]) -> bool:
        """Go back to where one of these vertices was near last; whether there is such a place."""
        lost = lost - self._been - self._in_sight
        way = list(self._way)[::-1]
        at = next((i for i, (_, near) in enumerate(way) if near & lost), None)
        if at is None:
            return False
        self._been |= way[at][1] & lost
        self._back = _without_detours(np.array([place for place, _ in way[: at + 1 + _BEYOND]]))
        return True

    def track(self, view: View, company: list[Companion]) -> Track | None:
        """What is to be driven next of the way back; None at its end, or if it cannot go on."""
        assert self._back is not None
        away = np.hypot(*(self._back - view.local_base.position).T)
        line = self._back[int(away.argmin()) :][: round(_AHEAD_M / _STEP_M)]
        track = own_way(line, view, company)
        return None if track.length < _THERE_M else track

    def end(self) -> None:
        """Go back no farther."""
        self._back = None

    def renew(self) -> None:
        """Allow to go back to every vertex once more."""
        self._been.clear()


def _without_detours(way: Array) -> Array:
    """The way (N, 2) without its loops."""
    tree, kept, i = cKDTree(way), [0], 0
    while i < len(way) - 1:
        last = max(tree.query_ball_point(way[i], _SHORTCUT_M))
        i = last if (last - i) * _STEP_M > _DETOUR_M else i + 1
        kept.append(i)
    return way[kept]
