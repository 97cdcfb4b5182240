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
from itertools import chain

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from gvgbot.geometry import Array, Pose, wrap_angle
from gvgbot.registration import assigned, rigid_fit
from gvgbot.team.chart import Chart
from gvgbot.team.laying import fitted, laid_on_walls
from gvgbot.team.likeness import UNLIKE_SHARE, likeness
from gvgbot.team.side import SPACING_M, Side
from gvgbot.team.stretches import Complex, leeway

_SAME_M = 0.7  # vertices nearer to each other may be one
_ALIKE_SHARE = 0.85  # of the walls around a vertex, on either side, speaks for it
_FITS = 5  # rounds of pairing and fitting
_MOST_STRETCHES = 10_000  # in a map of more, another one is not looked for
_LAID_AT_A_TIME = 50_000  # vertices, to find out which transforms promise most
_EXAMINED, _MISFITS = 12, 6  # transforms that are looked at closely, of a chart onto itself
_APART_M, _APART_RAD = 1.0, 0.25  # transforms nearer to each other are the same
_ON_EDGE_M = 0.4  # so near to an edge, a vertex should be known on it
_OFF_VERTEX_M = 1.0  # but not so near to a vertex of that chart
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
_LAID_BY_M, _LAID_RAD = 0.2, 0.1  # that walls move what was found, where it was found, and turn it
_MISTAKES = 2  # vertices of either kind do not refute what was sure


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """The pose of another chart's frame in one's own, with covariance (3, 3), and what tells it.

    `pairs` are ids of vertices that are one and the same, ours first. `by_sight`: two robots have
    seen each other pass more than once, and maps do not refute it.
    """

    pose: Pose
    covariance: Array
    pairs: tuple[tuple[int, int], ...]
    confidence: float
    by_sight: bool = False
    found: Pose | None = None  # before it was laid on walls, if that is another pose

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


def align(ours: Chart, theirs: Chart) -> Alignment | None:
    """How the other chart lies in ours, if that is beyond doubt."""
    a, b = Side(ours), Side(theirs)
    if min(len(a.ids), len(b.ids)) < _LEAST_PAIRS:
        return None
    chance = _Chance.of(chain(_misfits(a), _misfits(b)))
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
    laid = _laid_on_walls(a, b, pose, covariance)
    result = Alignment(laid, covariance, best.pairs, confidence, found=pose)
    return result if result.is_sure else None


def refined(ours: Chart, theirs: Chart, known: Alignment) -> Alignment | None:
    """The same alignment by charts that have grown since; None if they speak against it.

    They may disagree though they lie right, as where one robot has seen glass that the other one
    has looked through.
    """
    a, b = Side(ours), Side(theirs)
    evidence = _examine(a, b, known.pose)
    if evidence.is_possible:
        pose, covariance = fitted(ours, theirs, evidence.pairs)
        laid = _laid_on_walls(a, b, pose, covariance)
        return replace(known, pose=laid, covariance=covariance, pairs=evidence.pairs, found=pose)
    if evidence.is_refuted and not known.by_sight:
        return None
    found = known.found or known.pose  # each time from there, or it would creep along the walls
    return replace(known, pose=_laid_on_walls(a, b, found, known.covariance), found=found)


def _laid_on_walls(a: Side, b: Side, found: Pose, covariance: Array) -> Pose:
    """The pose by all walls that both tell of, if it may be there by what it was found by.

    Of few walls some may be two sides of one, or glass that only one of the robots has seen.
    """
    laid = laid_on_walls(a, b, found)
    lever = covariance[:2, 2] / max(covariance[2, 2], 1e-12)
    surest = np.array([found.x - lever[1], found.y + lever[0]])  # where it is turned about
    sigma = math.sqrt(max(0.0, covariance[0, 0] - covariance[2, 2] * lever[0] ** 2))
    moved = laid.transform(found.inverse().transform(surest)) - surest
    is_there = np.hypot(*moved) < max(_LAID_BY_M, 2 * sigma)
    return laid if is_there and abs(wrap_angle(laid.theta - found.theta)) < _LAID_RAD else found


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


def _misfits(side: Side) -> list[_Evidence]:
    """What speaks for and against laying a chart onto itself, but not as it is."""
    found = _examined(side, side, _MISFITS)
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
    here, there = a.stretches, b.stretches.both_ways()
    if max(len(here.ends), len(there.ends) // 2) > _MOST_STRETCHES:
        return []
    i, j = here.alike(there)
    if not len(i):
        return []
    turns = here.way[i] / there.way[j]
    turns /= np.abs(turns)
    shifts = here.places[i].mean(axis=1) - turns * there.places[j].mean(axis=1)
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
        ours, theirs = ([pair[k] for pair in partners] for k in (0, 1))
        pose, _ = rigid_fit(a.points[ours], b.points[theirs])
    alike = {(i, j): likeness(a, b, i, j, pose) for i, j in partners}
    pairs = [(a.ids[i], b.ids[j]) for (i, j), share in alike.items() if share >= _ALIKE_SHARE]
    against = sum(share < UNLIKE_SHARE for share in alike.values())
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
    away = cdist(a.points, pose.transform(b.points))
    away[a.is_meetpoint[:, None] != b.is_meetpoint] = _SAME_M
    return assigned(away, _SAME_M)


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
        limit = leeway(edge.length)
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
    return SPACING_M * np.count_nonzero(judged), SPACING_M * np.count_nonzero(crossed)
