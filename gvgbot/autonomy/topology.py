"""Changes of the graph where a vertex is found on an edge, proves to be none, or a known one."""

import math
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from gvgbot.autonomy.slam.ekf import Belief, apart
from gvgbot.autonomy.slam.graph import Edge, GvgGraph, HalfEdge, HalfEdgeId, Vertex
from gvgbot.autonomy.slam.recognition import match_bearings
from gvgbot.geometry import Array, Pose, stations_of, wrap_angle

_OUT_M = 1.0  # from a vertex, where the direction of an edge is taken
_OPPOSITE = math.radians(120)  # departures that differ by more go on as one line
_GENTLY = 2.0  # times what it is off, a line is bent over
_AT_VERTEX_M = 1.0  # nearer to one than this, the robot has not gone far on any of its edges
_STRAYS = 3  # vertices that hang together with nothing else, though the robot has driven there


def split_edge_at(
    graph: GvgGraph,
    belief: Belief,
    vertex: Vertex,
    *,
    reach: float,
    angle: float,
    driven: int | None = None,
) -> None:
    """Make two edges of one that was joined before a vertex on it was found.

    The edge must pass the vertex within `reach` m, where it is known as well as that, and leave it
    within `angle` rad of two of its half-edges that have no edge. If the robot has driven all along
    it, from the vertex by the `driven` half-edge, the other one may be missing: it is added.
    """
    map_vertex = belief.map_vertex(vertex.id)
    vertex_map, place = map_vertex.inverse(), map_vertex.position
    for edge in list(graph.edges.values()):
        map_start = belief.map_vertex(edge.a.vertex)
        if math.dist(map_start.transform(edge.polyline[0]), place) > edge.length + reach:
            continue
        line = vertex_map.transform(map_start.transform(edge.polyline))
        parts = _parted(line, reach)
        if parts is None:
            continue
        _, S = apart(belief, vertex.id, [edge.a.vertex])
        if np.trace(S[0]) > reach**2:
            continue  # it may as well be elsewhere
        bearings = tuple(direction(part) for part in parts)
        matched = _left_by(vertex, bearings, angle)
        if list(matched.values()) == [driven]:
            matched |= _added(vertex, {1 - i: bearings[1 - i] for i in matched}, angle)
        if len(matched) < 2:
            continue
        graph.unjoin(edge)
        for i, far in enumerate((edge.a, edge.b)):
            part = np.concatenate([np.zeros((1, 2)), parts[i]])
            near = HalfEdgeId(vertex.id, matched[i])
            room = clearance_between(part, vertex.clearance, graph.vertices[far.vertex].clearance)
            clearance = max(edge.min_clearance, room)
            part_edge = graph.join(near, far, part, clearance, driven=edge.driven)
            part_edge.established, part_edge.is_part = edge.established, True
        return


def _left_by(vertex: Vertex, bearings: tuple[float, ...], angle: float) -> dict[int, int]:
    """By index of a bearing, rad, the key of the half-edge without an edge that it is."""
    known = {key: half.bearing for key, half in vertex.half_edges.items() if half.edge is None}
    return match_bearings(bearings, known, angle)


def _added(vertex: Vertex, bearings: dict[int, float], angle: float) -> dict[int, int]:
    """By index of a bearing, rad, the key of a new half-edge; none that is near to another one."""
    known = {key: half.bearing for key, half in vertex.half_edges.items()}
    return {
        i: vertex.add_half_edge(bearing)
        for i, bearing in bearings.items()
        if not match_bearings((bearing,), known, angle)
    }


def clearance_between(line: Array, at_start: float, at_end: float) -> float:
    """The least clearance, m, that a line (N, 2) can have between places with these clearances.

    From point to point clearance changes by no more than the way between them.
    """
    from_start, from_end = (np.hypot(*(line - end).T) for end in (line[0], line[-1]))
    return float(np.maximum(at_start - from_start, at_end - from_end).min())


def _parted(line: Array, reach: float) -> tuple[Array, Array] | None:
    """A polyline (N, 2) from where it passes the origin to either end; None if it does not."""
    away = np.hypot(*line.T)
    at = int(np.argmin(away))
    to_end = min(float(np.hypot(*(line[at] - end))) for end in (line[0], line[-1]))
    if away[at] > reach or to_end < reach:
        return None
    return line[: at + 1][::-1], line[at:]


