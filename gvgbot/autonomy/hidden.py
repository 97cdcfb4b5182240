"""Places beside which somebody stood: a vertex, or a way that leaves one, may be missing there."""

from dataclasses import dataclass

import numpy as np

from gvgbot.autonomy.destinations import foot_of, route_to_foot
from gvgbot.autonomy.gvg.local import Branch
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.views import View, touching
from gvgbot.autonomy.whereabouts import Situation
from gvgbot.geometry import Array, Pose

_NEAR_M = 3.0  # a place farther away is left to when the robot comes nearer
_AT_IT_M = 1.5  # and from so near, what there is to see is seen
_SAME_M = 1.0  # places nearer to each other are one
_BESIDE_M = 0.5  # beyond the disc of a vertex: who stands there hides a way
_CLEAR_LOOKS = 10  # with nobody beside it show what is there
_SLOW_MPS = 0.1  # slower on the way there is no progress


@dataclass(slots=True, eq=False)
class _Place:
    position: Array  # (2,) map frame
    reach: float  # m; nearer, somebody hides something
    looks: int = 0  # from near, with nobody there


class Hidden:
    """Keeps such places until they have been seen with nobody there, and leads back to them."""

    def __init__(self) -> None:
        self._places: list[_Place] = []
        self._goal: _Place | None = None
        self._until = 0.0  # stamp: later, the goal is given up
        self._is_leading = False

    def note(self, view: View, map_local: Pose) -> None:
        """Take down what is no longer hidden, and where somebody stands.

        Whoever comes after the robot has been everywhere hides nothing.
        """
        self._look(view, map_local)
        for key in () if self._is_leading else touching(view.gvg, view.people):
            node = view.gvg.nodes[key]
            position = map_local.transform(node.position)
            is_near = np.hypot(*(node.position - view.local_base.position)) < _NEAR_M
            is_fork = node.is_meetpoint or node.is_suspect
            if is_near and is_fork and not self._is_noted(position):
                self._places.append(_Place(position, node.clearance + _BESIDE_M))

    def _is_noted(self, position: Array) -> bool:
        return any(np.hypot(*(one.position - position)) < _SAME_M for one in self._places)

    def _look(self, view: View, map_local: Pose) -> None:
        local_map = map_local.inverse()
        for one in self._places:
            there = local_map.transform(one.position)
            is_at_it = np.hypot(*(there - view.local_base.position)) < _AT_IT_M
            is_hidden = (np.hypot(*(view.people - there).T) < one.reach).any()
            one.looks += bool(is_at_it and not is_hidden)
        self._places = [one for one in self._places if one.looks < _CLEAR_LOOKS]

    def path(
        self, view: View, here: Situation, mapper: Mapper, patience_s: float
    ) -> tuple[Branch, ...] | None:
        """What to drive to the nearest of them; None if none is left that a way leads to."""
        self._is_leading = True
        if view.stamp > self._until:
            self._places = [one for one in self._places if one is not self._goal]
        if self._goal not in self._places:
            self._goal = None
        starts, found = here.starts(), []
        for one in self._places if self._goal is None else [self._goal]:
            foot = foot_of(mapper, one.position)
            route = None if foot is None else route_to_foot(here, starts, foot)
            if route is not None:
                found.append((route.metres, id(one), one, route))
        if not found:
            self._places = []
            return None
        metres, _, one, route = min(found)
        if self._goal is None:
            self._goal = one
            self._until = view.stamp + metres / _SLOW_MPS + patience_s
        return route.branches(here) or here.ahead()

    def skip(self, seconds: float) -> None:
        """Do not count a time in which nothing was to be seen."""
        self._until += seconds
