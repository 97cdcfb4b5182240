"""Where on a known map is the robot? Hypotheses all over it, and looks that tell them apart.

The robot draws a local map from nothing and drives about; each look lays that map onto the walls
of the known one. What fits nowhere better than chance is dropped, what fits in several places is
kept until the robot has driven to where they differ.

Two looks from near each other show the same walls and are no two witnesses: a look counts in full
only as long as it is the newest, and then with the share of its walls that has been left behind.
"""

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from gvgbot.autonomy.gvg.local_map import LocalMap
from gvgbot.autonomy.known_walls import CELL_M, REACH_M, KnownWalls
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig, register
from gvgbot.geometry import Array, Pose, wrap_angle, wrap_angles
from gvgbot.hal.packed_scan import AnyScan

# Walls so near to each other are one, and so far off are two, m: maps are a little bent. Corridors
# may differ by less, so one looks closely before one is sure.
_APART_BY_AND_LARGE, _APART_CLOSELY = (0.2, 0.4), (0.1, 0.2)
_CLOSE = 0.2  # share of the walls that may disagree then; many more do elsewhere
_HEADINGS = 120  # that are tried at each place
_TRIED = 100  # places in one go
_ROUGH_POINTS, _POINTS = 80, 300  # of the walls, for a rough guess and for a close look
_ROUGH_GUESSES = 1200  # whose scores are worked out better: in a corridor one is like the next
_GUESSES = 150  # that are looked at closely: a place that is left out can never be found
_ALIKE = 0.05  # in score, from the best: what is left out may be the place if it differs by less
_MOST_ROUNDS = 20  # of guessing again a little farther on, before some are left out nevertheless
_FINER_M, _FINER_RAD = CELL_M / 3, math.tau / _HEADINGS / 3  # steps to a better score
_STEPS = np.array(list(product((-1, 0, 1), repeat=3))) * [_FINER_M, _FINER_M, _FINER_RAD]
_FITS_A_STEP = 4  # hypotheses that are laid onto the map in one go
_APART_M, _APART_RAD = 0.6, 0.3  # guesses nearer to each other are the same
_COMPARED = 8000  # guesses in that
_PEAKS_A_STEP = 100  # found in one go
_ONE_M, _ONE_RAD = 0.4, 0.2  # hypotheses nearer to each other are the same
_LOOK_EVERY_M = 1.0  # driven between two looks
_TELLING = 0.01  # share of the walls: who disagrees with so much more is e times less likely
# where it looks alike by chance, and of what the map has not seen: that says nothing
_CHANCE = 0.15
_CHANCE_OUTSIDE = 0.07  # where half a building looks by chance like the other, unknown half
# Nobody carried it, but a base goes on for up to two seconds after its last command: so far at
# most, m, and e times less likely for each so many rad
_STAYED_M, _STAYED_RAD = 2.0, 0.6
_STAYED = 5.0  # log of how much likelier where it was is than any other place on half a map
_LOOKS = 5  # before anything is said
_SURE = 0.995  # share of a place
# in a row, with the same place: one may be wrong about a wall that has moved a little
_SURE_LOOKS = 3
_HOPELESS = 0.01  # share of a place that need not be thought of
_UNLIKE = 5  # of the points of all walls may differ in a building with several sides alike
_MOST_SIDES = 8
_GUESSED = np.diag([0.3**2, 0.3**2, 0.1**2])  # covariance of a guess
_FOLLOWED = np.diag([0.1**2, 0.1**2, 0.03**2])  # and of a hypothesis, since the last look


@dataclass(frozen=True, slots=True)
class Look:
    """What the robot has around it: the walls (N, 2) near it, in the local frame."""

    local_base: Pose
    local_map: LocalMap
    walls: Array

    @classmethod
    def around(cls, local_base: Pose, local_map: LocalMap) -> "Look":
        """What a local map shows now; it is the map itself, which goes on to change."""
        points = local_map.points()
        near = np.hypot(*(points - local_base.position).T) < REACH_M
        return cls(local_base, local_map, points[near])


