"""Voronoi diagram of the local map's points, reduced to what is certain and passable.

A Voronoi vertex whose maximal disc lies wholly in known space is a point of the real GVG, whatever
the unseen rest of the building looks like; nothing else is used.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from gvgbot.autonomy.gvg.coast import Diagram, Space, with_coast
from gvgbot.autonomy.gvg.triangulation import Triangulation, delaunay
from gvgbot.autonomy.virtual_walls import nearest_before
from gvgbot.geometry import Array

_RING = np.stack([f(np.arange(16) * np.pi / 8) for f in (np.cos, np.sin)], axis=1)
_WITHIN = np.concatenate([0.5 * _RING[::2], np.zeros((1, 2))])
_SIDES = (1, 2, 2, 0, 0, 1)  # corners of a triangle's sides, of which each lies opposite to one
_RIM_M = 0.2  # of a maximal disc, two cells: its walls may hide that
_MAX_UNKNOWN = 1  # of the sampled points of a disc
_CRUMB, _CRUMB_LOSES_M = 4, 2.0  # fewer points lose against a real piece so much farther off
_INFINITE_M = 1e6  # to the centre of a circle around three points on a line
_NOTHING: Array = np.empty((0, 2))
_LONG_RIDGE_M, _STEP_M, _FARTHEST_M = 1.0, 0.2, 8.0  # of ridges that end in the unknown


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
    local_map: Space,
    robot: Array,
    *,
    min_clearance: float,
    roughness: float,
    open_clearance: float = np.inf,
    felt: Array = _NOTHING,
    virtual_walls: Array = _NOTHING,
) -> FineGraph:
    """The certain Voronoi graph around the robot (2,); EMPTY where there is none.

    A ridge counts if the robot (of radius `min_clearance`) fits between its two generators, and if
    they cannot be two bumps of one flat wall: a disc of radius r touches two bumps of height h on a
    wall if they are less than sqrt(8 h r) apart. `roughness` is that h, m. Ridges that could be of
    such bumps count where they lead from some that could not to others: the way from a door into
    the middle of a room is that of its two posts. Farther from all walls than `open_clearance` m,
    the graph goes along the coast instead. `felt` are obstacles (N, 2) that the map does not show,
    and `virtual_walls` those of them that the robot sees beyond, but must not cross.
    """
    triangulation = delaunay(np.concatenate([local_map.points(), felt]))
    if triangulation is None:
        return EMPTY
    room = _Room(local_map, triangulation.points, min_clearance, open_clearance)
    diagram = _diagram(triangulation, room, roughness)
    points, clearance, links, endless = _ridges_that_count(diagram, room)
    certain, new = diagram.certain, slice(len(diagram.certain), None)  # those of the coast
    if len(points[new]):
        certain = np.concatenate([certain, room.is_certain(points[new], clearance[new])])
    here, there = certain[links.T]
    rim = np.concatenate([links[here & ~there], links[there & ~here, ::-1]])
    rim = rim[clearance[rim[:, 1]] >= min_clearance]
    endless = endless[certain[diagram.a[endless]]]
    away = _FARTHEST_M * _outwards(triangulation, diagram, endless) if len(endless) else _NOTHING
    rays = _Rays(
        np.concatenate([rim[:, 0], diagram.a[endless]]),
        np.concatenate([points[rim[:, 1]] - points[rim[:, 0]], away]),
    )
    whole = _prolonged(points, clearance, links[here & there], rays, room)
    return _piece_of_robot(*whole, robot, virtual_walls)


class _Room(NamedTuple):
    """What is known around the generators (N, 2), and how much room the robot wants.

    Its discs are those with a radius, m, from `min_clearance` to `open_clearance`.
    """

    local_map: Space
    generators: Array
    min_clearance: float
    open_clearance: float

    def is_certain(self, centres: Array, clearance: Array) -> NDArray[np.bool_]:
        """Which maximal discs, by centres (N, 2) and radii (N,), are such and surely there."""
        fits = (clearance >= self.min_clearance) & (clearance <= self.open_clearance)
        discs = fits.nonzero()[0]
        centres, radii = centres.take(discs, axis=0), clearance.take(discs)
        fits[discs] = _disc_is_known(self.local_map, centres, radii)
        return fits


class _Rays(NamedTuple):
    """Ridges of which one end is certain: that end (N,), and the way (N, 2) to the other one."""

    start: NDArray[np.int64]
    way: Array


def _diagram(triangulation: Triangulation, room: _Room, roughness: float) -> Diagram:
    """The whole Voronoi diagram, and which ridges count, by the rules of `fine_graph`."""
    generators = triangulation.points
    points, clearance = _circumcircles(generators, triangulation.triangles)
    a, b, pair = _ridges(triangulation)
    p, q = (generators.take(pair[:, k], axis=0) for k in (0, 1))
    wide = _far_apart(p, q, 2 * room.min_clearance)
    p, q = p.take(wide, axis=0), q.take(wide, axis=0)
    narrowest = _least_clearance(points, clearance, a.take(wide), b.take(wide), p, q)
    is_rough = np.hypot(*(p - q).T) < np.sqrt(8 * roughness * narrowest)
    smooth, rough = wide[~is_rough], wide[is_rough & (b.take(wide) >= 0)]
    parts = np.zeros(len(pair), bool)
    parts[smooth] = True
    touched = np.zeros(len(points), bool)
    touched[a[smooth]] = touched[b[smooth][b[smooth] >= 0]] = True
    certain = touched.copy()
    links = np.stack([a[rough], b[rough]])
    certain[links] = True
    ends = certain.nonzero()[0]
    certain[ends] = room.is_certain(points.take(ends, axis=0), clearance.take(ends))
    sure = certain[links].all(axis=0)
    parts[rough[sure]] = _bridging(links[:, sure], touched)
    return Diagram(points, clearance, certain, a, b, pair, parts)


def _far_apart(p: Array, q: Array, least: float) -> NDArray[np.intp]:
    """Which of the points p and q (N, 2) are at least so many metres apart."""
    dx, dy = (p - q).T
    far: NDArray[np.intp] = (dx * dx + dy * dy >= least * least).nonzero()[0]
    return far


def _bridging(links: NDArray[np.int64], touched: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which links (2, M) of points hang together between two points that are `touched` (N,)."""
    if not links.size:
        return np.zeros(0, bool)
    ends, numbered = np.unique(links, return_inverse=True)
    i, j = numbered.reshape(2, -1)
    piece = _pieces(i, j, len(ends))
    is_bridge: NDArray[np.bool_] = np.bincount(piece, touched[ends], len(ends))[piece[i]] > 1
    return is_bridge


