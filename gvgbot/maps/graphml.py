"""A route graph as GraphML, for networkx, Gephi, yEd and others.

GraphML knows plain values only: of frontiers there is the number, and lines are WKT.
"""

from collections.abc import Iterable
from xml.etree import ElementTree as ET

from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode

Value = str | int | float

_TYPES = {str: "string", int: "int", float: "double"}
_VERTEX_TYPES: dict[str, type[Value]] = {
    "kind": str,
    "x": float,  # m, map frame, as y
    "y": float,
    "degree": int,
    "clearance": float,  # m
    "covariance_xx": float,  # m^2
    "covariance_xy": float,
    "covariance_yy": float,
    "frontiers": int,
    "visits": int,
}
_EDGE_TYPES: dict[str, type[Value]] = {
    "length": float,  # m
    "min_clearance": float,  # m
    "traversals": int,
    "line": str,  # WKT, m, map frame
}


def encode(graph: RouteGraph) -> bytes:
    """The file: an undirected graph in which edges may be parallel."""
    root = ET.Element("graphml", xmlns="http://graphml.graphdrawing.org/xmlns")
    for owner, types in (("node", _VERTEX_TYPES), ("edge", _EDGE_TYPES)):
        for name, kind in types.items():
            key = {"id": f"{owner}.{name}", "for": owner, "attr.name": name}
            ET.SubElement(root, "key", key | {"attr.type": _TYPES[kind]})
    body = ET.SubElement(root, "graph", id="map", edgedefault="undirected")
    for vertex in graph.vertices:
        node = ET.SubElement(body, "node", id=str(vertex.id))
        _add_data(node, _VERTEX_TYPES, _vertex_values(vertex))
    for number, edge in enumerate(graph.edges):
        ends = {"source": str(edge.start), "target": str(edge.end)}
        element = ET.SubElement(body, "edge", ends, id=f"e{number}")
        _add_data(element, _EDGE_TYPES, _edge_values(edge))
    ET.indent(root)
    file: bytes = ET.tostring(root, "utf-8", xml_declaration=True)
    return file


def _vertex_values(vertex: RouteNode) -> tuple[Value, ...]:
    xx, xy, _, yy = vertex.covariance
    counts = (len(vertex.frontiers), vertex.visits)
    return (vertex.kind, *vertex.position, vertex.degree, vertex.clearance, xx, xy, yy, *counts)


def _edge_values(edge: RouteEdge) -> tuple[Value, ...]:
    points = ", ".join(f"{x:.6f} {y:.6f}" for x, y in edge.polyline.tolist())
    return edge.length, edge.min_clearance, edge.traversals, f"LINESTRING ({points})"


def _add_data(parent: ET.Element, names: Iterable[str], values: Iterable[Value]) -> None:
    for name, value in zip(names, values, strict=True):
        ET.SubElement(parent, "data", key=f"{parent.tag}.{name}").text = str(value)
