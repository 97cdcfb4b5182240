"""Route graphs of one building by several robots as one, by the word of all of them."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gvgbot.geometry import Array, Pose
from gvgbot.maps.merging import is_among, merged
from gvgbot.maps.moved import moved_graph
from gvgbot.maps.pieced import pieced
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode, lines_from
from gvgbot.registration import SAME_M


def joined_graph(
    graphs: Sequence[tuple[RouteGraph, Pose]], ways: Sequence[tuple[Array, float]] = ()
) -> RouteGraph:
    """One map of all, each with the pose of its frame in the frame of the result.

    `ways` are the parts of edges that robots have driven, in the result: lines (N, 2) and their
    least clearances, m. They are pieced together where they lead from frontier to frontier.
    A frontier that most robots at its place did not see is none: somebody may have stood there. If
    no more than two edges are left of a meetpoint that had frontiers, it is none either.
    """
    laid = [moved_graph(graph, pose) for graph, pose in graphs]
    whole, *others = (_agreed(graph, laid) for graph in laid)
    for other in others:
        whole = merged(whole, other, Pose())
    whole = pieced(whole, ways)
    unfinished = [
        vertex.position for graph in laid for vertex in graph.vertices if vertex.frontiers
    ]
    for vertex in whole.vertices:
        if any(math.dist(vertex.position, place) < SAME_M for place in unfinished):
            whole = _without_bend(whole, vertex)
    return whole


def _agreed(graph: RouteGraph, graphs: Sequence[RouteGraph]) -> RouteGraph:
    """A map without the frontiers that most of those at their places did not see."""
    return replace(graph, vertices=tuple(_heard(vertex, graphs) for vertex in graph.vertices))


def _heard(vertex: RouteNode, graphs: Sequence[RouteGraph]) -> RouteNode:
    if not vertex.frontiers:
        return vertex
    said = [one.bearings for graph in graphs if (one := _visited(graph, vertex)) is not None]
    denied = {
        frontier
        for frontier in vertex.frontiers
        if 2 * sum(is_among(frontier, bearings) for bearings in said) < len(said)
    }
    bearings = tuple(b for b in vertex.bearings if b not in denied)
    return replace(
        vertex,
        degree=len(bearings),
        bearings=bearings,
        frontiers=tuple(f for f in vertex.frontiers if f not in denied),
    )


def _visited(graph: RouteGraph, vertex: RouteNode) -> RouteNode | None:
    """What a map has at the place of a vertex, if its robot has been there."""
    driven = {end for e in graph.edges if e.traversals > 0 for end in (e.start, e.end)}
    here = [one for one in graph.vertices if one.id in driven]
    nearest = min(here, key=lambda o: math.dist(o.position, vertex.position), default=None)
    if nearest is None or math.dist(nearest.position, vertex.position) >= SAME_M:
        return None
    return nearest


def _without_bend(graph: RouteGraph, vertex: RouteNode) -> RouteGraph:
    """The map, with one edge over a vertex if two are all that is left of its departures."""
    ending = [edge for edge in graph.edges if vertex.id in (edge.start, edge.end)]
    lines = list(lines_from(vertex.id, ending))
    if vertex.frontiers or not len(ending) == len(lines) == 2:
        return graph
    start, end = (edge.end if edge.start == vertex.id else edge.start for edge in ending)
    passing = RouteEdge(
        start=start,
        end=end,
        polyline=np.concatenate([lines[0][::-1], lines[1][1:]]),
        min_clearance=min(edge.min_clearance for edge in ending),
        traversals=min(edge.traversals for edge in ending),
    )
    return RouteGraph(
        tuple(one for one in graph.vertices if one is not vertex),
        (*(edge for edge in graph.edges if edge not in ending), passing),
    )