def _pieces(i: NDArray[np.int64], j: NDArray[np.int64], count: int) -> NDArray[np.intp]:
    """The first point of the connected piece of each of so many, by links from i to j (M,).

    For some hundred links that is several times faster than scipy's sparse matrices.
    """
    before = list(range(count))  # of each point one of its piece, until that is the first
    for link in zip(i.tolist(), j.tolist(), strict=True):
        a, b = link
        while before[a] != a:
            before[a] = a = before[before[a]]
        while before[b] != b:
            before[b] = b = before[before[b]]
        if a < b:
            before[b] = a
        else:
            before[a] = b
    for point, other in enumerate(before):
        before[point] = before[other]
    return np.array(before, np.intp)


def _ridges_that_count(
    diagram: Diagram, room: _Room
) -> tuple[Array, Array, NDArray[np.int64], NDArray[np.int64]]:
    """Points (N, 2), clearance (N,) and links (M, 2), and which ridges (K,) go on without end.

    In the open they are those of the coast, where all ridges end.
    """
    is_whole = diagram.b >= 0
    endless = (diagram.parts & ~is_whole).nonzero()[0]
    if np.isfinite(room.open_clearance):
        coast = with_coast(diagram, room.generators, room.open_clearance, room.local_map)
        if coast is not None:
            return *coast, endless[:0]
    whole = (diagram.parts & is_whole).nonzero()[0]
    links = np.stack([diagram.a[whole], diagram.b[whole]], axis=1)
    return diagram.points, diagram.clearance, links, endless


