"""Edges that several robots of a team have driven in pieces, and none from end to end."""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import uniform_filter1d

from gvgbot.geometry import Array, direction_of
from gvgbot.maps.merging import is_among, is_same, settled
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode, lines_from
from gvgbot.registration import AHEAD_M
from gvgbot.team.ways import WELL_ON_M, Ways, leads_over

_EVENED = 7  # points of a line, 0.1 m apart


def pieced(graph: RouteGraph, ways: Sequence[tuple[Array, float]]) -> RouteGraph:
    """The map, with an edge from frontier to frontier wherever ways lead from one to the other.

    A vertex without any edge over which a way leads is none: who drove there saw nothing.
    `ways` are lines (N, 2) in the map frame and their least clearances, m.
    """
    if not ways:
        return graph
    joined = {end for edge in graph.edges for end in (edge.start, edge.end)}
    vertices = [v for v in graph.vertices if v.id in joined or not _is_passed(v, ways)]
    lines = [*ways, *((edge.polyline, edge.min_clearance) for edge in graph.edges)]
    known = Ways(lines, np.array([vertex.position for vertex in vertices]).reshape(-1, 2))
    edges = list(graph.edges)
    for number, vertex in enumerate(vertices):
        taken = list(lines_from(vertex.id, graph.edges)) if vertex.frontiers else []
        for bearing in vertex.frontiers:
            walk = known.behind(number, bearing, taken)
            if walk is None or not is_among(
                direction_of(walk.line[::-1], AHEAD_M), vertices[walk.place].frontiers
            ):
                continue
            edge = RouteEdge(
                start=vertex.id,
                end=vertices[walk.place].id,
                polyline=_evened(walk.line),
                min_clearance=walk.min_clearance,
                traversals=1,
            )
            if not any(is_same(edge, other) for other in edges):
                edges.append(edge)
    return settled(vertices, edges)


def _evened(line: Array) -> Array:
    """The line (N, 2) without the kinks where one way goes on beside the end of another one."""
    for _ in range(2):
        line = uniform_filter1d(line, _EVENED, axis=0, mode="nearest")
    return line


def _is_passed(vertex: RouteNode, ways: Sequence[tuple[Array, float]]) -> bool:
    """Whether a way leads over a vertex, and well on to both sides."""
    return any(leads_over(line, np.array(vertex.position), WELL_ON_M) for line, _ in ways)