@dataclass(slots=True, eq=False)
class Hypothesis:
    """Where the local frame may be on the map, and the log of how much speaks for it."""

    map_local: Pose
    behind: float = 0.0  # log weight, by the walls that have been left behind
    newest: float = 0.0  # and by those of the newest look
    is_possible: bool = True
    is_close: bool = True  # the newest look fits so well that it may be acted on

    @property
    def weight(self) -> float:
        """By all walls that have been seen."""
        return self.behind + self.newest if self.is_possible else -math.inf


@dataclass(frozen=True, slots=True)
class Opinion:
    """The best hypothesis, how sure it is (0..1), and how many places are possible."""

    map_local: Pose | None
    confidence: float
    possible: int
    looks: int
    is_hopeless: bool = False  # the whole map looks the same from every place that is possible
    sure_looks: int = 0  # the newest, after which it was the same place that was sure

    @property
    def is_sure(self) -> bool:
        """Whether to act on it."""
        return self.looks >= _LOOKS and self.sure_looks >= _SURE_LOOKS


class Relocaliser:
    """Forms an opinion, a little work at a time."""

    def __init__(
        self,
        scans: Sequence[tuple[Pose, AnyScan]],
        matching: ScanMatchingConfig,
        *,
        seen_at: Pose,
        is_whole: bool,
    ) -> None:
        """`scans` were taken at map_base poses, the robot was seen last at `seen_at`.

        What they show is gathered by the first steps. `is_whole`: the building ends where the map
        does.
        """
        self._scans, self._matching, self._is_whole = scans, matching, is_whole
        self._seen_at = seen_at
        self._chance = _CHANCE if is_whole else _CHANCE_OUTSIDE
        self._known: KnownWalls
        self._look: Look
        self._hypotheses: list[Hypothesis] = []
        self._nowhere = self._elsewhere()
        self._looks = 0
        self._surest: Hypothesis | None = None  # by the newest looks
        self._sure_looks = 0
        self._opinion = Opinion(None, 0.0, 0, 0)
        self._work = self._working()

    def step(self, look: Look) -> Opinion:
        """Do a bit of work on a look; the opinion so far."""
        self._look = look
        next(self._work)
        return self._opinion

    def _formed(self) -> Opinion:
        """What the looks so far say; weights are compared with that of no place at all."""
        if not self._hypotheses:
            return Opinion(None, 0.0, 0, self._looks)
        weights = np.array([h.weight for h in [*self._hypotheses, self._nowhere]])
        weights = np.exp(weights - weights.max())
        shares = weights / weights.sum()
        best = self._hypotheses[int(np.argmax(shares[:-1]))]
        if shares[:-1].max() < _SURE or not best.is_close:
            self._sure_looks = 0
        else:
            self._sure_looks = self._sure_looks + 1 if best is self._surest else 1
        self._surest = best
        others = [
            hypothesis
            for hypothesis, share in zip(self._hypotheses, shares[:-1], strict=True)
            if hypothesis is not best and share > _HOPELESS
        ]
        return Opinion(
            best.map_local,
            float(shares[:-1].max()),
            int((shares[:-1] > _HOPELESS).sum()),
            self._looks,
            self._looks >= _LOOKS and self._are_alike(best, others),
            self._sure_looks,
        )

    def _are_alike(self, best: Hypothesis, others: list[Hypothesis]) -> bool:
        """Whether no drive can tell the best place from the others."""
        turns = (other.map_local.compose(best.map_local.inverse()) for other in others)
        return 0 < len(others) < _MOST_SIDES and all(self._is_alike(turn) for turn in turns)

    def _is_alike(self, turn: Pose) -> bool:
        """Whether the whole map looks the same after a turn about some point, nearly `turn`."""
        walls, tree = self._known.points, self._known.tree
        some = _some(walls, _POINTS)
        found = register(some, tree, turn, _GUESSED, self._matching)
        if found is None:
            return False
        distance = np.asarray(tree.query(found.pose.transform(walls))[0])
        return int((distance > _APART_BY_AND_LARGE[0]).sum()) <= _UNLIKE

    def _working(self) -> Generator[None, None, None]:
        self._known = yield from KnownWalls.gather(self._scans, is_whole=self._is_whole)
        rounds = 0
        while True:
            look = self._look
            guesses, are_all = yield from self._guesses(look)
            rounds = 0 if are_all else rounds + 1
            if are_all or rounds > _MOST_ROUNDS:
                yield from self._begin(look, guesses)
            while self._hypotheses:
                before = self._look.local_base
                while (driven := self._look.local_base.distance(before)) < _LOOK_EVERY_M:
                    yield
                yield from self._compare(self._look, driven)
            while self._look.local_base.distance(look.local_base) < _LOOK_EVERY_M:
                yield

    def _guesses(self, look: Look) -> Generator[None, None, tuple[list[Pose], bool]]:
        """map_base where the walls around fit roughly, the best first; and whether that are all."""
        if not len(look.walls):  # nothing is in sight that could fit anywhere
            return [], True
        base_walls = look.local_base.inverse().transform(_some(look.walls, _ROUGH_POINTS))
        headings = np.arange(_HEADINGS) * math.tau / _HEADINGS
        c, s = np.cos(headings), np.sin(headings)
        turned = np.stack(
            [
                np.outer(c, base_walls[:, 0]) - np.outer(s, base_walls[:, 1]),
                np.outer(s, base_walls[:, 0]) + np.outer(c, base_walls[:, 1]),
            ],
            axis=-1,
        )
        found = []
        places = self._known.places
        for first in range(0, len(places), _TRIED):
            some = places[first : first + _TRIED]
            found.append(_best_turned(some, self._known.scores(some, turned)))
            yield
        peaks = yield from _peaks(np.concatenate([np.empty((0, 4)), *found]))
        return (yield from self._best(peaks, base_walls))

    def _best(
        self, peaks: Array, base_walls: Array
    ) -> Generator[None, None, tuple[list[Pose], bool]]:
        """The best of guesses (N, 3) after a few small steps to where each fits better.

        Else the best would be those that happen to be near to what was tried. In the middle of a
        corridor there may be too many that are as good: then these are not all.
        """
        best, scores = peaks, np.full(len(peaks), -1.0)
        for step in _STEPS:
            there = peaks + step
            found = self._known.scores_at(there, base_walls)
            is_better = found > scores
            best, scores = np.where(is_better[:, None], there, best), np.maximum(found, scores)
            yield
        order = np.argsort(-scores, kind="stable")
        are_all = len(order) <= _GUESSES or scores[order[_GUESSES]] < scores[order[0]] - _ALIKE
        some = best[order[:_GUESSES]].tolist()
        return [Pose(x, y, wrap_angle(heading)) for x, y, heading in some], bool(are_all)

    def _elsewhere(self) -> Hypothesis:
        """Being nowhere on the map, where everything fits as it does by chance."""
        return Hypothesis(Pose(), newest=-self._chance / _TELLING)

    def _stayed(self, hypothesis: Hypothesis) -> float:
        """Log of how much likelier it is for beginning where the robot was seen last."""
        off = self._seen_at.to(hypothesis.map_local)
        if math.hypot(off.x, off.y) > _STAYED_M:
            return 0.0
        return max(0.0, _STAYED - abs(off.theta) / _STAYED_RAD)

    def _begin(self, look: Look, guesses: list[Pose]) -> Generator[None, None, None]:
        """Make hypotheses of what fits closely, too."""
        inverse = look.local_base.inverse()
        self._hypotheses = [Hypothesis(guess.compose(inverse)) for guess in guesses]
        if not self._is_whole:  # what was being mapped, after a power cut; nobody was to carry it
            for hypothesis in self._hypotheses:
                hypothesis.behind = self._stayed(hypothesis)
        self._nowhere, self._looks = self._elsewhere(), 0
        yield from self._weigh(look, _GUESSED)

    def _compare(self, look: Look, driven: float) -> Generator[None, None, None]:
        """Weigh every hypothesis by a look, so many metres after the one before."""
        share = min(1.0, driven / (2 * REACH_M))
        for hypothesis in [*self._hypotheses, self._nowhere]:
            hypothesis.behind += share * hypothesis.newest
        yield from self._weigh(look, _FOLLOWED)

    def _weigh(self, look: Look, Q: Array) -> Generator[None, None, None]:
        for number, hypothesis in enumerate(self._hypotheses):
            if number % _FITS_A_STEP == 0:
                yield
            hypothesis.is_possible = self._fit(look, hypothesis, Q)
        self._conclude()

    def _conclude(self) -> None:
        self._looks += 1
        least = self._nowhere.weight + math.log(_HOPELESS)
        distinct: list[Hypothesis] = []
        for h in sorted(self._hypotheses, key=lambda h: -h.weight):
            if h.weight > least and not any(self._same(h, other) for other in distinct):
                distinct.append(h)
        self._hypotheses = distinct
        self._opinion = self._formed()

    def _same(self, one: Hypothesis, other: Hypothesis) -> bool:
        here = self._look.local_base
        return one.map_local.compose(here).is_near(other.map_local.compose(here), _ONE_M, _ONE_RAD)

    def _fit(self, look: Look, hypothesis: Hypothesis, Q: Array) -> bool:
        """Lay a look onto the map near a hypothesis and weigh it; whether that is possible."""
        points = look.local_base.inverse().transform(_some(look.walls, _POINTS))
        prior = hypothesis.map_local.compose(look.local_base)
        known = self._known
        found = register(points, known.tree, prior, Q, self._matching)
        if found is None:
            return False
        hypothesis.map_local = found.pose.compose(look.local_base.inverse())
        by_and_large, closely = self._disagreements(look, found.pose, points)
        hypothesis.newest, hypothesis.is_close = -by_and_large / _TELLING, closely < _CLOSE
        return True

    def _disagreements(self, look: Look, map_base: Pose, base_walls: Array) -> tuple[float, float]:
        """Share of the walls, of either map, that the other one should have and has not.

        And of those of the known map alone, for who looks closely: these have been seen.
        """
        laid = map_base.transform(base_walls)
        seen = self._known.is_seen(laid)
        off_map = np.asarray(self._known.tree.query(laid)[0])
        walls = self._known.points
        near = np.hypot(*(walls - map_base.position).T) < REACH_M
        there = look.local_base.compose(map_base.inverse()).transform(walls[near])
        there = there[look.local_map.known(there)]
        if not len(there):
            return 1.0, 1.0
        off_look = np.asarray(look.local_map.tree().query(there)[0])
        unknown_to_map = np.where(seen, _apart(off_map, *_APART_BY_AND_LARGE), self._chance).mean()
        by_and_large = max(unknown_to_map, _apart(off_look, *_APART_BY_AND_LARGE).mean())
        return float(by_and_large), float(_apart(off_look, *_APART_CLOSELY).mean())