def _outwards(triangulation: Triangulation, diagram: Diagram, endless: NDArray[np.int64]) -> Array:
    """Directions (N, 2) of ridges (N,) without end, square to the hull and away from it."""
    p, q = (triangulation.points[diagram.generators[endless, k]] for k in (0, 1))
    along = q - p
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    normal /= np.hypot(*normal.T)[:, None]
    corners = triangulation.triangles[diagram.a[endless]]
    inner = triangulation.points[corners].mean(axis=1)
    normal[((inner - p) * normal).sum(axis=1) > 0] *= -1
    return normal


def _prolonged(
    points: Array,
    clearance: Array,
    links: NDArray[np.int64],
    rays: _Rays,
    room: _Room,
) -> tuple[Array, Array, NDArray[np.int64], Array]:
    """Points, clearance, links and leads, with what is certain of ridges that end in the unknown.

    Between two corners with nothing behind them a ridge is long, and has no points of its own.
    """
    length = np.hypot(*rays.way.T)
    unit = rays.way / np.maximum(length, 1e-9)[:, None]
    long = (length > _LONG_RIDGE_M).nonzero()[0]
    if not len(long):
        lead = np.full(len(points), np.nan)
        lead[rays.start] = _direction(rays.way)
        return points, clearance, links, lead
    steps = np.arange(_STEP_M, _FARTHEST_M, _STEP_M)
    places = points[rays.start[long], None] + steps[:, None] * unit[long, None]
    seen = steps < length[long, None]
    radius = np.zeros(seen.shape)
    radius[seen] = _clearance(places[seen], room.generators)
    seen[seen] = room.is_certain(places[seen], radius[seen])
    seen = np.logical_and.accumulate(seen, axis=1)
    number = np.full(seen.shape, -1)
    number[seen] = len(points) + np.arange(np.count_nonzero(seen))
    chain = np.concatenate([rays.start[long, None], number], axis=1)
    onwards = chain[:, 1:] >= 0
    lead = np.full(len(points) + np.count_nonzero(seen), np.nan)
    end = rays.start.copy()
    end[long] = chain[np.arange(len(long)), onwards.sum(axis=1)]
    lead[end] = _direction(rays.way)
    return (
        np.concatenate([points, places[seen]]),
        np.concatenate([clearance, radius[seen]]),
        np.concatenate([links, np.stack([chain[:, :-1][onwards], chain[:, 1:][onwards]], axis=1)]),
        lead,
    )


def _clearance(places: Array, walls: Array) -> Array:
    """How far places (N, 2) are from the nearest of walls (M, 2); they are too few for a tree."""
    clearance: Array = np.sqrt(cdist(places, walls, "sqeuclidean").min(axis=1))
    return clearance


def _direction(vectors: Array) -> Array:
    """Angles (N,) of vectors (N, 2), rad."""
    angles: Array = np.arctan2(vectors[:, 1], vectors[:, 0])
    return angles


def _circumcircles(generators: Array, triangles: NDArray[np.int32]) -> tuple[Array, Array]:
    """Centres (N, 2) and radii (N,) around triangles (N, 3); infinite for degenerate ones."""
    x, y = generators.T.take(triangles.T, axis=1)
    bx, by, cx, cy = x[1] - x[0], y[1] - y[0], x[2] - x[0], y[2] - y[0]
    cross = 2 * (bx * cy - by * cx)
    bb, cc = bx * bx + by * by, cx * cx + cy * cy
    with np.errstate(divide="ignore", invalid="ignore"):
        dx, dy = (cy * bb - by * cc) / cross, (bx * cc - cx * bb) / cross
    is_line = ~(np.isfinite(dx) & np.isfinite(dy))
    dx[is_line] = dy[is_line] = _INFINITE_M
    return np.stack([x[0] + dx, y[0] + dy], axis=1), np.hypot(dx, dy)


