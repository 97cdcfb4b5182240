"""Route graph -> GeoJSON text for the Nav2 route server, which drives straight from node to node.

The server takes no notice of the lines of edges. So an edge becomes a chain of straight ones, with
a node of the kind `waypoint` wherever it bends.
"""

from itertools import count, pairwise
from typing import Any

import msgspec
import numpy as np

from gvgbot.geometry import Array, length_of
from gvgbot.maps import geojson
from gvgbot.maps.route_graph import RouteEdge, RouteGraph

TOLERANCE_M = 0.05  # from an edge to the chain: a cell of the grid

Feature = dict[str, Any]


def encode(graph: RouteGraph) -> str:
    """The graph as GeoJSON, one feature per line; each vertex keeps its id.

    Raises ValueError if a number of the graph is not finite.
    """
    given = msgspec.json.decode(geojson.encode(graph))["features"]
    nodes: list[Feature] = [one for one in given if one["geometry"]["type"] == "Point"]
    pieces: list[tuple[RouteEdge, int, int, Array]] = []
    ids = count(max((vertex.id for vertex in graph.vertices), default=-1) + 1)
    for edge in graph.edges:
        corners = _corners(edge.polyline)
        inner = [next(ids) for _ in corners[1:-1]]
        nodes += [
            _waypoint(node, edge.polyline[i]) for node, i in zip(inner, corners[1:-1], strict=True)
        ]
        ends = pairwise([edge.start, *inner, edge.end])
        for (a, b), (i, j) in zip(ends, pairwise(corners), strict=True):
            pieces.append((edge, a, b, edge.polyline[i : j + 1]))
    edges = [
        _straight(edge, next(ids), *way)
        for edge, a, b, line in pieces
        for way in ((a, b, line), (b, a, line[::-1]))
    ]
    lines = ",\n".join(msgspec.json.encode(feature).decode() for feature in nodes + edges)
    return f'{{"type":"FeatureCollection","features":[\n{lines}\n]}}\n'


def _corners(line: Array) -> list[int]:
    """Indices of points of a line (N, 2) between which it is straight enough, its ends among them.

    By the farthest point, again and again (Douglas and Peucker, 1973).
    """
    off = _from_chord(line)
    farthest = int(np.argmax(off))
    if off[farthest] <= TOLERANCE_M:
        return [0, len(line) - 1]
    before, after = _corners(line[: farthest + 1]), _corners(line[farthest:])
    return before[:-1] + [farthest + i for i in after]


def _from_chord(line: Array) -> Array:
    """How far each point of a line (N, 2) is from the straight way between its ends, m."""
    chord = line[-1] - line[0]
    along = np.clip((line - line[0]) @ chord / max(chord @ chord, 1e-12), 0.0, 1.0)
    off: Array = np.hypot(*(line - line[0] - along[:, None] * chord).T)
    return off


def _waypoint(number: int, place: Array) -> Feature:
    return {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": _rounded(place)},
        "properties": {"id": number, "frame": "map", "metadata": {"kind": "waypoint"}},
    }


def _straight(edge: RouteEdge, number: int, start: int, end: int, line: Array) -> Feature:
    length = round(length_of(line[[0, -1]]), geojson.DECIMALS)
    room = max(0.0, edge.min_clearance - float(_from_chord(line).max()))  # beside the straight way
    metadata = {
        "length": length,
        "min_clearance": round(room, geojson.DECIMALS),
        "traversals": edge.traversals,
        "edge": [edge.start, edge.end],
    }
    ends = [[_rounded(line[0]), _rounded(line[-1])]]
    return {
        "type": "Feature",
        "geometry": {"type": "MultiLineString", "coordinates": ends},
        "properties": {
            "id": number,
            "startid": start,
            "endid": end,
            "cost": length,
            "metadata": metadata,
        },
    }


def _rounded(place: Array) -> list[float]:
    return [round(float(value), geojson.DECIMALS) + 0.0 for value in place]
