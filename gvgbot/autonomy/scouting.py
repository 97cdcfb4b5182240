"""What to do while no known way leads to where the robot wants to go."""

from collections.abc import Set

import numpy as np

from gvgbot.autonomy.control.edge_follower import Track
from gvgbot.autonomy.control.orders import ARRIVED_M
from gvgbot.autonomy.exploration.paths import first_arrival, shortest_paths
from gvgbot.autonomy.gvg.local import Branch
from gvgbot.autonomy.situation import Situation
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.geometry import Array

_MOST_NEAR = 2  # vertices to go to, for each that no known way leads to
_BEGAN_M = 0.4  # a trail so short is back where it began
_AT_VERTEX_M = 0.5  # so near, all that there is to see from a vertex is seen
_SAME_M = 3.0  # so near to where it began before, the robot looks for the same way


class Scouting:
    """For a way: goes near what cannot be reached, and then along the present edge, to and fro."""

    def __init__(self) -> None:
        self._since: float | None = None  # stamp
        self._before_s, self._began_at = 0.0, np.full(2, np.inf)  # when a way was seen and lost
        self._gone_near = set[tuple[int, int]]()  # what no way leads to, and whence one was sought
        self._turned_back = False  # after the end of sight

    @property
    def is_on(self) -> bool:
        """Whether a way is being looked for."""
        return self._since is not None

    def begin(self, stamp: float, place: Array) -> None:
        """Look for a way, at a place (2,), local frame."""
        self._since, self._turned_back = stamp, False
        if np.hypot(*(place - self._began_at)) > _SAME_M:
            self._before_s, self._began_at = 0.0, place

    def rest(self, stamp: float) -> None:
        """There is a way: who loses it again at the same place goes on looking."""
        self._before_s = self.lasted(stamp)
        self._since = None

    def end(self) -> None:
        """There is nothing to look for any more, or no hope."""
        self._since, self._before_s = None, 0.0

    def skip(self, seconds: float) -> None:
        """Do not count a time in which nothing was to be seen."""
        self._since = None if self._since is None else self._since + seconds

    def lasted(self, stamp: float) -> float:
        """For how many seconds it has looked, since it was last on its way to a vertex."""
        return self._before_s + (0.0 if self._since is None else stamp - self._since)

    def path_near(self, here: Situation, belief: Belief, stamp: float) -> tuple[Branch, ...] | None:
        """To a vertex next to a frontier that no known way leads to: one may be seen there."""
        starts = here.starts()
        approaches = shortest_paths(here.graph, starts)
        lost = {end.vertex for end in here.graph.frontiers()} - approaches.keys()
        goals = self._next_to(lost, approaches.keys(), belief)
        if not goals:
            return None
        goal = min(goals.values(), key=lambda vertex: approaches[vertex].metres)
        approach = approaches[goal]
        if approach.metres < _AT_VERTEX_M:
            self._gone_near |= {pair for pair in goals.items() if pair[1] == goal}
            return None
        path = here.path_over(first_arrival(starts, approach), approach.departures)
        if path is not None:
            self._since, self._before_s = stamp, 0.0
        return path

    def _next_to(self, lost: Set[int], reached: Set[int], belief: Belief) -> dict[int, int]:
        """By vertices that no way leads to, the nearest that is reached and not gone to for it."""
        found = {}
        for one in sorted(lost):
            gone = {near for other, near in self._gone_near if other == one}
            rest = sorted(reached - gone)
            if rest and len(gone) < _MOST_NEAR:
                place = belief.map_vertex(one)
                found[one] = min(rest, key=lambda near: place.distance(belief.map_vertex(near)))
        return found

    def path_on(self, here: Situation) -> tuple[Branch, ...]:
        """On along the present edge; at the end of sight the robot turns back.

        If the vertex where its trail began has proved to be none, it drives on past that.
        """
        where = here.where
        is_lost = where.on_edge is None or here.graph.half_edge(where.on_edge) is None
        if is_lost and self._turned_back and where.trail_length < _BEGAN_M:
            where.trail, self._turned_back = [], False
        path = here.astern() if self._turned_back else here.ahead()
        if Track.of(*here.gvg.line_from(here.place, path)).length < ARRIVED_M:
            self._turned_back = not self._turned_back
        return path
