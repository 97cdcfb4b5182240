"""Which beams of a scan end on bodies, and which pass one by."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gvgbot.autonomy.islands import beam_ends
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan

BLUR_M = 0.1  # beyond its rim, beams may still end on something
_STRAY = 0.1  # of the beams towards a place: so many may end there though nothing is there

Disc = tuple[Array, float]  # centre (2,), local frame unless said otherwise, and radius, m


def without(scan: Scan, local_base: Pose, discs: list[Disc]) -> Scan:
    """The scan without the beams that end in discs."""
    inside = end_in(scan, local_base, discs)
    if not inside.any():
        return scan
    return replace(scan, ranges=np.where(inside, np.nan, scan.ranges))


def end_in(scan: Scan, local_base: Pose, discs: list[Disc]) -> NDArray[np.bool_]:
    """Which beams (N,) end in discs."""
    inside = np.zeros(len(scan.ranges), np.bool_)
    if not discs:
        return inside
    beams = np.flatnonzero(np.isfinite(scan.ranges))
    ends = beam_ends(scan, beams, scan.ranges[beams], local_base.compose(scan.base_laser))
    for centre, radius in discs:
        inside[beams] |= np.hypot(*(ends - centre).T) < radius + BLUR_M
    return inside


def is_seen_through(scan: Scan, local_base: Pose, disc: Disc) -> bool:
    """Whether most beams towards a disc get through it, and hardly any ends on it.

    Beside a post between two panes of glass most beams pass as well. What stands there is hit on
    its near side: a wall close behind it does not hide that it has gone. A beam without an echo
    gets no farther than the laser sees.
    """
    centre, radius = disc
    x, y = local_base.compose(scan.base_laser).inverse().transform(centre)
    away = float(np.hypot(x, y))
    if away < radius:
        return False
    middle = (np.arctan2(y, x) - scan.angle_min) % (2 * np.pi) / scan.angle_increment
    half = np.arcsin(radius / away) / scan.angle_increment
    first, last = round(middle - half), round(middle + half) + 1
    if first < 0 or last > len(scan.ranges):
        return False
    off = (np.arange(first, last) - middle) * scan.angle_increment
    half_chord = np.sqrt(np.maximum(0.0, radius**2 - (away * np.sin(off)) ** 2))
    nearest = away * np.cos(off)  # to the centre, on each beam
    told = np.minimum(scan.ranges[first:last], scan.range_max)
    beyond = told > nearest + half_chord
    ends = ~beyond & (told > nearest - half_chord - BLUR_M)
    beyond, ends = (hit[~np.isnan(told)] for hit in (beyond, ends))
    return bool(len(beyond) and np.mean(beyond) > 0.5 and np.mean(ends) < _STRAY)
