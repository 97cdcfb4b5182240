"""Where to look in the end, when all frontiers are explored and something may be missing.

Somebody may have stood in a door, or glass may have hidden it, as the robot passed.
"""

import math
from collections.abc import Callable

import numpy as np

from gvgbot.geometry import Array
from gvgbot.words import counted

_SAME_M = 1.0  # places nearer to each other are one
_STILL_M = 0.01  # from look to look, at most
_TOLD = 3  # places that are told of one by one
_MOST = 30  # visits altogether: where walls cannot be seen there is no end of unseen floor
_MOST_IN_VAIN = 6  # that do not count, as somebody stood in the way


class Unseen:
    """Remembers where the robot has gone for a look."""

    def __init__(self) -> None:
        self._visits: list[Array] = []
        self._is_sent = False  # to the last of them
        self._in_vain = 0  # visits that did not get there
        self._stands_at: float | None = None  # `travelled` when it was asked to stand
        self.is_done = False  # there is nothing to be gained
        self.left = np.empty((0, 2))  # places that are of no use, m, map frame

    def begin_anew(self) -> None:
        """Note that the robot explores, so that there is more to be seen."""
        self._stands_at, self.is_done, self.left = None, False, np.empty((0, 2))

    def is_standing(self, travelled: float) -> bool:
        """Whether the robot has come no further since this was asked last, at the look before.

        It should stand while the survey takes its time.
        """
        before, self._stands_at = self._stands_at, travelled
        return before is not None and travelled - before < _STILL_M

    def next(
        self, places: Array, metres_to: Callable[[Array], float | None], *, twice: bool
    ) -> Array | None:
        """Which of these (2,), m, map frame, to visit now: the nearest, less tried ones first.

        A visit that came to nothing is worth a second one only where things may have changed.
        """
        self._stands_at = None
        place = self._visit(places, metres_to, 1 + twice)
        if place is None:
            self.left = places
        return place

    def once_more(self, places: Array, metres_to: Callable[[Array], float | None]) -> Array | None:
        """Which of these to visit when there are no others; nothing is missing there for sure."""
        return self._visit(places, metres_to, 1)

    def _visit(
        self, places: Array, metres_to: Callable[[Array], float | None], most: int
    ) -> Array | None:
        chances = [
            (tries, metres, place.tolist())
            for place in places
            if (tries := self._tries(place)) < most
            and (metres := metres_to(place)) is not None
            and len(self._visits) < _MOST
        ]
        self.is_done = not chances
        if not chances:
            return None
        self._visits.append(np.array(min(chances)[2]))
        self._is_sent = True
        return self._visits[-1]

    def judge(self, position: Array, *, is_somebody_there: bool) -> bool:
        """Whether the last visit counts, which has led to a position (2,), m, map frame.

        Where somebody may have been in the way, one that did not get there does not.
        """
        is_vain = self._is_sent and not self.is_visited(position)
        self._is_sent = False
        if not (is_vain and is_somebody_there and self._in_vain < _MOST_IN_VAIN):
            return True
        self._visits.pop()
        self._in_vain += 1
        return False

    def is_visited(self, place: Array) -> bool:
        """Whether this (2,), m, map frame, is where it was sent to last."""
        return bool(self._visits) and math.dist(self._visits[-1], place) < _SAME_M

    @property
    def where(self) -> str:
        """The places that are of no use, in words."""
        return places_in_words(self.left)

    def _tries(self, place: Array) -> int:
        return sum(bool(np.hypot(*(place - visit)) < _SAME_M) for visit in self._visits)


def places_in_words(places: Array) -> str:
    """The first of some places (N, 2), m, and how many more there are."""
    told = ", ".join(f"({x:z.1f}, {y:z.1f})" for x, y in places[:_TOLD].tolist())
    rest = len(places) - _TOLD
    return told + (f" and {counted(rest, 'more place')}" if rest > 0 else "")
