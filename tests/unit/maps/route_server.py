"""What the route server of Nav2 takes for a graph, by the documentation and rules of its loader.

It reads features that are points or lines, ids as unsigned integers, edges between ids that exist,
and metadata of numbers, strings and truth values, alone or in arrays, or in objects of the same;
a graph without a node or without an edge it calls malformed.
"""

import json
import math
from dataclasses import dataclass, field
from typing import Any

LARGEST_ID = 2**32 - 1


class Malformed(Exception):
    """The route server would refuse the file, or end."""


@dataclass
class Loaded:
    """The graph: nodes by id, and directed edges by id as start, end, cost."""

    nodes: dict[int, tuple[float, float]] = field(default_factory=dict)
    edges: dict[int, tuple[int, int, float]] = field(default_factory=dict)


def load(text: str) -> Loaded:
    """The graph in a file. Raises Malformed."""
    try:
        collection = json.loads(text, parse_constant=_refuse)
    except ValueError as error:
        raise Malformed(f"no JSON: {error}") from error
    if not isinstance(collection, dict) or collection.get("type") != "FeatureCollection":
        raise Malformed("no collection of features")
    graph = Loaded()
    edges = []
    for feature in collection["features"]:
        kind = feature["geometry"]["type"]
        if kind == "Point":
            _add_node(graph, feature)
        elif kind in ("LineString", "MultiLineString"):
            edges.append(feature)
    for feature in edges:
        _add_edge(graph, feature)
    if not graph.nodes or not graph.edges:
        raise Malformed("without nodes or without edges")
    return graph


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} is no JSON")


def _add_node(graph: Loaded, feature: dict[str, Any]) -> None:
    properties = feature["properties"]
    number = _id(properties, "id", graph)
    if not isinstance(properties.get("frame", ""), str):
        raise Malformed("frame is no name")
    graph.nodes[number] = _position(feature["geometry"]["coordinates"])
    _check_metadata(properties.get("metadata", {}))


def _add_edge(graph: Loaded, feature: dict[str, Any]) -> None:
    properties = feature["properties"]
    number, start, end = (_id(properties, key) for key in ("id", "startid", "endid"))
    if start not in graph.nodes or end not in graph.nodes:
        raise Malformed(f"edge {number} joins a node that is not there")
    if number in graph.edges or number in graph.nodes:
        raise Malformed(f"id {number} stands twice")
    cost = properties.get("cost", 0.0)
    if not isinstance(cost, int | float) or not math.isfinite(cost) or cost < 0.0:
        raise Malformed(f"edge {number} costs {cost}")
    geometry = feature["geometry"]
    lines = geometry["coordinates"]
    for line in lines if geometry["type"] == "MultiLineString" else [lines]:
        if len([_position(point) for point in line]) < 2:
            raise Malformed(f"edge {number} has no length")
    graph.edges[number] = start, end, float(cost)
    _check_metadata(properties.get("metadata", {}))


def _id(properties: dict[str, Any], key: str, graph: Loaded | None = None) -> int:
    number = properties.get(key)
    if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number <= LARGEST_ID:
        raise Malformed(f"{key} = {number!r}")
    if graph is not None and number in graph.nodes:
        raise Malformed(f"id {number} stands twice")
    return number


def _position(coordinates: Any) -> tuple[float, float]:
    if len(coordinates) not in (2, 3) or not all(isinstance(c, int | float) for c in coordinates):
        raise Malformed(f"no position: {coordinates!r}")
    return float(coordinates[0]), float(coordinates[1])


def _check_metadata(metadata: dict[str, Any]) -> None:
    for key, value in metadata.items():
        if isinstance(value, dict):
            _check_metadata(value)
            continue
        for item in value if isinstance(value, list) else [value]:
            if not isinstance(item, int | float | str):
                raise Malformed(f"metadata {key} = {value!r}")
