"""The route graph as markers that RViz and Foxglove draw."""

from collections.abc import Iterable, Iterator

import numpy as np

from gvgbot.geometry import Array
from gvgbot.maps.route_graph import RouteGraph, RouteNode
from gvgbot.ros2.messages import ColorRGBA, Marker, MarkerArray, Pose, Vector3
from gvgbot.ros2.translation import MAP, header

_ADD, _DELETE = 0, 2
_LINES, _BALLS = 5, 7  # LINE_LIST, SPHERE_LIST
_BALL_M, _EDGE_M, _FRONTIER_M = 0.25, 0.05, 0.08  # diameters and widths
_FRONTIER_LENGTH_M = 0.5
_BLUE = ColorRGBA(0.13, 0.35, 0.72, 1.0)
_GREY = ColorRGBA(0.45, 0.48, 0.52, 1.0)
_GREEN = ColorRGBA(0.10, 0.55, 0.28, 1.0)
_RED = ColorRGBA(0.84, 0.21, 0.16, 1.0)


def markers(graph: RouteGraph, stamp: float) -> MarkerArray:
    """Meetpoints, endpoints, edges and frontiers; `stamp` in seconds since 1970."""
    vertices = graph.vertices
    return MarkerArray(
        (
            _marker("edges", _LINES, _EDGE_M, _BLUE, _edges(graph), stamp),
            _marker("meetpoints", _BALLS, _BALL_M, _GREEN, _places(vertices, "meetpoint"), stamp),
            _marker("endpoints", _BALLS, _BALL_M, _GREY, _places(vertices, "endpoint"), stamp),
            _marker("frontiers", _LINES, _FRONTIER_M, _RED, _frontiers(vertices), stamp),
        )
    )


def _marker(
    name: str, kind: int, size: float, colour: ColorRGBA, points: Array, stamp: float
) -> Marker:
    """All of one kind as one marker; where there are none, what was there goes."""
    return Marker(
        header(stamp, MAP),
        ns=name,
        id=0,
        type=kind,
        action=_ADD if len(points) else _DELETE,
        pose=Pose(),
        scale=Vector3(size, size, size),
        color=colour,
        points=points,
    )


def _edges(graph: RouteGraph) -> Array:
    """Pairs of points (2N, 3): the pieces of all edges."""
    pieces = [np.repeat(edge.polyline, 2, axis=0)[1:-1] for edge in graph.edges]
    return _on_floor(np.concatenate([np.zeros((0, 2)), *pieces]))


def _places(vertices: Iterable[RouteNode], kind: str) -> Array:
    return _on_floor(np.array([v.position for v in vertices if v.kind == kind]).reshape(-1, 2))


def _frontiers(vertices: Iterable[RouteNode]) -> Array:
    """Short lines from vertices into what was never followed."""

    def ends() -> Iterator[tuple[float, float]]:
        for vertex in vertices:
            x, y = vertex.position
            for bearing in vertex.frontiers:
                yield x, y
                yield (
                    x + _FRONTIER_LENGTH_M * float(np.cos(bearing)),
                    y + _FRONTIER_LENGTH_M * float(np.sin(bearing)),
                )

    return _on_floor(np.array(list(ends())).reshape(-1, 2))


def _on_floor(points: Array) -> Array:
    return np.column_stack([points, np.zeros(len(points))])
