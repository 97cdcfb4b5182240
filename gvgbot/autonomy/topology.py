"""Changes of the graph where a vertex is found on an edge, or proves to be none."""

import math

import numpy as np

from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.graph import Edge, GvgGraph, HalfEdgeId, Vertex
from gvgbot.autonomy.slam.recognition import match_bearings
from gvgbot.geometry import Array

_OUT_M = 1.0  # from a vertex, where the direction of an edge is taken


def split_edge_at(
    graph: GvgGraph, belief: Belief, vertex: Vertex, *, reach: float, angle: float
) -> None:
    """Make two edges of one that was joined before a vertex on it was found.

    The edge must pass the vertex within `reach` m, and leave it within `angle` rad of two of its
    half-edges.
    """
    vertex_map = belief.map_vertex(vertex.id).inverse()
    for edge in list(graph.edges.values()):
        line = vertex_map.transform(belief.map_vertex(edge.a.vertex).transform(edge.polyline))
        parts = _parted(line, reach)
        if parts is None:
            continue
        known = {key: half.bearing for key, half in vertex.half_edges.items()}
        matched = match_bearings(tuple(_direction(part) for part in parts), known, angle)
        if len(matched) < 2:
            continue
        graph.unjoin(edge)
        for i, far in enumerate((edge.a, edge.b)):
            part = np.concatenate([np.zeros((1, 2)), parts[i]])
            near = HalfEdgeId(vertex.id, matched[i])
            part_edge = graph.join(near, far, part, edge.min_clearance, driven=edge.driven)
            part_edge.established = edge.established
        return


def _parted(line: Array, reach: float) -> tuple[Array, Array] | None:
    """A polyline (N, 2) from where it passes the origin to either end; None if it does not."""
    away = np.hypot(*line.T)
    at = int(np.argmin(away))
    to_end = min(float(np.hypot(*(line[at] - end))) for end in (line[0], line[-1]))
    if away[at] > reach or to_end < reach:
        return None
    return line[: at + 1][::-1], line[at:]


def _direction(line: Array) -> float:
    """Direction (rad) in which a polyline (N, 2) leaves the origin."""
    away = np.hypot(*line.T)
    x, y = line[int(np.argmax(away > _OUT_M))] if away.max() > _OUT_M else line[-1]
    return math.atan2(y, x)


def take_out(graph: GvgGraph, belief: Belief, vertex: Vertex) -> None:
    """Remove a vertex from the graph; of two edges that met there one is made."""
    meeting = [
        (HalfEdgeId(vertex.id, key), graph.edges[half.edge])
        for key, half in vertex.half_edges.items()
        if half.edge is not None
    ]
    graph.remove_vertex(vertex.id)
    if len(meeting) != 2 or meeting[0][1] is meeting[1][1]:
        return
    (one_end, one), (other_end, other) = meeting
    start, end = one.other(one_end), other.other(other_end)
    inwards, outwards = _outwards(belief, one, one_end)[::-1], _outwards(belief, other, other_end)
    line = np.concatenate([inwards, outwards[1:]])
    line = belief.map_vertex(start.vertex).inverse().transform(line)
    clearance = min(one.min_clearance, other.min_clearance)
    edge = graph.join(start, end, line, clearance, driven=one.driven and other.driven)
    edge.established = one.established and other.established


def _outwards(belief: Belief, edge: Edge, end: HalfEdgeId) -> Array:
    """Polyline (N, 2) of an edge from one of its ends, map frame."""
    line = belief.map_vertex(edge.a.vertex).transform(edge.polyline)
    return line if edge.a == end else line[::-1]
