"""Since when the robot has not been anywhere new."""

import math
from itertools import product

import numpy as np

from gvgbot.geometry import Array

_CELL_M = 1.0
_LATELY_S = 60.0  # a cell beside one where it was before that is not new: maps sway
_AT_LEAST_S = 600.0
_SPEED_MPS = 0.4  # about how fast it comes on


class NewGround:
    """Cells of the map where the robot has been.

    Among things between which it hardly fits, frontiers may come and go without end.
    """

    def __init__(self) -> None:
        self._cells = dict[tuple[int, int], float]()  # and the stamp of the first time
        self._since: float | None = None  # stamp
        self._patience = 1.0  # half as much each time it has run out

    def note(self, place: Array, stamp: float) -> None:
        """The robot is at a place (2,), m, map frame."""
        x, y = np.floor(place / _CELL_M).astype(int).tolist()
        beside = product((x - 1, x, x + 1), (y - 1, y, y + 1))
        known = [self._cells[cell] for cell in beside if cell in self._cells]
        is_new = (x, y) not in self._cells and min(known, default=stamp) > stamp - _LATELY_S
        if is_new:
            self._patience = 1.0
        if is_new or self._since is None:
            self._since = stamp
        self._cells.setdefault((x, y), stamp)

    def restart(self) -> None:
        """Count anew: it had something else to do, or to wait for others."""
        self._since = None

    def run_out(self) -> None:
        """There is no more hope; the next time sooner, unless there is new ground by then."""
        if self._since != -math.inf:
            self._since, self._patience = -math.inf, 0.5 * self._patience

    def skip(self, seconds: float) -> None:
        """Do not count a time in which nothing was to be seen."""
        self._since = None if self._since is None else self._since + seconds

    def is_over(self, edges_m: float, stamp: float) -> bool:
        """Whether it has had the time to drive all edges, so many metres, twice since then.

        After that has run out, half of it; there is an end to what looks like frontiers.
        """
        since = stamp if self._since is None else self._since
        patience_s = _AT_LEAST_S + 2.0 * edges_m / _SPEED_MPS
        return stamp - since > self._patience * patience_s
