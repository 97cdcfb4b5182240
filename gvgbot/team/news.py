"""What robots of a team tell each other: all of it each time, so that any message may be lost."""

from typing import Annotated

import msgspec
import numpy as np

from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.errors import GvgbotError
from gvgbot.geometry import Array, length_of, resampled
from gvgbot.names import ROBOT_NAME
from gvgbot.team.chart import Chart, ChartEdge, ChartVertex, ChartWay, Departure

_WALL_M = 0.01  # unit of the walls around a vertex, as they travel
_WAY_M = 0.2  # from point to point of a way, as it travels
_MOST_BYTES = 2_000_000  # of a message: more than a thousand vertices
_MOST_M = 1e5  # from the origin of a map
_MOST_WAY_M = 2e4  # of all edges together
_MOST_OPEN = 1000  # departures without an edge: each is looked for in all other maps
MOST_MATES = 64  # that a robot knows at a time
_ROUNDED = 1e-9  # share of its variances by which a covariance may be

# Whoever tells may be broken, or no robot at all.
Name = Annotated[str, msgspec.Meta(pattern=rf"^{ROBOT_NAME}\Z")]
Number = Annotated[float, msgspec.Meta(ge=-_MOST_M, le=_MOST_M)]  # and one
Length = Annotated[float, msgspec.Meta(ge=0.0, le=_MOST_M)]
Radius = Annotated[float, msgspec.Meta(gt=0.0, le=10.0)]
Triple = tuple[Number, Number, Number]  # a pose: x, y, m, and theta, rad


class TeamVertex(msgspec.Struct, frozen=True, array_like=True):
    """A vertex of a chart."""

    id: Annotated[int, msgspec.Meta(ge=0)]
    position: tuple[Number, Number]  # m, the robot's map frame
    covariance: tuple[Number, Number, Number, Number]  # of the position, 2x2 row-major, m^2
    clearance: Length  # m
    # key, bearing, edge, blocked
    departures: Annotated[
        tuple[tuple[int, Number, int | None, bool], ...], msgspec.Meta(max_length=16)
    ]
    walls: bytes  # little-endian int16 pairs x, y, cm, from the vertex


class TeamEdge(msgspec.Struct, frozen=True, array_like=True):
    """An edge of a chart."""

    id: int
    a: tuple[int, int]  # vertex, key
    b: tuple[int, int]
    length: Length  # m
    min_clearance: Length  # m
    points: bytes  # little-endian float32 pairs x, y, m, map frame
    traversed: bool = False


class TeamWay(msgspec.Struct, frozen=True, array_like=True):
    """A part of an edge that was driven."""

    min_clearance: Length  # m
    points: bytes  # little-endian float32 pairs x, y, m, map frame


class Claim(msgspec.Struct, frozen=True, array_like=True):
    """A frontier that a robot is on its way to, and the metres that are left of the way.

    Less than none: it is so far beyond, on the edge.
    """

    x: Number  # m, the robot's map frame
    y: Number
    bearing: Number  # rad
    metres: Number


class Frame(msgspec.Struct, frozen=True, array_like=True):
    """Where the map frame of another robot lies in one's own, m and rad."""

    robot: Name
    life: int  # of that robot, whose map has this frame
    pose: Triple


class ToldLook(msgspec.Struct, frozen=True, array_like=True):
    """Where a robot was when it looked, and what bodies it saw."""

    age: Annotated[float, msgspec.Meta(ge=0.0, le=60.0)]  # s, when it is told
    pose: Triple  # map_base
    # x, y, m, map frame, and radius, m
    bodies: Annotated[tuple[tuple[Number, Number, Radius], ...], msgspec.Meta(max_length=1000)]


class Course(msgspec.Struct, frozen=True, kw_only=True, tag="course"):
    """Where a robot is and what it drives along: told more often than all the rest."""

    robot: Name
    life: int
    sequence: int  # of the courses
    pose: Triple  # map_base
    # little-endian float32 pairs x, y, m, map frame
    line: Annotated[bytes, msgspec.Meta(max_length=16_000)]
    look: ToldLook | None = None  # the newest, if it has not been told before

    @property
    def points(self) -> Array:
        """What it drives along (N, 2), m, its map frame."""
        return np.frombuffer(self.line, "<f4").reshape(-1, 2).astype(np.float64)


class News(msgspec.Struct, frozen=True, kw_only=True, tag="news"):
    """All that a robot tells its team."""

    robot: Name
    life: int  # another one after a restart: the map frame is a new one
    sequence: int
    pose: Triple  # map_base
    radius: Radius  # m, of its body
    claim: Claim | None
    finished: bool  # it does not drive any more
    # it knows of nothing that is left to do, but waits for what others find, or is on an errand
    idle: bool = False
    frames: Annotated[tuple[Frame, ...], msgspec.Meta(max_length=MOST_MATES)]
    vertices: Annotated[tuple[TeamVertex, ...], msgspec.Meta(max_length=1000)]
    edges: Annotated[tuple[TeamEdge, ...], msgspec.Meta(max_length=3000)]
    ways: Annotated[tuple[TeamWay, ...], msgspec.Meta(max_length=1000)] = ()

    @property
    def chart(self) -> Chart:
        """Its graph, in its map frame."""
        return Chart(
            {vertex.id: _vertex(vertex) for vertex in self.vertices},
            {edge.id: _edge(edge) for edge in self.edges},
            tuple(ChartWay(_line(way.points, "way"), way.min_clearance) for way in self.ways),
        )


