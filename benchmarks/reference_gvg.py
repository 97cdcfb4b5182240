"""The true reduced GVG of a bitmap world, to score maps against; shares no code with the robot's.

It is the exact Voronoi diagram of the wall cells that border on where the robot can get to, without
what comes of walls being stairs of cells, and without the branches that run into mere corners. The
reach of a dangling branch is its length and the clearance of its tip, over the clearance of its
base; in a right-angled corner that is 1.41.
"""

import math
from dataclasses import dataclass, field
from typing import TypeVar

import networkx as nx
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import KDTree, Voronoi

from gvgbot.drivers.start import check_start
from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose

CORNER_REACH = 1.6  # a branch of less is a corner's
DEAD_END_REACH = 2.2  # a branch of more belongs into every map; what is between is optional
MERGE = 0.6  # m: meetpoints joined by a shorter edge are one
LARGEST_CELL = 0.06  # m: cells of more are divided, or clearances would be too coarse
WALL_STEP = 4  # cells: generators closer than this are steps of one wall
CHORD = 0.9  # least distance of two generators, in clearances, that are not one rough wall

START, ANY_END = -1, -2  # of a tour

Node = int
Cell = TypeVar("Cell", bound=np.generic)


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """The reduced GVG, world frame, m; `graph` is a multigraph, empty where the robot hardly fits.

    Vertices have `position` (2,), `clearance` and `is_required`; edges have `length` and `line`
    (N, 2), which runs either way. What is not required may be missing from a map or be in it.
    `meetpoints` (N, 2) are those of the whole GVG, with the branches into corners, each by itself.
    """

    graph: nx.MultiGraph = field(default_factory=nx.MultiGraph)
    meetpoints: Array = field(default_factory=lambda: np.zeros((0, 2)))

    @property
    def length(self) -> float:
        """Of all edges together, m."""
        return float(sum(length for *_, length in self.graph.edges(data="length")))

    def tour_length(self, start: tuple[float, float]) -> float:
        """The shortest way, m, that begins on the GVG next to `start` and drives all its edges.

        It ends wherever that is best: an open tour of the Chinese postman.
        """
        if not self.graph.number_of_edges():
            return 0.0
        graph, first = _with_vertex_at(self.graph, np.array(start))
        return self.length + _least_repeats(graph, first)


def reference_gvg(world: World, start: tuple[float, float], radius: float) -> Reference:
    """What a robot of this radius (m) that starts at a point (m) could map of the world.

    Beyond its edges the bitmap counts as wall. Raises WorldError for a start without room.
    """
    check_start(world, Pose(*start), radius)
    fine = _fine_graph(world, start, radius)
    if not fine:
        return Reference()
    meetpoints = [fine.nodes[node]["position"] for node in fine if fine.degree(node) >= 3]
    while corners := _corner_branches(_reduced(fine, start)):
        fine.remove_nodes_from(corners)
    graph = _merged(_reduced(fine, start))
    _mark_required(graph)
    return Reference(graph, np.array(meetpoints).reshape(-1, 2))


def _fine_graph(world: World, start: tuple[float, float], radius: float) -> nx.Graph:
    """Voronoi vertices and ridges of the reachable part, without those that walls' steps make."""
    cells = _Cells.of(world)
    room = radius + cells.size / 2  # from the centres of wall cells
    generators, is_reachable = cells.around(start, room)
    diagram = Voronoi(generators)
    points = diagram.vertices
    clearance = np.asarray(KDTree(generators).query(points)[0])
    a, b = np.asarray(diagram.ridge_vertices).T
    p, q = generators[diagram.ridge_points.T]
    chord = np.hypot(*(p - q).T)
    to_a, to_b = points[a] - (p + q) / 2, points[b] - (p + q) / 2
    is_gap = np.sum(to_a * to_b, axis=1) < 0.0  # passes between its generators, narrowest there
    ends = np.minimum(clearance[a], clearance[b])
    narrowest = np.where(is_gap, chord / 2, ends)
    kept = (a >= 0) & (b >= 0) & (narrowest >= room)
    is_rough = chord < np.maximum(max(2 * radius, WALL_STEP * cells.size), CHORD * ends)
    graph = nx.Graph()
    for i, j, rough in zip(a[kept].tolist(), b[kept].tolist(), is_rough[kept], strict=True):
        graph.add_edge(i, j, is_rough=bool(rough))
    for node, data in graph.nodes.items():
        data.update(position=points[node], clearance=float(clearance[node]))
    _peel(graph)
    is_there = cells.at(is_reachable, points)
    pieces = [list(p) for p in nx.connected_components(graph) if is_there[list(p)].any()]
    piece = max(pieces, key=lambda nodes: int(is_there[nodes].sum()), default=[])
    return graph.subgraph(piece).copy()


