"""The lines of a log in the order in which they were true, without those that cannot be."""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from operator import attrgetter

import numpy as np

from gvgbot.geometry import Pose
from gvgbot.hal.messages import Odometry, Scan

LONGEST_PAUSE_S = 300.0  # what is longer comes of a clock that was set, or of a damaged stamp
_JUMP_M, _JUMP_MPS = 10.0, 10.0  # from one pose to the next; what is beyond both is no motion
_SET_BACK_S = 2.0  # lines that are only late are late by less
_NEIGHBOURS = 5  # lines, most of which have good stamps
_SHORTER = 0.99  # of the way, if lines come in the order in which they were true


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """Where a base was, and what its laser saw if the line has that; counted from 1."""

    number: int
    odometry: Odometry
    scan: Scan | None

    @property
    def stamp(self) -> float:
        """When it was true, s."""
        return self.odometry.stamp

    @property
    def pose(self) -> Pose:
        """Of the base, by its odometry."""
        return self.odometry.odom_base

    def later(self, seconds: float) -> "Line":
        """The same after so much time."""
        stamp = self.stamp + seconds
        scan = None if self.scan is None else replace(self.scan, stamp=stamp)
        return Line(self.number, replace(self.odometry, stamp=stamp), scan)


def in_order(lines: list[Line]) -> tuple[list[Line], list[int]]:
    """Those that can be true, by their stamps, and the numbers of those where a clock was set back.

    What follows one of these is moved on to after all that is before it.
    """
    strays = _strays(sorted({line.stamp for line in lines}))
    timely = [line for line in lines if line.stamp not in strays]
    ordered, starts = _by_stamp(timely), _set_back(timely)
    if starts:
        moved = _moved(timely, starts)
        if _way(moved) < _SHORTER * _way(ordered):
            return _within_reach(moved), [timely[k].number for k in starts]
    return _within_reach(ordered), []


def _by_stamp(lines: list[Line]) -> list[Line]:
    return sorted(lines, key=attrgetter("stamp"))


def _way(lines: list[Line]) -> float:
    """What a base drives that is at all these places, m; less for those that no base reaches."""
    return sum(min(a.pose.distance(b.pose), _JUMP_M) for a, b in pairwise(lines))


def _set_back(lines: list[Line]) -> list[int]:
    """Where most of the next lines are earlier than most of those just before."""
    stamps = np.array([line.stamp for line in lines])
    if len(stamps) < 2 * _NEIGHBOURS:
        return []
    middles = np.median(np.lib.stride_tricks.sliding_window_view(stamps, _NEIGHBOURS), axis=1)
    falls = middles[:-_NEIGHBOURS] - middles[_NEIGHBOURS:]
    here = stamps[_NEIGHBOURS - 1 : -_NEIGHBOURS] - stamps[_NEIGHBOURS : 1 - _NEIGHBOURS]
    found = np.flatnonzero((falls > _SET_BACK_S) & (here > _SET_BACK_S)) + _NEIGHBOURS
    return [int(k) for k in found]


def _moved(lines: list[Line], starts: list[int]) -> list[Line]:
    """The parts that begin at these indices one after the other, each by its stamps."""
    moved = _by_stamp(lines[: starts[0]])
    for start, end in pairwise([*starts, len(lines)]):
        part = _by_stamp(lines[start:end])
        seconds = moved[-1].stamp - part[0].stamp
        moved += [line.later(seconds) for line in part]
    return moved


def _strays(stamps: list[float]) -> set[float]:
    """Those of ascending stamps that are far from all others, unless all are."""
    gaps = [math.inf, *(later - earlier for earlier, later in pairwise(stamps)), math.inf]
    nearest = map(min, pairwise(gaps))
    found = {s for s, gap in zip(stamps, nearest, strict=False) if gap > LONGEST_PAUSE_S}
    return found if len(found) < len(stamps) else set()


def _within_reach(lines: list[Line]) -> list[Line]:
    """Those to which a base can have driven, on and back from the longest way without a jump."""
    pairs = enumerate(pairwise(lines), start=1)
    jumps = [k for k, (earlier, later) in pairs if not _can_reach(earlier, later)]
    stretches = pairwise([0, *jumps, len(lines)])
    end = max(stretches, key=lambda stretch: stretch[1] - stretch[0])[1]
    return [*_reached(lines[:end][::-1])[::-1], *_reached(lines[end - 1 :])[1:]]


def _reached(lines: list[Line]) -> list[Line]:
    """Those that can be reached from the one before that can be, as the first is."""
    reached = lines[:1]
    for line in lines[1:]:
        if _can_reach(reached[-1], line):
            reached.append(line)
    return reached


def _can_reach(one: Line, other: Line) -> bool:
    most = max(_JUMP_M, _JUMP_MPS * abs(other.stamp - one.stamp))
    return one.pose.distance(other.pose) <= most
