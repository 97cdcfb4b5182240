"""Route graph <-> GeoJSON text in the form that the Nav2 route server loads.

A vertex is a `Point` feature; an edge is two directed `MultiLineString` features, one each way.
Metadata holds numbers, strings and flat arrays only: the route server refuses nested arrays, null.
"""

import math
from collections import defaultdict
from collections.abc import Iterable
from itertools import chain
from typing import Annotated, Generic, Literal, TypeVar

import msgspec
import numpy as np

from gvgbot.errors import UsageError
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode, VertexKind

DECIMALS = 6  # of lengths and angles: micrometres
COVARIANCE_DECIMALS = 9  # of squares: fewer could make a good fix look singular

_FARTHEST_M = 1e5  # from the origin, in any map

T = TypeVar("T")
Metres = Annotated[float, msgspec.Meta(ge=-_FARTHEST_M, le=_FARTHEST_M)]
Length = Annotated[float, msgspec.Meta(ge=0.0, le=_FARTHEST_M)]  # m
Count = Annotated[int, msgspec.Meta(ge=0)]
SquareMetres = Annotated[float, msgspec.Meta(ge=-(_FARTHEST_M**2), le=_FARTHEST_M**2)]
XY = tuple[Metres, Metres]
Matrix = tuple[SquareMetres, SquareMetres, SquareMetres, SquareMetres]


class _VertexMetadata(msgspec.Struct):
    kind: VertexKind
    degree: Count
    bearings: tuple[float, ...]
    clearance: Length
    covariance: Matrix
    frontiers: tuple[float, ...]
    visits: Count


class _VertexProperties(msgspec.Struct):
    id: int
    frame: Literal["map"]
    metadata: _VertexMetadata


class _EdgeMetadata(msgspec.Struct):
    length: Length
    min_clearance: Length
    traversals: Count


class _EdgeProperties(msgspec.Struct):
    id: int
    startid: int
    endid: int
    cost: Length
    metadata: _EdgeMetadata


class _Point(msgspec.Struct, tag="Point"):
    coordinates: XY


class _MultiLineString(msgspec.Struct, tag="MultiLineString"):
    coordinates: tuple[tuple[XY, ...]]


class _Vertex(msgspec.Struct, tag="Feature"):
    geometry: _Point
    properties: _VertexProperties


class _Edge(msgspec.Struct, tag="Feature"):
    geometry: _MultiLineString
    properties: _EdgeProperties


class _AnyFeature(msgspec.Struct, tag="Feature"):
    geometry: _Point | _MultiLineString


class _Collection(msgspec.Struct, Generic[T], tag="FeatureCollection"):
    features: list[T]


def encode(graph: RouteGraph) -> str:
    """The graph as GeoJSON, one feature per line; the same graph always gives the same text.

    Raises ValueError if a number of the graph is not finite.
    """
    features: list[_Vertex | _Edge] = [
        _vertex_feature(vertex) for vertex in sorted(graph.vertices, key=lambda v: v.id)
    ]
    next_id = max((vertex.id for vertex in graph.vertices), default=-1) + 1
    for there, back in sorted((_both_ways(edge) for edge in graph.edges), key=_order):
        there.properties.id, back.properties.id = next_id, next_id + 1
        features += [there, back]
        next_id += 2
    lines = ",\n".join(msgspec.json.encode(feature).decode() for feature in features)
    return f'{{"type":"FeatureCollection","features":[\n{lines}\n]}}\n'


def decode(text: str) -> RouteGraph:
    """The graph in a text that `encode` wrote. Raises UsageError if the text is damaged."""
    try:
        collection = msgspec.json.decode(text, type=_Collection[msgspec.Raw])
    except (msgspec.MsgspecError, RecursionError) as error:
        raise UsageError(f"not a route graph in GeoJSON: {error}") from error
    features = [_feature(raw, number) for number, raw in enumerate(collection.features)]
    vertices = [_route_node(feature) for feature in features if isinstance(feature, _Vertex)]
    lines = _one_way(feature for feature in features if isinstance(feature, _Edge))
    try:
        return RouteGraph(tuple(vertices), tuple(_route_edge(line) for line in lines))
    except ValueError as error:
        raise UsageError(f"damaged route graph: {error}") from error