def _peel(graph: nx.Graph) -> None:
    """Take rough ridges away from the tips inwards, so that no way between walls is ever cut."""
    tips = [node for node in graph if graph.degree(node) == 1]
    while tips:
        tip = tips.pop()
        for neighbour, ridge in list(graph.adj[tip].items()):
            if ridge["is_rough"]:
                graph.remove_node(tip)
                if graph.degree(neighbour) == 1:
                    tips.append(neighbour)


@dataclass(frozen=True, slots=True, eq=False)
class _Cells:
    """The bitmap within a rim of wall: walls (rows, columns), size of a cell, corner of it all."""

    walls: NDArray[np.bool_]
    size: float
    corner: Array

    @classmethod
    def of(cls, world: World) -> "_Cells":
        parts = 1
        if world.resolution_m > LARGEST_CELL:
            parts = math.ceil(world.resolution_m / LARGEST_CELL)
        walls = np.kron(world.occupied, np.ones((parts, parts), dtype=np.bool_))
        size = world.resolution_m / parts
        return cls(np.pad(walls, 1, constant_values=True), size, np.array(world.origin) - size)

    def around(self, start: tuple[float, float], room: float) -> tuple[Array, NDArray[np.bool_]]:
        """Centres (N, 2) of the walls around the free space of the start, and where it has room.

        The latter are the cells that hang together next to the start; ways that are hardly wide
        enough may be cut.
        """
        labels, _ = ndimage.label(~self.walls)
        free = labels == self.at(labels, np.array([start]))
        border = ndimage.binary_dilation(free, np.ones((3, 3), dtype=np.bool_)) & ~free
        distance = ndimage.distance_transform_edt(~border) * self.size
        spacious, count = ndimage.label(free & (distance >= room))
        gaps = np.hypot(*(self._centres(spacious > 0) - start).T)
        if count:
            spacious = spacious == spacious[spacious > 0][gaps.argmin()]
        return self._centres(border), np.asarray(spacious, dtype=np.bool_)

    def _centres(self, cells: NDArray[np.bool_]) -> Array:
        """Of the cells that are set, (N, 2) m, row by row."""
        rows, columns = np.nonzero(cells)
        return np.asarray(self.corner + self.size * (np.column_stack((columns, rows)) + 0.5))

    def at(self, cells: NDArray[Cell], points: Array) -> NDArray[Cell]:
        """The cells that points (N, 2) lie in; 0 outside."""
        columns, rows = np.floor((points - self.corner) / self.size).T
        height, width = cells.shape
        inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
        found = np.zeros(len(points), cells.dtype)
        found[inside] = cells[rows[inside].astype(int), columns[inside].astype(int)]
        return found


def _reduced(fine: nx.Graph, start: tuple[float, float]) -> nx.MultiGraph:
    """Chains of points with two neighbours as edges; `chain` are the points.

    A ring without a vertex gets one next to the start.
    """
    ends = [node for node in fine if fine.degree(node) != 2]
    if not ends:
        ends = [min(fine, key=lambda node: math.dist(fine.nodes[node]["position"], start))]
    graph = nx.MultiGraph()
    graph.add_nodes_from((node, fine.nodes[node]) for node in ends)
    walked = set()
    for end in ends:
        for first in fine.adj[end]:
            if (end, first) in walked:
                continue
            chain = [end, first]
            while chain[-1] not in graph:
                one, other = fine.adj[chain[-1]]
                chain.append(other if one == chain[-2] else one)
            walked.add((chain[-1], chain[-2]))
            line = np.array([fine.nodes[node]["position"] for node in chain])
            graph.add_edge(end, chain[-1], chain=chain, line=line, length=_length(line))
    return graph


