"""The building as a team knows it: charts laid on each other, what is still open, and ways there.

Vertices of different charts that stand at one place are one. A departure is open only as long as
nobody has followed it, or seen where it leads.
"""

import heapq
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.geometry import Array, direction_of, length_of, wrap_angle
from gvgbot.registration import AHEAD_M, SAME_M, SAME_RAD, assigned
from gvgbot.team.chart import Chart, ChartEdge, Departure
from gvgbot.team.ways import BESIDE_M, WELL_ON_M, Ways, leads_over


@dataclass(frozen=True, slots=True)
class Frontier:
    """A departure that nobody has followed: the place it leaves from, m, and its bearing, rad."""

    x: float
    y: float
    bearing: float

    def is_at(self, x: float, y: float, bearing: float) -> bool:
        """Whether another frontier is this one."""
        away = math.hypot(self.x - x, self.y - y)
        return away < 2 * SAME_M and abs(wrap_angle(self.bearing - bearing)) < SAME_RAD


@dataclass(frozen=True, slots=True)
class Onward:
    """What another robot has found behind a departure: the vertex there, and how far it is."""

    place: int
    metres: float


class _Edges:
    """The edges of a chart, to be found by where they are: there may be hundreds."""

    def __init__(self, chart: Chart) -> None:
        self._edges = list(chart.edges.values())
        corners = [(e.polyline.min(axis=0), e.polyline.max(axis=0)) for e in self._edges]
        low, high = np.array(corners).reshape(-1, 2, 2).transpose(1, 0, 2)
        self._low, self._high = low - BESIDE_M, high + BESIDE_M

    def about(self, point: Array) -> list[ChartEdge]:
        """Those that may lie beside a point (2,): no others do."""
        is_about = ((self._low <= point) & (point <= self._high)).all(axis=1)
        return [self._edges[i] for i in np.flatnonzero(is_about)]


