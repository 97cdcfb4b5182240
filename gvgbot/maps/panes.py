"""Panes: walls of glass, of which a grid may show but a spot."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gvgbot.geometry import Array, resampled
from gvgbot.hal.messages import Scan
from gvgbot.maps.gaps import is_wall
from gvgbot.maps.hits import Scans
from gvgbot.maps.occupancy import OccupancyGrid

_STEP_M = 0.05  # between points of a way: a cell
_CLOSE_M = 1.0  # to a spot of it, there is more of a pane
_SPOT_M = 0.3  # across, at most; what is wider is a wall
_ON_M, _BEYOND_M = 0.12, 0.2  # off the middle of a spot, a beam ends on it; beyond, it has passed
_BESIDE_M = 0.06  # the middle of a spot, as poses err, beams still meet the leg of a chair
_BEAMS = 7  # of them, two centimetres from each other
_FINE_M = 0.03  # from beam to beam, at most: they cannot miss a leg
_LOOKS, _SHARE = 4, 0.25  # so many, and of all so large a share, pass a pane at least


def past_panes(scans: Scans, ways: Sequence[Array], grid: OccupancyGrid) -> NDArray[np.bool_]:
    """Which ways (K,), each of points (N, 2), m, map frame, lead past a spot of glass.

    Close to it they go from one side of the pane to the other, of which there is more.
    """
    piece, _ = ndimage.label(is_wall(grid.cells), np.ones((3, 3)))
    spots = _spots(ndimage.find_objects(piece), grid.resolution_m)
    if not len(spots):
        return np.zeros(len(ways), np.bool_)
    middles = np.array(ndimage.center_of_mass(piece > 0, piece, spots))[:, ::-1] + 0.5
    panes = _panes(scans, np.array(grid.origin) + middles * grid.resolution_m)
    return np.array([_leads_past(resampled(way, _STEP_M), panes) for way in ways], np.bool_)


def _leads_past(line: Array, panes: list[tuple[Array, Array]]) -> bool:
    """Whether a line (N, 2) changes sides at one of some panes."""
    for spot, normal in panes:
        off = line - spot
        is_near, side = np.hypot(*off.T) < _CLOSE_M, off @ normal > 0.0
        if (is_near[1:] & (side[1:] != side[:-1])).any():
            return True
    return False


def _spots(pieces: Sequence[tuple[slice, ...]], cell: float) -> NDArray[np.intp]:
    """The numbers (M,), from 1 on, of those pieces of wall that are no wider than a spot."""
    sides = [[side.stop - side.start for side in box] for box in pieces]
    width = np.hypot(*(np.array(sides).reshape(-1, 2) - 1).T) * cell
    return np.flatnonzero(width < _SPOT_M) + 1


def _panes(scans: Scans, spots: Array) -> list[tuple[Array, Array]]:
    """Those spots (2,), m, map frame, of some (M, 2) that are of glass, with its normal (2,).

    A leg or a pole stops each beam that meets it; glass does so where it is seen head-on.
    """
    ended, passed = np.zeros(len(spots)), np.zeros(len(spots))
    turned = np.zeros(len(spots), np.complex128)  # by twice the angle, as it has two sides
    for map_base, packed in scans:
        scan = packed.unpacked()
        map_laser = map_base.compose(scan.base_laser)
        off = map_laser.inverse().transform(spots)
        ends, passes = _met(scan, off)
        ended, passed = ended + ends, passed + passes
        turned += ends * np.exp(2j * (np.arctan2(off[:, 1], off[:, 0]) + map_laser.theta))
    glass = np.flatnonzero((passed >= _LOOKS) & (passed > _SHARE * (ended + passed)))
    normals = np.exp(0.5j * np.angle(turned[glass]))
    return list(zip(spots[glass], np.stack([normals.real, normals.imag], axis=1), strict=True))


def _met(scan: Scan, spots: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """On which of some spots (M, 2), m, laser frame, beams ended, and which they have passed."""
    away, bearing = np.hypot(*spots.T), np.arctan2(spots[:, 1], spots[:, 0])
    step = abs(scan.angle_increment)
    turn = (bearing - scan.angle_min) * math.copysign(1.0, scan.angle_increment)
    middle = ((turn + step / 2) % math.tau / step).astype(np.int64)
    beside = np.maximum(1.0, _BESIDE_M / np.maximum(away * step, 1e-6))[:, None]
    beams = middle[:, None] + (beside * np.linspace(-1.0, 1.0, _BEAMS)).round().astype(np.int64)
    told = (beams.min(axis=1) >= 0) & (beams.max(axis=1) < len(scan.ranges))
    told &= away < min(_FINE_M / step, scan.range_max - _BEYOND_M)
    beyond = scan.ranges[np.where(told[:, None], beams, 0)] - away[:, None]
    ends = told & (np.abs(beyond) < _ON_M).any(axis=1)
    return ends, told & ~ends & (beyond > _BEYOND_M).all(axis=1)
