"""Things that stand where there was nothing before: people, mostly, who go again.

They are kept out of the map until they have stood for a while, and nothing that depends on them is
believed for a while longer. The guard sees them all the same.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gvgbot.autonomy.gvg.local_map import LocalMap
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan
from gvgbot.ranges import Range

_CELL_M = 0.2
_AROUND = 0.15 * np.stack([f(np.arange(8) * np.pi / 4) for f in (np.cos, np.sin)], axis=1)  # m
_STEP_M = 0.3  # in range from beam to beam, at the rim of something
_BEAMS = 3  # fewer see nothing for sure
_WIDE_M = 1.0  # no person is that wide
_REACH_M = 6.0  # beyond, beams are too far apart to tell what was there before
_LOST_S = 3.0  # what has not been seen for so long has gone, and begins anew if it comes back

Cell = tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class NewcomersConfig:
    """When something new is taken for a part of the building."""

    away_from_walls_m: Annotated[float, Range(0.1, 2.0)] = 0.2  # nearer to a wall, it is the wall
    # standing for so long, it enters the local map
    mapped_after_s: Annotated[float, Range(0.0, 600.0)] = 5.0
    # standing for so long, vertices may depend on it
    believed_after_s: Annotated[float, Range(0.0, 3600.0)] = 120.0


@dataclass(slots=True, eq=False)
class _Stay:
    first: float  # stamps
    last: float


class Newcomers:
    """Where something has come lately, by cells of the local frame."""

    def __init__(self, config: NewcomersConfig) -> None:
        self._config = config
        self._stays: dict[Cell, _Stay] = {}

    def sift(self, scan: Scan, local_base: Pose, local_map: LocalMap) -> Scan:
        """The scan without the beams that end on something which has come a moment ago."""
        self._forget(scan.stamp)
        beams = np.flatnonzero(_in_front(scan) & (scan.ranges < _REACH_M))
        ends = _ends(scan, beams, local_base)
        cells = [(i, j) for i, j in np.floor(ends / _CELL_M).astype(int).tolist()]
        is_new = self._is_new(ends, local_map)
        passing = [
            beam
            for beam, cell, new in zip(beams.tolist(), cells, is_new.tolist(), strict=True)
            if (new or cell in self._stays)
            and self._age(cell, scan.stamp) < self._config.mapped_after_s
        ]
        if not passing:
            return scan
        ranges = scan.ranges.copy()
        ranges[passing] = np.nan
        return replace(scan, ranges=ranges)

    def _is_new(self, ends: Array, local_map: LocalMap) -> NDArray[np.bool_]:
        """Which points (N, 2) lie where the map has known nothing but free space.

        All around: behind a wall that comes into sight nothing is known.
        """
        walls = local_map.points()
        known = local_map.known(ends[:, None, :] + _AROUND).all(axis=1)
        if not len(walls) or not known.any():
            return np.zeros(len(ends), bool)
        limit = self._config.away_from_walls_m
        distance, _ = cKDTree(walls).query(ends, distance_upper_bound=limit)
        return np.asarray(known & ~np.isfinite(distance))

    def _age(self, cell: Cell, stamp: float) -> float:
        stay = self._stays.setdefault(cell, _Stay(stamp, stamp))
        stay.last = stamp
        return stamp - stay.first

    def _forget(self, stamp: float) -> None:
        c = self._config
        self._stays = {
            cell: stay
            for cell, stay in self._stays.items()
            if stamp - stay.first < c.believed_after_s
            and (stamp - stay.last < _LOST_S or stay.last - stay.first >= c.mapped_after_s)
        }

    @property
    def points(self) -> Array:
        """The middles (N, 2) of the cells that have been new lately, local frame."""
        return (np.array(list(self._stays), dtype=np.float64).reshape(-1, 2) + 0.5) * _CELL_M


def _in_front(scan: Scan) -> NDArray[np.bool_]:
    """Which beams (N,) end on something narrow with more room on either side: no wall does.

    A beam without an echo has the room of the whole range; one that failed tells nothing.
    """
    told = np.flatnonzero(~np.isnan(scan.ranges))
    depth = np.minimum(scan.ranges[told], scan.range_max)
    edges = np.flatnonzero(np.abs(np.diff(depth)) >= _STEP_M) + 1
    found = np.zeros(len(scan.ranges), np.bool_)
    for start, stop in pairwise(edges.tolist()):
        near, far = depth[start], depth[stop - 1]
        stands_out = near + _STEP_M < depth[start - 1] and far + _STEP_M < depth[stop]
        width = near * scan.angle_increment * (stop - start)
        found[told[start:stop]] = stands_out and stop - start >= _BEAMS and width < _WIDE_M
    return found


def _ends(scan: Scan, beams: NDArray[np.intp], local_base: Pose) -> Array:
    """Where beams end (N, 2), local frame."""
    bearings = scan.angle_min + scan.angle_increment * beams
    directions = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    return local_base.compose(scan.base_laser).transform(scan.ranges[beams, None] * directions)
