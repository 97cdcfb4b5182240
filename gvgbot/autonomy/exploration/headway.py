"""Since when the robot has not come on, or not away from where it is about."""

import math

import numpy as np

from gvgbot.autonomy.exploration.stay import Stay
from gvgbot.geometry import Array

_FAR_M = 0.3  # to and fro on the spot is no headway
_LONGEST_VIEW_S = 2.0  # a longer gap between views is an outage, not a lack of headway


class Headway:
    """A place, and when the robot came there; whoever has a reason to wait counts anew."""

    def __init__(self) -> None:
        self._place: Array | None = None
        self._since = 0.0  # stamp
        self._last_view = math.inf  # stamp
        self._stay = Stay()

    def note(self, place: Array, stamp: float) -> float:
        """For how many seconds the robot, seen here (2,), local frame, has not come on."""
        if self._place is None or np.hypot(*(place - self._place)) > _FAR_M:
            self._place, self._since = place, stamp
        unseen = max(0.0, stamp - self._last_view - _LONGEST_VIEW_S)
        self._since = min(self._since + unseen, stamp)  # it may have begun to wait meanwhile
        self._stay.skip(unseen)
        self._last_view = stamp
        return max(self._stay.note(place, stamp), self.waited(stamp))

    def waited(self, stamp: float) -> float:
        """For how many seconds it has been at the place where it was last noted."""
        return stamp - self._since

    def restart(self, stamp: float) -> None:
        """Count the waiting anew."""
        self._since = stamp

    def restart_stay(self) -> None:
        """Count anew for how long it has been about one place."""
        self._stay.end()

    def skip(self, seconds: float) -> None:
        """Do not count a time in which nothing was to be seen."""
        self._since += seconds
        self._last_view += seconds
        self._stay.skip(seconds)