def _length(line: Array) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def _corner_branches(graph: nx.MultiGraph) -> list[Node]:
    """All points of the branches that run into corners, but for the vertices they hang on.

    They go together, so that a dead end keeps the vertex that both its corners hang on.
    """
    return [
        node
        for tip in _tips(graph)
        if _reach(graph, tip) < CORNER_REACH
        for *_, chain in graph.edges(tip, data="chain")
        for node in chain
        if node != _base(graph, tip)
    ]


def _tips(graph: nx.MultiGraph) -> list[Node]:
    """Ends of branches that hang on a vertex of three edges or more."""
    return [n for n in graph if graph.degree(n) == 1 and graph.degree(_base(graph, n)) >= 3]


def _base(graph: nx.MultiGraph, tip: Node) -> Node:
    (base,) = graph.adj[tip]
    return int(base)


def _reach(graph: nx.MultiGraph, tip: Node) -> float:
    ((_, base, length),) = graph.edges(tip, data="length")
    return float((length + graph.nodes[tip]["clearance"]) / graph.nodes[base]["clearance"])


def _merged(graph: nx.MultiGraph) -> nx.MultiGraph:
    """Meetpoints that almost coincide as one between them, the closest first."""
    while short := [
        (length, a, b, key)
        for a, b, key, length in graph.edges(keys=True, data="length")
        if a != b and length < MERGE and min(graph.degree(a), graph.degree(b)) >= 3
    ]:
        _, a, b, key = min(short)
        one, other = graph.nodes[a], graph.nodes[b]
        middle = {name: (one[name] + other[name]) / 2 for name in ("position", "clearance")}
        graph.remove_edge(a, b, key)
        graph = nx.relabel_nodes(graph, {b: a})
        graph.nodes[a].update(middle)
    return graph


def _mark_required(graph: nx.MultiGraph) -> None:
    """What every map must have: no tip of little reach, nor a vertex that may lose two of three.

    A vertex without edges is where a space without ways was entered, a ring's is anywhere on it.
    """
    weak = {tip for tip in _tips(graph) if _reach(graph, tip) < DEAD_END_REACH}
    for node, data in graph.nodes.items():
        certain = graph.degree(node) - sum(tip in weak for tip in graph.adj[node])
        is_vertex = graph.degree(node) == 1 or certain >= 3
        data["is_required"] = node not in weak and is_vertex


def _with_vertex_at(graph: nx.MultiGraph, point: Array) -> tuple[nx.MultiGraph, Node]:
    """The graph with a vertex on the edge that passes next to the point, and that vertex."""
    gaps = {
        (a, b, key): np.hypot(*(line - point).T)
        for a, b, key, line in graph.edges(keys=True, data="line")
    }
    a, b, key = min(gaps, key=lambda edge: float(gaps[edge].min()))
    line, cut = graph.edges[a, b, key]["line"], int(gaps[a, b, key].argmin())
    a, b = sorted((a, b), key=lambda node: math.dist(graph.nodes[node]["position"], line[0]))
    if cut in (0, len(line) - 1):
        return graph, (a if cut == 0 else b)
    split = graph.copy()
    split.remove_edge(a, b, key)
    split.add_edge(a, START, length=_length(line[: cut + 1]))
    split.add_edge(START, b, length=_length(line[cut:]))
    return split, START


def _least_repeats(graph: nx.MultiGraph, first: Node) -> float:
    """Metres to be driven twice by a walk over all edges from one vertex to any.

    Vertices with an odd number of edges, the first one counted the other way, are joined in pairs;
    one is left over for the end.
    """
    odd = {node for node in graph if graph.degree(node) % 2} ^ {first}
    ways = nx.Graph()
    ways.add_weighted_edges_from((ANY_END, node, 0.0) for node in odd)
    for node in odd:
        metres = nx.single_source_dijkstra_path_length(graph, node, weight="length")
        ways.add_weighted_edges_from((node, other, metres[other]) for other in odd if other != node)
    pairs = nx.min_weight_matching(ways)
    return float(sum(ways.edges[pair]["weight"] for pair in pairs))
