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
_WITHIN = np.concatenate([0.5 * _RING[::2], np.zeros((1, 2))])
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
    points, clearance = _circumcircles(generators, triangles.simplices)
    a, b, pair = _ridges(triangles)
    p, q = generators[pair[:, 0]], generators[pair[:, 1]]
    chord = np.hypot(*(p - q).T)
    parts = chord >= 2 * min_clearance
    narrowest = _least_clearance(points, clearance, a[parts], b[parts], p[parts], q[parts])
    parts[parts] = chord[parts] >= np.sqrt(8 * roughness * narrowest)
    endless = np.flatnonzero(parts & (b < 0))
    links = np.stack([a, b], axis=1)[parts & (b >= 0)]
    if np.isfinite(open_clearance):
        diagram = Diagram(points, clearance, a, b, pair, parts)
        coast = with_coast(diagram, generators, open_clearance, local_map)
        if coast is not None:
            points, clearance, links = coast
    wide = clearance >= min_clearance
    asked = np.zeros(len(points), bool)
    asked[links] = asked[a[endless]] = True
    asked &= wide & (clearance <= open_clearance)
    certain = np.zeros(len(points), bool)
    certain[asked] = _disc_is_known(local_map, points[asked], clearance[asked])
    lead = np.full(len(points), np.nan)
    for here, there in ((links[:, 0], links[:, 1]), (links[:, 1], links[:, 0])):
        out = certain[here] & wide[there] & ~certain[there]
        lead[here[out]] = _direction(points[there[out]] - points[here[out]])
    out = endless[certain[a[endless]]]
    lead[a[out]] = _direction((p[out] + q[out]) / 2 - points[a[out]])
    joined = certain[links[:, 0]] & certain[links[:, 1]]
    return _piece_of_robot(points, clearance, links[joined], lead, robot)


def _direction(vectors: Array) -> Array:
    """Angles (N,) of vectors (N, 2), rad."""
    angles: Array = np.arctan2(vectors[:, 1], vectors[:, 0])
    return angles


def _circumcircles(generators: Array, triangles: NDArray[np.int32]) -> tuple[Array, Array]:
    """Centres (N, 2) and radii (N,) around triangles (N, 3); infinite for degenerate ones."""
    x, y = (generators[:, k][triangles.T] for k in (0, 1))
    bx, by, cx, cy = x[1] - x[0], y[1] - y[0], x[2] - x[0], y[2] - y[0]
    cross = 2 * (bx * cy - by * cx)
    bb, cc = bx * bx + by * by, cx * cx + cy * cy
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = np.stack([(cy * bb - by * cc) / cross, (bx * cc - cx * bb) / cross], axis=1)
    offset[~(np.isfinite(offset[:, 0]) & np.isfinite(offset[:, 1]))] = 1e6
    centres = np.stack([x[0], y[0]], axis=1) + offset
    return centres, np.hypot(offset[:, 0], offset[:, 1])


def _disc_is_known(local_map: LocalMap, centres: Array, radii: Array) -> NDArray[np.bool_]:
    """Whether the maximal discs, but for a rim of two cells, lie in known space."""
    outer = np.maximum(radii - 0.2, 0.5 * radii)
    unknown = _unknown(local_map, centres, outer, _WITHIN)
    hopeful = np.flatnonzero(unknown <= _MAX_UNKNOWN)
    unknown[hopeful] += _unknown(local_map, centres[hopeful], outer[hopeful], _RING)
    return unknown <= _MAX_UNKNOWN


def _unknown(local_map: LocalMap, centres: Array, radii: Array, places: Array) -> NDArray[np.int64]:
    """How many of the places (K, 2) of a unit disc lie in unknown space, for each disc (N,)."""
    samples = centres[:, None, :] + radii[:, None, None] * places
    unknown: NDArray[np.int64] = (~local_map.known(samples)).sum(axis=1)
    return unknown


def _ridges(triangles: Delaunay) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int32]]:
    """Triangles (a, b) that share an edge, b = -1 at the hull, and the edge's two generators."""
    other = triangles.neighbors.ravel()
    own = np.repeat(np.arange(len(triangles.simplices)), 3)
    once = np.flatnonzero((own < other) | (other < 0))
    corners, side = triangles.simplices.ravel(), once % 3
    first = once - side  # corner of the triangle; a side lies opposite to its own
    pair = np.stack([corners[first + (side + 1) % 3], corners[first + (side + 2) % 3]], axis=1)
    return own[once], other[once].astype(np.int64), pair


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
    if len(ridges) == 0:
        return EMPTY
    used = np.zeros(len(centres), bool)
    used[ridges] = True
    nodes = np.flatnonzero(used)
    ridges = (np.cumsum(used) - 1)[ridges]
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
