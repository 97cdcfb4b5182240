"""The walls of a known map, laid out so that what a robot sees can be compared with all of it."""

from collections.abc import Generator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, distance_transform_edt
from scipy.spatial import cKDTree

from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan
from gvgbot.hal.packed_scan import AnyScan

REACH_M = 8.0  # around the robot, what is compared
CELL_M = 0.25  # of what has been seen, and from place to place
_WALL_CELL_M = 0.1
_ROOM_M = 0.2  # from the walls, a robot may stand
_ROUGH_M = 0.4  # walls so far off do not speak for a rough guess
_AROUND_WHOLE, _AROUND_HALF = 2, 1  # cells
_SCANS_A_STEP = 30  # gathered in one go

Bools = NDArray[np.bool_]


class KnownWalls:
    """The walls of a known map, what of it has been seen, and where a robot may be."""

    def __init__(self, points: Array, stood: Array) -> None:
        """Points of the walls (N, 2), and where they were seen from (M, 2), map frame."""
        self.points = points
        self.tree = cKDTree(points)
        told = np.concatenate([points, stood])
        low = told.min(axis=0) if len(told) else np.zeros(2)
        high = told.max(axis=0) if len(told) else np.zeros(2)
        self._corner = low - 2 * REACH_M
        shape = np.ceil((high - low + 4 * REACH_M) / _WALL_CELL_M).astype(int)
        walls = np.zeros(shape, bool)
        walls[self._cells(points, _WALL_CELL_M)] = True
        self._score = np.clip(
            1.0 - distance_transform_edt(~walls) * _WALL_CELL_M / _ROUGH_M, 0.0, 1.0
        ).astype(np.float32)
        self._seen: Bools = np.zeros(np.ceil(shape * _WALL_CELL_M / CELL_M).astype(int), bool)
        self.places = np.empty((0, 2))

    @classmethod
    def gather(
        cls, scans: Sequence[tuple[Pose, AnyScan]], *, is_whole: bool = True
    ) -> Generator[None, None, "KnownWalls"]:
        """What scans taken at map_base poses show, a few of them in one go.

        Around what they have seen, a map that `is_whole` counts as seen as well: there is nothing
        more. Beside half a map, the walls go on.
        """
        lasers = [base.compose(scan.base_laser) for base, scan in scans]
        ends = [np.empty((0, 2))]
        for number, (laser, (_, scan)) in enumerate(zip(lasers, scans, strict=True), 1):
            ends.append(laser.transform(scan.unpacked().ends))
            if number % _SCANS_A_STEP == 0:
                yield
        points = _thinned(np.concatenate(ends), _WALL_CELL_M)
        yield
        known = cls(points, np.array([base.position for base, _ in scans]).reshape(-1, 2))
        for number, (laser, (_, scan)) in enumerate(zip(lasers, scans, strict=True)):
            if number % _SCANS_A_STEP == 0:
                yield
            known._seen[known._cells(laser.transform(_passed(scan.unpacked())), CELL_M)] = True
        free = known._corner + (np.argwhere(known._seen) + 0.5) * CELL_M
        known.places = free[known.tree.query(free)[0] > _ROOM_M]
        around = _AROUND_WHOLE if is_whole else _AROUND_HALF
        known._seen = binary_dilation(known._seen, iterations=around)
        return known

    def _cells(self, points: Array, cell: float) -> tuple[NDArray[np.int64], ...]:
        return tuple(((points - self._corner) / cell).astype(np.int64).T)

    def scores(self, places: Array, around: Array) -> Array:
        """How well points lie on walls around each place, 0..1 (N, H), on average.

        `places` (N, 2) are some of the map's; `around` (H, K, 2) are H sets of points, seen from a
        place and nearer than is compared, so that all are inside. Places stand in one of few ways
        on the cells of walls, and all that stand in the same way share the cells of the points.
        """
        at = (places - self._corner) / _WALL_CELL_M
        cells = np.floor(at).astype(np.int64)
        ways, way_of = np.unique((at - cells).round(3), axis=0, return_inverse=True)
        columns = self._score.shape[1]
        found = np.empty((len(places), len(around)))
        for number, way in enumerate(ways):
            these = np.flatnonzero(way_of.ravel() == number)
            i, j = np.moveaxis(np.floor(around / _WALL_CELL_M + way).astype(np.int64), -1, 0)
            flat = (cells[these] @ [columns, 1])[:, None, None] + (i * columns + j)
            found[these] = self._score.take(flat, mode="clip").mean(axis=-1)
        return found

    def scores_at(self, guesses: Array, base_walls: Array) -> Array:
        """The same (N,) for guesses (N, 3), x, y and heading, and points (K, 2) as seen there."""
        x, y, theta = guesses[:, :, None].transpose(1, 0, 2)
        c, s = np.cos(theta), np.sin(theta)
        laid = np.stack(
            [
                x + c * base_walls[:, 0] - s * base_walls[:, 1],
                y + s * base_walls[:, 0] + c * base_walls[:, 1],
            ],
            axis=-1,
        )
        i, j = np.moveaxis(((laid - self._corner) / _WALL_CELL_M).astype(np.int64), -1, 0)
        flat = i * self._score.shape[1] + j
        return np.asarray(self._score.take(flat, mode="clip").mean(axis=1))

    def is_seen(self, points: Array) -> Bools:
        """Whether the map has seen anything where points (N, 2) are."""
        i, j = self._cells(points, CELL_M)
        rows, columns = self._seen.shape
        inside = (i >= 0) & (j >= 0) & (i < rows) & (j < columns)
        found: Bools = inside & self._seen[np.where(inside, i, 0), np.where(inside, j, 0)]
        return found


def _thinned(points: Array, cell: float) -> Array:
    """`geometry.thinned`, in less time."""
    if not len(points):
        return points
    cells = np.floor(points / cell).astype(np.int64)
    i, j = (cells - cells.min(axis=0)).T
    index = i * (j.max() + 1) + j  # counted, not sorted: of a large building there are a million
    count = np.bincount(index)
    used = count > 0
    return np.stack([np.bincount(index, points[:, k])[used] / count[used] for k in (0, 1)], axis=1)


def _passed(scan: Scan) -> Array:
    """Points (N, 2) along the beams, as far as is compared, laser frame."""
    ends = scan.ends[::4]
    away = np.hypot(*ends.T)
    shares = np.arange(0.0, 2 * REACH_M, CELL_M)[None] / np.maximum(away, 1e-6)[:, None]
    i, k = np.nonzero(shares < 1.0)
    passed: Array = ends[i] * shares[i, k][:, None]
    return passed
