"""Edges that several robots of a team have driven in pieces, and none from end to end."""

from collections.abc import Sequence

import numpy as np

from gvgbot.geometry import Array
from gvgbot.maps.merging import direction, is_among, is_same, settled
from gvgbot.maps.route_graph import MapEdge, RouteGraph
from gvgbot.team.ways import Ways


def pieced(graph: RouteGraph, ways: Sequence[tuple[Array, float]]) -> RouteGraph:
    """The map, with an edge from frontier to frontier wherever ways lead from one to the other.

    `ways` are lines (N, 2) in the map frame and their least clearances, m.
    """
    if not ways:
        return graph
    vertices = graph.vertices
    lines = [*ways, *((edge.polyline, edge.min_clearance) for edge in graph.edges)]
    known = Ways(lines, np.array([vertex.position for vertex in vertices]).reshape(-1, 2))
    edges = list(graph.edges)
    for number, vertex in enumerate(vertices):
        for bearing in vertex.frontiers:
            walk = known.behind(number, bearing)
            if walk is None or not is_among(
                direction(walk.line[::-1]), vertices[walk.place].frontiers
            ):
                continue
            edge = MapEdge(
                start=vertex.id,
                end=vertices[walk.place].id,
                polyline=walk.line,
                length=walk.length,
                min_clearance=walk.min_clearance,
                traversals=1,
            )
            if not any(is_same(edge, other) for other in edges):
                edges.append(edge)
    return settled(vertices, edges)
