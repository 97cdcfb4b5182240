"""Where another robot's map frame lies in one's own, by what both charts share; or doubt.

Stretches of as many metres between vertices that look alike suggest transforms. Each that lays
several vertices on each other is examined: vertices must agree in kind, departures, clearance and
the walls around them, some must hang together by edges of equal length in both charts, and nothing
may speak against it. How much it says that they agree is measured in the building itself: each
chart is laid onto itself in all the wrong ways, and where that often fits, as in a grid of equal
corridors, agreement says little. If what is shared can be laid elsewhere in either chart, it says
nothing.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from gvgbot.autonomy.slam.recognition import match_bearings
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig, Sides, register_coarsely
from gvgbot.geometry import Array, Pose, resampled, wrap_angle
from gvgbot.team.chart import Chart, ChartVertex, thinned

_SAME_M = 0.7  # vertices nearer to each other may be one
_LEAST_BASE_M = 1.0  # between two vertices that suggest a transform
_LENGTH_M, _LENGTH_SHARE = 0.35, 0.03  # by which the same stretch may differ in two charts
_CLEARANCE_M, _CLEARANCE_SHARE = 0.1, 0.03
_BEARING_RAD = 0.7
_BEYOND_M = 1.2  # of a vertex's disc, walls must agree
_SECTORS, _THICK_M = 90, 0.3  # around a vertex; in each, walls farther behind the first are hidden
_WALL_M = 0.15  # a point so near to a wall lies on it
_SHIFT_M, _TURN_RAD = 0.35, 0.1  # by which charts may be bent against each other at a vertex
_LAID_OUT = 3  # rounds of laying walls on walls
_ALIKE_SHARE = 0.85  # of the walls around a vertex, on either side, speaks for it,
_UNLIKE_SHARE = 0.6  # and less than this against it; one robot may not have seen all
_HOPELESS_SHARE = 0.5  # if fewer of them lie twice as near, they need not be laid out further
_FITS = 5  # rounds of pairing and fitting
_LAID_AT_A_TIME = 50_000  # vertices, to find out which transforms promise most
_EXAMINED, _MISFITS = 12, 6  # transforms that are looked at closely, of a chart onto itself
_APART_M, _APART_RAD = 1.0, 0.25  # transforms nearer to each other are the same
_ON_EDGE_M = 0.4  # so near to an edge, a vertex should be known on it
_OFF_VERTEX_M = 1.0  # but not so near to a vertex of that chart
_SPACING_M = 0.2  # of points along an edge, where it is tested for walls
_SPOKEN = 0.55  # share of an edge's clearance that is surely free, whatever the drift
_CROSSING = 0.02  # share of the edges that walls may seem to cross, by the blur of either chart

# Weights are logarithms of how much likelier something is if the transform is right.
_AGREES = 0.9  # probability that a vertex agrees where it should; where it should not, see above
_SEEN_BEFORE = (1.0, 15.0)  # of so many vertices, so many agree by chance in any building
_CROSSED_BEFORE = (15.0, 60.0)  # and of so many metres of edges, so many are crossed by walls
_ONE_CROSSING_M = 3.0  # metres that are crossed together
_AGAINST = 3.0  # a vertex that looks otherwise
_MISSED = 1.5  # one that should be there and is not: either robot may have been mistaken
_FIXED_BY = 2  # pairs that any transform lays on each other
_TRIES = 6.0  # log of how many transforms chance may choose from
_LEAST_PAIRS, _LEAST_CONNECTED, _LEAST_MEETPOINTS = 4, 3, 3
_AGAINST_SHARE = 0.1  # of all vertices that are judged,
_MISSED_SHARE = 0.3
_SURE = 0.995
_MISTAKES = 2  # vertices of either kind do not refute what was sure

_LAYING = ScanMatchingConfig(pair_sigma_m=0.05)  # walls of one chart on those of another
_LAID_FROM_M = (0.6,)  # farther away, in the beginning
_LAID_BY_M = 1.5  # at most, where the other robot has been
_LOOSELY = np.diag([1.0, 1.0, 0.1**2])  # what is known before, where walls tell nothing

Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """The pose of another chart's frame in one's own, with covariance (3, 3), and what tells it.

    `pairs` are ids of vertices that are one and the same, ours first.
    """

    pose: Pose
    covariance: Array
    pairs: tuple[tuple[int, int], ...]
    confidence: float

    @property
    def is_sure(self) -> bool:
        """Whether to act on it."""
        return self.confidence >= _SURE


@dataclass(frozen=True, slots=True, eq=False)
class _Evidence:
    """What speaks for and against a transform."""

    pose: Pose
    pairs: tuple[tuple[int, int], ...]  # vertices that agree in everything
    partners: int  # vertices that lie where one of the other chart does
    connected: int  # pairs that hang together by edges of equal length in both charts
    against: int  # vertices that look otherwise
    missed: int  # those that the other robot should have seen where it followed an edge
    meetpoints: int
    judged: float  # metres of edges beside which the other chart has walls
    crossed: float  # of them, metres that those walls cross

    @property
    def is_possible(self) -> bool:
        judged = len(self.pairs) + self.against + self.missed
        return (
            len(self.pairs) >= _LEAST_PAIRS
            and self.connected >= _LEAST_CONNECTED
            and self.meetpoints >= _LEAST_MEETPOINTS
            and self.against <= _AGAINST_SHARE * judged
            and self.missed <= _MISSED_SHARE * judged
            and self.crossed <= _CROSSING * self.judged
        )

    @property
    def is_refuted(self) -> bool:
        """Whether more than a few mistakes of either robot speaks against it."""
        return (
            self.against > max(_MISTAKES, len(self.pairs))
            or self.missed > max(_MISTAKES, len(self.pairs))
            or self.crossed > max(_ONE_CROSSING_M, 3 * _CROSSING * self.judged)
        )


@dataclass(frozen=True, slots=True)
class _Chance:
    """How well wrong transforms fit in this building."""

    agrees: float  # probability that a vertex agrees with one that lies where it does
    crossed: float  # share of the edges that walls cross

    @classmethod
    def of(cls, wrong: Iterable[_Evidence]) -> "_Chance":
        """As wrong transforms have it, on top of what is so in any building."""
        (agreeing, partners), (crossed, judged) = _SEEN_BEFORE, _CROSSED_BEFORE
        for evidence in wrong:
            agreeing += len(evidence.pairs)
            partners += evidence.partners
            crossed += evidence.crossed
            judged += evidence.judged
        return cls(agreeing / partners, crossed / judged)

    def weight(self, evidence: _Evidence) -> float:
        """The logarithm of how much likelier the evidence is if its transform is right."""
        per_vertex = max(0.0, math.log(_AGREES / self.agrees))
        per_metre = -math.log(1.0 - self.crossed) / _ONE_CROSSING_M
        return (
            per_vertex * (len(evidence.pairs) - _FIXED_BY)
            + per_metre * (evidence.judged - evidence.crossed)
            - _AGAINST * evidence.against
            - _MISSED * evidence.missed
        )


class Side:
    """A chart as alignment needs it; made once, used for many transforms."""

    def __init__(self, chart: Chart) -> None:
        self.chart = chart
        self.ids = list(chart.vertices)
        self.vertices = list(chart.vertices.values())
        self.points = np.array([v.position for v in self.vertices]).reshape(-1, 2)
        self.is_meetpoint = np.array([v.is_meetpoint for v in self.vertices], bool)

    @cached_property
    def walls(self) -> cKDTree:
        """All walls that are told."""
        around = [vertex.walls for vertex in self.vertices]
        return cKDTree(thinned(np.concatenate([np.empty((0, 2)), *around])))

    @cached_property
    def sights(self) -> Array:
        """From each of the walls (N, 2) the way to the vertex that tells of it: seen there."""
        told = [vertex.walls for vertex in self.vertices]
        teller = np.repeat(np.arange(len(told)), [len(walls) for walls in told])
        _, nearest = cKDTree(np.concatenate(told)).query(self.walls.data)
        sights: Array = self.points[teller[nearest]] - self.walls.data
        return sights

    @cached_property
    def ways(self) -> tuple[Array, Array]:
        """Points (N, 2) along all edges, and how far (N,) there is surely no wall."""
        lines = [
            (resampled(e.polyline, _SPACING_M), e.min_clearance) for e in self.chart.edges.values()
        ]
        points = np.concatenate([np.empty((0, 2)), *(line for line, _ in lines)])
        free = np.concatenate([np.empty(0), *(np.full(len(line), c) for line, c in lines)])
        return points, free

    @cached_property
    def way_tree(self) -> cKDTree:
        """Points along all edges."""
        return cKDTree(self.ways[0])

    @cached_property
    def misfits(self) -> list["_Evidence"]:
        """What speaks for and against laying the chart onto itself, but not as it is."""
        return [
            found for found in _examined(self, self, _MISFITS) if not _is_identity(found.pose, self)
        ]

    @cached_property
    def bases(self) -> tuple[NDArray[np.intp], Complex, Array]:
        """Stretches over one edge or two: vertices (N, 2), their places, metres driven (N,)."""
        index = {key: i for i, key in enumerate(self.ids)}
        one = [(index[e.a.vertex], index[e.b.vertex], e.length) for e in self.chart.edges.values()]
        both = one + [(b, a, metres) for a, b, metres in one]
        two = [(a, d, m + n) for a, b, m in both for c, d, n in both if b == c and a < d]
        rows = [(a, b, m) for a, b, m in chain(one, two) if a != b]
        ends = np.array([(a, b) for a, b, _ in rows], np.intp).reshape(-1, 2)
        metres = np.array([m for _, _, m in rows], np.float64)
        return ends, (self.points[:, 0] + 1j * self.points[:, 1])[ends], metres


def align(ours: Chart, theirs: Chart) -> Alignment | None:
    """How the other chart lies in ours, if that is beyond doubt."""
    a, b = Side(ours), Side(theirs)
    if min(len(a.ids), len(b.ids)) < _LEAST_PAIRS:
        return None
    chance = _Chance.of(chain(a.misfits, b.misfits))
    found = sorted(_examined(a, b), key=chance.weight, reverse=True)
    if not found or not found[0].is_possible:
        return None
    best, others = found[0], found[1:]
    weight = chance.weight(best)
    others += _elsewhere(a, {i for i, _ in best.pairs}) + _elsewhere(b, {j for _, j in best.pairs})
    odds = math.fsum(math.exp(min(chance.weight(other) - weight, 50.0)) for other in others)
    odds += math.exp(min(_TRIES - weight, 50.0))
    confidence = 1.0 / (1.0 + odds)
    pose, covariance = fitted(a.chart, b.chart, best.pairs)
    result = Alignment(pose, covariance, best.pairs, confidence)
    return _laid_on_walls(a, b, result) if result.is_sure else None


def refined(ours: Chart, theirs: Chart, known: Alignment) -> Alignment | None:
    """The same alignment by charts that have grown since; None if they speak against it."""
    a, b = Side(ours), Side(theirs)
    evidence = _examine(a, b, known.pose)
    if evidence.is_possible:
        pose, covariance = fitted(ours, theirs, evidence.pairs)
        return _laid_on_walls(a, b, Alignment(pose, covariance, evidence.pairs, known.confidence))
    return None if evidence.is_refuted else _laid_on_walls(a, b, known)


def _laid_on_walls(a: Side, b: Side, known: Alignment) -> Alignment:
    """The same alignment by all walls that both tell of, which say more of the turn than vertices.

    It stays as it was if too few are shared, or if they would move it far.
    """
    if min(len(a.walls.data), len(b.walls.data)) < _LAYING.min_pairs:
        return known
    found = register_coarsely(
        b.walls.data,
        a.walls,
        a.walls.data,
        known.pose,
        _LOOSELY,
        _LAYING,
        _LAID_FROM_M,
        sides=Sides(a.sights, b.sights),
    )
    if found is None:
        return known
    moved_by = found.pose.transform(b.points) - known.pose.transform(b.points)
    return replace(known, pose=found.pose) if np.hypot(*moved_by.T).max() < _LAID_BY_M else known


def _elsewhere(side: Side, shared: set[int]) -> list[_Evidence]:
    """What lays the shared part of a chart somewhere else in the same chart."""
    part = Chart(
        {key: vertex for key, vertex in side.chart.vertices.items() if key in shared},
        {
            key: edge
            for key, edge in side.chart.edges.items()
            if edge.a.vertex in shared and edge.b.vertex in shared
        },
    )
    found = _examined(side, Side(part))
    return [evidence for evidence in found if not _is_identity(evidence.pose, side)]


def _is_identity(pose: Pose, side: Side) -> bool:
    return _is_same(pose, Pose(), side.points.mean(axis=0))


def _examined(a: Side, b: Side, most: int = _EXAMINED) -> list[_Evidence]:
    """What speaks for the most promising transforms of b into a, each another one."""
    chosen: list[_Evidence] = []
    middle = b.points.mean(axis=0)
    for pose in _suggested(a, b):
        if not any(_is_same(pose, other.pose, middle) for other in chosen):
            evidence = _examine(a, b, pose)
            if not any(_is_same(evidence.pose, other.pose, middle) for other in chosen):
                chosen.append(evidence)
            if len(chosen) == most:
                break
    return chosen


def _is_same(one: Pose, other: Pose, where: Array) -> bool:
    away = float(np.hypot(*(one.transform(where) - other.transform(where))))
    return away < _APART_M and abs(wrap_angle(one.theta - other.theta)) < _APART_RAD


def _suggested(a: Side, b: Side) -> list[Pose]:
    """Poses of b's frame in a's by pairs of stretches, those that bring most vertices together."""
    (ends_a, places_a, metres_a), (ends_b, places_b, metres_b) = a.bases, b.bases
    if not len(ends_a) or not len(ends_b):
        return []
    ends_b, places_b = (np.concatenate([x, x[:, ::-1]]) for x in (ends_b, places_b))
    metres_b = np.concatenate([metres_b, metres_b])
    way_a, way_b = (p[:, 1] - p[:, 0] for p in (places_a, places_b))
    limit = _LENGTH_M + _LENGTH_SHARE * metres_a[:, None]
    alike = (np.abs(np.abs(way_a)[:, None] - np.abs(way_b)) < limit) & (
        np.abs(metres_a[:, None] - metres_b) < limit
    )
    alike &= (np.abs(way_a)[:, None] > _LEAST_BASE_M) & (np.abs(way_b) > _LEAST_BASE_M)
    for end in (0, 1):
        kinds = a.is_meetpoint[ends_a[:, end]][:, None] == b.is_meetpoint[ends_b[:, end]]
        room_a, room_b = (
            np.array([v.clearance for v in s.vertices])[e[:, end]]
            for s, e in ((a, ends_a), (b, ends_b))
        )
        alike &= kinds & (
            np.abs(room_a[:, None] - room_b) < _CLEARANCE_M + _CLEARANCE_SHARE * room_a[:, None]
        )
    i, j = np.nonzero(alike)
    if not len(i):
        return []
    turns = way_a[i] / way_b[j]
    turns /= np.abs(turns)
    shifts = places_a[i].mean(axis=1) - turns * places_b[j].mean(axis=1)
    scores = _together(a, b, turns, shifts)
    return [
        Pose(float(shifts[k].real), float(shifts[k].imag), float(np.angle(turns[k])))
        for k in np.argsort(-scores, kind="stable")
    ]


def _together(a: Side, b: Side, turns: Complex, shifts: Complex) -> Array:
    """How many vertices each transform brings together, those that coincide counting most.

    Some transforms at a time: in a building of equal corridors there are hundreds of thousands.
    """
    some = 1 + _LAID_AT_A_TIME // len(b.ids)
    parts = [
        _brought_together(a, b, turns[first : first + some], shifts[first : first + some])
        for first in range(0, len(turns), some)
    ]
    return np.concatenate(parts)


def _brought_together(a: Side, b: Side, turns: Complex, shifts: Complex) -> Array:
    scores = np.zeros(len(turns))
    for kind in (True, False):
        here, there = a.points[a.is_meetpoint == kind], b.points[b.is_meetpoint == kind]
        if len(here) and len(there):
            laid = turns[:, None] * (there[:, 0] + 1j * there[:, 1]) + shifts[:, None]
            away, _ = cKDTree(here).query(np.stack([laid.real, laid.imag], axis=-1))
            scores += np.maximum(0.0, 1.0 - (np.asarray(away) / _SAME_M) ** 2).sum(axis=1)
    return scores


def _examine(a: Side, b: Side, pose: Pose) -> _Evidence:
    """What speaks for and against a transform, after it has been fitted to its pairs."""
    partners: list[tuple[int, int]] = []
    for _ in range(_FITS):
        before, partners = partners, _partners(a, b, pose)
        if partners == before or len(partners) < _FIXED_BY:
            break
        pose, _ = least_squares(
            a.points[[i for i, _ in partners]], b.points[[j for _, j in partners]]
        )
    likeness = {(i, j): _likeness(a, b, i, j, pose) for i, j in partners}
    pairs = [(a.ids[i], b.ids[j]) for (i, j), share in likeness.items() if share >= _ALIKE_SHARE]
    against = sum(share < _UNLIKE_SHARE for share in likeness.values())
    lone_a = set(range(len(a.ids))) - {i for i, _ in partners}
    lone_b = set(range(len(b.ids))) - {j for _, j in partners}
    missed = _missed(a, b, pose.inverse(), lone_a) + _missed(b, a, pose, lone_b)
    meetpoints = sum(a.chart.vertices[i].is_meetpoint for i, _ in pairs)
    judged, crossed = np.add(_crossing(a, b, pose.inverse()), _crossing(b, a, pose)) / 2
    return _Evidence(
        pose,
        tuple(pairs),
        len(partners),
        _connected(a.chart, b.chart, pairs),
        against,
        missed,
        meetpoints,
        float(judged),
        float(crossed),
    )


def _partners(a: Side, b: Side, pose: Pose) -> list[tuple[int, int]]:
    """Indices of vertices of one kind that lie where the other's do."""
    from scipy.optimize import linear_sum_assignment

    laid = pose.transform(b.points)
    away = np.minimum(cdist(a.points, laid), _SAME_M)
    away[a.is_meetpoint[:, None] != b.is_meetpoint] = _SAME_M
    rows, columns = linear_sum_assignment(away)
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if away[i, j] < _SAME_M]


