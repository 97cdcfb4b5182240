"""Maps of one building by several robots, laid on each other as one route graph.

Each map holds what one robot has measured, and only that, so they are independent but for the
frame that they are laid into. Where two know the same vertex its place is their covariance
intersection: never surer than it may be, whatever the two have in common.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from gvgbot.geometry import (
    Array,
    Pose,
    anchored,
    direction_of,
    stations_of,
    wrap_angle,
    wrap_angles,
)
from gvgbot.maps.moved import moved_graph
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode, lines_from
from gvgbot.registration import AHEAD_M, SAME_M, SAME_RAD, assigned

_KINK_RAD = 1.2  # at most, from the bearing of an edge to where it sets out
_ON_EDGE_M = 0.4  # from an edge, a vertex that the edge's own map does not know splits it
_FROM_ENDS_M = SAME_M  # but not so near to its ends: there it is one of them
_BESIDE_M = 1.0  # edges between the same vertices that stay nearer to each other are one
_SHARES = np.linspace(0.02, 0.98, 25)  # of the first covariance in an intersection


def merged(ours: RouteGraph, theirs: RouteGraph, pose: Pose) -> RouteGraph:
    """Both maps as one, in the frame of the first; `pose` is where the other's frame lies in it.

    What is in both maps must then be less than half a metre apart.
    """
    theirs = moved_graph(theirs, pose)
    pairs = _pairs(ours, theirs)
    here, there = {ours.vertices[i].id for i, _ in pairs}, {theirs.vertices[j].id for _, j in pairs}
    # one after the other: what refutes a vertex must not have gone by then
    theirs = _without(theirs, _refuted(theirs, there, ours))
    ours = _without(ours, _refuted(ours, here, theirs))
    pairs = _pairs(ours, theirs)
    ours, theirs = (
        _drawn_together(ours, {ours.vertices[i].id for i, _ in pairs}),
        _drawn_together(theirs, {theirs.vertices[j].id for _, j in pairs}),
    )
    pairs = _pairs(ours, theirs)
    here, there = {ours.vertices[i].id for i, _ in pairs}, {theirs.vertices[j].id for _, j in pairs}
    ours, theirs = _seen_once(ours, here, theirs), _seen_once(theirs, there, ours)
    free_id = max((vertex.id for vertex in ours.vertices), default=-1) + 1
    names = {theirs.vertices[j].id: ours.vertices[i].id for i, j in pairs}
    lone = [vertex for vertex in theirs.vertices if vertex.id not in names]
    names |= {vertex.id: free_id + k for k, vertex in enumerate(lone)}
    new = [replace(vertex, id=names[vertex.id]) for vertex in lone]
    own = list(_split(ours.edges, new))
    edges = list(own)
    others = [replace(e, start=names[e.start], end=names[e.end]) for e in theirs.edges]
    others = list(_split(others, [v for v in ours.vertices if v.id not in here]))
    for number, edge in enumerate(others):
        twin = _twin(edge, own)
        if twin is None or _twin(own[twin], others) != number:
            edges.append(edge)
        else:
            edges[twin] = _as_driven_by_both(edges[twin], edge)
    partner = {ours.vertices[i].id: theirs.vertices[j] for i, j in pairs}
    vertices = [
        _fused(vertex, partner[vertex.id]) if vertex.id in partner else vertex
        for vertex in ours.vertices
    ]
    return settled((*vertices, *new), edges)


def settled(vertices: Sequence[RouteNode], edges: Sequence[RouteEdge]) -> RouteGraph:
    """The map of vertices and edges, where these end on those, and are no frontiers any more."""
    return RouteGraph(
        tuple(_settled(vertex, edges) for vertex in vertices),
        tuple(_anchored(edge, vertices) for edge in edges),
    )


def _pairs(ours: RouteGraph, theirs: RouteGraph) -> list[tuple[int, int]]:
    """Indices of the vertices that both have."""
    a, b = (np.array([v.position for v in g.vertices]).reshape(-1, 2) for g in (ours, theirs))
    return assigned(cdist(a, b), SAME_M)


def _refuted(graph: RouteGraph, paired: set[int], other: RouteGraph) -> set[int]:
    """Vertices where the other robot drove along a plain edge and saw none.

    Somebody may have stood there. Nothing else may hang on them than what both know, and they must
    lead nowhere where the other one knows no way.
    """
    ways = [point for edge in other.edges for point in edge.polyline]
    tree = cKDTree(ways) if ways else None
    leading = {
        end
        for edge in graph.edges
        if tree is None or np.max(tree.query(edge.polyline)[0]) > _BESIDE_M
        for end in (edge.start, edge.end)
    }
    wrong = {
        vertex.id
        for vertex in graph.vertices
        if vertex.id not in paired | leading
        and any(_is_inside(vertex, edge) for edge in other.edges)
    }
    while True:
        holding = {
            mine
            for edge in graph.edges
            for mine, far in ((edge.start, edge.end), (edge.end, edge.start))
            if mine in wrong and far not in wrong and far not in paired
        }
        if not holding:
            return wrong
        wrong -= holding


def _is_inside(vertex: RouteNode, edge: RouteEdge) -> bool:
    """Whether a vertex lies on an edge that was driven, away from its ends."""
    return edge.traversals > 0 and _cut_at(edge, vertex, _BESIDE_M) is not None


def _without(graph: RouteGraph, wrong: set[int]) -> RouteGraph:
    return RouteGraph(
        tuple(vertex for vertex in graph.vertices if vertex.id not in wrong),
        tuple(edge for edge in graph.edges if not {edge.start, edge.end} & wrong),
    )


def _drawn_together(graph: RouteGraph, paired: set[int]) -> RouteGraph:
    """The graph with one meetpoint where it has two close ones, and the other map has only one."""
    vertices = {vertex.id: vertex for vertex in graph.vertices}
    onto: dict[int, int] = {}
    for edge in graph.edges:
        for lone, kept in ((edge.start, edge.end), (edge.end, edge.start)):
            if lone in paired or kept not in paired or vertices[lone].kind == "endpoint":
                continue
            if math.dist(vertices[lone].position, vertices[kept].position) < SAME_M:
                onto[lone] = kept
    for lone, kept in onto.items():
        vertices[kept] = _united(vertices[kept], vertices.pop(lone))
    edges = (
        replace(e, start=onto.get(e.start, e.start), end=onto.get(e.end, e.end))
        for e in graph.edges
    )
    between = 2 * SAME_M  # longer ones are ways round something
    return RouteGraph(
        tuple(vertices.values()),
        tuple(edge for edge in edges if edge.start != edge.end or edge.length > between),
    )


def _united(kept: RouteNode, lone: RouteNode) -> RouteNode:
    """Two vertices of one map as one, without the departures towards each other."""
    (x0, y0), (x1, y1) = kept.position, lone.position
    ahead = math.atan2(y1 - y0, x1 - x0)
    return _fused(_turned_from(kept, ahead), _turned_from(lone, ahead + math.pi))


def _turned_from(vertex: RouteNode, bearing: float) -> RouteNode:
    return replace(
        vertex,
        bearings=tuple(b for b in vertex.bearings if not is_among(b, [bearing])),
        frontiers=tuple(f for f in vertex.frontiers if not is_among(f, [bearing])),
    )


def _seen_once(graph: RouteGraph, paired: set[int], other: RouteGraph) -> RouteGraph:
    """The graph, with each departure once where the other map has an edge and no vertex."""
    return replace(
        graph,
        vertices=tuple(
            vertex if vertex.id in paired else _passed(vertex, other.edges)
            for vertex in graph.vertices
        ),
    )


def _passed(vertex: RouteNode, edges: Iterable[RouteEdge]) -> RouteNode:
    """A vertex that edges of another map pass, without what it has beside their directions."""
    twice = set[float]()
    for edge in edges:
        i = _cut_at(edge, vertex)
        if i is not None:
            line = edge.polyline
            ways = [direction_of(part, AHEAD_M) for part in (line[i:], line[i::-1])]
            twice |= _seen_twice(vertex, ways, ways)
    bearings = tuple(b for b in vertex.bearings if b not in twice)
    frontiers = tuple(f for f in vertex.frontiers if f not in twice)
    return replace(vertex, degree=len(bearings), bearings=bearings, frontiers=frontiers)


def _fused(ours: RouteNode, theirs: RouteNode) -> RouteNode:
    """One vertex of two, with the departures of both."""
    position, covariance = covariance_intersection(
        np.array(ours.position), _matrix(ours), np.array(theirs.position), _matrix(theirs)
    )
    twice = _seen_twice(ours, theirs.bearings, _followed(theirs))
    bearings = [b for b in ours.bearings if b not in twice]
    bearings += [b for b in theirs.bearings if not is_among(b, ours.bearings)]
    frontiers = [
        *(f for f in ours.frontiers if not is_among(f, _followed(theirs))),
        *(f for f in theirs.frontiers if not is_among(f, ours.bearings)),
    ]
    x, y = position.tolist()
    xx, xy, yx, yy = covariance.ravel().tolist()
    return replace(
        ours,
        kind="meetpoint" if len(bearings) > 1 else "endpoint",
        position=(x, y),
        covariance=(xx, xy, yx, yy),
        degree=len(bearings),
        bearings=tuple(bearings),
        frontiers=tuple(frontiers),
        visits=ours.visits + theirs.visits,
    )


def _seen_twice(ours: RouteNode, theirs: Sequence[float], followed: Sequence[float]) -> set[float]:
    """Frontiers of which the other robot followed one, where this one saw several from afar.

    `theirs` are the bearings of all departures that the other one saw there, rad.
    """
    off = np.abs(wrap_angles(np.subtract.outer(ours.bearings, theirs)))
    paired = {ours.bearings[i] for i, _ in assigned(off, SAME_RAD)}
    return {f for f in ours.frontiers if f not in paired and is_among(f, followed)}


def covariance_intersection(a: Array, of_a: Array, b: Array, of_b: Array) -> tuple[Array, Array]:
    """Means (2,) and covariances (2, 2) as one that is consistent, whatever they have in common.

    Of all mixtures of both informations the one with the least determinant.
    """
    inverse_a, inverse_b = np.linalg.inv(_regular(of_a)), np.linalg.inv(_regular(of_b))
    mixtures = (np.linalg.inv(w * inverse_a + (1 - w) * inverse_b) for w in _SHARES)
    best, w = min(zip(mixtures, _SHARES, strict=True), key=lambda m: float(np.linalg.det(m[0])))
    mean: Array = best @ (w * inverse_a @ a + (1 - w) * inverse_b @ b)
    return mean, np.asarray(best)


def _regular(covariance: Array) -> Array:
    """The start of a map is where it is by definition, and certain only in its own frame."""
    return np.asarray(covariance + 1e-6 * np.eye(2))


def _matrix(vertex: RouteNode) -> Array:
    return np.array(vertex.covariance).reshape(2, 2)


def is_among(bearing: float, bearings: Iterable[float]) -> bool:
    """Whether one of the bearings, rad, is this one."""
    return any(abs(wrap_angle(bearing - other)) < SAME_RAD for other in bearings)


def _followed(vertex: RouteNode) -> list[float]:
    """In which directions a vertex has edges, rad."""
    return [b for b in vertex.bearings if b not in vertex.frontiers]


def _split(edges: Iterable[RouteEdge], vertices: list[RouteNode]) -> Iterable[RouteEdge]:
    """The edges, cut where vertices lie on them that their map does not know."""
    for edge in edges:
        cuts = [(i, v.id) for v in vertices if (i := _cut_at(edge, v)) is not None]
        start, first = edge.start, 0
        for i, middle in sorted(cuts):
            if i > first:
                yield _piece(edge, start, middle, first, i)
                start, first = middle, i
        yield _piece(edge, start, edge.end, first, len(edge.polyline) - 1)


def _cut_at(edge: RouteEdge, vertex: RouteNode, within_m: float = _ON_EDGE_M) -> int | None:
    """The point of an edge's line at which a vertex that its map does not know lies on it."""
    along = stations_of(edge.polyline)
    away = np.hypot(*(edge.polyline - vertex.position).T)
    i = int(np.argmin(away))
    is_inside = _FROM_ENDS_M < along[i] < along[-1] - _FROM_ENDS_M
    return i if away[i] < within_m and is_inside else None


