"""Ways over the known graph to a vertex, or to the point of an edge that is nearest to a place."""

import math
from dataclasses import dataclass

import numpy as np

from gvgbot.autonomy.exploration.paths import Approach, first_arrival, shortest_path, shortest_paths
from gvgbot.autonomy.gvg.local import Branch
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.situation import Situation
from gvgbot.autonomy.slam.graph import Edge, GvgGraph, HalfEdgeId
from gvgbot.autonomy.views import View
from gvgbot.autonomy.virtual_walls import nearest_before
from gvgbot.geometry import Array, Pose, length_of, stations_of

_SIGHT_M = 3.0  # from a place, an edge on its side of the walls may be its foot
_SHOWS_M = 8.0  # so near to it, a vertex shows the walls around it
_EVERY = 4  # points of edges, of which one is looked at
_WELL_ON_M = 1.5  # an edge that nobody knows, it is driven to its end
_INTO_M = 1.0  # an edge that nobody knows, to tell which one leads nearer
NOWHERE = HalfEdgeId(-1, -1)  # that is known: the end of such an edge


@dataclass(frozen=True, slots=True, eq=False)
class Foot:
    """The point of the graph that is nearest to a place: metres `station` from the edge's end a."""

    edge: Edge
    index: int  # of the edge's polyline
    station: float
    away: float  # m from the place

    def in_local_frame(self, mapper: Mapper, view: View) -> Array:
        """Where it is, (2,)."""
        start = mapper.in_local_frame(view, self.edge.a.vertex)
        point: Array = start.transform(self.edge.polyline[self.index])
        return point


@dataclass(frozen=True, slots=True)
class Route:
    """A way: over these departures and on into the last one, or along one's own edge.

    `first` is the half-edge of arrival at the first vertex, or at the one that lies beyond the end
    of the way; `ahead` tells which way along the own edge, None if the way leads over vertices.
    """

    metres: float
    first: HalfEdgeId
    departures: tuple[HalfEdgeId, ...]
    ahead: bool | None = None

    def branches(self, here: Situation) -> tuple[Branch, ...] | None:
        """What to drive of it, as far as it is in sight."""
        if self.ahead is not None:
            return here.along_own_edge(ahead=self.ahead)
        return here.path_over(self.first, self.departures)


def foot_of(mapper: Mapper, point: Array) -> Foot | None:
    """The foot of a point (2,), map frame; None if no edge is known.

    One near by on the point's side of the walls, where there is one: the edge that is nearest to a
    place in a room may be in the corridor behind it.
    """
    edges = list(mapper.graph.edges.values())
    if not edges:
        return None
    lines = [mapper.belief.map_vertex(e.a.vertex).transform(e.polyline) for e in edges]
    places = np.concatenate(lines)
    away = np.hypot(*(places - point).T)
    i = _nearest_in_sight(mapper, point, places, away)
    ends = np.cumsum([len(line) for line in lines])
    k = int(ends.searchsorted(i, side="right"))
    index = i - int(ends[k]) + len(lines[k])
    return Foot(edges[k], index, length_of(lines[k][: index + 1]), float(away[i]))


def _nearest_in_sight(mapper: Mapper, point: Array, places: Array, away: Array) -> int:
    """The nearest of places (N, 2) before the walls around a point, else the very nearest."""
    some = np.argsort(away, kind="stable")
    some = some[: max(1, int(away[some].searchsorted(_SIGHT_M)))][::_EVERY]
    walls = _walls_around(mapper, point)
    before = nearest_before(walls, point, places[some], away[some])
    return int(some[before or 0])


def _walls_around(mapper: Mapper, point: Array) -> Array:
    """The walls (N, 2), map frame, that vertices near a point (2,) were seen among.

    Virtual ones as well.
    """
    belief, walls = mapper.belief, [mapper.virtual_walls]
    for vertex in belief.ids:
        map_vertex = belief.map_vertex(vertex)
        if math.dist(map_vertex.position, point) < _SHOWS_M:
            walls.append(map_vertex.transform(mapper.graph.vertices[vertex].snapshot))
    found = np.concatenate(walls)
    near: Array = found[np.hypot(*(found - point).T) < _SIGHT_M]
    return near


def foot_at(graph: GvgGraph, end: HalfEdgeId, station: float) -> Foot | None:
    """The point of an edge so many metres from one of its ends; None if there is no edge."""
    edge = graph.edge_at(end)
    if edge is None:
        return None
    from_a = station if end == edge.a else edge.length - station
    along = stations_of(edge.polyline)
    return Foot(edge, int(np.argmin(np.abs(along - from_a))), from_a, 0.0)


def route_to_vertex(graph: GvgGraph, starts: list[Approach], vertex: int) -> Route | None:
    """The shortest way to a vertex; None if no known way leads there."""
    approach = shortest_path(graph, starts, vertex)
    if approach is None:
        return None
    return Route(approach.metres, first_arrival(starts, approach), approach.departures)


def route_to_foot(
    here: Situation, starts: list[Approach], foot: Foot, closed: HalfEdgeId | None = None
) -> Route | None:
    """The shortest way to a point of an edge; None if no known way leads there.

    If something stands between the robot and an end of its edge, `closed`, the way to what lies
    beyond that is by that end.
    """
    edge, reached = foot.edge, shortest_paths(here.graph, starts)
    routes = []
    for end, rest in ((edge.a, foot.station), (edge.b, edge.length - foot.station)):
        approach, half = reached.get(end.vertex), here.graph.half_edge(end)
        is_shut = half is None or (end != closed and half.blocked)
        begin = 0.0 if end == edge.a else edge.length
        is_shut |= here.graph.is_walled(edge, begin, foot.station)
        if approach is not None and not is_shut:
            first, departures = first_arrival(starts, approach), (*approach.departures, end)
            routes.append(Route(approach.metres + rest, first, departures))
        if end == here.where.on_edge:
            onwards = rest - here.where.trail_length
            towards = edge.other(end) if onwards > 0.0 else end
            now = foot.station + (-onwards if end == edge.a else onwards)
            if towards != closed and not here.graph.is_walled(edge, now, foot.station):
                routes.append(Route(abs(onwards), towards, (), ahead=onwards > 0.0))
    return min(routes, key=lambda route: route.metres, default=None)


def route_exploring(
    mapper: Mapper, here: Situation, starts: list[Approach], goal: Array
) -> Route | None:
    """The way into a frontier that leads towards a place (2,), map frame; None without frontiers.

    Where furniture stands now that did not when the map was made, new edges lead round it.
    """
    graph, where, reached = here.graph, here.where, shortest_paths(here.graph, starts)
    routes = []
    for end in graph.frontiers():
        bearing = graph.vertices[end.vertex].half_edges[end.key].bearing
        into = Pose(_INTO_M * math.cos(bearing), _INTO_M * math.sin(bearing))
        rest = math.dist(mapper.belief.map_vertex(end.vertex).compose(into).position, goal)
        if end == where.on_edge:
            on_it = Route(rest, NOWHERE, (), ahead=True)
            if where.trail_length > _WELL_ON_M:
                return on_it
            routes.append(on_it)
        elif end.vertex in reached:
            approach = reached[end.vertex]
            first, departures = first_arrival(starts, approach), (*approach.departures, end)
            routes.append(Route(approach.metres + rest, first, departures))
    return min(routes, key=lambda route: route.metres, default=None)