def _likeness(a: Side, b: Side, i: int, j: int, pose: Pose) -> float:
    """How far (0..1) two vertices agree: by their walls, or 0 if their clearances are not the same.

    Departures may be seen in other directions by each: if they differ, that tells nothing.
    """
    ours, theirs = a.vertices[i], b.vertices[j]
    room = _CLEARANCE_M + _CLEARANCE_SHARE * ours.clearance
    known = {d.key: d.bearing for d in ours.departures}
    seen = tuple(bearing + pose.theta for bearing in theirs.bearings)
    paired = match_bearings(seen, known, _BEARING_RAD)
    if abs(ours.clearance - theirs.clearance) > room:
        return 0.0
    agreement = _agreement(a, b, ours, theirs, pose)
    is_same = abs(len(known) - len(seen)) <= 1 and len(paired) >= min(len(known), len(seen))
    return agreement if is_same else min(agreement, _UNLIKE_SHARE)


def _agreement(a: Side, b: Side, ours: ChartVertex, theirs: ChartVertex, pose: Pose) -> float:
    """Share of the walls around a vertex that the other chart has as well, the worse of both."""
    near_a, near_b = _around(ours), _around(theirs)
    if not len(near_a) or not len(near_b):
        return 0.0
    local = pose
    for _ in range(_LAID_OUT):
        laid = local.transform(near_b)
        away, index = a.walls.query(laid, distance_upper_bound=2 * _WALL_M)
        found = np.isfinite(np.asarray(away))
        if np.count_nonzero(found) < max(_LEAST_PAIRS, _HOPELESS_SHARE * len(found)):
            return 0.0
        local, _ = least_squares(a.walls.data[np.asarray(index)[found]], near_b[found])
    shift = local.transform(theirs.position) - pose.transform(theirs.position)
    if np.hypot(*shift) > _SHIFT_M or abs(wrap_angle(local.theta - pose.theta)) > _TURN_RAD:
        return 0.0
    of_theirs = np.asarray(a.walls.query(local.transform(near_b))[0]) < _WALL_M
    of_ours = np.asarray(b.walls.query(local.inverse().transform(near_a))[0]) < _WALL_M
    return float(min(of_theirs.mean(), of_ours.mean()))


