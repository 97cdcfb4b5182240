"""The map of a team as one robot knows it: its own, with the charts of others laid on it."""

from collections.abc import Iterable, Mapping

from gvgbot.geometry import Array, Pose
from gvgbot.maps import geojson
from gvgbot.maps.joined_graph import joined_graph
from gvgbot.maps.picture import draw_map
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode
from gvgbot.team.chart import Chart, ChartEdge, ChartVertex


def team_files(
    own: RouteGraph,
    parts: Iterable[tuple[Array, float]],
    others: Mapping[str, tuple[Chart, Pose]],
    title: str,
) -> dict[str, bytes | str]:
    """Files by name. `others` has charts, and where their frames lie in that of the own map.

    `parts` of edges that this robot has driven are lines (N, 2) and least clearances, m.
    """
    ways = list(parts)
    for chart, pose in others.values():
        ways += [(pose.transform(way.polyline), way.min_clearance) for way in chart.ways]
    charts = [(route_graph(chart), pose) for chart, pose in others.values()]
    graph = joined_graph([(own, Pose()), *charts], ways)
    return {"team.geojson": geojson.encode(graph), "team.png": draw_map(graph, title=title)}


def route_graph(chart: Chart) -> RouteGraph:
    """A chart as a map. Of how often its robot came by, it says only whether it ever did."""
    return RouteGraph(
        tuple(_vertex(vertex) for vertex in chart.vertices.values()),
        tuple(_edge(edge) for edge in chart.edges.values()),
    )


def _vertex(vertex: ChartVertex) -> RouteNode:
    x, y = vertex.position.tolist()
    xx, xy, yx, yy = vertex.covariance.ravel().tolist()
    return RouteNode(
        id=vertex.id,
        kind="meetpoint" if vertex.is_meetpoint else "endpoint",
        position=(x, y),
        degree=len(vertex.departures),
        bearings=vertex.bearings,
        clearance=vertex.clearance,
        covariance=(xx, xy, yx, yy),
        frontiers=tuple(one.bearing for one in vertex.departures if one.edge is None),
    )


def _edge(edge: ChartEdge) -> RouteEdge:
    return RouteEdge(
        start=edge.a.vertex,
        end=edge.b.vertex,
        polyline=edge.polyline.copy(),
        min_clearance=edge.min_clearance,
        traversals=int(edge.traversed),
    )
