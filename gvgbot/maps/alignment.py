"""Two maps of one place: how the second lies in the first, and which vertices and edges they share.

Maps begin where their robots began, so the frames may differ by any turn and shift. Edges whose
ends are as far apart suggest some; the one that lays most vertices on each other wins.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from gvgbot.geometry import Array, Pose, resampled
from gvgbot.maps.moved import moved_graph
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode
from gvgbot.registration import assigned, rigid_fit

_MOST_TRIES = 4000  # the longest edges come first: they give the best angles
_FITS = 10  # rounds of pairing and fitting, more than were ever needed
_STEP_M = 0.05  # between points of an edge
_KIND_M = 1e3  # how far apart vertices of two kinds count to be

Complex = NDArray[np.complex128]


Pair = tuple[int, int, float]


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """What two maps share, and what only one has.

    `graphs` are both in the frame of the first; `a_b` is the pose of the second's own frame there.
    Pairs of `vertices` and of `edges` are indices into the first and the second, and how far they
    are apart (m): of edges, their farthest points.
    """

    graphs: tuple[RouteGraph, RouteGraph]
    a_b: Pose
    vertices: tuple[Pair, ...]
    edges: tuple[Pair, ...]

    def lone_vertices(self, which: int) -> tuple[RouteNode, ...]:
        """The vertices that only map 0 or only map 1 has."""
        paired = {pair[which] for pair in self.vertices}
        vertices = self.graphs[which].vertices
        return tuple(vertex for k, vertex in enumerate(vertices) if k not in paired)

    def lone_edges(self, which: int) -> tuple[RouteEdge, ...]:
        """The edges that only map 0 or only map 1 has."""
        paired = {pair[which] for pair in self.edges}
        edges = self.graphs[which].edges
        return tuple(edge for k, edge in enumerate(edges) if k not in paired)

    @property
    def is_equal(self) -> bool:
        """Whether each map has all that the other has."""
        return not any(self.lone_vertices(k) or self.lone_edges(k) for k in (0, 1))


def compare(a: RouteGraph, b: RouteGraph, tolerance: float) -> Comparison:
    """What is the same in both: within the tolerance (m), once the second is laid on the first."""
    a_b = _alignment(a, b, tolerance)
    b = moved_graph(b, a_b)
    vertices = _partners(_marked(a), _marked(b), tolerance)
    names = {b.vertices[j].id: a.vertices[i].id for i, j, _ in vertices}
    edges = _paired(_edge_distances(a, b, names, tolerance), tolerance)
    return Comparison((a, b), a_b, tuple(vertices), tuple(edges))


def _alignment(a: RouteGraph, b: RouteGraph, reach: float) -> Pose:
    """The pose of b's frame in a's; if two do as well, the one in which the frames are the same."""
    fits = [_fitted(_marked(a), _marked(b), pose, reach) for pose in (Pose(), _best(a, b, reach))]
    return max(fits, key=lambda pose: len(_partners(_marked(a), _moved(_marked(b), pose), reach)))


def _fitted(a: Array, b: Array, pose: Pose, reach: float) -> Pose:
    """The pose that lays partners on each other best, as long as there are two pairs."""
    for _ in range(_FITS):
        pairs = _partners(a, _moved(b, pose), reach)
        if len(pairs) < 2:
            return pose
        ours, theirs = [i for i, _, _ in pairs], [j for _, j, _ in pairs]
        pose, _ = rigid_fit(a[ours, :2], b[theirs, :2])
    return pose


def _best(a: RouteGraph, b: RouteGraph, reach: float) -> Pose:
    """The pose, of those that an edge of each suggests, which brings most vertices together."""
    turns, shifts = _suggestions(_ends(a), _ends(b), reach)
    if not len(turns):
        return Pose()
    marked = _marked(b)
    moved = turns[:, None] * _as_complex(marked) + shifts[:, None]
    kinds = np.broadcast_to(marked[:, 2], moved.shape)
    distances, _ = KDTree(_marked(a)).query(np.stack([moved.real, moved.imag, kinds], axis=-1))
    best = int(np.argmax(np.maximum(0.0, 1.0 - (distances / reach) ** 2).sum(axis=1)))
    return Pose(float(shifts[best].real), float(shifts[best].imag), float(np.angle(turns[best])))


def _suggestions(a: Complex, b: Complex, reach: float) -> tuple[Complex, Complex]:
    """Turns and shifts (N,) that lay an edge (2,) of b on one of a, either way round."""
    b = np.concatenate([b, b[:, ::-1]])
    way_a, way_b = (ends[:, 1] - ends[:, 0] for ends in (a, b))
    unlike = np.abs(np.abs(way_a)[:, None] - np.abs(way_b))
    i, j = np.nonzero((unlike < reach) & (np.abs(way_a)[:, None] > reach) & (np.abs(way_b) > reach))
    longest = np.argsort(-np.abs(way_a[i]), kind="stable")[:_MOST_TRIES]
    i, j = i[longest], j[longest]
    turns = way_a[i] / way_b[j]
    turns /= np.abs(turns)
    return turns, a[i].mean(axis=1) - turns * b[j].mean(axis=1)


def _partners(a: Array, b: Array, reach: float) -> list[Pair]:
    """Vertices (N, 3) of both that belong together, with their distances."""
    return _paired(cdist(a, b), reach)


def _paired(distances: Array, reach: float) -> list[Pair]:
    """Rows and columns, each once, so that the sum of distances within reach is least."""
    return [(i, j, float(distances[i, j])) for i, j in assigned(distances, reach)]


def _edge_distances(a: RouteGraph, b: RouteGraph, names: dict[int, int], reach: float) -> Array:
    """How far apart (m) edges are that join the same vertices; all others are out of reach."""
    distances = np.full((len(a.edges), len(b.edges)), reach)
    for i, edge in enumerate(a.edges):
        for j, other in enumerate(b.edges):
            if {edge.start, edge.end} == {names.get(other.start), names.get(other.end)}:
                distances[i, j] = max(_farthest(edge, other), _farthest(other, edge))
    return distances


def _farthest(edge: RouteEdge, other: RouteEdge) -> float:
    """How far (m) the point of an edge that is farthest from another is from it."""
    points, begins = resampled(edge.polyline, _STEP_M)[:, None], other.polyline[:-1]
    ways = np.diff(other.polyline, axis=0)
    squares = np.maximum((ways**2).sum(axis=1), np.finfo(float).tiny)
    shares = np.clip(((points - begins) * ways).sum(axis=2) / squares, 0.0, 1.0)
    gaps = points - (begins + shares[..., None] * ways)
    return float(np.hypot(gaps[..., 0], gaps[..., 1]).min(axis=1).max())


def _ends(graph: RouteGraph) -> Complex:
    """The ends (N, 2) of every edge, as x + iy."""
    positions = {vertex.id: complex(*vertex.position) for vertex in graph.vertices}
    ends = [(positions[edge.start], positions[edge.end]) for edge in graph.edges]
    return np.array(ends, np.complex128).reshape(-1, 2)


def _marked(graph: RouteGraph) -> Array:
    """The vertices (N, 3): x, y, and a third coordinate that keeps the kinds apart."""
    rows = [(*v.position, _KIND_M * (v.kind == "endpoint")) for v in graph.vertices]
    return np.array(rows, np.float64).reshape(-1, 3)


def _moved(marked: Array, pose: Pose) -> Array:
    return np.column_stack([pose.transform(marked[:, :2]), marked[:, 2]])


def _as_complex(points: Array) -> Complex:
    number: Complex = points[:, 0] + 1j * points[:, 1]
    return number
