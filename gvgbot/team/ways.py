"""From a vertex along what robots have driven, one over the other's way, to the next vertex.

Two that follow an edge from both ends meet in its middle; a robot that starts on an edge drives one
half of it. So an edge may be driven by several robots, and by none from end to end.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from gvgbot.autonomy.whereabouts import LEAST_LOOP_M
from gvgbot.geometry import Array, direction_of, length_of, resampled, stations_of, wrap_angle
from gvgbot.registration import AHEAD_M, SAME_RAD

WELL_ON_M = 3.0  # beyond a vertex, who did not see it is as right as who did
BESIDE_M = 0.45  # from a line, a place lies on it
_GAP_M = 1.0  # between two ways: robots that meet keep so far apart
_APART_M = 1.5  # from a vertex, two ways that leave it are apart
_LEAST_M = 0.3  # of a way that is gone on with
_MOST = 16  # pieces
_SPACING_M = 0.1
_ASTRAY, _CUT = 20, 3  # points at the end of a way that may lead astray, cut off so many at a time


@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """Where one arrives (the index of a place) along a line (N, 2), m, with this least clearance.

    `length` is that of the line, m.
    """

    place: int
    line: Array
    min_clearance: float
    length: float


def leads_over(line: Array, point: Array, on_m: float) -> bool:
    """Whether a line (N, 2) leads over a point (2,) and so far on, m, to both sides."""
    away = np.hypot(*(line - point).T)
    return bool(away.min() < BESIDE_M and away[[0, -1]].min() > on_m)


class Ways:
    """What robots have driven along, in one frame: lines (N, 2), m, and their clearances, m.

    `places` (M, 2) are the vertices that the lines may lead to.
    """

    def __init__(self, lines: Sequence[tuple[Array, float]], places: Array) -> None:
        self._lines = [resampled(line, _SPACING_M) for line, _ in lines]
        self._clearances = [clearance for _, clearance in lines]
        self._places = places
        points = np.concatenate([np.empty((0, 2)), *self._lines])
        self._of = np.repeat(np.arange(len(self._lines)), [len(line) for line in self._lines])
        self._tree = cKDTree(points)

    def behind(self, place: int, bearing: float, taken: Sequence[Array] = ()) -> Walk | None:
        """The way from a place in a direction, rad, to the next place; None if it is not known.

        `taken` are lines (N, 2) of edges that leave the place in other directions, as it is known:
        what begins along one of them is that edge, though it may set out in this direction.
        """
        pieces, used = list[Array](), set[int]()
        found = self._onwards(self._places[place], bearing, used, BESIDE_M, taken)
        while found is not None and len(used) < _MOST:
            number, piece = found
            used.add(number)
            arrived = self._arrival(piece, place, sum(map(length_of, pieces)))
            pieces.append(piece if arrived is None else piece[: arrived[1] + 1])
            if arrived is not None:
                line = np.concatenate(pieces)
                if len(line) < 2:  # two vertices at one place
                    return None
                clearance = min(self._clearances[k] for k in used)
                return Walk(arrived[0], line, clearance, length_of(line))
            found = self._beyond(pieces, used, taken)
        return None

    def _beyond(
        self, pieces: list[Array], used: set[int], taken: Sequence[Array]
    ) -> tuple[int, Array] | None:
        """The line that goes on from the last piece, and its number; see `_onwards`.

        Where robots meet they go round each other: such an end is cut off if nothing goes on there,
        as long as what is left tells the direction.
        """
        last = pieces[-1]
        least = max(len(last) - _ASTRAY, round(AHEAD_M / _SPACING_M))
        for count in range(len(last), min(least, len(last) - 1), -_CUT):
            here = last[count - 1 :: -1]
            ahead = direction_of(here, AHEAD_M) + math.pi
            found = self._onwards(here[0], ahead, used, _GAP_M, taken)
            if found is not None:
                pieces[-1] = last[:count]
                return found
        return None

    def _onwards(
        self,
        here: Array,
        ahead: float,
        used: set[int],
        gap: float,
        taken: Sequence[Array],
    ) -> tuple[int, Array] | None:
        """The longest line that goes on from a point (2,) in a direction, and its number."""
        near = np.unique(self._of[self._tree.query_ball_point(here, math.hypot(gap, BESIDE_M))])
        best: tuple[int, Array] | None = None
        for number in sorted(set(near.tolist()) - used):
            line = self._lines[number]
            dx, dy = (line - here).T
            along = dx * math.cos(ahead) + dy * math.sin(ahead)
            aside = dy * math.cos(ahead) - dx * math.sin(ahead)
            is_ahead = (np.abs(aside) <= BESIDE_M) & (along > -BESIDE_M) & (along < gap)
            if not is_ahead.any():
                continue
            i = int(np.where(is_ahead, np.hypot(dx, dy), np.inf).argmin())
            for rest in (line[i:], line[i::-1]):
                least = _LEAST_M if best is None else length_of(best[1])
                if length_of(rest) > least and _leads(rest, ahead, taken):
                    best = number, rest
        return best

    def _arrival(self, line: Array, start: int, before: float) -> tuple[int, int] | None:
        """The first place that a line leads to, and the index of its point there.

        To its start it leads only round something, metres `before` it included.
        """
        away = cdist(line, self._places)
        away[: np.searchsorted(stations_of(line), LEAST_LOOP_M - before), start] = math.inf
        on = np.flatnonzero((away < BESIDE_M).any(axis=1))
        if not len(on):
            return None
        place = int(away[on[0]].argmin())
        there = away[on[0] : on[0] + math.ceil(2 * BESIDE_M / _SPACING_M), place]
        return place, int(on[0] + there.argmin())


def _leads(line: Array, ahead: float, taken: Sequence[Array]) -> bool:
    """Whether a line (N, 2) sets out in a direction, rad, and along no other one."""
    turned = abs(wrap_angle(direction_of(line, AHEAD_M) - ahead))
    return turned < SAME_RAD and not any(_begins_along(line, other) for other in taken)


def _begins_along(line: Array, other: Array) -> bool:
    """Whether a line (N, 2) begins beside another one, which sets out at the same place."""
    begins = line[: 1 + round(_APART_M / _SPACING_M)]
    away, _ = cKDTree(resampled(other, _SPACING_M)).query(begins)
    return bool(np.max(away) < BESIDE_M)