def _piece(edge: RouteEdge, start: int, end: int, first: int, last: int) -> RouteEdge:
    if (first, last) == (0, len(edge.polyline) - 1):
        return edge
    line = edge.polyline[first : last + 1].copy()
    return replace(edge, start=start, end=end, polyline=line)


def _twin(edge: RouteEdge, own: Sequence[RouteEdge]) -> int | None:
    """Which of the own edges another map's edge may be, by its index; None if it is none of them.

    Two that one map has are two, however close: something stands between them. So it must be the
    nearest of that map's edges to that one as well.
    """
    away = [_apart(edge, other) for other in own]
    nearest = min(away, default=math.inf)
    return away.index(nearest) if nearest < _BESIDE_M else None


def is_same(edge: RouteEdge, other: RouteEdge) -> bool:
    """Whether two edges join the same vertices by the same way."""
    return _apart(edge, other) < _BESIDE_M


def _apart(edge: RouteEdge, other: RouteEdge) -> float:
    """How far apart, m, edges between the same vertices are at most; infinity for all others."""
    if {edge.start, edge.end} != {other.start, other.end}:
        return math.inf
    away = cdist(edge.polyline, other.polyline)
    return float(max(away.min(axis=0).max(), away.min(axis=1).max()))


def _as_driven_by_both(edge: RouteEdge, other: RouteEdge) -> RouteEdge:
    """One edge of two that are the same: who has driven along it has felt how narrow it is."""
    return replace(
        edge,
        traversals=edge.traversals + other.traversals,
        min_clearance=min(edge.min_clearance, other.min_clearance),
    )