def direction(line: Array) -> float:
    """Direction (rad) in which a polyline (N, 2) leaves the origin."""
    away = np.hypot(*line.T)
    x, y = line[int(np.argmax(away > _OUT_M))] if away.max() > _OUT_M else line[-1]
    return math.atan2(y, x)


def take_out(graph: GvgGraph, belief: Belief, vertex: Vertex, *, is_passed: bool = False) -> None:
    """Remove a vertex from the graph; of two edges that met there one is made.

    If a third departure had none, they may be a way round a corner that another one goes past: then
    sight must show that an edge passes, along both, or they must lead in opposite directions. If
    not, their other ends become frontiers.
    """
    meeting = [(end, edge) for end in vertex.ends if (edge := graph.edge_at(end)) is not None]
    departures = [vertex.half_edges[end.key] for end, _ in meeting]
    is_line = is_passed or vertex.degree == 2 or _are_opposite(departures)
    graph.remove_vertex(vertex.id)
    if len(meeting) != 2 or meeting[0][1] is meeting[1][1] or not is_line:
        return
    (one_end, one), (other_end, other) = meeting
    start, end = one.other(one_end), other.other(other_end)
    to_it, onwards = outwards(belief, one, one_end)[::-1], outwards(belief, other, other_end)
    line = np.concatenate([to_it, onwards[1:]])
    line = belief.map_vertex(start.vertex).inverse().transform(line)
    clearance = min(one.min_clearance, other.min_clearance)
    edge = graph.join(start, end, line, clearance, driven=one.driven and other.driven)
    edge.established = one.established and other.established
    edge.is_part = one.is_part and other.is_part


def _are_opposite(departures: list[HalfEdge]) -> bool:
    turn = departures[0].bearing - departures[-1].bearing if departures else 0.0
    return abs(wrap_angle(turn)) > _OPPOSITE


def strays(graph: GvgGraph) -> list[Vertex]:
    """Vertices from which nothing leads to most of the graph, nor was a way tried in vain.

    They were seen through glass, or a few are what is left of the ways round somebody who has gone:
    where the robot has driven, all that it drove over hangs together.
    """
    if not graph.edges:
        return []
    rest = _pieces(graph)
    rest.remove(max(rest, key=lambda piece: (_proved_edges(graph, piece), len(piece))))
    return [
        vertex
        for piece in rest
        if len(piece) <= _STRAYS or not _proved_edges(graph, piece)
        if not any(_was_tried(vertex) for vertex in piece)
        for vertex in piece
    ]


def piece_of(graph: GvgGraph, vertex: int) -> set[int]:
    """The vertices that hang together with one, itself included; none if it is not in the graph."""
    pieces = ({one.id for one in piece} for piece in _pieces(graph))
    return next((ids for ids in pieces if vertex in ids), set())


def _proved_edges(graph: GvgGraph, piece: list[Vertex]) -> int:
    """How many edges of a piece the robot has driven, or of a map that was finished."""
    ids = {vertex.id for vertex in piece}
    edges = (edge for edge in graph.edges.values() if edge.a.vertex in ids)
    return sum(edge.established or edge.traversals > 0 for edge in edges)


def _was_tried(vertex: Vertex) -> bool:
    return any(half.blocked and half.edge is None for half in vertex.half_edges.values())


def _pieces(graph: GvgGraph) -> list[list[Vertex]]:
    """The vertices of each connected part of a graph."""
    ids = list(graph.vertices)
    number = {vertex: i for i, vertex in enumerate(ids)}
    ends = [(number[e.a.vertex], number[e.b.vertex]) for e in graph.edges.values()]
    rows, columns = np.array(ends, int).reshape(-1, 2).T
    links = coo_array((np.ones(len(ends)), (rows, columns)), (len(ids), len(ids)))
    count, piece = connected_components(links, directed=False)
    return [[graph.vertices[ids[i]] for i in np.flatnonzero(piece == k)] for k in range(count)]


