"""How much longer it is worth while to go after frontiers: as long as they lead anywhere new."""

import math
from itertools import product

from gvgbot.geometry import Array

_CELL_M = 1.0
_LATELY_S = 60.0  # a cell beside one where it was before that is not new: maps sway
_AT_LEAST_S = 600.0
_SPEED_MPS = 0.4  # about how fast it comes on
_EARNED_S = 20.0  # at least, by each new cell
_TO_END_S = 600.0  # for what is left to be done without hope, all together


class NewGround:
    """Cells of the map where the robot has been, and the patience that they earn.

    Among people, and among things between which it hardly fits, frontiers may come and go without
    end. So patience is used up by time, and earned by new ground and new edges alone: every
    exploration ends, in a time in proportion to what there is of them.
    """

    def __init__(self) -> None:
        self._cells = dict[tuple[int, int], float]()  # and the stamp of the first time
        self._left_s, self._hopeless_s = _AT_LEAST_S, 0.0
        self._most_m = 0.0  # of edges that were ever known
        self._counted: float | None = None  # stamp, up to which time is used up

    def note(self, place: Array, stamp: float, edges_m: float) -> None:
        """The robot is at a place (2,), m, map frame, and so many metres of edges are known.

        There is never more patience than for driving all of them twice.
        """
        used_s = 0.0 if self._counted is None else stamp - self._counted
        self._counted = stamp
        self._hopeless_s += max(0.0, used_s - self._left_s)
        self._left_s = max(0.0, self._left_s - used_s)
        earned_s = self._earned_by(place, stamp) + _time_for(edges_m - self._most_m)
        self._most_m = max(self._most_m, edges_m)
        if earned_s > 0.0:
            self._left_s = min(self._left_s + earned_s, _AT_LEAST_S + _time_for(edges_m))

    def _earned_by(self, place: Array, stamp: float) -> float:
        """Patience (s) for a cell in which, and but for just now beside which, it never was.

        A slow robot gets twice the time that it has taken to cross the one before.
        """
        x, y = (math.floor(v / _CELL_M) for v in place.tolist())
        beside = product((x - 1, x, x + 1), (y - 1, y, y + 1))
        known = [self._cells[cell] for cell in beside if cell in self._cells]
        is_new = (x, y) not in self._cells and min(known, default=stamp) > stamp - _LATELY_S
        self._cells.setdefault((x, y), stamp)
        return max(_EARNED_S, 2.0 * (stamp - max(known, default=stamp))) if is_new else 0.0

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


def _time_for(edges_m: float) -> float:
    """Time (s) to drive so many metres of edges twice; none for less than nothing."""
    return max(0.0, 2.0 * edges_m / _SPEED_MPS)
