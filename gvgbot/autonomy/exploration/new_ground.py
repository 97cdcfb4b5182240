"""How much longer it is worth while to go after frontiers: as long as they lead anywhere new."""

import math
from itertools import product

from gvgbot.geometry import Array

_CELL_M = 1.0
_LATELY_S = 60.0  # a cell beside one where it was before that is not new: maps sway
_AT_LEAST_S = 600.0
_SPEED_MPS = 0.4  # about how fast it comes on
_EARNED_S = 20.0  # by each new cell: a slow robot needs half of that to cross it
_TO_END_S = 600.0  # for what is left to be done without hope, all together


class NewGround:
    """Cells of the map where the robot has been, and the patience that they earn.

    Among people, and among things between which it hardly fits, frontiers may come and go without
    end. So patience is used up by time, and earned by new ground alone: every exploration ends, in
    a time in proportion to the floor that it has driven over.
    """

    def __init__(self) -> None:
        self._cells = dict[tuple[int, int], float]()  # and the stamp of the first time
        self._left_s, self._hopeless_s = _AT_LEAST_S, 0.0
        self._counted: float | None = None  # stamp, up to which time is used up

    def note(self, place: Array, stamp: float, edges_m: float) -> None:
        """The robot is at a place (2,), m, map frame, and so many metres of edges are known.

        There is never more patience than for driving all of them twice.
        """
        used_s = 0.0 if self._counted is None else stamp - self._counted
        self._counted = stamp
        self._hopeless_s += max(0.0, used_s - self._left_s)
        self._left_s = max(0.0, self._left_s - used_s)
        if self._is_new(place, stamp):
            most_s = _AT_LEAST_S + 2.0 * edges_m / _SPEED_MPS
            self._left_s = min(self._left_s + _EARNED_S, most_s)

    def _is_new(self, place: Array, stamp: float) -> bool:
        """Whether it was neither in this cell before nor, but for just now, beside it."""
        x, y = (math.floor(v / _CELL_M) for v in place.tolist())
        beside = product((x - 1, x, x + 1), (y - 1, y, y + 1))
        known = [self._cells[cell] for cell in beside if cell in self._cells]
        is_new = (x, y) not in self._cells and min(known, default=stamp) > stamp - _LATELY_S
        self._cells.setdefault((x, y), stamp)
        return is_new

    def set_aside(self) -> None:
        """Do not count the time until the next note: there is something else to do, or a wait."""
        self._counted = None

    def skip(self, seconds: float) -> None:
        """Do not count a time in which nothing was to be seen."""
        self._counted = None if self._counted is None else self._counted + seconds

    @property
    def is_over(self) -> bool:
        """Whether nothing has led anywhere new for so long that no frontier is worth a try."""
        return self._left_s == 0.0

    @property
    def is_past_its_end(self) -> bool:
        """Whether the robot has had the time to end since then as well."""
        return self._hopeless_s > _TO_END_S
