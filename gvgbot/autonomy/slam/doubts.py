"""New vertices that may be known ones: weighed together with those that were found after them.

A place by itself may leave several readings open, above all where all corners look alike. But the
way from one vertex to the next is known well, so a reading of the first foretells where the others
lie. A few readings of the latest vertices are kept side by side, each with its cost, minus twice
the log likelihood; what all cheap ones have in common is settled.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from gvgbot.autonomy.slam import ekf
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.geometry import Array

NEW_PER_M2 = 0.02  # vertices where nothing is known yet
IMPOSSIBLE = 1e-3  # what the chance is called at least that there is room for a new vertex
SAME = np.eye(2) * 0.15**2  # covariance of two sightings of one place
_READINGS = 5  # that are kept side by side
_LATEST = 8  # vertices that are weighed together
_AROUND_M = 30.0  # vertices farther from all of them have no say
_ALIKE_M = 0.3  # ways whose ends lie so near to each other are alike
_HABIT = 0.5  # of all new vertices lie where the building's habits have them


@dataclass(frozen=True, slots=True)
class Doubt:
    """A vertex, those it may be, and how dense (1/m^2) new ones that look like it are.

    `habit` is how dense they are by what the edges of the map are like.
    """

    vertex: int
    rivals: tuple[int, ...]
    density: float
    habit: float = 0.0


class Reading(NamedTuple):
    """What some vertices are taken for, by id; None for a new one."""

    cost: float
    belief: Belief
    known_as: dict[int, int | None]


class Verdict(NamedTuple):
    """What a vertex is certainly, and by how much any other reading costs more."""

    vertex: int
    known: int | None
    margin: float


def match_cost(r: Array, S: Array) -> float:
    """The cost of taking two places for one, r (2,) apart with covariance S (2, 2)."""
    _, log_det = np.linalg.slogdet(2 * math.pi * S)
    return float(r @ np.linalg.solve(S, r) + log_det)


def novelty_cost(density: float, room: float) -> float:
    """The cost of taking a place for a new one."""
    return -2.0 * math.log(density * max(room, IMPOSSIBLE))


def room_for_new(r: Array, S: Array, reach: Array) -> float:
    """The chance that a place lies beyond the reach (N,), m, of all vertices.

    It lies r (N, 2) off them with covariances S (N, 2, 2). Their surroundings do not overlap.
    """
    near = np.hypot(*r.T) < reach + 4.0 * np.sqrt(np.trace(S, axis1=1, axis2=2))
    inside = 0.0
    for offset, covariance, within in zip(r[near], S[near], reach[near], strict=True):
        drawn = offset + _NORMAL @ np.linalg.cholesky(covariance).T
        inside += float((np.hypot(*drawn.T) < within).mean())
    return max(0.0, 1.0 - inside)


def habit_density(way: Array, ways: Array) -> float:
    """How dense (1/m^2) new vertices are at the end of a way (2,), by the ways (N, 2) of the map.

    Where one edge is like another, the next one will be like them, too.
    """
    if not len(ways):
        return 0.0
    off = ((ways - way) ** 2).sum(axis=1)
    kernel = np.exp(-0.5 * off / _ALIKE_M**2) / (2 * math.pi * _ALIKE_M**2)
    return _HABIT * float(kernel.mean())


@dataclass(slots=True, eq=False)
class Doubts:
    """The vertices that were added since the first one that is still in doubt."""

    recent: list[Doubt] = field(default_factory=list)

    def note(self, doubt: Doubt) -> None:
        """Learn of a new vertex; one without a doubt is of interest only after one with."""
        if any(old.vertex == doubt.vertex for old in self.recent):
            self.recent = [
                replace(old, rivals=tuple(dict.fromkeys(old.rivals + doubt.rivals)))
                if old.vertex == doubt.vertex
                else old
                for old in self.recent
            ]
        elif self.recent or doubt.rivals:
            self.recent.append(doubt)
        self._forget_settled()

    def rivals(self, vertex: int) -> tuple[int, ...]:
        """Which known vertices a vertex may be; none if it is not in doubt."""
        return next((doubt.rivals for doubt in self.recent if doubt.vertex == vertex), ())

    def forget(self, vertex: int) -> None:
        """A vertex is no more."""
        self.recent = [doubt for doubt in self.recent if doubt.vertex != vertex]
        self.refute(vertex)

    def unite(self, kept: int, gone: int) -> None:
        """A vertex is no more, since it proved to be another: what may be it may be that one."""
        self.recent = [
            replace(doubt, rivals=_with_name(doubt.rivals, gone, kept, but=doubt.vertex))
            for doubt in self.recent
        ]
        self.forget(gone)

    def refute(self, known: int) -> None:
        """None of them is a vertex that they may have been."""
        self.recent = [
            replace(doubt, rivals=tuple(rival for rival in doubt.rivals if rival != known))
            for doubt in self.recent
        ]
        self._forget_settled()

    def believe(self, vertex: int) -> None:
        """A vertex is a new one."""
        self.recent = [
            replace(doubt, rivals=()) if doubt.vertex == vertex else doubt for doubt in self.recent
        ]
        self._forget_settled()

    def _forget_settled(self) -> None:
        while self.recent and not self.recent[0].rivals:
            del self.recent[0]
        if len(self.recent) > _LATEST:
            del self.recent[0]
            self._forget_settled()

    def weigh(self, belief: Belief, reach: dict[int, float], margin: float) -> Verdict | None:
        """What is certain by now of one of them, if the best reading is cheaper by a margin.

        `reach` says how far around each vertex there is no other, m.
        """
        doubts = self.recent
        if not doubts:
            return None
        readings = [Reading(0.0, _around(belief, doubts), {})]
        for doubt in doubts:
            later = {other.vertex for other in doubts} - readings[0].known_as.keys()
            told = [new for old in readings for new in _readings(old, doubt, later, reach)]
            readings = sorted(told, key=lambda reading: reading.cost)[:_READINGS]
        verdicts = [_verdict(doubt.vertex, readings) for doubt in doubts if doubt.rivals]
        certain = [verdict for verdict in verdicts if verdict.margin > margin]
        return certain[0] if certain else None


def _with_name(rivals: tuple[int, ...], old: int, new: int, *, but: int) -> tuple[int, ...]:
    """Rivals, each once, of which one has got a new name; without the vertex that has them."""
    named = dict.fromkeys(new if rival == old else rival for rival in rivals)
    return tuple(rival for rival in named if rival != but)


def _around(belief: Belief, doubts: Sequence[Doubt]) -> Belief:
    """The part of a belief that has a say: doubted vertices, and all around them."""
    map_all = belief.positions
    at = [belief.ids.index(doubt.vertex) for doubt in doubts]
    away = np.hypot(*(map_all[:, None] - map_all[at]).transpose(2, 0, 1)).min(axis=1)
    rivals = {rival for doubt in doubts for rival in doubt.rivals}
    near = [v for v, m in zip(belief.ids, away, strict=True) if m < _AROUND_M or v in rivals]
    return ekf.part(belief, near)


def _readings(
    reading: Reading, doubt: Doubt, later: set[int], reach: dict[int, float]
) -> Iterable[Reading]:
    """A reading, and what a further vertex may be: new, or one of its rivals.

    What others were taken for is one of these only if the vertex may be one of the others, too.
    """
    belief, known_as = reading.belief, reading.known_as
    older = [v for v in belief.ids if v not in later and v in reach and v != doubt.vertex]
    r, S = ekf.apart(belief, doubt.vertex, older)
    room = room_for_new(r, S + SAME, np.array([reach[v] for v in older]))
    cost = reading.cost + novelty_cost(doubt.density + doubt.habit, room)
    yield Reading(cost, belief, {**known_as, doubt.vertex: None})
    for rival in dict.fromkeys(known_as.get(rival) or rival for rival in doubt.rivals):
        same = {vertex for vertex, known in known_as.items() if known == rival}
        is_taken = bool(same) and not same & set(doubt.rivals)
        if is_taken or rival == doubt.vertex or rival not in belief.ids:
            continue
        r, S = ekf.apart(belief, doubt.vertex, [rival])
        cost = reading.cost + match_cost(r[0], S[0] + SAME)
        united = ekf.unite(belief, rival, doubt.vertex, SAME)
        yield Reading(cost, united, _renamed(known_as, doubt.vertex, rival))


def _renamed(known_as: dict[int, int | None], vertex: int, known: int) -> dict[int, int | None]:
    """What vertices are taken for if one, and what was taken for that one, is a known one."""
    return {v: known if k == vertex else k for v, k in known_as.items()} | {vertex: known}


def _verdict(vertex: int, readings: list[Reading]) -> Verdict:
    """What the cheapest reading takes a vertex for, against the cheapest that does not."""
    best = readings[0]
    known = best.known_as[vertex]
    others = [reading.cost for reading in readings if not _agrees(reading.known_as, vertex, known)]
    return Verdict(vertex, known, min([*others, readings[-1].cost]) - best.cost)


def _agrees(known_as: dict[int, int | None], vertex: int, known: int | None) -> bool:
    """Whether a vertex is taken for a known one, or for what that is taken for in turn."""
    same = known if known is None else known_as.get(known) or known
    return known_as[vertex] == same


def _normal_points() -> Array:
    """Points (N, 2) spread as the standard normal distribution is."""
    k = np.arange(256) + 0.5
    radius, turn = np.sqrt(-2.0 * np.log(1.0 - k / len(k))), k * math.pi * (3.0 - math.sqrt(5.0))
    return np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)


_NORMAL = _normal_points()