def _around(vertex: ChartVertex) -> Array:
    """The walls so near to a vertex, and not behind others, that whoever comes by sees them."""
    offsets = vertex.walls - vertex.position
    away = np.hypot(*offsets.T)
    sector = ((np.arctan2(offsets[:, 1], offsets[:, 0]) / math.tau) % 1.0 * _SECTORS).astype(int)
    nearest = np.full(_SECTORS, np.inf)
    np.minimum.at(nearest, sector % _SECTORS, away)
    in_sight = away < nearest[sector % _SECTORS] + _THICK_M
    near: Array = vertex.walls[(away < vertex.clearance + _BEYOND_M) & in_sight]
    return near


def _connected(ours: Chart, theirs: Chart, pairs: list[tuple[int, int]]) -> int:
    """How many pairs the largest part has that hangs together by edges of equal length in both."""
    of = dict(pairs)
    links: dict[int, set[int]] = {i: set() for i in of}
    lengths: dict[frozenset[int], list[float]] = {}
    for edge in theirs.edges.values():
        lengths.setdefault(frozenset((edge.a.vertex, edge.b.vertex)), []).append(edge.length)
    for edge in ours.edges.values():
        i, k = edge.a.vertex, edge.b.vertex
        if i not in of or k not in of or i == k:
            continue
        limit = _LENGTH_M + _LENGTH_SHARE * edge.length
        others = lengths.get(frozenset((of[i], of[k])), [])
        if any(abs(edge.length - other) < 2 * limit for other in others):
            links[i].add(k)
            links[k].add(i)
    largest: set[int] = set()
    seen: set[int] = set()
    for start in of:
        if start not in seen:
            part = _reached(start, links)
            seen |= part
            largest = max(largest, part, key=len)
    return len(largest)


