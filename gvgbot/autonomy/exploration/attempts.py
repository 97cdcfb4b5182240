"""How often frontiers at a place have been explored, for there may always be another one."""

import numpy as np

from gvgbot.geometry import Array

_SAME_M = 1.0  # places nearer than this are one
_MOST = 10  # frontiers explored at a place: no vertex has so many departures


class Attempts:
    """Counts the frontiers that were explored, or have gone, by the places of their vertices.

    At a threshold of sight a vertex may be taken out and found again for ever.
    """

    def __init__(self) -> None:
        self._places: list[Array] = []
        self._under_way: Array | None = None

    def begin(self, place: Array) -> None:
        """The robot sets out for a frontier of a vertex at a place (2,), m, map frame."""
        self._under_way = place

    def end(self) -> None:
        """It is none any more, explored or gone."""
        if self._under_way is not None:
            self._places.append(self._under_way)
        self._under_way = None

    def are_vain(self, place: Array) -> bool:
        """Whether so many have been explored at a place (2,), m, map frame, that it must end."""
        near = [one for one in self._places if np.hypot(*(place - one)) < _SAME_M]
        return len(near) >= _MOST
