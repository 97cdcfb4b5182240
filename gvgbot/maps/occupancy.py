"""Scans with their poses -> occupancy grid: how likely every cell is part of a wall.

Each scan votes once per cell around it: every cell looks up, by its direction from the laser, how
far the beams saw free space. A cell that holds a hit gains, one that was seen through loses.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gvgbot.errors import GvgbotError
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan
from gvgbot.hal.packed_scan import AnyScan

UNKNOWN = -1

Cells = NDArray[np.int8]
Seconds = NDArray[np.float32]
Indices = NDArray[np.int64]

_HIT, _MISS, _CERTAIN = 18, -15, 60  # log odds in tenths: a vote each way, and where votes saturate
_DIRECTIONS = 4096  # per turn, finer than the beams
_ANGLES = (np.arange(_DIRECTIONS) + 0.5) * (math.tau / _DIRECTIONS) - math.pi
_TOWARDS = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])
_MOST_CELLS = 200_000_000  # a gigabyte: half a square kilometre in squares of 5 cm
_EDGE_M = 0.5  # of unknown cells left around the known ones


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyGrid:
    """Occupancy in percent, -1 where unknown: `cells` (rows, columns), row 0 at the bottom.

    `origin` is the outer corner of cell [0, 0] (m, map frame), `resolution_m` a cell's side.
    `seen_s`, shaped like the cells, says how long (s) after the beginning each was first seen, inf
    for never; it is None where nobody knows. The arrays are read-only.
    """

    cells: Cells
    resolution_m: float
    origin: tuple[float, float]
    seen_s: Seconds | None = None

    def __post_init__(self) -> None:
        self.cells.setflags(write=False)
        if self.seen_s is not None:
            self.seen_s.setflags(write=False)

    def middles(self, chosen: NDArray[np.bool_]) -> Array:
        """The middles (N, 2), m, map frame, of the cells that are chosen (rows, columns)."""
        x_y = np.argwhere(chosen)[:, ::-1] + 0.5
        return np.asarray(np.array(self.origin) + x_y * self.resolution_m)


def occupancy_grid(
    scans: Sequence[tuple[Pose, AnyScan]],
    resolution_m: float = 0.05,
    max_range_m: float = 12.0,
    *,
    began: float | None = None,
) -> OccupancyGrid:
    """The grid that scans see from `map_base` poses; what is farther than the range counts not.

    A scan counts as taken at one instant, from its one pose. NaN beams say nothing; inf beams
    say that there is nothing up to the laser's range. Scans come in the order of their stamps.
    `began` is the stamp from which on it counts when a cell was seen, if that is not the first
    scan's; what was seen before was seen then. Without any scan one unknown cell.
    """
    if began is None:
        began = scans[0][1].stamp if scans else 0.0
    lasers = [(map_base.compose(scan.base_laser), scan) for map_base, scan in scans]
    reach = min(max_range_m, max((scan.range_max for _, scan in lasers), default=0.0))
    disc = _Disc.of_radius(reach, resolution_m)
    ballot = _Ballot.around([laser for laser, _ in lasers], disc)
    seen_s = np.full(ballot.votes.shape, np.inf, np.float32)
    for map_laser, scan in lasers:
        around, seen = _vote(ballot, disc, map_laser, scan.unpacked())
        window = seen_s[around]
        window[seen & np.isinf(window)] = max(0.0, scan.stamp - began)
    return _finished(ballot, resolution_m, seen_s)


class GrowingGrid:
    """The same grid of scans that come one by one; lasers of a longer range see as the first.

    It does not note when a cell was first seen, which would take four fifths of the memory.
    """

    def __init__(self, resolution_m: float = 0.05, max_range_m: float = 12.0) -> None:
        self._cell, self._max_range = resolution_m, max_range_m
        self._disc: _Disc | None = None
        self._ballot: _Ballot | None = None

    def add(self, map_base: Pose, scan: Scan) -> None:
        """Let a scan vote that was taken at a pose."""
        map_laser = map_base.compose(scan.base_laser)
        if self._disc is None:
            self._disc = _Disc.of_radius(min(self._max_range, scan.range_max), self._cell)
        around = _Ballot.around([map_laser], self._disc)
        self._ballot = around if self._ballot is None else self._ballot.grown(around)
        _vote(self._ballot, self._disc, map_laser, scan)

    def around(self, map_base: Pose, scan: AnyScan) -> tuple[Indices, Indices]:
        """The first (row, column) that a scan from a pose can change, and that after the last.

        Cell (0, 0) has its lower left corner at the map's origin.
        """
        here = np.array(_cell(map_base.compose(scan.base_laser), self._cell))
        half = math.ceil(min(self._max_range, scan.range_max) / self._cell) + 2
        return here - half, here + half + 1

    def square(self, row: int, column: int, side: int) -> Cells:
        """Occupancy in percent of a square of cells (side, side) from a (row, column) on."""
        votes = np.zeros((side, side), np.int8)
        if self._ballot is not None:
            first, corner = np.array([row, column]), self._ballot.corner
            low = np.maximum(first, corner)
            high = np.maximum(low, np.minimum(first + side, corner + self._ballot.votes.shape))
            votes[_box(low - first, high - first)] = self._ballot.votes[
                _box(low - corner, high - corner)
            ]
        return _PERCENT[votes]

    def grid(self) -> OccupancyGrid:
        """The grid so far; without any scan one unknown cell."""
        if self._ballot is None:
            return occupancy_grid([], self._cell)
        return _finished(self._ballot, self._cell)


@dataclass(frozen=True, slots=True, eq=False)
class _Disc:
    """Distance (m) and direction (index) of cells from the middle one, (2 half + 1) square."""

    reach: float
    cell: float
    half: int
    distance: NDArray[np.float32]
    direction: NDArray[np.int16]

    @classmethod
    def of_radius(cls, reach: float, cell: float) -> Self:
        half = math.ceil(reach / cell) + 2
        axis = np.arange(-half, half + 1, dtype=np.float32) * np.float32(cell)
        y, x = axis[:, None], axis[None, :]
        turns = np.arctan2(y, x) / np.float32(math.tau) + np.float32(0.5)
        direction = (turns * _DIRECTIONS).astype(np.int16) % _DIRECTIONS
        return cls(reach, cell, half, np.hypot(x, y), direction)


@dataclass(frozen=True, slots=True, eq=False)
class _Ballot:
    """Votes; `corner` is (row, column) of the first cell."""

    votes: Cells
    corner: Indices

    @classmethod
    def around(cls, lasers: Sequence[Pose], disc: _Disc) -> Self:
        """No vote yet for all that can be seen from the lasers."""
        places = np.array([_cell(laser, disc.cell) for laser in lasers or [Pose()]])
        corner = places.min(axis=0) - disc.half
        rows, columns = places.max(axis=0) + disc.half + 1 - corner
        return cls._empty(corner, (rows, columns))

    @classmethod
    def _empty(cls, corner: Indices, shape: tuple[int, int]) -> Self:
        rows, columns = map(int, shape)
        if rows * columns > _MOST_CELLS:
            raise GvgbotError(
                f"a grid of {rows} by {columns} cells is too large: is the odometry damaged?"
            )
        return cls(np.zeros(shape, np.int8), corner)

    def grown(self, other: Self) -> Self:
        """This ballot, or a larger one with its votes that covers the other's cells as well."""
        corner = np.minimum(self.corner, other.corner)
        end = np.maximum(self.corner + self.votes.shape, other.corner + other.votes.shape)
        rows, columns = end - corner
        if (rows, columns) == self.votes.shape:
            return self
        larger = self._empty(corner, (rows, columns))
        row, column = self.corner - corner
        rows, columns = self.votes.shape
        larger.votes[row : row + rows, column : column + columns] = self.votes
        return larger


