"""The GVG graph: vertices with half-edges in rotation order, and edges that pair them.

A half-edge is one end of an edge at a vertex; one without an edge is a frontier. Pairing half-edges
rather than vertices makes self-loops and parallel edges ordinary.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np

from gvgbot.geometry import Array, Pose, length_of, wrap_angle

Kind = Literal["meetpoint", "endpoint"]
_BESIDE = 3.0  # times its clearance: from a vertex, farther off walls leave it as it is


class HalfEdgeId(NamedTuple):
    """A half-edge: its vertex and its key at that vertex."""

    vertex: int
    key: int


@dataclass(slots=True, eq=False)
class HalfEdge:
    """A departure from a vertex; bearing in the vertex's frame, rad."""

    bearing: float
    edge: int | None = None
    blocked: bool = False
    misses: int = 0

    @property
    def open(self) -> bool:
        """Whether it is a frontier: nothing known beyond it, and no reason not to go there."""
        return self.edge is None and not self.blocked


@dataclass(slots=True, eq=False)
class Vertex:
    """A meetpoint or endpoint. Its pose is in the belief; `local` is where the local map has it."""

    id: int
    clearance: float
    local: Pose
    seen_at: float  # metres driven when last seen
    updated_at: float  # metres driven when it last corrected the belief
    half_edges: dict[int, HalfEdge] = field(default_factory=dict)
    gone: list[float] = field(default_factory=list)  # bearings of departures that were none
    snapshot: Array = field(
        default_factory=lambda: np.empty((0, 2))
    )  # walls around it, vertex frame
    sights: Array = field(default_factory=lambda: np.empty((0, 2)))  # of its walls, vertex frame
    sightings: int = 1
    misses: int = 0
    surplus: int = 0  # sightings in a row with a departure that is not known
    unclear: int = 0  # sightings from it with a departure of which too little can be seen
    elsewhere: int = 0  # corrections in a row that say it is not where it is believed to be
    visits: int = 1
    reached: bool = False  # the robot has been there, and did not only see it
    settled: bool = True  # it has been seen where nothing unseen could move it
    serial: int = 0
    established: bool = False  # part of a map that was finished
    doubted_since: float | None = None  # stamp; since when sight speaks against it

    @property
    def ends(self) -> list[HalfEdgeId]:
        """Its half-edges, oldest first."""
        return [HalfEdgeId(self.id, key) for key in self.half_edges]

    @property
    def is_bend(self) -> bool:
        """Whether there is nothing to it but two edges, which might as well be one."""
        edges = {half.edge for half in self.half_edges.values()}
        return self.degree == len(edges) == 2 and None not in edges

    def add_half_edge(self, bearing: float) -> int:
        """The key of a new half-edge."""
        key, self.serial = self.serial, self.serial + 1
        self.half_edges[key] = HalfEdge(wrap_angle(bearing))
        return key

    def bearings(self, theta: float, *, open_only: bool = False) -> tuple[float, ...]:
        """Where its half-edges leave, rad in (-pi, pi], in a frame that sees the vertex at theta.

        `open_only`: of those only that lead along no edge.
        """
        return tuple(
            wrap_angle(half.bearing + theta)
            for half in self.half_edges.values()
            if half.edge is None or not open_only
        )

    def clockwise_from(self, key: int) -> list[int]:
        """All half-edges in clockwise order after one; that one comes last."""
        start = self.half_edges[key].bearing

        def turn(other: int) -> float:
            angle = (start - self.half_edges[other].bearing) % math.tau
            return angle if other != key else math.tau + 1.0

        return sorted(self.half_edges, key=lambda k: (turn(k), k))

    @property
    def degree(self) -> int:
        """Number of departures."""
        return len(self.half_edges)

    @property
    def hesitation(self) -> int:
        """How many times as much must be seen to change its departures: 1, and 1 by each dropped.

        What comes and goes, as half a corner in sight may, is then no news for ever.
        """
        return 1 + len(self.gone)

    @property
    def kind(self) -> Kind:
        """An endpoint has one departure."""
        return "meetpoint" if self.degree > 1 else "endpoint"


@dataclass(slots=True, eq=False)
class Edge:
    """A stretch of GVG between half-edges a and b; polyline (N, 2) in the frame of a's vertex.

    Where its vertices stand is the mean of many sights, the oldest from far away, so a line that
    was found now may end beside them.
    """

    id: int
    a: HalfEdgeId
    b: HalfEdgeId
    polyline: Array
    length: float
    min_clearance: float
    driven: bool = False
    traversals: int = 0
    conflicts: int = 0  # sights that spoke against it, less those that spoke for it
    established: bool = False  # part of a map that was finished
    is_part: bool = False  # of an edge that was parted: it may have more room than it says
    doubted_since: float | None = None  # stamp; since when sight speaks against it
    drawn: Array | None = None  # the polyline from vertex to vertex as these were believed then

    @property
    def shown(self) -> Array:
        """The polyline (N, 2) for maps, in the frame of a's vertex."""
        return self.polyline if self.drawn is None else self.drawn

    def other(self, end: HalfEdgeId) -> HalfEdgeId:
        """The half-edge at the far end."""
        return self.b if end == self.a else self.a