def _rounded(value: float, decimals: int = DECIMALS) -> float:
    if not math.isfinite(value):
        raise ValueError(f"{value} has no place in a map")
    return round(float(value), decimals) + 0.0  # turns -0.0 into 0.0


def _rounded_matrix(matrix: Matrix) -> Matrix:
    xx, xy, yx, yy = (_rounded(value, COVARIANCE_DECIMALS) for value in matrix)
    return xx, xy, yx, yy


def _all_rounded(values: Iterable[float]) -> tuple[float, ...]:
    return tuple(_rounded(value) for value in values)


def _vertex_feature(vertex: RouteNode) -> _Vertex:
    x, y = vertex.position
    metadata = _VertexMetadata(
        kind=vertex.kind,
        degree=vertex.degree,
        bearings=_all_rounded(vertex.bearings),
        clearance=_rounded(vertex.clearance),
        covariance=_rounded_matrix(vertex.covariance),
        frontiers=_all_rounded(vertex.frontiers),
        visits=vertex.visits,
    )
    point = _Point((_rounded(x), _rounded(y)))
    return _Vertex(point, _VertexProperties(vertex.id, "map", metadata))


def _both_ways(edge: RouteEdge) -> tuple[_Edge, _Edge]:
    """The edge as two directed features whose ids are still to be given."""
    length = _rounded(edge.length)
    metadata = _EdgeMetadata(length, _rounded(edge.min_clearance), edge.traversals)
    line = tuple((_rounded(x), _rounded(y)) for x, y in edge.polyline.tolist())
    there = _EdgeProperties(-1, edge.start, edge.end, length, metadata)
    back = _EdgeProperties(-1, edge.end, edge.start, length, metadata)
    return (
        _Edge(_MultiLineString((line,)), there),
        _Edge(_MultiLineString((line[::-1],)), back),
    )


def _order(both: tuple[_Edge, _Edge]) -> tuple[int, int, tuple[tuple[XY, ...]]]:
    there = both[0]
    return there.properties.startid, there.properties.endid, there.geometry.coordinates


def _feature(raw: msgspec.Raw, number: int) -> _Vertex | _Edge:
    try:
        geometry = msgspec.json.decode(raw, type=_AnyFeature).geometry
        if isinstance(geometry, _Point):
            return msgspec.json.decode(raw, type=_Vertex)
        return msgspec.json.decode(raw, type=_Edge)
    except (msgspec.MsgspecError, RecursionError) as error:
        if b'"waypoint"' in bytes(raw):
            raise UsageError(
                "an export for Nav2's route server, and no run's map.geojson: give the run itself"
            ) from error
        raise UsageError(f"damaged route graph, feature {number}: {error}") from error


def _one_way(edges: Iterable[_Edge]) -> list[_Edge]:
    """The first of every pair of opposite edges. Raises UsageError if one has no opposite."""
    kept: list[_Edge] = []
    waiting: defaultdict[tuple[int, int, tuple[XY, ...]], list[_Edge]] = defaultdict(list)
    for edge in edges:
        start, end = edge.properties.startid, edge.properties.endid
        (line,) = edge.geometry.coordinates
        if opposite := waiting[end, start, line[::-1]]:
            opposite.pop()
        else:
            kept.append(edge)
            waiting[start, end, line].append(edge)
    for edge in chain.from_iterable(waiting.values()):
        raise UsageError(f"damaged route graph: edge {edge.properties.id} has no way back")
    return kept


def _route_node(feature: _Vertex) -> RouteNode:
    metadata = msgspec.structs.asdict(feature.properties.metadata)
    return RouteNode(id=feature.properties.id, position=feature.geometry.coordinates, **metadata)


def _route_edge(feature: _Edge) -> RouteEdge:
    properties = feature.properties
    (line,) = feature.geometry.coordinates
    metadata = properties.metadata
    return RouteEdge(
        start=properties.startid,
        end=properties.endid,
        polyline=np.array(line, np.float64).reshape(-1, 2),
        min_clearance=metadata.min_clearance,
        traversals=metadata.traversals,
    )
