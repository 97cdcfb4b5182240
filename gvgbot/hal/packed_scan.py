"""A scan that is kept: in the laser's millimetres, which take a quarter of the memory."""

from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from gvgbot.geometry import Array, Pose
from gvgbot.hal.deskew import deskewed
from gvgbot.hal.messages import Scan

_UNTRUSTED, _NOTHING = 65534, 65535  # mm: in the place of NaN and inf
_NO_RANGES = np.empty(0)

Millimetres = NDArray[np.uint16]


class Sweep(NamedTuple):
    """A scan as it came from the laser, how the base moved meanwhile, and the scan without that."""

    raw: Scan
    motion: Pose
    deskewed: Scan

    @classmethod
    def of(cls, raw: Scan, motion: Pose) -> Self:
        """The sweep, deskewed."""
        return cls(raw, motion, deskewed(raw, motion))


class PackedScan:
    """Gives back the scan that was packed, to the last bit.

    Ranges that were moved with the base are no whole millimetres any more: they are computed anew
    each time, from what came from the laser.
    """

    __slots__ = ("_left_out", "_motion", "_ranges", "_rest")

    def __init__(self, scan: Scan, sweep: Sweep | None = None) -> None:
        """The scan may have been made of a sweep by leaving out some beams."""
        raw = scan if sweep is None else sweep.raw
        self._ranges = _packed(raw.ranges)
        self._rest = replace(raw, ranges=_NO_RANGES)
        self._motion: Pose | None = None
        self._left_out: NDArray[np.uint8] | None = None  # bits
        if sweep is not None:
            self._motion = sweep.motion
            left_out = np.isnan(scan.ranges) & ~np.isnan(sweep.deskewed.ranges)
            self._left_out = np.packbits(left_out) if left_out.any() else None

    @property
    def base_laser(self) -> Pose:
        """Where the laser is on the base."""
        return self._rest.base_laser

    @property
    def range_max(self) -> float:
        """How far the laser sees, m."""
        return self._rest.range_max

    @property
    def stamp(self) -> float:
        """The time of the first beam, s."""
        return self._rest.stamp

    def unpacked(self) -> Scan:
        """The scan."""
        scan = replace(self._rest, ranges=_unpacked(self._ranges))
        if self._motion is not None:
            scan = deskewed(scan, self._motion)
        if self._left_out is None:
            return scan
        left_out = np.unpackbits(self._left_out, count=len(scan.ranges)).view(np.bool_)
        return replace(scan, ranges=np.where(left_out, np.nan, scan.ranges))


AnyScan = Scan | PackedScan


def _packed(ranges: Array) -> Millimetres | Array:
    """Ranges (N,), m, as millimetres; as they are, if they are no whole ones, or too long."""
    with np.errstate(invalid="ignore"):
        packed: Millimetres = np.rint(ranges * 1000.0).astype(np.uint16)
    untrusted = np.isnan(ranges)
    packed[untrusted], packed[np.isposinf(ranges)] = _UNTRUSTED, _NOTHING
    is_same = (_unpacked(packed) == ranges) | untrusted
    return packed if is_same.all() else ranges


def _unpacked(packed: Millimetres | Array) -> Array:
    if packed.dtype != np.uint16:
        return packed.astype(np.float64, copy=False)
    ranges: Array = packed / 1000.0
    ranges[packed == _UNTRUSTED], ranges[packed == _NOTHING] = np.nan, np.inf
    return ranges
