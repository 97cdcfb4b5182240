"""Shortest paths over the GVG graph, as half-edges to leave by."""

import heapq
from dataclasses import dataclass

from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId


@dataclass(frozen=True, slots=True)
class Approach:
    """A way to a vertex: metres, the half-edge of arrival, and the departures on the way."""

    metres: float
    arrival: HalfEdgeId
    departures: tuple[HalfEdgeId, ...] = ()


def first_arrival(starts: list[Approach], approach: Approach) -> HalfEdgeId:
    """The half-edge of arrival at the first vertex of the shortest approach from these starts."""
    first = (*approach.departures, approach.arrival)[0].vertex
    nearest = min((s for s in starts if s.arrival.vertex == first), key=lambda s: s.metres)
    return nearest.arrival


def shortest_path(graph: GvgGraph, starts: list[Approach], vertex: int) -> Approach | None:
    """As `shortest_paths`, to one vertex only; None if it cannot be reached."""
    return shortest_paths(graph, starts, vertex).get(vertex)


def shortest_paths(
    graph: GvgGraph, starts: list[Approach], last: int | None = None
) -> dict[int, Approach]:
    """The shortest approach to every vertex that can be reached, from one or more first arrivals.

    None leads over an edge that a virtual wall crosses; those farther away than the `last` one are
    left out. Dijkstra on the multigraph; ties go to the smaller ids, so that equal runs stay equal.
    """
    queue = [(s.metres, i, s) for i, s in enumerate(starts)]
    heapq.heapify(queue)
    serial = len(queue)
    done: dict[int, Approach] = {}
    while queue:
        _, _, here = heapq.heappop(queue)
        vertex = here.arrival.vertex
        if vertex in done or vertex not in graph.vertices:
            continue
        done[vertex] = here
        if vertex == last:
            break
        for key, half in graph.vertices[vertex].half_edges.items():
            if half.edge is None or half.blocked or half.edge in graph.walled:
                continue
            edge = graph.edges[half.edge]
            out = HalfEdgeId(vertex, key)
            far = Approach(here.metres + edge.length, edge.other(out), (*here.departures, out))
            if far.arrival.vertex not in done:
                serial += 1
                heapq.heappush(queue, (far.metres, serial, far))
    return done
