"""Where the robot has been although it is hardly as wide there as it plans for: it fits.

A gap of about that width is wide enough at one look and not at the next. Whoever is in it then
would be cut off from both sides.
"""

import numpy as np

from gvgbot.autonomy.gvg.voronoi import Tight
from gvgbot.geometry import Array

_NEARLY_M = 0.03  # more room than it plans for: looks differ by that
_SCRAPING_M = 0.03  # beside the robot; with less the guard stops it
_APART_M = 0.05
_AROUND_M = 0.6  # of where it got stuck, nothing tells that it fits
_MEMORY_M = 20.0  # driven since: the local frame has drifted, and things may have been moved

_Place = tuple[float, Array]  # `travelled` then, m, and where (2,), local frame


class TightPlaces:
    """The latest of them, for a robot of a radius, m, and the margin, m, that it plans with."""

    def __init__(self, radius: float, margin: float) -> None:
        self._fits_m = radius + min(margin, _SCRAPING_M)
        self._roomy_m = radius + margin + _NEARLY_M
        self._fitted: list[_Place] = []
        self._stuck: list[_Place] = []

    def fit(self, place: Array, things: Array, travelled: float) -> None:
        """The robot is at a place (2,) among things (N, 2), local frame, after so many metres."""
        self._fitted, self._stuck = (
            [one for one in places if travelled - one[0] < _MEMORY_M]
            for places in (self._fitted, self._stuck)
        )
        room = np.hypot(*(things - place).T).min(initial=np.inf)
        is_told = _is_near(place, self._fitted, _APART_M) or _is_near(place, self._stuck, _AROUND_M)
        if room < self._roomy_m and not is_told:
            self._fitted.append((travelled, place))

    def get_stuck(self, place: Array, travelled: float) -> None:
        """The guard has held the robot up at a place (2,), local frame, after so many metres."""
        self._fitted = [one for one in self._fitted if not _is_near(place, [one], _AROUND_M)]
        self._stuck.append((travelled, place))

    @property
    def known(self) -> Tight:
        """Those where it fitted, and with how much room around its centre it does, m."""
        if not self._fitted:
            return Tight()
        return Tight(np.array([place for _, place in self._fitted]), self._fits_m)


def _is_near(place: Array, places: list[_Place], metres: float) -> bool:
    return any(np.hypot(*(place - other)) < metres for _, other in places)
