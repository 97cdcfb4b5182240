"""A mind that knows a building from a map that somebody else has made: walls, and what is free.

The GVG of the whole map is found as that of the local map is; its vertices and edges become the
graph. Scans that the robot would have taken on its edges stand for the walls, as in any mission.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gvgbot.autonomy.gvg.local import Branch, LocalEdge, LocalGvg
from gvgbot.autonomy.keyframes import Keyframe, Step
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId, Vertex
from gvgbot.autonomy.views import Observation
from gvgbot.geometry import Array, Pose, rows_of
from gvgbot.hal.messages import Scan
from gvgbot.hal.packed_scan import PackedScan

_SCAN_EVERY_M = 1.0  # on the edges
_SIGMA = np.diag([0.03**2, 0.03**2, 0.01**2])  # covariance of a vertex on a map that is right
_STEP = np.diag([1e-8, 1e-8, 1e-8])  # and of the way from one scan to the next
_UNSEEN = -1e6  # metres driven when the robot last saw a vertex

Look = Callable[[Pose], Scan]


@dataclass(frozen=True, slots=True, eq=False)
class KnownGrid:
    """Points of walls (N, 2), m, and which squares of `resolution` m are known: free, or wall.

    `known_cells` is (rows, columns), row 0 at the bottom; `corner` (2,) is its lower left one, m.
    """

    walls: Array
    known_cells: NDArray[np.bool_]
    resolution: float
    corner: Array

    def points(self) -> Array:
        """The walls (N, 2), map frame."""
        return self.walls

    def known(self, points: Array) -> NDArray[np.bool_]:
        """Whether each point (..., 2) lies where something is known."""
        cells = np.floor((points - self.corner) / self.resolution).astype(np.int64)
        rows, columns = self.known_cells.shape
        i, j = np.clip(cells[..., 1], -1, rows), np.clip(cells[..., 0], -1, columns)
        inside = (i >= 0) & (j >= 0) & (i < rows) & (j < columns)
        found: NDArray[np.bool_] = inside & self.known_cells[i % rows, j % columns]
        return found


def learn(pipeline: Pipeline, gvg: LocalGvg, look: Look) -> None:
    """Make a new mind know the GVG of a whole map; `look` is the scan from a pose, map frame."""
    ends = _add_vertices(pipeline, gvg, look)
    _add_edges(pipeline.mapper.graph, gvg, ends)
    _drive_mentally(pipeline, gvg, look)
    _believe(pipeline)


def _add_vertices(pipeline: Pipeline, gvg: LocalGvg, look: Look) -> dict[Branch, HalfEdgeId]:
    """Make vertices of nodes; the half-edges that branches became."""
    graph, ends = pipeline.mapper.graph, {}
    for key in _vertices(gvg):
        node = gvg.nodes[key]
        place = Pose(float(node.position[0]), float(node.position[1]))
        vertex = Vertex(graph.next_id(), node.clearance, place, _UNSEEN, _UNSEEN)
        for branch in node.branches:
            if branch not in node.weak:
                bearing = gvg.bearing(branch, node.clearance)
                ends[branch] = HalfEdgeId(vertex.id, vertex.add_half_edge(bearing))
        vertex.snapshot, vertex.sights = _walls_in_sight(look(place))
        graph.vertices[vertex.id] = vertex
    return ends


def _vertices(gvg: LocalGvg) -> list[int]:
    """The nodes that are vertices; on a ring without any, one is made of a point of it."""
    found = [key for key, node in gvg.nodes.items() if node.is_meetpoint or node.is_endpoint]
    return found or [key for key, node in gvg.nodes.items() if node.degree == 2][:1]


def _walls_in_sight(scan: Scan) -> tuple[Array, Array]:
    """The walls (N, 2) that a scan sees, in its own frame, and directions to where from."""
    hit = np.isfinite(scan.ranges)
    bearings = scan.bearings[hit]
    away = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    return scan.ranges[hit, None] * away, -away


def _add_edges(graph: GvgGraph, gvg: LocalGvg, ends: dict[Branch, HalfEdgeId]) -> None:
    """Join the half-edges that hang together; those that end in the unknown stay frontiers."""
    for start, end in ends.items():
        path = list(_onwards(gvg, start, ends))
        last = path[-1]
        far = ends.get(Branch(last.edge, not last.forward))
        if far is None or far == end or graph.edge_at(end) is not None:
            continue
        line = np.concatenate([gvg.leaving(branch) for branch in path])
        clearance = min(float(gvg.edges[branch.edge].clearance.min()) for branch in path)
        line = graph.vertices[end.vertex].local.inverse().transform(line)
        graph.join(end, far, line, clearance, driven=True)


def _onwards(gvg: LocalGvg, start: Branch, ends: dict[Branch, HalfEdgeId]) -> Iterator[Branch]:
    """The branches from a vertex on, through points that are none, to the next vertex or an end."""
    branch, passed = start, set[int]()
    while branch.edge not in passed:
        yield branch
        passed.add(branch.edge)
        onwards = gvg.onwards(branch)
        if onwards is None or Branch(branch.edge, not branch.forward) in ends:
            return
        branch = onwards


def _drive_mentally(pipeline: Pipeline, gvg: LocalGvg, look: Look) -> None:
    """Take scans all along the edges, as if the robot had been there, without driving a metre."""
    past = pipeline.past
    for edge in gvg.edges.values():
        for pose in _poses(edge):
            if past.last is not None:
                past.steps.append(Step(past.last.map_base.to(pose), _STEP))
            past.keyframes.append(Keyframe(0.0, pose, pose, pose, PackedScan(look(pose))))
    past.lasting = past.lent = len(past.keyframes)


def _poses(edge: LocalEdge) -> Iterator[Pose]:
    """Poses along an edge, looking ahead."""
    count = max(2, round(edge.length / _SCAN_EVERY_M) + 1)
    at = np.searchsorted(edge.stations, np.linspace(0.0, edge.length, count)[:-1])
    for i in np.minimum(at, len(edge.polyline) - 2):
        (x, y), (dx, dy) = edge.polyline[i], edge.polyline[i + 1] - edge.polyline[i]
        yield Pose(float(x), float(y), float(np.arctan2(dy, dx)))


def _believe(pipeline: Pipeline) -> None:
    """Be at the last place, and know where every vertex is, each seen once from near by."""
    mapper, keyframes = pipeline.mapper, pipeline.past.keyframes
    vertices = list(mapper.graph.vertices.values())
    base = keyframes[-1].map_base
    poses = [base, *(vertex.local for vertex in vertices)]
    x = rows_of(poses).ravel()
    P = np.kron(np.eye(len(poses)), _SIGMA).astype(np.float64)
    mapper.belief = Belief(x, P, tuple(vertex.id for vertex in vertices))
    places = np.array([keyframe.map_base.position for keyframe in keyframes])
    seen = []
    for vertex in vertices:
        nearest = int(np.hypot(*(places - vertex.local.position).T).argmin())
        base_vertex = keyframes[nearest].map_base.to(vertex.local)
        seen.append(Observation(nearest, vertex.id, base_vertex, _SIGMA))
    mapper.observations.extend(sorted(seen, key=lambda observation: observation.keyframe))