def _box(low: Indices, high: Indices) -> tuple[slice, slice]:
    """Where an array has rows and columns from one corner up to another."""
    return slice(low[0], high[0]), slice(low[1], high[1])


def _cell(pose: Pose, cell: float) -> tuple[int, int]:
    """(row, column) of the cell that a pose stands on."""
    return math.floor(pose.y / cell), math.floor(pose.x / cell)


def _vote(
    ballot: _Ballot, disc: _Disc, map_laser: Pose, scan: Scan
) -> tuple[tuple[slice, slice], NDArray[np.bool_]]:
    """Add what a scan saw to the votes around its laser; a part of the cells, and which it saw."""
    here = np.array(_cell(map_laser, disc.cell))
    hits = _hits(disc, map_laser, scan) - here
    free_ranges = _free_ranges(disc, map_laser, scan)
    low, high = _extent(disc, hits, free_ranges)
    first = here - ballot.corner
    around = _box(first + low, first + high)
    window = ballot.votes[around]
    hits -= low
    free = _seen_through(disc, _box(disc.half + low, disc.half + high), free_ranges)
    free[hits[:, 0], hits[:, 1]] = False
    window += free.view(np.int8) * np.int8(_MISS)
    window[hits[:, 0], hits[:, 1]] += np.int8(_HIT)
    np.clip(window, -_CERTAIN, _CERTAIN, out=window)
    free[hits[:, 0], hits[:, 1]] = True
    return around, free


