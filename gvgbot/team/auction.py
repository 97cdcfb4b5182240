"""Which frontier is whose: every robot takes the one that nobody else is nearer to, and says so.

There is nobody who assigns work. What the others have found tells a robot where not to go, and
which of its own frontiers leads to where nobody has been.
"""

from collections.abc import Callable, Collection
from typing import Protocol

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.autonomy.exploration.paths import Approach, shortest_paths
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId
from gvgbot.geometry import Array, Pose
from gvgbot.team.chart import Chart, moved
from gvgbot.team.news import Claim
from gvgbot.team.site import Frontier, Site
from gvgbot.team.ways import BESIDE_M

_MOSTLY = 0.8  # of a line: what others have driven along the same way
_TAKES_OVER_M = 2.0  # nearer to a frontier than who claims it, one takes it


class Team(Protocol):
    """What has been heard of the others."""

    @property
    def frames(self) -> dict[str, Pose]:
        """Poses of their frames in the own one, as far as they are known."""

    def chart(self, name: str) -> Chart:
        """What one of them has told of its map, in its own frame."""

    def claims(self) -> list[tuple[str, Claim]]:
        """What they are on their way to, own map frame."""

    @property
    def may_find_more(self) -> bool:
        """Whether one of them has something to do."""


class Auction:
    """Shares the frontiers with the others of a team; the `Sharing` of a mission."""

    def __init__(self, name: str, own_chart: Callable[[], Chart], team: Team) -> None:
        self._name, self._own_chart, self._team = name, own_chart, team
        self.claim: Claim | None = None
        self.is_idle = False  # nothing is open that this robot could go to
        self._claimed_end: HalfEdgeId | None = None
        self._site: Site | None = None
        self._frontiers = frozenset[HalfEdgeId]()  # own ones at the last choice
        self._others_claim_all = self._nothing_left = False
        self.known_to_others: list[Array] = []  # lines (N, 2); see `Sharing`

    def renew(self) -> None:
        """Look anew at what is open: a chart, or how it lies, has changed."""
        self._site = None

    def withdraw(self) -> None:
        """Claim nothing any more."""
        self.claim = None

    def choose(self, graph: GvgGraph, starts: list[Approach]) -> tuple[HalfEdgeId, Approach] | None:
        """The frontier that nobody else is nearer to, by the shortest way; see `Sharing`."""
        reached = shortest_paths(graph, starts)
        frontiers = frozenset(graph.frontiers())
        if frontiers != self._frontiers:
            self._frontiers, self._site = frontiers, None
        site = self._current_site()
        metres = {vertex: way.metres for vertex, way in reached.items()}
        costs = {
            frontier: (cost, end)
            for frontier, (cost, end) in site.costs(metres).items()
            if (half := graph.half_edge(end)) is not None and half.open
        }
        claims = self._team.claims()
        mine = [
            (cost, end, frontier)
            for frontier, (cost, end) in costs.items()
            if not self._is_taken(frontier, cost, claims)
        ]
        may_come = self._team.may_find_more
        is_placed = bool(reached) or (not graph.vertices and site.is_explored)
        self.is_idle = is_placed and not costs
        self._nothing_left = self.is_idle and not may_come
        self._others_claim_all = is_placed and not mine and (bool(costs) or may_come)
        if self._nothing_left:
            self.known_to_others = site.known_to_others
        if not mine:
            self.claim = self._claimed_end = None
            return None
        cost, end, frontier = min(mine, key=lambda one: (one[0], one[1]))
        self._claim(frontier, cost, end)
        return end, reached[end.vertex]

    def keeps(self, target: HalfEdgeId, graph: GvgGraph, starts: list[Approach]) -> bool:
        """Whether the target is still what it was chosen for; see `Sharing`."""
        site, claim = self._current_site(), self.claim
        if target == self._claimed_end:
            frontiers = (f for many in site.open.values() for f in many if self._is_claimed(f))
            frontier = next(frontiers, None)
        else:  # the vertex from which that led was none: it is a departure before it
            frontier = site.own.get(target)
        if frontier is None:
            return False
        if frontier in site.own_at(target.vertex) and site.own.get(target) != frontier:
            return False  # it leaves from the same vertex, as this robot sees now
        metres = {vertex: way.metres for vertex, way in shortest_paths(graph, starts).items()}
        cost, _ = site.costs(metres).get(frontier, (0.0 if claim is None else claim.metres, target))
        self._claim(frontier, cost, target)
        return not self._is_taken(frontier, cost, self._team.claims())

    def has_driven(self, line: Array, *, either_way: bool = False) -> bool:
        """Whether others have driven along a line (N, 2) the same way; see `Sharing`.

        A whole edge does not tell in which direction it was driven.
        """
        ways = [
            pose.transform(polyline)
            for name, pose in self._team.frames.items()
            for polyline in _driven(self._team.chart(name), edges=either_way)
        ]
        if not ways or len(line) < 2:
            return False
        away, nearest = cKDTree(np.concatenate(ways)).query(line)
        onwards = np.concatenate([np.gradient(way, axis=0) for way in ways])[nearest]
        is_same_way = (onwards * np.gradient(line, axis=0)).sum(axis=1) > 0.0
        is_on_way = np.max(away) < BESIDE_M
        return bool(is_on_way and (either_way or is_same_way.mean() > _MOSTLY))

    @property
    def is_waiting(self) -> bool:
        """Whether others are on their way to all that is left; see `Sharing`."""
        return self._others_claim_all

    @property
    def is_done(self) -> bool:
        """Whether nothing is left that this robot could go to; see `Sharing`."""
        return self._nothing_left

    @property
    def is_explored(self) -> bool:
        """Whether nothing is open anywhere; see `Sharing`."""
        return self._current_site().is_explored

    @property
    def unfollowed(self) -> Collection[HalfEdgeId]:
        """Own departures that nobody has followed; see `Sharing`."""
        return self._current_site().own

    def _claim(self, frontier: Frontier, cost: float, end: HalfEdgeId) -> None:
        self.claim = Claim(frontier.x, frontier.y, frontier.bearing, cost)
        self._claimed_end = end

    def _is_claimed(self, frontier: Frontier) -> bool:
        claim = self.claim
        return claim is not None and frontier.is_at(claim.x, claim.y, claim.bearing)

    def _is_taken(self, frontier: Frontier, cost: float, claims: list[tuple[str, Claim]]) -> bool:
        """Whether another robot is on its way to a frontier, and not much farther from it."""
        for name, claim in claims:
            if frontier.is_at(claim.x, claim.y, claim.bearing):
                lead = 0.0 if self._is_claimed(frontier) else _TAKES_OVER_M
                if (claim.metres, name) < (cost + lead, self._name):
                    return True
        return False

    def _current_site(self) -> Site:
        if self._site is None:
            charts = [self._own_chart()]
            charts += [moved(self._team.chart(n), pose) for n, pose in self._team.frames.items()]
            self._site = Site(charts)
        return self._site


def _driven(chart: Chart, *, edges: bool) -> list[Array]:
    """The lines (N, 2) of the parts of edges that a robot has driven, and of whole edges."""
    whole = [edge.polyline for edge in chart.edges.values() if edges and edge.traversed]
    return whole + [way.polyline for way in chart.ways]
