"""Since when the robot has not been anywhere new."""

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

    def note(self, place: Array, stamp: float) -> None:
        """The robot is at a place (2,), m, map frame."""
        x, y = np.floor(place / _CELL_M).astype(int).tolist()
        beside = product((x - 1, x, x + 1), (y - 1, y, y + 1))
        known = [self._cells[cell] for cell in beside if cell in self._cells]
        is_new = (x, y) not in self._cells and min(known, default=stamp) > stamp - _LATELY_S
        if is_new or self._since is None:
            self._since = stamp
        self._cells.setdefault((x, y), stamp)

    def restart(self) -> None:
        """Count anew: it had something else to do, or to wait for others."""
        self._since = None

    def skip(self, seconds: float) -> None:
        """Do not count a time in which nothing was to be seen."""
        self._since = None if self._since is None else self._since + seconds

    def is_over(self, edges_m: float, stamp: float) -> bool:
        """Whether it has had the time to drive all edges, so many metres, twice since then."""
        since = stamp if self._since is None else self._since
        return stamp - since > _AT_LEAST_S + 2.0 * edges_m / _SPEED_MPS
