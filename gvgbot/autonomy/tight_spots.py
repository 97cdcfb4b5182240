"""Where the robot just fits: a noisy laser makes gaps look narrower than they are."""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gvgbot.autonomy.gvg.coast import Space
from gvgbot.geometry import Array
from gvgbot.hal.messages import Scan
from gvgbot.hal.sweep import excess_noise

_TIGHT_M = 0.1  # more than the robot needs: where walls are as near, noise may close the way
_STEP_M = 0.05  # between two of the spots
_NEW = 0.5  # of the room it needs: what is nearer to where it was has come since
# Sigmas beyond the usual by which either side of a gap comes nearer in the local map: passing a
# door showed 5, 10 and 25 mm with a sigma of 15, 20 and 30 mm.
_NEARER = 1.5
_LEAST_MARGIN = 0.4  # of what is to spare, whatever the noise


@dataclass(frozen=True, slots=True, eq=False)
class _Eased:
    """A space whose walls give way."""

    space: Space
    walls: Array

    def points(self) -> Array:
        return self.walls

    def known(self, points: Array) -> NDArray[np.bool_]:
        return self.space.known(points)


class TightSpots:
    """Where the middle of the robot was, local frame, with walls nearer than it needs, or nearly.

    It fits there, however near they may seem. A door would close behind it otherwise while it is in
    the door, or in the room behind.
    """

    def __init__(self, radius: float, margin: float, memory_m: float) -> None:
        """Of a robot that wants a margin, m, to each side; they last for `memory_m` driven."""
        self._radius, self._margin, self._memory = radius, margin, memory_m
        self._room = radius + margin
        self._spots: deque[tuple[float, Array]] = deque()  # metres driven, and positions (N, 2)
        self._last: Array | None = None

    def note(self, position: Array, walls: Array, travelled: float) -> None:
        """Account for a position (2,) among walls (N, 2), after so many metres driven."""
        before, self._last = self._last, position
        while self._spots and self._spots[0][0] < travelled - self._memory:
            self._spots.popleft()
        if not len(walls) or np.hypot(*(walls - position).T).min() > self._room + _TIGHT_M:
            return
        before = position if before is None else before
        steps = 1 + round(float(np.hypot(*(position - before))) / _STEP_M)
        self._spots.append((travelled, np.linspace(before, position, steps)))

    def least_clearance(self, scan: Scan) -> float:
        """How far, m, the middle of the robot has to be from walls as a local map shows them."""
        nearer = _NEARER * excess_noise(scan.ranges)
        return self._radius + max(self._margin - nearer, _LEAST_MARGIN * self._margin)

    def eased(self, space: Space) -> Space:
        """The space, with its walls as far off from where the robot was as it needs."""
        walls = space.points()
        if not self._spots or not len(walls):
            return space
        spots = np.concatenate([spots for _, spots in self._spots])
        away, nearest = (np.asarray(found) for found in cKDTree(spots).query(walls))
        needed = self._room + _STEP_M / 8  # so that there is room between two spots as well
        near = np.flatnonzero((away < needed) & (away > _NEW * self._room))
        if not len(near):
            return space
        walls, spot = walls.copy(), spots[nearest[near]]
        walls[near] = spot + (walls[near] - spot) * (needed / away[near])[:, None]
        return _Eased(space, walls)