class Site:
    """Charts in one frame, the own one first."""

    def __init__(self, charts: list[Chart]) -> None:
        self._charts = charts
        self._edges = [_Edges(chart) for chart in charts]
        self._place: dict[tuple[int, int], int] = {}  # chart and vertex -> place
        self._members: list[dict[int, int]] = []  # by place: chart -> vertex
        self._points: list[Array] = []
        for number, chart in enumerate(charts):
            self._lay(number, chart)
        self._links: dict[int, list[tuple[int, float]]] = {}
        for number, chart in enumerate(charts):
            for edge in chart.edges.values():
                a, b = (self._place[number, end.vertex] for end in (edge.a, edge.b))
                self._links.setdefault(a, []).append((b, edge.length))
                self._links.setdefault(b, []).append((a, edge.length))
        self._ways = self._driven_in_parts()
        self.open: dict[int, list[Frontier]] = {}  # by place
        self.onward: dict[HalfEdgeId, Onward] = {}  # behind own departures, by what others know
        self.own: dict[HalfEdgeId, Frontier] = {}  # own departures that nobody has followed
        for number, chart in enumerate(charts):
            for vertex in chart.vertices.values():
                for departure in vertex.departures:
                    if departure.edge is None:
                        self._judge(number, HalfEdgeId(vertex.id, departure.key), departure)

    @property
    def is_explored(self) -> bool:
        """Whether there are places, and no departure from any of them is open."""
        return bool(self._points) and not self.open

    @property
    def known_to_others(self) -> list[Array]:
        """All lines (N, 2) but those of own edges: what this robot drove of others is no edge."""
        others = [edge.polyline for c in self._charts[1:] for edge in c.edges.values()]
        return others + [way.polyline for chart in self._charts for way in chart.ways]

    def own_at(self, vertex: int) -> list[Frontier]:
        """What is open of the departures of an own vertex."""
        return [frontier for end, frontier in self.own.items() if end.vertex == vertex]

    def _lay(self, number: int, chart: Chart) -> None:
        """Let vertices of one more chart be at known places, or at new ones."""
        ids = list(chart.vertices)
        points = np.array([chart.vertices[i].position for i in ids]).reshape(-1, 2)
        if ids and self._points:
            away = cdist(points, np.array(self._points))
            for row, place in assigned(away, SAME_M):
                self._place[number, ids[row]] = place
                self._members[place][number] = ids[row]
        for i, point in zip(ids, points, strict=True):
            if (number, i) not in self._place:
                self._place[number, i] = len(self._points)
                self._points.append(point)
                self._members.append({number: i})

    def _driven_in_parts(self) -> Ways | None:
        """All lines of all charts, if there are such as are no edges of one chart."""
        if not any(chart.ways for chart in self._charts):
            return None
        lines = [(way.polyline, way.min_clearance) for c in self._charts for way in c.ways]
        lines += [(e.polyline, e.min_clearance) for c in self._charts for e in c.edges.values()]
        return Ways(lines, np.array(self._points).reshape(-1, 2))

    def _judge(self, number: int, end: HalfEdgeId, departure: Departure) -> None:
        """Find out whether a departure without an edge has one in another chart."""
        place = self._place[number, end.vertex]
        known = self._followed(number, end.vertex, departure.bearing)
        if number == 0 and known is not None:
            self.onward[end] = known
        if (
            known is not None
            or (departure.blocked and number > 0)
            or self._is_denied(number, place, departure.bearing)
            or self._is_refuted(number, end.vertex)
        ):
            return
        x, y = self._points[place]
        frontier = Frontier(float(x), float(y), departure.bearing)
        same = [f for f in self.open.get(place, []) if f.is_at(x, y, departure.bearing)]
        if not same:
            self.open.setdefault(place, []).append(frontier)
        if number == 0:
            self.own[end] = same[0] if same else frontier

    def _is_denied(self, number: int, place: int, bearing: float) -> bool:
        """Whether robots that have been at a place saw no departure in a direction there.

        Most of them; or this one, which cannot take what another one saw: who saw it finds out.
        """
        saw, missed = set[int](), set[int]()
        for other, vertex in self._members[place].items():
            if self._has_been_at(other, vertex):
                departures = self._charts[other].vertices[vertex].departures
                near = any(abs(wrap_angle(d.bearing - bearing)) < SAME_RAD for d in departures)
                (saw if near else missed).add(other)
        return len(missed) > len(saw) or (number > 0 and 0 in missed)

    def _has_been_at(self, number: int, vertex: int) -> bool:
        edges = self._charts[number].edges.values()
        return any(e.traversed and vertex in (e.a.vertex, e.b.vertex) for e in edges)

    def _is_refuted(self, number: int, vertex: int) -> bool:
        """Whether another robot found no vertex where it drove, and this one has not been there.

        If it has, the other one does not go there again: who saw a departure finds out.
        """
        place = self._place[number, vertex]
        point, holders = self._points[place], self._members[place]
        others = [n for n in range(len(self._charts)) if n != number and n not in holders]
        drivers = [n for n in others if self._has_an_edge_over(n, point)]
        passers = [n for n in others if self._has_driven_over(n, point)]
        if self._has_been_at(number, vertex):
            return 0 in (*drivers, *passers)
        return bool(drivers) or len(passers) >= len(holders)

    def _has_an_edge_over(self, number: int, point: Array) -> bool:
        edges = self._edges[number].about(point)
        return any(e.traversed and leads_over(e.polyline, point, AHEAD_M) for e in edges)

    def _has_driven_over(self, number: int, point: Array) -> bool:
        ways = self._charts[number].ways
        return any(leads_over(way.polyline, point, WELL_ON_M) for way in ways)

    def _followed(self, number: int, vertex: int, bearing: float) -> Onward | None:
        """What another chart has behind a departure, or several have together."""
        place = self._place[number, vertex]
        for other in range(len(self._charts)):
            if other == number:
                continue
            known = self._members[place].get(other)
            if known is not None:
                found = self._behind(other, known, bearing)
            else:
                found = self._along(other, self._points[place], bearing)
            if found is not None:
                return found
        if self._ways is None:
            return None
        walk = self._ways.behind(place, bearing, list(self._edges_at(place)))
        return None if walk is None else Onward(walk.place, walk.length)

    def _edges_at(self, place: int) -> Iterator[Array]:
        """The lines (N, 2) of all edges that end at a place, from there."""
        for number, vertex in self._members[place].items():
            for edge in self._charts[number].edges.values():
                if edge.a.vertex == vertex:
                    yield edge.polyline
                if edge.b.vertex == vertex:
                    yield edge.polyline[::-1]

    def _behind(self, number: int, vertex: int, bearing: float) -> Onward | None:
        """Behind the departure of a chart's vertex that leaves in a direction."""
        chart = self._charts[number]
        departures = chart.vertices[vertex].departures
        nearest = min(departures, key=lambda d: abs(wrap_angle(d.bearing - bearing)), default=None)
        if nearest is None or nearest.edge is None:
            return None
        if abs(wrap_angle(nearest.bearing - bearing)) > SAME_RAD:
            return None
        edge = chart.edges[nearest.edge]
        far = edge.b if edge.a == (vertex, nearest.key) else edge.a
        return Onward(self._place[number, far.vertex], edge.length)

    def _along(self, number: int, point: Array, bearing: float) -> Onward | None:
        """Along the edge of a chart that passes a point in a direction."""
        for edge in self._edges[number].about(point):
            away = np.hypot(*(edge.polyline - point).T)
            i = int(np.argmin(away))
            if away[i] > BESIDE_M:
                continue
            for end, line in ((edge.b, edge.polyline[i:]), (edge.a, edge.polyline[i::-1])):
                metres = length_of(line)
                if metres < AHEAD_M:
                    continue
                if abs(wrap_angle(direction_of(line, AHEAD_M) - bearing)) < SAME_RAD:
                    return Onward(self._place[number, end.vertex], metres)
        return None

    def costs(self, reached: dict[int, float]) -> dict[Frontier, tuple[float, HalfEdgeId]]:
        """The way to every open frontier, m, and the own departure to take for it.

        `reached` has the ways to own vertices. From a departure that others have followed it goes
        on over the edges of all. What others alone have seen to leave from an own vertex is looked
        for there.
        """
        best: dict[Frontier, tuple[float, HalfEdgeId]] = {}
        queue: list[tuple[float, int, HalfEdgeId]] = []
        for end, frontier in self.own.items():
            if end.vertex in reached:
                _improve(best, frontier, reached[end.vertex], end)
        for end, onward in self.onward.items():
            if end.vertex in reached:
                queue.append((reached[end.vertex] + onward.metres, onward.place, end))
        for end in (*self.own, *self.onward):
            if end.vertex in reached:
                for frontier in self._seen_by_others(end.vertex):
                    _improve(best, frontier, reached[end.vertex], end)
        heapq.heapify(queue)
        done: set[int] = set()
        while queue:
            metres, place, end = heapq.heappop(queue)
            if place in done:
                continue
            done.add(place)
            for frontier in self.open.get(place, []):
                _improve(best, frontier, metres, end)
            for other, length in self._links.get(place, []):
                if other not in done:
                    heapq.heappush(queue, (metres + length, other, end))
        return best

    def _seen_by_others(self, vertex: int) -> list[Frontier]:
        """What is open at an own vertex, and no departure of it in the own chart."""
        own = self.own_at(vertex)
        return [f for f in self.open.get(self._place[0, vertex], []) if f not in own]


def _improve(
    best: dict[Frontier, tuple[float, HalfEdgeId]],
    frontier: Frontier,
    metres: float,
    end: HalfEdgeId,
) -> None:
    if frontier not in best or (metres, end) < best[frontier]:
        best[frontier] = metres, end
