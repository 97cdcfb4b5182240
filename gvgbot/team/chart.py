"""A chart: a robot's own graph in its own map frame, as it tells the other robots of it.

Only what the robot has measured itself is in its chart, never what it heard from others. So charts
of different robots are independent, and nothing is counted twice however they are put together.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId, Vertex
from gvgbot.geometry import Array, Pose, thinned, wrap_angle

WALL_CELL_M = 0.1  # one point of a wall is told for each cell of this size
_WALLS_BEYOND_M = 2.5  # of a vertex's disc, walls tell what it looks like


@dataclass(frozen=True, slots=True)
class Departure:
    """A half-edge of a vertex: its key there, bearing (rad, map frame), edge if it has one."""

    key: int
    bearing: float
    edge: int | None
    blocked: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class ChartVertex:
    """A vertex: position (2,) in m with covariance (2, 2) and walls around it (N, 2), map frame."""

    id: int
    position: Array
    covariance: Array
    clearance: float
    departures: tuple[Departure, ...]
    walls: Array = field(default_factory=lambda: np.empty((0, 2)))

    @property
    def is_meetpoint(self) -> bool:
        """Whether more than one edge leaves here."""
        return len(self.departures) > 1

    @property
    def bearings(self) -> tuple[float, ...]:
        """Of all departures, rad, map frame."""
        return tuple(departure.bearing for departure in self.departures)


@dataclass(frozen=True, slots=True, eq=False)
class ChartEdge:
    """An edge between two half-edges; polyline (N, 2) from a to b, map frame, m.

    `traversed`: the robot has driven along it, and not only seen it.
    """

    id: int
    a: HalfEdgeId
    b: HalfEdgeId
    length: float
    min_clearance: float
    polyline: Array
    traversed: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class ChartWay:
    """A part of an edge that was driven: polyline (N, 2), map frame, and least clearance, m."""

    polyline: Array
    min_clearance: float


@dataclass(frozen=True, slots=True, eq=False)
class Chart:
    """Vertices and edges by id, and the ways that are parts of edges."""

    vertices: dict[int, ChartVertex] = field(default_factory=dict)
    edges: dict[int, ChartEdge] = field(default_factory=dict)
    ways: tuple[ChartWay, ...] = ()


def chart_of(graph: GvgGraph, belief: Belief, parts: Iterable[tuple[Array, float]] = ()) -> Chart:
    """What a robot knows of the building; `parts` of edges are lines (N, 2) and clearances, m."""
    vertices = {vertex.id: _vertex(vertex, belief) for vertex in graph.vertices.values()}
    edges = {
        edge.id: ChartEdge(
            edge.id,
            edge.a,
            edge.b,
            edge.length,
            edge.min_clearance,
            belief.map_vertex(edge.a.vertex).transform(edge.polyline),
            edge.traversals > 0,
        )
        for edge in graph.edges.values()
    }
    return Chart(vertices, edges, tuple(ChartWay(line, clearance) for line, clearance in parts))


def _vertex(vertex: Vertex, belief: Belief) -> ChartVertex:
    place = belief.map_vertex(vertex.id)
    near = np.hypot(*vertex.snapshot.T) < vertex.clearance + _WALLS_BEYOND_M
    return ChartVertex(
        vertex.id,
        place.position,
        belief.vertex_covariance(vertex.id),
        vertex.clearance,
        tuple(
            Departure(key, wrap_angle(half.bearing + place.theta), half.edge, half.blocked)
            for key, half in vertex.half_edges.items()
        ),
        place.transform(thinned(vertex.snapshot[near], WALL_CELL_M)),
    )


def moved(chart: Chart, pose: Pose) -> Chart:
    """The chart in the frame in which its own frame has this pose."""
    turn = Pose(theta=pose.theta).transform(np.eye(2))  # rows: the turned axes
    vertices = {
        key: replace(
            vertex,
            position=pose.transform(vertex.position),
            covariance=turn.T @ vertex.covariance @ turn,
            departures=tuple(
                replace(d, bearing=wrap_angle(d.bearing + pose.theta)) for d in vertex.departures
            ),
            walls=pose.transform(vertex.walls),
        )
        for key, vertex in chart.vertices.items()
    }
    edges = {
        key: replace(edge, polyline=pose.transform(edge.polyline))
        for key, edge in chart.edges.items()
    }
    ways = (replace(way, polyline=pose.transform(way.polyline)) for way in chart.ways)
    return Chart(vertices, edges, tuple(ways))
