"""How long the robot has been about one place, also if it drives to and fro there."""

import numpy as np

from gvgbot.geometry import Array

_ABOUT_M = 1.5  # from a place; whoever drives to and fro between two ideas gets hardly so far


class Stay:
    """A place, and since when the robot has not got away from it."""

    def __init__(self) -> None:
        self._place: Array | None = None
        self._since = 0.0  # stamp

    def note(self, place: Array, stamp: float) -> float:
        """For how many seconds it has been about where it is now (2,)."""
        if self._place is None or np.hypot(*(place - self._place)) > _ABOUT_M:
            self._place, self._since = place, stamp
        return stamp - self._since

    def end(self) -> None:
        """Count anew: there was a reason to stay."""
        self._place = None

    def skip(self, seconds: float) -> None:
        """Do not count a time in which nothing could be done."""
        self._since += seconds
