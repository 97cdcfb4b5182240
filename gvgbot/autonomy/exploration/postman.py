"""The shortest tour that drives every known edge: the Chinese postman's, open at its end.

Vertices with an odd number of edges are joined in pairs by ways that are driven once more, so that
all edges can be driven in one go. Which pairs make these ways shortest is an integer programme.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.sparse import coo_array

from gvgbot.autonomy.exploration.paths import Approach, shortest_paths
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId

_ANYWHERE = -1  # instead of a vertex: where the tour may end
_NEIGHBOURS = 12  # that are likely enough to be the other one of a pair
_PATIENCE_S = 1.0  # of the robot's computer, for the very best pairs

Pair = tuple[int, int]


def postman_tour(graph: GvgGraph, start: int) -> list[HalfEdgeId]:
    """The departures, one after the other, over all edges that hang together with a vertex.

    Edges that are blocked, or walled, are left out. The tour ends wherever that is best.
    """
    graph = _drivable(graph)
    reached = _ways_from(graph, start)
    odd = {vertex for vertex in reached if graph.vertices[vertex].degree % 2} ^ {start}
    ways = {vertex: _ways_from(graph, vertex) for vertex in sorted(odd)}
    times = {edge.id: 1 for edge in graph.edges.values() if edge.a.vertex in reached}
    for a, b in _pairs(ways):
        for departure in () if b == _ANYWHERE else ways[a][b].departures:
            edge = graph.edge_at(departure)
            assert edge is not None, "ways lead over edges"
            times[edge.id] += 1
    return _in_one_go(graph, start, times)


def _drivable(graph: GvgGraph) -> GvgGraph:
    """The graph without frontiers, and without edges that are blocked or walled."""
    ends = {
        edge.id: (graph.half_edge(edge.a), graph.half_edge(edge.b)) for edge in graph.edges.values()
    }
    open_ = {
        edge
        for edge, halves in ends.items()
        if all(half is not None and not half.blocked for half in halves)
        and edge not in graph.walled
    }
    vertices = {
        vertex.id: replace(
            vertex, half_edges={k: h for k, h in vertex.half_edges.items() if h.edge in open_}
        )
        for vertex in graph.vertices.values()
    }
    return GvgGraph(vertices, {edge: graph.edges[edge] for edge in sorted(open_)})


def _ways_from(graph: GvgGraph, vertex: int) -> dict[int, Approach]:
    return shortest_paths(graph, [Approach(0.0, HalfEdgeId(vertex, -1))])


def _pairs(ways: dict[int, dict[int, Approach]]) -> list[Pair]:
    """Vertices in pairs with the shortest ways between them together; one goes with anywhere."""
    metres = {
        (a, b): 0.0 if b == _ANYWHERE else ways[a][b].metres
        for a, b in combinations([*ways, _ANYWHERE], 2)
    }
    return _matched(_likely(metres)) or _matched(metres)


def _likely(metres: dict[Pair, float]) -> dict[Pair, float]:
    """The pairs of which one is among the nearest of the other: the best ones are among them."""
    around: dict[int, list[float]] = {}
    for pair, d in metres.items():
        for vertex in pair:
            around.setdefault(vertex, []).append(d)
    reach = {vertex: sorted(d)[:_NEIGHBOURS][-1] for vertex, d in around.items()}
    return {(a, b): d for (a, b), d in metres.items() if d <= max(reach[a], reach[b])}


def _matched(metres: dict[Pair, float]) -> list[Pair]:
    """Pairs in which everybody is once, the shortest together; none if that cannot be."""
    from scipy.optimize import Bounds, LinearConstraint, milp

    pairs = list(metres)
    number = {vertex: i for i, vertex in enumerate(sorted({v for pair in pairs for v in pair}))}
    rows = [number[vertex] for pair in pairs for vertex in pair]
    columns = np.repeat(np.arange(len(pairs)), 2)
    each = coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(number), len(pairs)))
    best = milp(
        np.array(list(metres.values())),
        integrality=np.ones(len(pairs), np.int64),
        bounds=Bounds(0.0, 1.0),
        constraints=LinearConstraint(each.tocsc(), 1.0, 1.0),
        options={"time_limit": _PATIENCE_S},
    )
    return [] if best.x is None else [pairs[i] for i in np.flatnonzero(best.x > 0.5)]


def _in_one_go(graph: GvgGraph, start: int, times: dict[int, int]) -> list[HalfEdgeId]:
    """A walk from a vertex over each edge so many times (Hierholzer's algorithm)."""
    ways = {vertex.id: vertex.ends for vertex in graph.vertices.values()}
    walk: list[tuple[int, HalfEdgeId | None]] = [(start, None)]
    finished: list[HalfEdgeId] = []
    while walk:
        vertex, came_by = walk[-1]
        edge = None
        while ways[vertex] and edge is None:
            edge = graph.edge_at(ways[vertex][-1])
            if edge is None or not times[edge.id]:
                ways[vertex].pop()
                edge = None
        if edge is not None:
            end = ways[vertex][-1]
            times[edge.id] -= 1
            walk.append((edge.other(end).vertex, end))
            continue
        walk.pop()
        if came_by is not None:
            finished.append(came_by)
    return finished[::-1]