def loose_ends(
    graph: GvgGraph, belief: Belief, vertex: Vertex
) -> dict[HalfEdgeId, tuple[HalfEdgeId, Array]]:
    """Where one comes from who is on an edge of a vertex that proves to be none.

    For half-edges of the vertex: the far end of their edge, or of the only one that ends there, and
    the polyline (N, 2), map frame, from there to the vertex. Who still stands at the vertex is on
    any of its edges, if there are several.
    """
    edges = {end: edge for end in vertex.ends if (edge := graph.edge_at(end)) is not None}
    is_at_it = belief.map_base.distance(belief.map_vertex(vertex.id)) < _AT_VERTEX_M
    found = {}
    for end in vertex.ends:
        serves = end not in edges and (len(edges) == 1 or (edges and is_at_it))
        near = next(iter(edges)) if serves else end
        if near in edges and edges[near].other(near).vertex != vertex.id:
            found[end] = edges[near].other(near), outwards(belief, edges[near], near)[::-1]
    return found


class Fused(NamedTuple):
    """What has become of the half-edges of the vertex that is no more, and who may be one as well.

    The same departure led to both vertices of each of the `twins`.
    """

    renamed: dict[HalfEdgeId, HalfEdgeId]
    twins: list[tuple[int, int]]


def fuse(graph: GvgGraph, kept: Vertex, gone: Vertex, kept_gone: Pose, angle: float) -> Fused:
    """Make one vertex of two, the second of which stands at a pose in the frame of the first.

    Departures within `angle` rad are the same; an edge that both have is kept once.
    """
    renamed = _with_departures(kept, gone, kept_gone.theta, angle)
    twins = []
    for edge in [e for e in graph.edges.values() if gone.id in (e.a.vertex, e.b.vertex)]:
        graph.unjoin(edge)
        a, b = renamed.get(edge.a, edge.a), renamed.get(edge.b, edge.b)
        begins_here = edge.a.vertex == gone.id
        near, far = (a, b) if begins_here else (b, a)
        before = graph.edge_at(near)
        if before is not None and before.other(near).vertex != far.vertex != kept.id:
            twins.append((before.other(near).vertex, far.vertex))
        if a == b or before is not None or graph.edge_at(far) is not None:
            continue
        line = kept_gone.transform(edge.polyline) if begins_here else edge.polyline
        joined = graph.join(a, b, line, edge.min_clearance, driven=edge.driven)
        joined.traversals, joined.established = edge.traversals, edge.established
        joined.is_part = edge.is_part
    del graph.vertices[gone.id]
    return Fused(renamed, twins)


def _with_departures(
    kept: Vertex, gone: Vertex, turn: float, angle: float
) -> dict[HalfEdgeId, HalfEdgeId]:
    """Give one vertex the departures of another, turned: what they are called there.

    One that leads along no edge stays given up if neither of the two knows better.
    """
    turned = tuple(half.bearing + turn for half in gone.half_edges.values())
    known = {key: half.bearing for key, half in kept.half_edges.items()}
    matched, renamed = match_bearings(turned, known, angle), {}
    for i, (key, half) in enumerate(gone.half_edges.items()):
        at = matched[i] if i in matched else kept.add_half_edge(turned[i])
        same = kept.half_edges[at]
        if same.edge is None:
            same.blocked = half.blocked and (i not in matched or same.blocked)
        renamed[HalfEdgeId(gone.id, key)] = HalfEdgeId(kept.id, at)
    return renamed


def outwards(belief: Belief, edge: Edge, end: HalfEdgeId) -> Array:
    """Polyline (N, 2) of an edge from one of its ends, map frame."""
    line = belief.map_vertex(edge.a.vertex).transform(edge.polyline)
    return line if edge.a == end else line[::-1]


def tied_to(line: Array, start: Array, end: Array, room: tuple[float, float]) -> Array:
    """A line (N, 2) that ends at two vertices (2,), m, and is as it was but near to these.

    `room` is how far, m, there is no wall around either. What is between stays where walls were
    seen beside it: spread over the whole line, a vertex that was seen elsewhere at first would
    push it out of the middle of a door.
    """
    along = stations_of(line)
    tied = line.copy()
    for off, away, free in (
        (start - line[0], along, room[0]),
        (end - line[-1], along[-1] - along, room[1]),
    ):
        reach = min(max(free, _GENTLY * float(np.hypot(*off))), along[-1] / 2)
        tied += np.maximum(0.0, 1.0 - away / max(reach, 1e-9))[:, None] * off
    return tied