def _reached(start: int, links: dict[int, set[int]]) -> set[int]:
    part, waiting = {start}, [start]
    while waiting:
        for other in links[waiting.pop()] - part:
            part.add(other)
            waiting.append(other)
    return part


def _missed(side: Side, other: Side, other_side: Pose, lone: set[int]) -> int:
    """How many vertices without a partner lie where the other has an edge and saw none."""
    if not lone or not len(other.ways[0]):
        return 0
    laid = other_side.transform(side.points[sorted(lone)])
    on_edge = np.asarray(other.way_tree.query(laid)[0]) < _ON_EDGE_M
    off_vertices = np.asarray(cKDTree(other.points).query(laid)[0]) > _OFF_VERTEX_M
    return int(np.count_nonzero(on_edge & off_vertices))


def _crossing(side: Side, other: Side, other_side: Pose) -> tuple[float, float]:
    """Metres of one chart's edges beside which the other has walls, and of those crossed."""
    points, free = side.ways
    if not len(points) or not other.walls.n:
        return 0.0, 0.0
    away = np.asarray(other.walls.query(other_side.transform(points))[0])
    judged = away < 2 * free
    crossed = judged & (away < _SPOKEN * free)
    return _SPACING_M * np.count_nonzero(judged), _SPACING_M * np.count_nonzero(crossed)


