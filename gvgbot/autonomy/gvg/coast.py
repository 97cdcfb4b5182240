"""The Extended Voronoi Graph: where no two walls are near enough, one is followed at a distance.

In a hall larger than the laser sees, the middle between the walls cannot be known. There the graph
goes along the coast: the line at a fixed distance R from the nearest wall. A ridge of the Voronoi
diagram is cut where the clearance on it reaches R; each cut touches the circles of radius R around
the ridge's two generators, and the arcs between neighbouring cuts of one generator, as far as no
other generator is nearer, make up the coast. (Beeson, Jong, Kuipers: Towards autonomous topological
place detection using the extended Voronoi graph, ICRA 2005.)
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gvgbot.geometry import Array

_ARC_M = 0.3  # a longer arc is made of pieces
_TOUCH_M = 1e-6  # what numbers cannot tell from lying on the coast

Indices = NDArray[np.int64]


class Space(Protocol):
    """What is known of a place, such as a local map."""

    def points(self) -> Array:
        """Points of the walls (N, 2)."""

    def known(self, points: Array) -> NDArray[np.bool_]:
        """Whether something is known where each point (..., 2) is."""


@dataclass(frozen=True, slots=True, eq=False)
class Diagram:
    """Points (N, 2) with clearance (N,), linked by ridges from `a` to `b` (M,).

    `certain` (N,) is whether the robot surely fits there, of those where a ridge that counts ends.
    `b` is -1 where a ridge goes on without end. `generators` (M, 2) are the two that a ridge lies
    between, `parts` (M,) whether the robot can tell them apart and fits between.
    """

    points: Array
    clearance: Array
    certain: NDArray[np.bool_]
    a: Indices
    b: Indices
    generators: NDArray[np.int32]
    parts: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class _Cuts:
    """Where ridges reach the coast: points (K, 2), and the ridge (K,) of each."""

    points: Array
    ridge: Indices


def with_coast(
    diagram: Diagram, walls: Array, radius: float, space: Space
) -> tuple[Array, Array, Indices] | None:
    """The coast at `radius` m from the walls (G, 2), and the diagram as far as it is within.

    Returns points (N', 2), the diagram's own first, clearance (N',) and links (L, 2); None where
    no such open space is in sight.
    """
    cuts = _cuts(diagram, walls, radius)
    if not space.known(cuts.points).any():
        return None
    ridges = _cut_ridges(diagram, cuts, radius)
    arcs, bends = _arcs(diagram, walls, cuts, radius)
    arcs += len(diagram.points)
    points = np.concatenate([diagram.points, cuts.points, bends])
    clearance = np.concatenate([diagram.clearance, np.full(len(cuts.points) + len(bends), radius)])
    return points, clearance, np.concatenate([ridges, arcs])


def _cuts(diagram: Diagram, walls: Array, radius: float) -> _Cuts:
    a, b = diagram.a, diagram.b
    is_far = diagram.clearance > radius - _TOUCH_M
    far = ((b < 0) | is_far.take(a) | is_far.take(b)).nonzero()[0]  # of those that end, at one end
    p, q = walls.take(diagram.generators.take(far, axis=0).T, axis=0)
    middle, half = (p + q) / 2, np.hypot(*(q - p).T) / 2
    across = (q - p) / (2 * half)[:, None]
    direction = np.stack([-across[:, 1], across[:, 0]], axis=1)
    a, b = a.take(far), b.take(far)
    start, end = (_along(diagram.points.take(i, axis=0) - middle, direction) for i in (a, b))
    out = (b < 0).nonzero()[0]  # of the hull
    inside = np.einsum("ij->j", walls) / len(walls)  # faster than mean()
    end[out] = -np.copysign(np.inf, _along(inside - middle[out], direction[out]))
    low, high = np.minimum(start, end), np.maximum(start, end)
    away = np.sqrt(np.maximum(radius**2 - half**2, 0.0))
    cut, along = [], []
    for side in (-away, away):
        hit = ((half < radius) & (low < side) & (side < high)).nonzero()[0]
        cut.append(hit)
        along.append(side[hit])
    cuts, places = np.concatenate(cut), np.concatenate(along)
    return _Cuts(middle[cuts] + places[:, None] * direction[cuts], far[cuts])


def _along(ways: Array, directions: Array) -> Array:
    """How far ways (N, 2) lead in directions (N, 2), m."""
    x, y = (ways * directions).T
    return np.asarray(x + y)


def _cut_ridges(diagram: Diagram, cuts: _Cuts, radius: float) -> Indices:
    """Links (L, 2) along what lies within the coast of the ridges that part two walls."""
    first = len(diagram.points)
    count = np.bincount(cuts.ridge, minlength=len(diagram.a))
    whole = diagram.parts & (count == 0) & (diagram.b >= 0)
    whole &= diagram.clearance[diagram.a] <= radius
    links = [np.stack([diagram.a[whole], diagram.b[whole]], axis=1)]
    single = np.flatnonzero((count[cuts.ridge] == 1) & diagram.parts[cuts.ridge])
    ridge = cuts.ridge[single]
    a, b = diagram.a[ridge], diagram.b[ridge]
    inner = np.where((b < 0) | (diagram.clearance[a] <= radius), a, b)
    links.append(np.stack([inner, first + single], axis=1))
    double = np.flatnonzero((count[cuts.ridge] == 2) & diagram.parts[cuts.ridge])
    pairs = double[np.argsort(cuts.ridge[double], kind="stable")].reshape(-1, 2)
    links.append(first + pairs)
    return np.concatenate(links)


def _arcs(diagram: Diagram, walls: Array, cuts: _Cuts, radius: float) -> tuple[Indices, Array]:
    """Links (L, 2) between cuts, and between them and the bends (B, 2) numbered after them."""
    owner = diagram.generators[cuts.ridge].T.ravel()
    cut = np.tile(np.arange(len(cuts.points)), 2)
    offset = cuts.points[cut] - walls[owner]
    angle = np.arctan2(offset[:, 1], offset[:, 0])
    order = np.lexsort((angle, owner))
    owner, cut, angle = owner[order], cut[order], angle[order]
    begins = np.flatnonzero(np.r_[True, owner[1:] != owner[:-1]]) if len(owner) else owner
    after = np.arange(1, len(owner) + 1)
    after[np.r_[begins[1:], len(owner)] - 1] = begins  # round to the first of the same generator
    turn = (angle[after] - angle) % (2 * np.pi)
    turn[after == np.arange(len(owner))] = 2 * np.pi
    centre = walls[owner]
    halfway = _on_circle(centre, angle + turn / 2, radius)
    free = cKDTree(walls).query(halfway)[0] >= radius - _TOUCH_M if len(halfway) else turn > 0
    links: list[tuple[int, int]] = []
    bends = [np.empty((0, 2))]
    serial = len(cuts.points)
    for i in np.flatnonzero(free).tolist():
        pieces = max(1, int(np.ceil(radius * turn[i] / _ARC_M)))
        at = angle[i] + turn[i] * np.arange(1, pieces) / pieces
        bends.append(_on_circle(centre[i], at, radius))
        chain = [cut[i], *range(serial, serial + pieces - 1), cut[after[i]]]
        serial += pieces - 1
        links += pairwise(chain)
    return np.array(links, np.int64).reshape(-1, 2), np.concatenate(bends)


def _on_circle(centre: Array, angle: Array, radius: float) -> Array:
    return centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