def _disc_is_known(local_map: Space, centres: Array, radii: Array) -> NDArray[np.bool_]:
    """Whether the maximal discs, but for a rim of two cells, lie in known space."""
    outer = np.maximum(radii - _RIM_M, 0.5 * radii)
    unknown = _unknown(local_map, centres, outer, _WITHIN)
    hopeful = (unknown <= _MAX_UNKNOWN).nonzero()[0]
    centres, outer = centres.take(hopeful, axis=0), outer.take(hopeful)
    unknown[hopeful] += _unknown(local_map, centres, outer, _RING)
    return unknown <= _MAX_UNKNOWN


def _unknown(local_map: Space, centres: Array, radii: Array, places: Array) -> NDArray[np.int64]:
    """How many of the places (K, 2) of a unit disc lie in unknown space, for each disc (N,)."""
    # the discs last, of which there are far more than places, so that NumPy's loops are long
    x_y = centres.T[:, None, :] + places.T[:, :, None] * radii
    known = local_map.known(x_y.transpose(1, 2, 0)).sum(axis=0, dtype=np.uint8)
    return np.asarray(len(places) - known.astype(np.int64))


def _ridges(
    triangulation: Triangulation,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int32]]:
    """Triangles (a, b) that share an edge, b = -1 at the hull, and the edge's two generators."""
    triangles = triangulation.triangles
    other = triangulation.neighbours.ravel()
    own = np.repeat(np.arange(len(triangles)), 3)
    once = ((own < other) | (other < 0)).nonzero()[0]
    pair = triangles.take(_SIDES, axis=1).reshape(-1, 2).take(once, axis=0)
    return own.take(once), other.take(once).astype(np.int64), pair


def _least_clearance(
    centres: Array, clearance: Array, a: NDArray[np.int64], b: NDArray[np.int64], p: Array, q: Array
) -> Array:
    """Least clearance along ridges from centre a to centre b between the generators p and q.

    A ridge that passes between its generators is a door: it is half their distance wide there.
    """
    near, middle = centres.take(a, axis=0), (p + q) / 2
    far = np.where((b < 0)[:, None], 2 * p - near, centres.take(b, axis=0))
    x, y = ((near - middle) * (far - middle)).T
    between = x + y < 0
    ends = np.minimum(clearance.take(a), np.where(b < 0, np.inf, clearance.take(b)))
    return np.where(between, np.hypot(*(p - q).T) / 2, ends)


def _piece_of_robot(
    centres: Array,
    clearance: Array,
    ridges: NDArray[np.int64],
    lead: Array,
    robot: Array,
    virtual_walls: Array,
) -> FineGraph:
    """The connected piece that is nearest to the robot, with no virtual walls (N, 2) between."""
    if len(ridges) == 0:
        return EMPTY
    used = np.zeros(len(centres), bool)
    used[ridges] = True
    nodes = used.nonzero()[0]
    ridges = (used.cumsum() - 1).take(ridges)
    piece = _pieces(ridges[:, 0], ridges[:, 1], len(nodes))
    places = centres.take(nodes, axis=0)
    distance = np.hypot(*(places - robot).T)
    size = np.bincount(piece)
    distance[size[piece] < _CRUMB] += _CRUMB_LOSES_M
    nearest = nearest_before(virtual_walls, robot, places, distance)
    if nearest is None:
        return EMPTY
    keep = piece == piece[nearest]
    renumber = keep.cumsum() - 1
    inside = keep[ridges[:, 0]]
    nodes = nodes[keep]
    return FineGraph(
        centres.take(nodes, axis=0),
        clearance.take(nodes),
        renumber.take(ridges[inside]),
        lead.take(nodes),
    )
