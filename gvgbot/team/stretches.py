"""Ways between two vertices of a chart, by which it may lie on another one."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gvgbot.geometry import Array

_LEAST_BASE_M = 1.0  # between two vertices that suggest a transform
_LENGTH_M, _LENGTH_SHARE = 0.35, 0.03  # by which the same stretch may differ in two charts
_COMPARED_AT_A_TIME = 1_000_000  # stretches with stretches
_CLEARANCE_M, _CLEARANCE_SHARE = 0.1, 0.03

Complex = NDArray[np.complex128]
Metres = TypeVar("Metres", float, Array)


@dataclass(frozen=True, slots=True, eq=False)
class Stretches:
    """So many of them (N)."""

    ends: NDArray[np.intp]  # (N, 2), indices of vertices
    places: Complex  # (N, 2), of these
    metres: Array  # (N,), that are driven between
    is_meetpoint: NDArray[np.bool_]  # (N, 2), of the ends
    clearance: Array  # (N, 2), m, at the ends

    @property
    def way(self) -> Complex:
        """From end to end (N,)."""
        way: Complex = self.places[:, 1] - self.places[:, 0]
        return way

    def both_ways(self) -> "Stretches":
        """These, and then the same from their other ends."""
        return Stretches(
            np.concatenate([self.ends, self.ends[:, ::-1]]),
            np.concatenate([self.places, self.places[:, ::-1]]),
            np.concatenate([self.metres, self.metres]),
            np.concatenate([self.is_meetpoint, self.is_meetpoint[:, ::-1]]),
            np.concatenate([self.clearance, self.clearance[:, ::-1]]),
        )

    def alike(self, others: "Stretches") -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Which of these and of the others may be the same, by their indices.

        Some at a time: a building of a thousand vertices has some thousand stretches.
        """
        some = 1 + _COMPARED_AT_A_TIME // max(1, len(others.ends))
        rows, columns = [np.empty(0, np.intp)], [np.empty(0, np.intp)]
        for first in range(0, len(self.ends), some):
            i, j = np.nonzero(self._match(slice(first, first + some), others))
            rows.append(first + i)
            columns.append(j)
        return np.concatenate(rows), np.concatenate(columns)

    def _match(self, some: slice, others: "Stretches") -> NDArray[np.bool_]:
        """Whether each of some of these (n,) may be each of the others (M,), as a matrix (n, M)."""
        metres, apart = self.metres[some, None], np.abs(self.way)[some, None]
        limit, others_apart = leeway(metres), np.abs(others.way)
        alike = (np.abs(apart - others_apart) < limit) & (np.abs(metres - others.metres) < limit)
        alike &= (apart > _LEAST_BASE_M) & (others_apart > _LEAST_BASE_M)
        for end in (0, 1):
            alike &= self.is_meetpoint[some, None, end] == others.is_meetpoint[:, end]
            alike &= as_clear(self.clearance[some, None, end], others.clearance[:, end])
        matrix: NDArray[np.bool_] = alike
        return matrix


def leeway(metres: Metres) -> Metres:
    """By how many metres the same stretch may differ in two charts."""
    return _LENGTH_M + _LENGTH_SHARE * metres


def as_clear(ours: Array, theirs: Array, apart: float = 0.0) -> NDArray[np.bool_]:
    """Whether two clearances, m, may be those of one vertex in two charts, `apart` m if laid.

    The distance to the nearest wall changes by no more than one moves: it is Lipschitz by 1.
    """
    limit = _CLEARANCE_M + _CLEARANCE_SHARE * ours + apart
    alike: NDArray[np.bool_] = np.abs(ours - theirs) <= limit
    return alike
