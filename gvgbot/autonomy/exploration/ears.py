"""Which frontier comes next: by the ear rule at a vertex, or the one that costs least to reach.

Always turning to the first frontier clockwise of the arrival keeps one face of the graph on the
left, so that the robot comes back to mapped ground after each face: one ear after another.
"""

from collections.abc import Callable

from gvgbot.autonomy.exploration.paths import Approach, shortest_paths
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId


def ear_next(graph: GvgGraph, arrival: HalfEdgeId) -> HalfEdgeId | None:
    """The first frontier clockwise after the half-edge of arrival; that one itself comes last."""
    vertex = graph.vertices[arrival.vertex]
    if arrival.key not in vertex.half_edges:
        keys = list(vertex.half_edges)
    else:
        keys = vertex.clockwise_from(arrival.key)
    return next((HalfEdgeId(vertex.id, k) for k in keys if vertex.half_edges[k].open), None)


def nearest_frontier(
    graph: GvgGraph, starts: list[Approach], handicap: Callable[[int], float] = lambda vertex: 0.0
) -> tuple[HalfEdgeId, Approach] | None:
    """The frontier at the vertex with the shortest way, by the ear rule; None if out of reach.

    `handicap` of a vertex, m, counts as if the way to it were so much longer.
    """
    reachable = shortest_paths(graph, starts)
    costs = sorted((way.metres + handicap(vertex), vertex) for vertex, way in reachable.items())
    for _, vertex in costs:
        approach = reachable[vertex]
        frontier = ear_next(graph, HalfEdgeId(vertex, approach.arrival.key))
        if frontier is not None:
            return frontier, approach
    return None
