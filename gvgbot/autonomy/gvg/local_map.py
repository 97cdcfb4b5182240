"""The rolling local map: what the last metres of scans say is free, occupied or unknown.

It fills the laser's blind rear. It lives in the local frame (odometry corrected by scan matching),
which never jumps: corrections of the global estimate do not move it.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gvgbot.autonomy.gvg.beams import (
    bridged,
    is_lone,
    least_of_three,
    range_towards,
    without_single_dropouts,
)
from gvgbot.autonomy.gvg.walls import Walls, merged
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan
from gvgbot.ranges import Range

Index = NDArray[np.intp]
Window = tuple[slice, slice]  # rows and columns

_HIT = 2  # votes that one hit gives an occupied cell
_MOST_HITS = 100  # that a mean remembers; more would keep a wall where it no longer is
_EMPTY = (
    ("_free", False),
    ("_votes", 0),
    ("_mean", 0.0),
    ("_hits", 0.0),
    ("_sight", 0.0),
    ("_look", 0.0),
    ("_spread", 0.0),
    ("_echoes", 0.0),
    ("_seen_at", -np.inf),
)
_ONE_WALL = 0.4  # of a cell: means of neighbouring cells nearer than this are of one wall
_GLASS_ECHOES = 3.0  # so many about a cell make it glass, which beams pass and robots do not
_BESIDE_WALLS_M = 0.22  # half a gap that robots go through: nearer, they make no difference
_DECAY = 0.05  # echoes that one look outweighs which meets nothing
_GLASS_DECAY = 0.02  # the same of glass, the dust of which gives more from almost anywhere
_FIRM = 5  # votes: at least three looks
_MAX_VOTES = 8  # a wall needs this many contrary scans, less the hits, before it is forgotten


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalMapConfig:
    """Size and memory of the local map."""

    half_width_m: Annotated[float, Range(3.0, 30.0)] = 8.0  # from the robot to the edge of the map
    cell_m: Annotated[float, Range(0.05, 0.5)] = 0.1  # side of a cell
    memory_m: Annotated[float, Range(5.0, 200.0)] = (
        30.0  # metres driven after which a cell is forgotten
    )
    bridge_gap_m: Annotated[float, Range(0.0, 1.0)] = (
        0.3  # neighbouring hits closer than this are one wall
    )


class LocalMap:
    """A square window of cells around the robot, addressed in the local frame.

    Per occupied cell it keeps the mean of the hits, so that walls are sharper than the cells.
    """

    def __init__(self, config: LocalMapConfig) -> None:
        self._config = config
        self._cell = config.cell_m
        self._size = 2 * round(config.half_width_m / config.cell_m)
        n = self._size
        self._corner = np.array([-n // 2, -n // 2])  # indices of cell [0, 0]
        self._free = np.zeros((n, n), bool)
        self._votes = np.zeros((n, n), np.int16)
        self._mean = np.zeros((n, n, 2))
        self._hits = np.zeros((n, n), np.float32)  # that the mean is made of
        self._sight = np.zeros((n, n, 2), np.float32)  # mean direction to where it was seen from
        self._look = np.zeros((n, n), np.float32)  # mean number of the looks at it
        self._spread = np.zeros((n, n), np.float32)  # variance of these numbers
        self._echoes = np.zeros((n, n), np.float32)  # lone ones, of which old ones count less
        self._seen_at = np.full((n, n), -np.inf, np.float32)  # metres driven when last seen
        self.looks = 0  # so far
        self._known = np.zeros((n + 2, n + 2), bool)  # with a rim for what is not in the window
        self._renew()
        self._middles = ((np.arange(n) + 0.5) * self._cell).astype(np.float32)  # from the corner, m

    def insert(
        self, scan: Scan, local_laser: Pose, travelled: float, free: Array | None = None
    ) -> None:
        """Add a scan taken at the laser pose after so many metres driven.

        `free` (N,) is how far, m, there was nothing on each beam, if that is more than its range
        tells: up to somebody who is left out.
        """
        self._recentre(local_laser)
        self.looks += 1
        directions, passed = scan.directions, without_single_dropouts(scan.ranges)
        if free is not None:
            passed = np.fmax(passed, free)
        self._carve(scan, passed, directions, local_laser, travelled)
        hit = (scan.ranges < self._reach).nonzero()[0]
        ends = local_laser.transform(scan.ranges.take(hit)[:, None] * directions.take(hit, axis=0))
        alone = is_lone(scan.ranges).take(hit)
        on_glass = self._note_echoes(ends[alone])
        points = np.concatenate([bridged(ends[~alone], self._config.bridge_gap_m), on_glass])
        self._occupy(points, local_laser.position, travelled)
        self._forget(travelled)
        self._renew()

    def _renew(self) -> None:
        """Draw from the cells what is asked for again and again."""
        occupied = self._votes > 0
        cells = np.flatnonzero(occupied)
        walls = Walls(
            self._mean.reshape(-1, 2).take(cells, axis=0),
            self._hits.take(cells).astype(np.float64),
            self._sight.reshape(-1, 2).take(cells, axis=0).astype(np.float64),
            self._look.take(cells).astype(np.float64),
            self._spread.take(cells).astype(np.float64),
        )
        self._walls = merged(cells, self._size, walls, _ONE_WALL * self._cell)
        for drawn in self._walls:
            drawn.setflags(write=False)
        self._tree: cKDTree | None = None
        np.logical_or(self._free, occupied, out=self._known[1:-1, 1:-1])

    def points(self) -> Array:
        """Points of the walls (N, 2), local frame: about one for each cell that a wall crosses."""
        return self._walls.points

    def firm_points(self) -> Array:
        """Points (N, 2), local frame, of glass and of walls that have been seen again and again."""
        i, j = np.nonzero(self._votes > 0)
        firm = (self._votes[i, j] >= _FIRM) | self._is_glass(i, j)
        return np.asarray(self._mean[i[firm], j[firm]])

    def tree(self) -> cKDTree:
        """To find the nearest of `points`."""
        if self._tree is None:
            self._tree = cKDTree(self._walls.points, balanced_tree=False)
        return self._tree

    def hits(self) -> Array:
        """How many hits (N,) each of `points` is the mean of, the oldest forgotten."""
        return self._walls.hits

    def sights(self) -> Array:
        """Mean direction (N, 2) from each of `points` to where it was seen from, local frame."""
        return self._walls.sights

    def looked_at(self) -> Array:
        """The mean number (N,) of the looks that hit each of `points`: the first look is 1."""
        return self._walls.looks

    def looks_spread(self) -> Array:
        """The variance (N,) of the numbers of these looks."""
        return self._walls.spreads

    def suspects(self) -> Array:
        """Middles (N, 2) of free cells away from walls that send echoes: glass, perhaps."""
        cells = np.flatnonzero((self._echoes > 0) & (self._votes <= 0))
        if not len(cells):
            return np.empty((0, 2))
        middles = (np.stack(np.divmod(cells, self._size), axis=1) + self._corner + 0.5) * self._cell
        if not len(self.points()):
            return np.asarray(middles)
        return np.asarray(middles[self.tree().query(middles)[0] > _BESIDE_WALLS_M])

    def covers(self, points: Array) -> NDArray[np.bool_]:
        """Whether each point (N, 2) lies in the window."""
        cells = np.floor(points / self._cell).astype(np.int64) - self._corner
        inside: NDArray[np.bool_] = ((cells >= 0) & (cells < self._size)).all(axis=-1)
        return inside

    def known(self, points: Array) -> NDArray[np.bool_]:
        """Whether the cell under each point (..., 2) is free or occupied rather than unknown."""
        i, j = (self._within(points[..., k], k) for k in (0, 1))
        known: NDArray[np.bool_] = self._known.take((i * len(self._known) + j).astype(np.intp))
        return known

    def _within(self, metres: Array, axis: int) -> Array:
        """Rows or columns of `_known` for coordinates of any shape, its rim for those outside."""
        cells = np.floor(metres / self._cell) - (self._corner[axis] - 1)
        return np.asarray(cells.clip(0.0, self._size + 1))

    def is_bare(self, centre: Array, radius: float) -> bool:
        """Whether a disc, local frame, is free for certain, and all of it in the window."""
        if not self.covers(np.array([centre - radius, centre + radius])).all():
            return False
        i, j = self._disc(centre, radius)
        return bool(len(i)) and bool((self._free[i, j] & (self._votes[i, j] <= 0)).all())

    def was_free(self, centre: Array, radius: float) -> bool:
        """Whether a disc, local frame, was free once, whatever has been seen there since."""
        i, j = self._disc(centre, radius)
        return bool(len(i)) and bool(self._free[i, j].all())

    def doubt(self, centre: Array, radius: float) -> None:
        """Let the next beams that pass through a disc, local frame, forget what is no glass."""
        i, j = self._disc(centre, radius)
        self._votes[i, j] = np.minimum(self._votes[i, j], 1)

    def clear(self, centre: Array, radius: float) -> None:
        """Forget, at the next scan, what stands in a disc, local frame."""
        self._votes[self._disc(centre, radius)] = 0

    def forget(self, centre: Array, radius: float) -> None:
        """Know no floor in a disc, local frame, from the next scan on, but what that sees."""
        self._free[self._disc(centre, radius)] = False

    def stand_on(self, centre: Array, radius: float, travelled: float) -> None:
        """Know a disc, local frame, to be floor, from the next scan on: somebody stands on it."""
        disc = self._disc(centre, radius)
        self._free[disc], self._seen_at[disc] = True, travelled

    def count_on(self, metres: float) -> None:
        """Take what was driven as so much more: the counting began elsewhere."""
        self._seen_at += np.float32(metres)

    def _disc(self, centre: Array, radius: float) -> tuple[Index, Index]:
        """Rows and columns of the cells whose middles lie in a disc, local frame."""
        reach = math.ceil(radius / self._cell)
        around = np.mgrid[-reach : reach + 1, -reach : reach + 1].reshape(2, -1).T
        cells = np.floor(centre / self._cell).astype(np.int64) + around
        cells = cells[np.hypot(*((cells + 0.5) * self._cell - centre).T) < radius]
        cells -= self._corner
        i, j = cells[((cells >= 0) & (cells < self._size)).all(axis=1)].T
        return i, j

    @property
    def _reach(self) -> float:
        return self._config.half_width_m * 1.2

    def _recentre(self, local_laser: Pose) -> None:
        wanted = np.floor(local_laser.position / self._cell).astype(np.int64) - self._size // 2
        shift = wanted - self._corner
        if np.abs(shift).max() * self._cell < 1.0:
            return
        self._corner = wanted
        for name, empty in _EMPTY:
            setattr(self, name, _shifted(getattr(self, name), shift, empty))

    def _carve(
        self, scan: Scan, ranges: Array, directions: Array, local_laser: Pose, travelled: float
    ) -> None:
        """Mark what the beams passed through as free, and vote against walls they passed."""
        reach = min(self._reach, scan.range_max)  # as far as a beam without an echo is free
        see = least_of_three(np.where(np.isnan(ranges), 0.0, np.minimum(ranges, reach)))
        ends = local_laser.transform(see[:, None] * directions)
        window = self._window(ends, local_laser, reach * scan.angle_increment)
        x, y = self._corner * self._cell - local_laser.position
        dx = self._middles[window[0], None] + np.float32(x)
        dy = self._middles[window[1]] + np.float32(y)
        seen_to = range_towards(scan, see.astype(np.float32), dx, dy, local_laser.theta)
        distance = np.sqrt(dx * dx + dy * dy)
        passed = distance < seen_to - np.float32(0.8 * self._cell)
        self._free[window] |= passed
        self._seen_at[window][passed] = travelled
        i, j = self._cells(window, passed & (self._echoes[window] > 0))
        if len(i):
            self._doubt_echoes(i, j)
        i, j = self._cells(window, passed & (self._votes[window] > 0))
        if len(i):
            self._vote_against(i, j, scan, see, local_laser)

    def _window(self, ends: Array, eye: Pose, beside: float) -> Window:
        """The cells that beams from the eye to their ends (N, 2) pass, or pass `beside` m away."""
        margin, corner = beside + self._cell, self._corner.tolist()

        def span(metres: Array, own: float, before: int) -> slice:
            low, high = min(float(metres.min()), own), max(float(metres.max()), own)
            first = math.floor((low - margin) / self._cell) - before
            last = math.ceil((high + margin) / self._cell) - before
            return slice(max(first, 0), max(last, 0))

        return span(ends[:, 0], eye.x, corner[0]), span(ends[:, 1], eye.y, corner[1])

    @staticmethod
    def _cells(window: Window, chosen: NDArray[np.bool_]) -> tuple[Index, Index]:
        """Rows and columns of the cells that are chosen in a window."""
        i, j = np.divmod(np.flatnonzero(chosen), chosen.shape[1])  # faster than nonzero()
        return i + window[0].start, j + window[1].start

    def _vote_against(self, i: Index, j: Index, scan: Scan, see: Array, local_laser: Pose) -> None:
        d = self._mean[i, j] - local_laser.position
        beyond = range_towards(scan, see, d[:, 0], d[:, 1], local_laser.theta)
        gone = np.hypot(d[:, 0], d[:, 1]) < beyond - 1.5 * self._cell
        gone[gone] = ~self._is_glass(i[gone], j[gone])
        self._votes[i[gone], j[gone]] -= 1

    def _doubt_echoes(self, i: Index, j: Index) -> None:
        """Let echoes count less where beams have passed, but slowly where there is glass."""
        decay = np.where(self._is_glass(i, j), _GLASS_DECAY, _DECAY)
        self._echoes[i, j] = np.maximum(self._echoes[i, j] - decay, 0.0)

    def _note_echoes(self, points: Array) -> Array:
        """Count lone echoes (N, 2), once for each cell; those (M, 2) that come from glass."""
        if not len(points):
            return points
        points = points[self.covers(points)]
        i, j = (np.floor(points / self._cell).astype(np.int64) - self._corner).T
        self._echoes[i, j] += 1
        glass: Array = points[self._is_glass(i, j)]
        return glass

    def _is_glass(self, i: Index, j: Index) -> NDArray[np.bool_]:
        """Which cells (N,) have had lone echoes again and again, with their neighbours."""
        if not len(i):
            return np.zeros(0, np.bool_)
        rows, columns = self._beside(i)[:, :, None], self._beside(j)[:, None, :]
        echoes = self._echoes[rows, columns].sum(axis=(1, 2), dtype=np.float64)
        glass: NDArray[np.bool_] = echoes >= _GLASS_ECHOES
        return glass

    def _beside(self, k: Index) -> Index:
        """Each row or column (N,) with the one before and the one after it (N, 3)."""
        beside: Index = np.minimum(np.maximum(k[:, None] + (-1, 0, 1), 0), self._size - 1)
        return beside

    def _occupy(self, points: Array, eye: Array, travelled: float) -> None:
        i, j = (np.floor(points / self._cell).astype(np.int64) - self._corner).T
        inside = ((i >= 0) & (i < self._size) & (j >= 0) & (j < self._size)).nonzero()[0]
        flat = i.take(inside) * self._size + j.take(inside)
        counts = np.bincount(flat)
        cell = (counts > 0).nonzero()[0]
        count = counts[cell]
        x, y = (np.bincount(flat, points[:, k].take(inside))[cell] / count for k in (0, 1))
        mean, sight = self._mean.reshape(-1, 2), self._sight.reshape(-1, 2)
        votes, hits, look = (a.reshape(-1) for a in (self._votes, self._hits, self._look))
        spread = self._spread.reshape(-1)
        old = np.maximum(votes.take(cell), 0)
        before = np.where(old > 0, hits.take(cell), 0.0)
        share = (count / (before + count))[:, None]
        seen = np.stack([x, y], axis=1)
        towards = eye - seen
        towards /= np.maximum(np.hypot(*towards.T), 1e-6)[:, None]
        mean[cell] = (1 - share) * mean.take(cell, axis=0) + share * seen
        sight[cell] = (1 - share) * sight.take(cell, axis=0) + share * towards
        newer, new = self.looks - look.take(cell), share[:, 0]
        spread[cell] = (1.0 - new) * (spread.take(cell) + new * newer**2)
        look[cell] += new * newer
        hits[cell] = np.minimum(before + count, _MOST_HITS)
        votes[cell] = np.minimum(old + _HIT, _MAX_VOTES)
        self._seen_at.reshape(-1)[cell] = travelled

    def _forget(self, travelled: float) -> None:
        fresh = self._seen_at >= travelled - self._config.memory_m
        self._free &= fresh
        self._votes *= fresh
        self._echoes *= fresh


def _shifted(
    array: NDArray[np.generic], shift: NDArray[np.int64], empty: object
) -> NDArray[np.generic]:
    """The array as seen from a corner moved by `shift` cells; what comes into view is empty."""
    n = array.shape[0]
    out = np.full_like(array, empty)
    if np.abs(shift).max() >= n:
        return out
    source = tuple(slice(max(s, 0), n + min(s, 0)) for s in shift)
    target = tuple(slice(max(-s, 0), n + min(-s, 0)) for s in shift)
    out[target] = array[source]
    return out
