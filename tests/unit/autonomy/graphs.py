"""Graphs to test with, and what networkx says of them."""

import math

import networkx as nx
import numpy as np

from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId, Vertex
from gvgbot.geometry import Pose

STREET = 10.0  # m


def streets(columns: int, rows: int) -> tuple[GvgGraph, dict[tuple[int, int], int]]:
    """All crossings and streets of a rectangular town; vertex ids by (column, row)."""
    graph = GvgGraph()
    places = [(x, y) for x in range(columns) for y in range(rows)]
    ids = {place: graph.next_id() for place in places}
    for (x, y), vertex in ids.items():
        local = Pose(STREET * x, STREET * y)
        graph.vertices[vertex] = Vertex(vertex, 1.0, local, 0.0, 0.0)
    for x, y in places:
        for dx, dy in ((1, 0), (0, 1)):
            if (x + dx, y + dy) in ids:
                out = math.atan2(dy, dx)
                a = graph.vertices[ids[x, y]]
                b = graph.vertices[ids[x + dx, y + dy]]
                ends = (
                    HalfEdgeId(a.id, a.add_half_edge(out)),
                    HalfEdgeId(b.id, b.add_half_edge(out + math.pi)),
                )
                line = STREET * np.array([[0.0, 0.0], [dx, dy]])
                graph.join(*ends, line, 1.0, driven=True)
    return graph, ids


def between(graph: GvgGraph, vertex: int, neighbour: int) -> HalfEdgeId:
    """The half-edge by which a vertex is left for its neighbour."""
    for edge in graph.edges.values():
        for end in (edge.a, edge.b):
            if end.vertex == vertex and edge.other(end).vertex == neighbour:
                return end
    raise LookupError(f"no edge from {vertex} to {neighbour}")


def random_multigraph(rng: np.random.Generator) -> GvgGraph:
    """Up to eight vertices, with self-loops, parallel edges, frontiers and blocked departures."""
    graph = GvgGraph()
    for _ in range(int(rng.integers(1, 9))):
        vertex = Vertex(graph.next_id(), 1.0, Pose(), 0.0, 0.0)
        graph.vertices[vertex.id] = vertex
    vertices = list(graph.vertices.values())
    for _ in range(int(rng.integers(0, 14))):
        a, b = (vertices[i] for i in rng.integers(0, len(vertices), 2))
        ends = (
            HalfEdgeId(a.id, a.add_half_edge(float(rng.uniform(-3, 3)))),
            HalfEdgeId(b.id, b.add_half_edge(float(rng.uniform(-3, 3)))),
        )
        length = float(rng.integers(1, 20))  # whole metres, so that equal ways are common
        graph.join(*ends, np.array([[0.0, 0.0], [length, 0.0]]), 1.0, driven=True)
    for _ in range(int(rng.integers(0, 4))):
        vertex = vertices[int(rng.integers(len(vertices)))]
        key = vertex.add_half_edge(float(rng.uniform(-3, 3)))
        vertex.half_edges[key].blocked = bool(rng.random() < 0.3)
    return graph


def networkx_distances(graph: GvgGraph, starts: list[tuple[int, float]]) -> dict[int, float]:
    """Metres to each vertex that can be reached, from a robot so far away from some of them."""
    robot = 0
    same = nx.MultiGraph()
    for edge in graph.edges.values():
        same.add_edge(edge.a.vertex, edge.b.vertex, weight=edge.length)
    for vertex, metres in starts:
        same.add_edge(robot, vertex, weight=metres)
    found = nx.single_source_dijkstra_path_length(same, robot)
    return {int(vertex): float(metres) for vertex, metres in found.items() if vertex != robot}


Crossing = tuple[int, int]


def part_of_a_town(
    rng: np.random.Generator,
) -> tuple[list[Crossing], list[tuple[Crossing, Crossing]]]:
    """Crossings and streets of a connected piece of a town of which a fifth is missing."""
    town = nx.grid_2d_graph(4, 4)
    town.remove_nodes_from([n for n in list(town) if rng.random() < 0.2])
    town.remove_edges_from([e for e in list(town.edges) if rng.random() < 0.2])
    piece = town.subgraph(max(nx.connected_components(town), key=len))
    return sorted(piece), sorted(piece.edges)