def _apart(distance: Array, near: float, off: float) -> Array:
    """How surely points at distances (N,), m, from walls are on none of these, 0..1 (N,)."""
    return np.clip((distance - near) / (off - near), 0.0, 1.0)


def _best_turned(places: Array, scores: Array) -> Array:
    """Guesses (N, 4) of x, y, heading and score: what fits better than if turned a little."""
    best = (scores >= np.roll(scores, 1, axis=1)) & (scores > np.roll(scores, -1, axis=1))
    i, k = np.nonzero(best)
    return np.column_stack([places[i], k * (math.tau / _HEADINGS), scores[i, k]])


def _peaks(guesses: Array) -> Generator[None, None, Array]:
    """The best (N, 3), x, y and heading, of guesses (N, 4), none near a better one."""
    left = guesses[np.argsort(-guesses[:, 3], kind="stable")[:_COMPARED]]
    peaks: list[Array] = []
    while len(peaks) < _ROUGH_GUESSES and len(left):
        x, y, heading = left[0, :3].tolist()
        peaks.append(left[0, :3])
        turn = np.abs(wrap_angles(left[:, 2] - heading))
        left = left[(np.hypot(left[:, 0] - x, left[:, 1] - y) > _APART_M) | (turn > _APART_RAD)]
        if len(peaks) % _PEAKS_A_STEP == 0:
            yield
    return np.array(peaks).reshape(-1, 3)


def _some(points: Array, count: int) -> Array:
    """About so many of the points, evenly taken."""
    return points[:: max(1, len(points) // count)]