def _extent(disc: _Disc, hits: Indices, free_ranges: Array) -> tuple[Indices, Indices]:
    """From which (row, column) up to which a scan tells of cells, from the laser's cell."""
    ends = np.floor((free_ranges[:, None] * _TOWARDS)[:, ::-1] / disc.cell).astype(np.int64)
    told = np.concatenate([[[0, 0]], ends, hits])
    low, high = told.min(axis=0) - 1, told.max(axis=0) + 2
    return np.maximum(low, -disc.half), np.minimum(high, disc.half + 1)


def _hits(disc: _Disc, map_laser: Pose, scan: Scan) -> Indices:
    """(row, column) of the cells that beams ended in (N, 2)."""
    hit = scan.ranges <= disc.reach
    ranges, bearings = scan.ranges[hit], scan.bearings[hit]
    ends = np.column_stack([ranges * np.cos(bearings), ranges * np.sin(bearings)])
    return np.floor(map_laser.transform(ends)[:, ::-1] / disc.cell).astype(np.int64)


def _seen_through(
    disc: _Disc, window: tuple[slice, slice], free_ranges: Array
) -> NDArray[np.bool_]:
    """Which cells of a window of the disc are nearer than it is free in their direction."""
    limits = free_ranges.astype(np.float32)[disc.direction[window]]
    return disc.distance[window] < limits


def _free_ranges(disc: _Disc, map_laser: Pose, scan: Scan) -> Array:
    """How far (m) it is free from the middle of the laser's cell, in every direction."""
    along_beams = np.append(_free_along_beams(disc, scan), 0.0)
    free = along_beams[_beams(map_laser, scan)]
    row, column = _cell(map_laser, disc.cell)
    middle = np.array([column + 0.5, row + 0.5]) * disc.cell
    return np.where(free > 0.0, free + _TOWARDS @ (map_laser.position - middle), 0.0)


def _free_along_beams(disc: _Disc, scan: Scan) -> Array:
    """How far (m) from the laser every beam and both its neighbours saw nothing; NaN as 0."""
    free = np.where(np.isposinf(scan.ranges), scan.range_max, scan.ranges - disc.cell)
    least = free.copy()
    least[1:] = np.fmin(least[1:], free[:-1])
    least[:-1] = np.fmin(least[:-1], free[1:])
    least[np.isnan(free)] = 0.0
    return np.clip(least, 0.0, disc.reach)


def _beams(map_laser: Pose, scan: Scan) -> Indices:
    """The beam that looks in each direction of the map; where none does, one past the last."""
    step = scan.angle_increment
    turn = (_ANGLES - map_laser.theta - scan.angle_min) * math.copysign(1.0, step)
    beams: Indices = ((turn + abs(step) / 2.0) % math.tau / abs(step)).astype(np.int64)
    return np.minimum(beams, len(scan.ranges))


def _finished(ballot: _Ballot, cell: float, seen_s: Seconds | None = None) -> OccupancyGrid:
    """The votes as percent, cut to the known cells and a margin."""
    votes = ballot.votes
    rows, columns = np.flatnonzero(votes.any(axis=1)), np.flatnonzero(votes.any(axis=0))
    if not len(rows):
        never = None if seen_s is None else np.full((1, 1), np.inf, np.float32)
        return OccupancyGrid(np.full((1, 1), UNKNOWN, np.int8), cell, (0.0, 0.0), never)
    edge = math.ceil(_EDGE_M / cell)
    bottom, left = max(0, int(rows[0]) - edge), max(0, int(columns[0]) - edge)
    cut = np.s_[bottom : rows[-1] + edge + 1, left : columns[-1] + edge + 1]
    row, column = int(ballot.corner[0]) + bottom, int(ballot.corner[1]) + left
    origin = (column * cell, row * cell)
    seen_s = None if seen_s is None else seen_s[cut].copy()
    return OccupancyGrid(_PERCENT[votes[cut]], cell, origin, seen_s)


def _percentages() -> Cells:
    """Occupancy in percent for every int8 vote, by the vote as an index; no vote is unknown."""
    votes = np.arange(256).astype(np.uint8).view(np.int8)
    percent = np.rint(100.0 / (1.0 + np.exp(-votes / 10.0))).astype(np.int8)
    percent[0] = UNKNOWN
    return percent


_PERCENT = _percentages()  # a negative vote counts from the end, as indices do
