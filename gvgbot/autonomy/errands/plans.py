"""Which stop comes next on an errand: the only one, the next of a patrol, or of all edges."""

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal, Protocol

from gvgbot.autonomy.errands.driving import Ended
from gvgbot.autonomy.errands.kinds import (
    Coverage,
    Errand,
    Home,
    Look,
    Patrol,
    Rest,
    Stop,
    ToPoint,
    ToVertex,
    Waypoint,
)
from gvgbot.autonomy.events import Event, Recovery, RoundEnded
from gvgbot.autonomy.exploration.paths import Approach, shortest_paths
from gvgbot.autonomy.exploration.postman import postman_tour
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId
from gvgbot.autonomy.slam.names import Names

_REST_S = 30.0  # after a round of a patrol that led nowhere
_MOVED_M = 1.0  # a round shorter than this led nowhere
_NEAR_END_M = 0.5  # from its end, an edge counts as driven


@dataclass(frozen=True, slots=True, eq=False)
class Here:
    """What a plan is made by: the graph, the first vertices around, and m driven so far.

    Vertices and half-edges of a plan keep the `names` that they had when it was made.
    """

    stamp: float
    graph: GvgGraph
    starts: list[Approach]
    travelled: float
    names: Names


@dataclass(frozen=True, slots=True)
class Kept:
    """An errand as it is kept for after a restart; which fields mean something, `kind` tells."""

    kind: Literal["vertex", "point", "home", "patrol", "coverage"]
    vertices: tuple[int, ...] = ()  # to go to, or to patrol
    x: float = 0.0  # m, map frame
    y: float = 0.0
    left: tuple[int, ...] = ()  # vertices of this round
    rounds: int = 0
    departures: tuple[HalfEdgeId, ...] | None = None  # still to be driven; None: not planned yet
    missed: tuple[HalfEdgeId, ...] = ()  # in vain
    driven: int = 0
    is_last_try: bool = False

    def renamed(self, names: Names) -> "Kept":
        """With the names of now, the only ones that are known after a restart."""
        vertices, left = (tuple(map(names.vertex, some)) for some in (self.vertices, self.left))
        missed = tuple(map(names.half_edge, self.missed))
        departures = self.departures and tuple(map(names.half_edge, self.departures))
        return replace(self, vertices=vertices, left=left, departures=departures, missed=missed)


class Plan(Protocol):
    """Knows the stops of an errand."""

    errand: Errand
    happened: list[Event]  # whoever tells of it takes it out

    def next(self, here: Here) -> Stop | Ended:
        """The next stop, or how the errand ended."""

    def note(self, here: Here, ended: Ended) -> None:
        """Learn how driving to the stop ended."""

    def kept(self) -> Kept | None:
        """What there is to remember; None for what a restart ends."""

    def __str__(self) -> str:
        """What is being done, and how far that is."""


def plan_for(errand: Errand) -> Plan:
    """The plan of a new errand."""
    match errand:
        case Patrol():
            return Rounds(errand)
        case Coverage():
            return AllEdges(errand)
        case _:
            return OneStop(errand)


def recalled(kept: Kept) -> Plan:
    """The plan that was kept."""
    match kept.kind:
        case "vertex":
            return OneStop(ToVertex(kept.vertices[0]))
        case "point":
            return OneStop(ToPoint(kept.x, kept.y))
        case "home":
            return OneStop(Home(kept.x, kept.y))
        case "patrol":
            return Rounds(Patrol(kept.vertices), list(kept.left), kept.rounds)
        case "coverage":
            return AllEdges(Coverage(), kept)


class OneStop:
    """A plan with a single stop."""

    def __init__(self, errand: ToVertex | ToPoint | Home | Look) -> None:
        self.errand: Errand = errand
        self.happened: list[Event] = []
        self._stop = errand
        self._ended: Ended | None = None

    def next(self, here: Here) -> Stop | Ended:
        """The stop, and after it its end."""
        return self._stop if self._ended is None else self._ended

    def note(self, here: Here, ended: Ended) -> None:
        """That is the end of the errand, too."""
        self._ended = ended

    def kept(self) -> Kept | None:
        """Where it was going."""
        match self._stop:
            case ToVertex(vertex=vertex):
                return Kept("vertex", vertices=(vertex,))
            case ToPoint(x=x, y=y):
                return Kept("point", x=x, y=y)
            case Home(x=x, y=y):
                return Kept("home", x=x, y=y)
            case Look():
                return None

    def __str__(self) -> str:
        return str(self.errand)