@dataclass(slots=True, eq=False)
class GvgGraph:
    """Vertices and edges by id, in order of discovery."""

    vertices: dict[int, Vertex] = field(default_factory=dict)
    edges: dict[int, Edge] = field(default_factory=dict)
    serial: int = 0
    # by edge: m along it, at which virtual walls cross it as they are now
    walled: dict[int, tuple[float, ...]] = field(default_factory=dict)

    def is_walled(self, edge: Edge, begin: float, end: float) -> bool:
        """Whether a virtual wall crosses an edge between two places, m along it."""
        low, high = sorted((begin, end))
        return any(low < at < high for at in self.walled.get(edge.id, ()))

    def unwalled(self) -> "GvgGraph":
        """The same vertices and edges, as if there were no virtual walls."""
        return replace(self, walled={})

    def copied(self) -> "GvgGraph":
        """The same graph, to change apart from this one.

        Both share lines and walls: these are replaced as a whole, never changed.
        """
        vertices = {
            vertex.id: replace(
                vertex,
                half_edges={key: replace(half) for key, half in vertex.half_edges.items()},
                gone=vertex.gone.copy(),
            )
            for vertex in self.vertices.values()
        }
        edges = {edge.id: replace(edge) for edge in self.edges.values()}
        return GvgGraph(vertices, edges, self.serial, self.walled)

    def next_id(self) -> int:
        """An id never used before."""
        self.serial += 1
        return self.serial

    def half_edge(self, end: HalfEdgeId) -> HalfEdge | None:
        """The half-edge, or None if it is no more."""
        vertex = self.vertices.get(end.vertex)
        return None if vertex is None else vertex.half_edges.get(end.key)

    def edge_at(self, end: HalfEdgeId) -> Edge | None:
        """The edge of a half-edge, None for a frontier."""
        half = self.half_edge(end)
        return None if half is None or half.edge is None else self.edges[half.edge]

    def reach(self, vertex: Vertex) -> float:
        """How far around a vertex, m, there is surely no other: half its shortest edge."""
        edges = map(self.edge_at, vertex.ends)
        return min((e.length / 2 for e in edges if e is not None), default=vertex.clearance)

    def join(
        self, a: HalfEdgeId, b: HalfEdgeId, polyline: Array, min_clearance: float, *, driven: bool
    ) -> Edge:
        """Make an edge of two departures that had none, given up or not.

        The polyline (N, 2) runs from a to b in the frame of a's vertex.
        """
        length = length_of(polyline)
        edge = Edge(self.next_id(), a, b, polyline, length, min_clearance, driven, int(driven))
        self.edges[edge.id] = edge
        for end in (a, b):
            half = self.vertices[end.vertex].half_edges[end.key]
            half.edge, half.blocked = edge.id, False
        return edge

    def unjoin(self, edge: Edge) -> None:
        """Take an edge out again; its half-edges become frontiers."""
        del self.edges[edge.id]
        for end in (edge.a, edge.b):
            half = self.half_edge(end)
            if half is not None:
                half.edge = None

    def remove_half_edge(self, end: HalfEdgeId) -> None:
        """Take a half-edge out, with its edge."""
        edge = self.edge_at(end)
        if edge is not None:
            self.unjoin(edge)
        vertex = self.vertices[end.vertex]
        vertex.gone.append(vertex.half_edges.pop(end.key).bearing)

    def remove_vertex(self, vertex: int) -> None:
        """Take a vertex out; the edges that ended there become frontiers at their other ends."""
        for end in self.vertices[vertex].ends:
            self.remove_half_edge(end)
        del self.vertices[vertex]

    def frontiers(self) -> list[HalfEdgeId]:
        """All open half-edges."""
        return [end for end, half in self._half_edges() if half.open]

    def rings(self) -> list[Vertex]:
        """The vertices of edges without an end, at which there is nothing but the edge to see."""
        ends = ((edge.a.vertex, edge.b.vertex) for edge in self.edges.values())
        return [self.vertices[a] for a, b in ends if a == b and self.vertices[a].degree == 2]

    def walled_up(self) -> list[Vertex]:
        """The vertices beside which virtual walls lie over edges: there may be no more to see."""
        found = dict[int, Vertex]()
        for key, crossings in self.walled.items():
            edge = self.edges.get(key)
            for end, begin in () if edge is None else ((edge.a, 0.0), (edge.b, edge.length)):
                vertex = self.vertices[end.vertex]
                if any(abs(at - begin) < _BESIDE * vertex.clearance for at in crossings):
                    found[vertex.id] = vertex
        return list(found.values())

    def leave_ring(self, vertex: Vertex) -> bool:
        """Take out what leads away from a ring's vertex; False if there is more than that, or less.

        Without it nothing would be left of an edge that ends where it began.
        """
        away = [end for end in vertex.ends if self.edge_at(end) is None]
        edges = {half.edge for half in vertex.half_edges.values()} - {None}
        if not away or len(edges) != 1 or vertex.degree - len(away) != 2:
            return False
        for end in away:
            self.remove_half_edge(end)
        vertex.misses = 0
        return True

    def blocked(self) -> list[HalfEdgeId]:
        """All half-edges that were given up."""
        return [end for end, half in self._half_edges() if half.blocked]

    def _half_edges(self) -> Iterator[tuple[HalfEdgeId, HalfEdge]]:
        for vertex in self.vertices.values():
            yield from zip(vertex.ends, vertex.half_edges.values(), strict=True)
