"""Exact ranges from a point to the sides of a bitmap's occupied squares.

Neighbouring pixel sides are merged into faces. A cast keeps the faces that turn their front to
the sensor and lie in reach, finds the beams that each of them spans, and keeps every beam's
nearest crossing. Two squares that touch at a corner share that corner exactly, so that no beam
slips between them.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gvgbot.geometry import Array

Mask = NDArray[np.bool_]
Index = NDArray[np.intp]

EDGE_ON = 1e-6  # m: a face whose plane passes this close to the sensor hides nothing
ANGLE_SLACK = 1e-12  # rad: above rounding errors, far below what a face seen edge-on could notice


@dataclass(frozen=True, slots=True, eq=False)
class Faces:
    """Wall sides (F,) around one free region, in metres; those on a vertical line x = plane first.

    Seen from the front, a face runs anticlockwise from `first` to `last`, both coordinates along
    its line. `side` is +1 where the free region is on the greater side of the plane, else -1.
    """

    plane: Array
    first: Array
    last: Array
    side: Array
    vertical: int

    def facing(self, x: float, y: float, reach: float) -> "Faces":
        """The faces whose front looks at (x, y) from less than `reach`, relative to that point."""
        depth = self.plane.copy()
        depth[: self.vertical] -= x
        depth[self.vertical :] -= y
        ahead = depth * self.side
        (kept,) = ((ahead < -EDGE_ON) & (ahead >= -reach)).nonzero()
        vertical = int(kept.searchsorted(self.vertical))
        first, last = self.first[kept], self.last[kept]
        for ends in (first, last):
            ends[:vertical] -= y
            ends[vertical:] -= x
        return Faces(depth[kept], first, last, self.side[kept], vertical)

    def angles(self, ends: Array) -> Array:
        """Directions (F,) of one end of each face of a `facing` selection, rad."""
        angles = np.empty_like(ends)
        v = self.vertical
        np.arctan2(ends[:v], self.plane[:v], out=angles[:v])
        np.arctan2(self.plane[v:], ends[v:], out=angles[v:])
        return angles


class RayCaster:
    """Casts beams into an occupancy bitmap (row 0 at the bottom); outside it all is empty."""

    def __init__(self, occupied: Mask, resolution: float, origin: tuple[float, float]) -> None:
        walls = np.pad(occupied, 1)
        self._regions = ndimage.label(~walls)[0].astype(np.int32, copy=False)
        self._resolution = resolution
        self._corner = (origin[0] - resolution, origin[1] - resolution)
        self._region_of_face, self._all_faces = self._trace(walls)
        self._faces: dict[int, Faces] = {}

    def cast(
        self, x: float, y: float, directions: Array, reach: float, moved: Array | None = None
    ) -> Array:
        """Ranges (N,) in metres along ascending directions (N,) in rad; inf beyond `reach`.

        A beam may begin a few millimetres away, `moved` (N, 2), m: it ends on the same faces.
        Zeros when (x, y) is inside a wall. Raises ValueError unless the directions ascend and
        span at most one turn.
        """
        _require_fan(directions)
        region = self._region_at(x, y)
        if region == 0 or len(directions) == 0:
            return np.zeros(len(directions))
        faces = self._faces_of(region).facing(x, y, reach)
        face, beam = _crossings(faces, directions)
        slopes = np.empty((2, len(directions)))
        np.cos(directions, out=slopes[0])
        np.sin(directions, out=slopes[1])
        if moved is None:
            axis = (face >= faces.vertical).astype(np.intp)
            crossed = faces.plane[face] / slopes[axis, beam]
        else:
            crossed = _on_faces(faces, face, moved[beam], slopes[:, beam])
        ranges = np.full(len(directions), np.inf)
        np.minimum.at(ranges, beam, crossed)
        ranges[ranges > reach] = np.inf
        return ranges

    def _region_at(self, x: float, y: float) -> int:
        rows, columns = self._regions.shape
        row = math.floor((y - self._corner[1]) / self._resolution)
        column = math.floor((x - self._corner[0]) / self._resolution)
        return int(self._regions[min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)])

    def _faces_of(self, region: int) -> Faces:
        if region not in self._faces:
            mine = self._region_of_face == region
            f = self._all_faces
            vertical = int(np.count_nonzero(mine[: f.vertical]))
            self._faces[region] = Faces(
                f.plane[mine], f.first[mine], f.last[mine], f.side[mine], vertical
            )
        return self._faces[region]

    def _trace(self, walls: Mask) -> tuple[NDArray[np.int32], Faces]:
        """Every face of the bitmap, with the free region in front of it."""
        x0, y0 = self._corner
        right, left = _sides(walls.T, self._regions.T, self._resolution, (x0, y0))
        up, down = _sides(walls, self._regions, self._resolution, (y0, x0))
        parts = (_flipped(right), left, up, _flipped(down))
        plane, first, last = (np.concatenate([part[i] for part in parts]) for i in range(3))
        side = np.repeat([1.0, -1.0, 1.0, -1.0], [len(part[0]) for part in parts])
        vertical = len(right[0]) + len(left[0])
        regions = np.concatenate([part[3] for part in parts])
        return regions, Faces(plane, first, last, side, vertical)


_Runs = tuple[Array, Array, Array, NDArray[np.int32]]


def _sides(
    walls: Mask, regions: NDArray[np.int32], scale: float, corner: tuple[float, float]
) -> tuple[_Runs, _Runs]:
    """Faces between rows, free above and free below: plane, low end, high end (m), region."""
    above = np.where(walls[:-1], regions[1:], 0)
    below = np.where(walls[1:], regions[:-1], 0)
    return _runs(above, scale, corner), _runs(below, scale, corner)


def _runs(labels: NDArray[np.int32], scale: float, corner: tuple[float, float]) -> _Runs:
    """Maximal runs of one non-zero label along the rows."""
    padded = np.pad(labels, ((0, 0), (1, 1)))
    change = padded[:, 1:] != padded[:, :-1]
    row, start = np.nonzero(change[:, :-1] & (labels > 0))
    _, last = np.nonzero(change[:, 1:] & (labels > 0))
    plane, low, high = (
        corner[i] + scale * ends.astype(np.float64)
        for i, ends in ((0, row + 1), (1, start), (1, last + 1))
    )
    return plane, low, high, labels[row, start]


def _flipped(runs: _Runs) -> _Runs:
    plane, low, high, region = runs
    return plane, high, low, region


def _require_fan(directions: Array) -> None:
    span = float(directions[-1] - directions[0]) if len(directions) else 0.0
    if span > math.tau + 1e-9 or bool((directions[1:] < directions[:-1]).any()):
        raise ValueError("beam directions must ascend and span at most one turn")


def _crossings(faces: Faces, directions: Array) -> tuple[Index, Index]:
    """Face and beam of every pair that meet: two arrays (M,)."""
    first = faces.angles(faces.first)
    width = (faces.angles(faces.last) - first) % math.tau
    start = directions[0] + (first - directions[0]) % math.tau
    (wrapped,) = (start + width >= directions[0] + math.tau - ANGLE_SLACK).nonzero()
    face = np.concatenate((np.arange(len(start)), wrapped))
    start = np.concatenate((start, start[wrapped] - math.tau))
    low = directions.searchsorted(start - ANGLE_SLACK, side="left")
    high = directions.searchsorted(start + width[face] + ANGLE_SLACK, side="right")
    return _expanded(face, low, high - low)


def _on_faces(faces: Faces, face: Index, moved: Array, slopes: Array) -> Array:
    """Ranges (M,) to the faces (M,) that beams would meet, had they not begun `moved` (M, 2) away.

    A beam that is almost along its face may meet the line of that far from it, or nowhere: it ends
    where the face does.
    """
    beam, axis = np.arange(len(face)), (face >= faces.vertical).astype(np.intp)
    depth = faces.plane[face] - moved[beam, axis]
    ranges = depth / slopes[axis, beam]
    aside = moved[beam, 1 - axis]
    crossed = aside + ranges * slopes[1 - axis, beam]
    first, last = faces.first[face], faces.last[face]
    ends = np.clip(crossed, np.minimum(first, last), np.maximum(first, last))
    off = ends != crossed
    ranges[off] = np.hypot(depth[off], ends[off] - aside[off])
    return np.asarray(ranges)


def _expanded(face: Index, low: Index, count: Index) -> tuple[Index, Index]:
    """Each face repeated for its `count` beams from `low` on, with those beams."""
    before = count.cumsum() - count
    beam = np.arange(int(count.sum())) + (low - before).repeat(count)
    return face.repeat(count), beam
