"""Where the robot just fits: a noisy laser makes gaps look narrower than they are."""

from collections import deque

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.geometry import Array

_TIGHT_M = 0.1  # more than the robot needs: where walls are as near, noise may close the way
_STEP_M = 0.05  # between two of the spots
_FARTHEST_M = 0.5  # from one position to the next, if it was driven
_NOISE_M = 0.11  # what is nearer to where it was than it needs, by more than this, has come since


class TightSpots:
    """Where the middle of the robot was, local frame, with walls nearer than it needs, or nearly.

    It fits there, though they may seem nearer to a noisy laser. A door would close behind it
    otherwise while it is in the door, or in the room behind.
    """

    def __init__(self, room_m: float, memory_m: float) -> None:
        """The robot needs `room_m` from its middle to walls; spots last for `memory_m` driven."""
        self._room, self._memory = room_m, memory_m
        self._spots: deque[tuple[float, Array]] = deque()  # metres driven, and positions (N, 2)
        self._last: Array | None = None

    def note(self, position: Array, walls: Array, travelled: float) -> None:
        """Account for a position (2,) among noisy walls (N, 2), after so many metres driven."""
        before = position if self._last is None else self._last
        moved = float(np.hypot(*(position - before)))
        if self._last is not None and moved < _STEP_M / 2:
            return
        self._last = position
        while self._spots and self._spots[0][0] < travelled - self._memory:
            self._spots.popleft()
        if not len(walls) or np.hypot(*(walls - position).T).min() > self._room + _TIGHT_M:
            return
        steps = 1 + round(moved / _STEP_M) if moved < _FARTHEST_M else 1
        self._spots.append((travelled, np.linspace(position, before, steps)))

    def eased(self, walls: Array) -> Array:
        """Walls (N, 2), as far off from where the robot was as it needs."""
        if not self._spots or not len(walls):
            return walls
        spots = np.concatenate([spots for _, spots in self._spots])
        away, nearest = (np.asarray(found) for found in cKDTree(spots).query(walls))
        needed = self._room + _STEP_M / 8  # so that there is room between two spots as well
        near = np.flatnonzero((away < needed) & (away > self._room - _NOISE_M))
        if not len(near):
            return walls
        walls, spot = walls.copy(), spots[nearest[near]]
        walls[near] = spot + (walls[near] - spot) * (needed / away[near])[:, None]
        return walls
