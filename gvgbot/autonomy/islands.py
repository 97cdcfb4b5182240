"""What may be people, by one scan: beams that end nearer than those beside them."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gvgbot.autonomy.roundness import SURE, round_evidence
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan
from gvgbot.hal.noise import range_noise

_STEP_M = 0.3  # in range from beam to beam, at the rim of something that stands free
_SMOOTH_M = 0.15  # in range from beam to beam, on it: two legs of a chair are farther apart
_GAP_M = 0.1  # in range from beam to beam, from a person to what is close behind or before
_NOISE = 4.0  # sigma: what differs by more is no noise
_BEAMS = 3  # fewer see nothing for sure
_ARC_BEAMS = 8  # fewer lie on a circle by chance
_SLIM_M, _WIDE_M = 0.1, 0.65  # people are between these; what is slimmer is furniture
_FLAT = 0.06  # of its width: what bulges less towards the laser is a piece of wall, or of glass

Piece = tuple[int, int]  # the first beam, and the one after the last


@dataclass(frozen=True, slots=True, eq=False)
class Island:
    """Beams that end on something narrow with more room on one side or both; local frame."""

    ends: Array  # (N, 2)
    centre: Array
    radius: float
    is_whole: bool  # there is more room on both sides
    evidence: float  # that it is round: log-likelihood ratio

    @property
    def is_round(self) -> bool:
        """Whether this look alone shows somebody."""
        return self.evidence > SURE


def islands(scan: Scan, local_base: Pose) -> list[Island]:
    """What people may be.

    A beam without an echo has the room of the whole range; one that failed tells nothing. Where a
    wall is so close to somebody that this is no room, only roundness tells them apart.
    """
    told = (~np.isnan(scan.ranges)).nonzero()[0]
    if not len(told):  # it is blind
        return []
    look = _Look(scan, local_base.compose(scan.base_laser), told)
    found = []
    for piece in _pieces((0, len(told)), look.steps >= _STEP_M):
        island = look.island(piece)
        if island is not None:
            found.append(island)
            continue
        parts = (part for part in _pieces(piece, look.is_gap) if part[1] - part[0] >= _ARC_BEAMS)
        islets = (look.island(part, only_round=True) for part in parts)
        found += [one for one in islets if one is not None]
    return found


def slivers(scan: Scan, local_base: Pose) -> tuple[Array, NDArray[np.bool_]]:
    """Where beams end (N, 2), local frame, on what too little is seen of to be an island.

    It is narrow and has more room on one side at least. And on which of them (N,) something nearer
    cuts it off on the other side, so that there may be more of it.
    """
    told = (~np.isnan(scan.ranges)).nonzero()[0]
    if not len(told):
        return np.empty((0, 2)), np.zeros(0, np.bool_)
    look = _Look(scan, local_base.compose(scan.base_laser), told)
    pieces = list(_pieces((0, len(told)), look.steps >= _STEP_M))
    ends = [look.sliver(piece) for piece in pieces]
    is_cut = [look.is_half_hidden(piece) for piece in pieces]
    return np.concatenate([np.empty((0, 2)), *ends]), np.repeat(is_cut, list(map(len, ends)))


def without_fringes(scan: Scan) -> Scan:
    """The scan without what its first and its last beams show too little of.

    Something stands free there, and all but a sliver of it is out of sight: that may be a person.
    """
    told = (~np.isnan(scan.ranges)).nonzero()[0]
    depth = np.minimum(scan.ranges[told], scan.range_max)
    ends = (np.abs(np.diff(depth)) >= _STEP_M).nonzero()[0]
    if not len(ends):
        return scan
    first, last = ends[0] + 1, ends[-1] + 1
    ranges = scan.ranges.copy()
    for fringe, beside in ((slice(first), first), (slice(last, None), last - 1)):
        metres = depth[fringe]
        if metres.max() < depth[beside] and metres.max() * _angle(scan, told[fringe]) < _SLIM_M:
            ranges[told[fringe]] = np.nan
    return replace(scan, ranges=ranges)


def _angle(scan: Scan, beams: NDArray[np.intp]) -> float:
    return float(beams[-1] - beams[0]) * scan.angle_increment


class _Look:
    """A scan without the beams that failed."""

    def __init__(self, scan: Scan, local_laser: Pose, told: NDArray[np.intp]) -> None:
        self._laser = local_laser
        self._noise = range_noise(scan.ranges)
        self._smooth = math.hypot(_SMOOTH_M, _NOISE * self._noise)
        self._depth = np.minimum(scan.ranges[told], scan.range_max)
        self._beam_ends = beam_ends(scan, told, self._depth, local_laser)
        # who is cut off at the first or the last beam is half hidden
        self._beside = np.concatenate([[-np.inf], self._depth, [-np.inf]])
        self.steps = np.abs(self._depth[1:] - self._depth[:-1])
        is_echo = self._depth < scan.range_max
        least = max(_GAP_M, _NOISE * math.sqrt(2.0) * self._noise)
        self.is_gap = (self.steps >= least) | (is_echo[1:] != is_echo[:-1])

    def island(self, piece: Piece, *, only_round: bool = False) -> Island | None:
        """What may be somebody; None if it is too wide, too slim, behind something or in parts.

        With `only_round` None as well if this look alone does not show that it is round.
        """
        start, stop = piece
        if stop - start < _BEAMS:
            return None
        rims = self._rims(piece)
        if not any(rims) or self.steps[start : stop - 1].max() >= self._smooth:
            return None
        ends = self._ends(piece)
        width = float(np.hypot(*(ends[-1] - ends[0])))
        if not _SLIM_M <= width < _WIDE_M:
            return None
        return self._shaped(ends, width, all(rims), only_round=only_round)

    def sliver(self, piece: Piece) -> Array:
        """Where its beams end (N, 2), local frame, if it is too slim, or has too few of them."""
        if not any(self._rims(piece)):
            return np.empty((0, 2))
        ends = self._ends(piece)
        is_slim = np.hypot(*(ends[-1] - ends[0])) < _SLIM_M
        return ends if is_slim or len(ends) < _BEAMS else np.empty((0, 2))

    def is_half_hidden(self, piece: Piece) -> bool:
        """Whether something nearer cuts it off on one side only."""
        return self._rims(piece).count(False) == 1

    def _rims(self, piece: Piece) -> tuple[bool, bool]:
        """Whether there is more room before its first beam, and after its last one."""
        start, stop = piece
        first, last = self._depth[start], self._depth[stop - 1]
        return bool(first < self._beside[start]), bool(last < self._beside[stop + 1])

    def _ends(self, piece: Piece) -> Array:
        return self._beam_ends[slice(*piece)]

    def _shaped(
        self, ends: Array, width: float, is_whole: bool, *, only_round: bool
    ) -> Island | None:
        eye, evidence = self._laser.position, 0.0
        if len(ends) >= _ARC_BEAMS:
            evidence, centre, radius = round_evidence(ends, eye, self._noise, only_sure=only_round)
            if evidence > SURE:
                return Island(ends, centre, radius, is_whole, evidence)
        if only_round:
            return None
        if is_whole and evidence <= 0.0 and _is_flat(ends, width):
            return None
        away = ends.mean(axis=0) - eye
        centre = ends.mean(axis=0) + 0.3 * width * away / np.hypot(*away)
        return Island(ends, centre, width / 2, is_whole, evidence)


def _pieces(piece: Piece, is_end: NDArray[np.bool_]) -> Iterator[Piece]:
    """The parts of a piece, each up to a beam that is the end of one."""
    start, stop = piece
    ends = is_end[start : stop - 1].nonzero()[0] + start + 1
    return pairwise([start, *ends.tolist(), stop])


def _is_flat(ends: Array, width: float) -> bool:
    """Whether ends (N, 2) seen from side to side, m, are on a line, as on no leg and no body.

    Glass shows a flat patch where it is seen head-on, which wanders along it with the robot.
    """
    along = (ends[-1] - ends[0]) / width
    bulge = np.abs((ends - ends[0]) @ np.array([-along[1], along[0]]))
    third = len(ends) // 3
    rims = (bulge[:third].mean() + bulge[-third:].mean()) / 2
    return bool(bulge[third:-third].mean() - rims < _FLAT * width)


def beam_ends(scan: Scan, beams: NDArray[np.intp], depth: Array, local_laser: Pose) -> Array:
    """Where beams of these depths, m, end (N, 2), local frame."""
    return local_laser.transform(depth[:, None] * scan.directions.take(beams, axis=0))
