"""Voronoi diagram of the local map's points, reduced to what is certain and passable.

A Voronoi vertex whose maximal disc lies wholly in known space is a point of the real GVG, whatever
the unseen rest of the building looks like; nothing else is used.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay, QhullError

from gvgbot.autonomy.gvg.coast import Diagram, with_coast
from gvgbot.autonomy.gvg.local_map import LocalMap
from gvgbot.geometry import Array

_RING = np.stack([f(np.arange(16) * np.pi / 8) for f in (np.cos, np.sin)], axis=1)
_MAX_UNKNOWN = 1  # of the sampled points of a disc
_NOTHING: Array = np.empty((0, 2))


@dataclass(frozen=True, slots=True, eq=False)
class FineGraph:
    """Voronoi vertices and ridges of one connected piece, local frame.

    points (N, 2) m, clearance (N,) m, ridges (M, 2) indices into points, and for each point the
    direction (rad) in which the diagram goes on from there into unknown space, NaN if it does not.
    """

    points: Array
    clearance: Array
    ridges: NDArray[np.int64]
    lead: Array


EMPTY = FineGraph(np.empty((0, 2)), np.empty(0), np.empty((0, 2), np.int64), np.empty(0))


def fine_graph(
    local_map: LocalMap,
    robot: Array,
    *,
    min_clearance: float,
    roughness: float,
    open_clearance: float = np.inf,
    felt: Array = _NOTHING,
) -> FineGraph:
    """The certain Voronoi graph around the robot (2,); EMPTY where there is none.

    A ridge counts if the robot (of radius `min_clearance`) fits between its two generators, and if
    they cannot be two bumps of one flat wall: a disc of radius r touches two bumps of height h on a
    wall if they are less than sqrt(8 h r) apart. `roughness` is that h, m. Farther from all walls
    than `open_clearance` m, the graph goes along the coast instead. `felt` are obstacles (N, 2)
    that the map does not show.
    """
    generators = np.concatenate([local_map.points(), felt])
    if len(generators) < 4:
        return EMPTY
    try:
        triangles = Delaunay(generators)
    except QhullError:
        return EMPTY
    points, clearance = _circumcircles(generators[triangles.simplices])
    a, b, pair = _ridges(triangles)
    p, q = generators[pair[:, 0]], generators[pair[:, 1]]
    chord = np.hypot(*(p - q).T)
    narrowest = _least_clearance(points, clearance, a, b, p, q)
    parts = chord >= np.maximum(2 * min_clearance, np.sqrt(8 * roughness * narrowest))
    endless = parts & (b < 0)
    links = np.stack([a, b], axis=1)[parts & ~endless]
    if np.isfinite(open_clearance):
        diagram = Diagram(points, clearance, a, b, pair, parts)
        coast = with_coast(diagram, generators, open_clearance, local_map)
        if coast is not None:
            points, clearance, links = coast
    wide = clearance >= min_clearance
    near = wide & (clearance <= open_clearance)
    certain = np.zeros(len(points), bool)
    certain[near] = _disc_is_known(local_map, points[near], clearance[near])
    lead = np.full(len(points), np.nan)
    for here, there in ((links[:, 0], links[:, 1]), (links[:, 1], links[:, 0])):
        out = certain[here] & wide[there] & ~certain[there]
        lead[here[out]] = _direction(points[there[out]] - points[here[out]])
    out = endless & certain[a]
    lead[a[out]] = _direction((p[out] + q[out]) / 2 - points[a[out]])
    joined = certain[links].all(axis=1)
    return _piece_of_robot(points, clearance, links[joined], lead, robot)


def _direction(vectors: Array) -> Array:
    """Angles (N,) of vectors (N, 2), rad."""
    angles: Array = np.arctan2(vectors[:, 1], vectors[:, 0])
    return angles


def _circumcircles(corners: Array) -> tuple[Array, Array]:
    """Centres (N, 2) and radii (N,) of triangles (N, 3, 2); infinite for degenerate ones."""
    a, b, c = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    cross = 2 * (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        bb, cc = (b * b).sum(axis=1), (c * c).sum(axis=1)
        x = (c[:, 1] * bb - b[:, 1] * cc) / cross
        y = (b[:, 0] * cc - c[:, 0] * bb) / cross
    offset = np.stack([x, y], axis=1)
    offset[~np.isfinite(offset).all(axis=1)] = 1e6
    return a + offset, np.hypot(offset[:, 0], offset[:, 1])


def _disc_is_known(local_map: LocalMap, centres: Array, radii: Array) -> NDArray[np.bool_]:
    """Whether the maximal discs, but for a rim of two cells, lie in known space."""
    outer = np.maximum(radii - 0.2, 0.5 * radii)
    rings = np.concatenate([_RING, 0.5 * _RING[::2], np.zeros((1, 2))])
    samples = centres[:, None, :] + outer[:, None, None] * rings
    unknown: NDArray[np.int64] = (~local_map.known(samples)).sum(axis=1)
    return unknown <= _MAX_UNKNOWN


def _ridges(triangles: Delaunay) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int32]]:
    """Triangles (a, b) that share an edge, b = -1 at the hull, and the edge's two generators."""
    own = np.repeat(np.arange(len(triangles.simplices)), 3)
    other = triangles.neighbors.ravel().astype(np.int64)
    pair = triangles.simplices[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
    once = (own < other) | (other < 0)
    return own[once], other[once], pair[once]


def _least_clearance(
    centres: Array, clearance: Array, a: NDArray[np.int64], b: NDArray[np.int64], p: Array, q: Array
) -> Array:
    """Least clearance along ridges from centre a to centre b between the generators p and q.

    A ridge that passes between its generators is a door: it is half their distance wide there.
    """
    far = np.where((b < 0)[:, None], 2 * p - centres[a], centres[b])
    middle = (p + q) / 2
    between = ((centres[a] - middle) * (far - middle)).sum(axis=1) < 0
    ends = np.minimum(clearance[a], np.where(b < 0, np.inf, clearance[b]))
    return np.where(between, np.hypot(*(p - q).T) / 2, ends)


def _piece_of_robot(
    centres: Array, clearance: Array, ridges: NDArray[np.int64], lead: Array, robot: Array
) -> FineGraph:
    """The connected piece that is nearest to the robot."""
    nodes = np.unique(ridges)
    if len(nodes) == 0:
        return EMPTY
    number = np.full(len(centres), -1)
    number[nodes] = np.arange(len(nodes))
    ridges = number[ridges]
    n = len(nodes)
    links = coo_array((np.ones(len(ridges)), (ridges[:, 0], ridges[:, 1])), (n, n))
    _, piece = connected_components(links, directed=False)
    distance = np.hypot(*(centres[nodes] - robot).T)
    size = np.bincount(piece)
    distance[size[piece] < 4] += 2.0  # crumbs lose against a real piece nearby
    keep = piece == piece[np.argmin(distance)]
    renumber = np.cumsum(keep) - 1
    inside = keep[ridges[:, 0]]
    return FineGraph(
        centres[nodes[keep]],
        clearance[nodes[keep]],
        renumber[ridges[inside]],
        lead[nodes[keep]],
    )