def fitted(ours: Chart, theirs: Chart, pairs: tuple[tuple[int, int], ...]) -> tuple[Pose, Array]:
    """The pose of the other's frame in ours that lays pairs on each other, and its covariance.

    The covariance (3, 3) is by how far apart they stay, with none of the belief that all of them
    err independently: vertices of one chart err together.
    """
    a = np.array([ours.vertices[i].position for i, _ in pairs])
    b = np.array([theirs.vertices[j].position for _, j in pairs])
    return least_squares(a, b)


def least_squares(a: Array, b: Array) -> tuple[Pose, Array]:
    """The pose for which b's points (N, 2), laid by it, are nearest to a's; its covariance."""
    u, v = a[:, 0] + 1j * a[:, 1], b[:, 0] + 1j * b[:, 1]
    turn = np.vdot(v - v.mean(), u - u.mean())
    turn = turn / abs(turn) if turn else 1.0  # one point says nothing of it
    shift = u.mean() - v.mean() * turn
    pose = Pose(float(shift.real), float(shift.imag), float(np.angle(turn)))
    off = a - pose.transform(b)
    variance = max(float((off**2).sum() / max(1, 2 * len(a) - 3)), 1e-4)
    spread = max(float((np.abs(v - v.mean()) ** 2).mean()), 1e-6)
    middle = pose.transform(b).mean(axis=0)
    lever = np.array([middle[1] - pose.y, -(middle[0] - pose.x)])  # of the origin by the turn
    of_turn = variance / spread
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = variance * np.eye(2) + of_turn * np.outer(lever, lever)
    covariance[:2, 2] = covariance[2, :2] = of_turn * lever
    covariance[2, 2] = of_turn
    return pose, covariance
