"""The ear rule: which edge to take at a vertex, and where to go when none is left there.

Always turning to the first frontier clockwise of the arrival keeps one face of the graph on the
left, so that the robot comes back to mapped ground after each face: one ear after another.
"""

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


def nearest_frontier(graph: GvgGraph, starts: list[Approach]) -> tuple[HalfEdgeId, Approach] | None:
    """The frontier at the vertex with the shortest way, by the ear rule; None if out of reach."""
    reachable = shortest_paths(graph, starts)
    for vertex, approach in sorted(reachable.items(), key=lambda item: (item[1].metres, item[0])):
        frontier = ear_next(graph, HalfEdgeId(vertex, approach.arrival.key))
        if frontier is not None:
            return frontier, approach
    return None