def _settled(vertex: RouteNode, edges: Sequence[RouteEdge]) -> RouteNode:
    """A vertex whose frontiers are those that no edge of either map follows."""
    leaving = [direction_of(line, AHEAD_M) for line in lines_from(vertex.id, edges)]
    followed = [b for b in vertex.bearings if b not in vertex.frontiers]
    others = _unexplained(leaving, followed)
    frontiers = tuple(f for f in vertex.frontiers if not is_among(f, others))
    bearings = vertex.bearings + tuple(d for d in others if not is_among(d, vertex.bearings))
    return replace(
        vertex,
        frontiers=frontiers,
        bearings=bearings,
        degree=len(bearings),
        kind="meetpoint" if len(bearings) > 1 else "endpoint",
    )


def _unexplained(leaving: list[float], followed: list[float]) -> list[float]:
    """The directions of edges, rad, without those of edges that a vertex is known to have.

    An edge may set out a little to the side of the bearing that it was seen at.
    """
    if not (leaving and followed):
        return leaving
    off = np.array([[abs(wrap_angle(d - b)) for b in followed] for d in leaving])
    explained = {i for i, _ in assigned(off, _KINK_RAD)}
    return [d for i, d in enumerate(leaving) if i not in explained and off[i].min() > SAME_RAD / 2]


def _anchored(edge: RouteEdge, vertices: Sequence[RouteNode]) -> RouteEdge:
    """The edge, bent so that it ends on its vertices."""
    places = {vertex.id: np.array(vertex.position) for vertex in vertices}
    return replace(edge, polyline=anchored(edge.polyline, places[edge.start], places[edge.end]))