class Rounds:
    """A patrol: in the order that was asked for, or to the nearest that is left of all."""

    def __init__(self, errand: Patrol, left: list[int] | None = None, rounds: int = 0) -> None:
        self.errand: Errand = errand
        self.happened: list[Event] = []
        self._wanted = errand.vertices
        self._left, self._rounds = left or [], rounds
        self._target: int | None = None
        self._reached = self._missed = 0
        self._travelled_then: float | None = None

    def next(self, here: Here) -> Stop | Ended:
        """The next vertex of the round; a rest after one that led nowhere."""
        if not self._left:
            led_nowhere = self._end_round(here)
            known = here.graph.vertices
            self._left = [v for v in self._wanted or known if here.names.vertex(v) in known]
            if not self._left:
                return Ended("given up", "none of its vertices is in the map any more")
            if led_nowhere:
                return Rest(_REST_S)
        self._target = self._left[0] if self._wanted else self._nearest(here)
        return ToVertex(self._target)

    def _end_round(self, here: Here) -> bool:
        """Tell of a round that is over; whether it led nowhere."""
        began, self._travelled_then = self._travelled_then, here.travelled
        if not (self._reached or self._missed):
            return False
        self._rounds += 1
        self.happened.append(RoundEnded(here.stamp, self._rounds, self._reached, self._missed))
        has_moved = began is None or here.travelled > began + _MOVED_M
        led_nowhere = not (self._reached and has_moved)
        self._reached = self._missed = 0
        return led_nowhere

    def _nearest(self, here: Here) -> int:
        ways = shortest_paths(here.graph, here.starts)

        def away(vertex: int) -> float:
            way = ways.get(here.names.vertex(vertex))
            return math.inf if way is None else way.metres

        return min(self._left, key=lambda vertex: (away(vertex), vertex))

    def note(self, here: Here, ended: Ended) -> None:
        """One vertex fewer is left, whether it was reached or not."""
        if self._target is None:  # after a rest
            return
        self._left.remove(self._target)
        if ended.outcome == "arrived":
            self._reached += 1
        else:
            self._missed += 1
            self.happened.append(
                Recovery(here.stamp, "leave out a vertex", f"{self._target}: {ended.reason}")
            )
        self._target = None

    def kept(self) -> Kept | None:
        """The round, and what is left of it."""
        return Kept("patrol", self._wanted, left=tuple(self._left), rounds=self._rounds)

    def __str__(self) -> str:
        return f"{self.errand}, round {self._rounds + 1}"


class AllEdges:
    """Coverage: the postman's tour, and once more what could not be driven."""

    def __init__(self, errand: Coverage, kept: Kept | None = None) -> None:
        kept = kept or Kept("coverage")
        self.errand: Errand = errand
        self.happened: list[Event] = []
        self._left = None if kept.departures is None else list(kept.departures)
        self._missed, self._driven = list(kept.missed), kept.driven
        self._is_last_try = kept.is_last_try
        self._stops: deque[Stop] = deque()

    def next(self, here: Here) -> Stop | Ended:
        """The next stop on the edge, or on the next edge."""
        if self._left is None:
            self._left = list(_once_each(here.graph, postman_tour(here.graph, _first(here))))
        if not self._left and self._missed and not self._is_last_try:
            self._left, self._missed, self._is_last_try = self._missed, [], True
        if not self._left:
            return self._end()
        if not self._stops:
            self._stops.extend(_stops(here, self._left[0], is_last=len(self._left) == 1))
        return self._stops[0]

    def note(self, here: Here, ended: Ended) -> None:
        """Go on along the edge; leave it out if there is no way on."""
        assert self._left, "there was a stop"
        self._stops.popleft()
        if ended.outcome == "given up":
            self._stops.clear()
            end = self._left.pop(0)
            self._missed.append(end)
            reason = f"at vertex {end.vertex}: {ended.reason}"
            self.happened.append(Recovery(here.stamp, "leave out an edge", reason))
        elif not self._stops:
            del self._left[0]
            self._driven += 1

    def _end(self) -> Ended:
        total = self._driven + len(self._missed)
        outcome: Literal["arrived", "given up"] = "given up" if self._missed else "arrived"
        return Ended(outcome, f"{self._driven} of {total} edges driven")

    def kept(self) -> Kept | None:
        """Which edges are left."""
        departures = None if self._left is None else tuple(self._left)
        return Kept(
            "coverage",
            departures=departures,
            missed=tuple(self._missed),
            driven=self._driven,
            is_last_try=self._is_last_try,
        )

    def __str__(self) -> str:
        if self._left is None:
            return str(self.errand)
        total = self._driven + len(self._missed) + len(self._left)
        return f"{self.errand}, {self._driven} of {total} edges"


def _first(here: Here) -> int:
    """The vertex at which a tour begins: the nearest."""
    nearest = min(here.starts, key=lambda start: start.metres, default=None)
    return next(iter(here.graph.vertices)) if nearest is None else nearest.arrival.vertex


def _once_each(graph: GvgGraph, tour: list[HalfEdgeId]) -> Iterator[HalfEdgeId]:
    """The departures by which edges are driven for the first time; the others are on the way."""
    seen = set[int]()
    for end in tour:
        edge = graph.edge_at(end)
        if edge is not None and edge.id not in seen:
            seen.add(edge.id)
            yield end


def _stops(here: Here, end: HalfEdgeId, *, is_last: bool) -> list[Stop]:
    """Where to pass so that the shortest way from each to the next is along the edge."""
    now = here.names.half_edge(end)
    edge = here.graph.edge_at(now)
    stops: list[Stop] = [Waypoint(end, 0.0)]
    if edge is None:
        return stops
    third = edge.length / 3
    stops += [Waypoint(end, third), Waypoint(end, 2 * third)]
    if third > _NEAR_END_M:
        stops.append(Waypoint(end, edge.length - _NEAR_END_M))
    far = edge.other(now).vertex
    if is_last or here.graph.vertices[far].degree == 1:
        stops.append(ToVertex(far))
    return stops
