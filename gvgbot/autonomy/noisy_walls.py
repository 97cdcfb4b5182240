"""The walls for the GVG, as thin as they are, whatever the laser's noise makes of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gvgbot.autonomy.gvg.coast import Space
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.tight_spots import TightSpots
from gvgbot.geometry import Array
from gvgbot.hal.messages import Scan
from gvgbot.hal.noise import excess_noise

_EXCESS_M = 0.0025  # beyond the usual noise: a laser with more is noisy
_NEWEST = 0.1  # weight of a scan in what is known of the noise
_FRINGE = 0.25  # of the hits of a neighbour; what has less is there by its noise
_NEIGHBOUR = 1.3  # cells; the means of the two may be as far apart


@dataclass(frozen=True, slots=True, eq=False)
class _Redrawn:
    """A space with its walls drawn otherwise."""

    space: Space
    walls: Array

    def points(self) -> Array:
        return self.walls

    def known(self, points: Array) -> NDArray[np.bool_]:
        return self.space.known(points)


class NoisyWalls:
    """What to take for walls; with a laser of usual noise it is all that the local map holds."""

    def __init__(self, room_m: float, config: LocalMapConfig) -> None:
        """The robot needs `room_m` from its middle to walls; `config` is that of the local map."""
        self._tight_spots = TightSpots(room_m, config.memory_m)
        self._neighbour = _NEIGHBOUR * config.cell_m
        self._excess: float | None = None

    @property
    def _is_noisy(self) -> bool:
        return self._excess is not None and self._excess > _EXCESS_M

    def note(self, scan: Scan, position: Array, local_map: LocalMap, travelled: float) -> None:
        """Account for a scan, taken at a position (2,), local frame, after so many metres."""
        excess = excess_noise(scan.ranges)
        before = excess if self._excess is None else self._excess
        self._excess = before + _NEWEST * (excess - before)
        if self._is_noisy:
            self._tight_spots.note(position, local_map.points(), travelled)

    def drawn(self, local_map: LocalMap) -> Space:
        """The local map, with its walls as they are to be taken."""
        if not self._is_noisy:
            return local_map
        walls = local_map.points()[~self._fringe(local_map)]
        return _Redrawn(local_map, self._tight_spots.eased(walls))

    def _fringe(self, local_map: LocalMap) -> NDArray[np.bool_]:
        """Which walls (N,) are but stray hits beside others, and narrow a gap."""
        hits = local_map.hits()
        most = hits.copy()
        pairs = local_map.tree().query_pairs(self._neighbour, output_type="ndarray")
        for one, other in (pairs.T, pairs.T[::-1]):
            np.maximum.at(most, one, hits[other])
        return np.asarray(hits < _FRINGE * most)