def encode(told: News | Course) -> bytes:
    """What is told in MessagePack."""
    return msgspec.msgpack.encode(told)


def decode(data: bytes) -> News | Course:
    """What `encode` wrote. Raises GvgbotError if it is damaged, or does not hang together."""
    if len(data) > _MOST_BYTES:
        raise GvgbotError(f"damaged news of a team: more than {_MOST_BYTES} bytes")
    try:
        told = msgspec.msgpack.decode(data, type=News | Course)
        if isinstance(told, Course):
            return _checked_course(told)
        return _checked(told, told.chart)
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise GvgbotError(f"damaged news of a team: {error}") from error


def _checked_course(course: Course) -> Course:
    if not _is_near(course.points):
        raise ValueError("a course leads nowhere")
    return course


def _checked(news: News, chart: Chart) -> News:
    """The news. Raises ValueError if they are of no map that a robot can have."""
    ends = [(end, edge.id) for edge in chart.edges.values() for end in (edge.a, edge.b)]
    departures = [(v, d) for v in chart.vertices.values() for d in v.departures]
    leaving = {HalfEdgeId(v.id, d.key): d.edge for v, d in departures}
    followed = {end: edge for end, edge in leaving.items() if edge is not None}
    if followed != dict(ends) or len(followed) != len(ends):
        raise ValueError("edges and departures do not belong together")
    if len(leaving) != len(departures) or len(leaving) - len(followed) > _MOST_OPEN:
        raise ValueError("more departures than there can be")
    if not all(_is_covariance(vertex.covariance) for vertex in chart.vertices.values()):
        raise ValueError("a covariance is none")
    lines = [e.polyline for e in chart.edges.values()] + [way.polyline for way in chart.ways]
    if sum(length_of(line) for line in lines) > _MOST_WAY_M:
        raise ValueError("longer ways than there can be")
    return news


def _is_covariance(matrix: Array) -> bool:
    """Whether it (2, 2) is symmetric and positive semidefinite, but for rounding."""
    (xx, xy), (yx, yy) = matrix.tolist()
    slack = _ROUNDED * (abs(xx) + abs(yy))
    is_symmetric = abs(xy - yx) <= slack
    return is_symmetric and bool(np.linalg.eigvalsh(matrix)[0] >= -slack)


def _is_near(points: Array) -> bool:
    """Whether all points (N, 2) may be on one map; NaN is nowhere."""
    return bool((np.abs(points) <= _MOST_M).all())


def told_vertices(chart: Chart) -> tuple[TeamVertex, ...]:
    """The vertices of a chart as they travel."""
    return tuple(_told_vertex(vertex) for vertex in chart.vertices.values())


def told_edges(chart: Chart) -> tuple[TeamEdge, ...]:
    """The edges of a chart as they travel."""
    return tuple(
        TeamEdge(
            edge.id,
            (edge.a.vertex, edge.a.key),
            (edge.b.vertex, edge.b.key),
            edge.length,
            edge.min_clearance,
            edge.polyline.astype("<f4").tobytes(),
            edge.traversed,
        )
        for edge in chart.edges.values()
    )


def told_ways(chart: Chart) -> tuple[TeamWay, ...]:
    """The ways of a chart as they travel."""
    return tuple(
        TeamWay(way.min_clearance, resampled(way.polyline, _WAY_M).astype("<f4").tobytes())
        for way in chart.ways
    )


def _told_vertex(vertex: ChartVertex) -> TeamVertex:
    x, y = vertex.position.tolist()
    xx, xy, yx, yy = vertex.covariance.ravel().tolist()
    walls = np.rint((vertex.walls - vertex.position) / _WALL_M).astype("<i2").tobytes()
    departures = tuple((d.key, d.bearing, d.edge, d.blocked) for d in vertex.departures)
    return TeamVertex(vertex.id, (x, y), (xx, xy, yx, yy), vertex.clearance, departures, walls)


def _vertex(told: TeamVertex) -> ChartVertex:
    position = np.array(told.position)
    walls = position + _WALL_M * np.frombuffer(told.walls, "<i2").reshape(-1, 2)
    return ChartVertex(
        told.id,
        position,
        np.array(told.covariance).reshape(2, 2),
        told.clearance,
        tuple(Departure(*departure) for departure in told.departures),
        walls,
    )


def _edge(told: TeamEdge) -> ChartEdge:
    line = _line(told.points, f"edge {told.id}")
    return ChartEdge(
        told.id,
        HalfEdgeId(*told.a),
        HalfEdgeId(*told.b),
        told.length,
        told.min_clearance,
        line,
        told.traversed,
    )


def _line(points: bytes, what: str) -> Array:
    """A line (N, 2) as it has travelled. Raises ValueError if it is none."""
    line: Array = np.frombuffer(points, "<f4").reshape(-1, 2).astype(np.float64)
    if len(line) < 2 or not _is_near(line):
        raise ValueError(f"{what} has no line")
    return line
