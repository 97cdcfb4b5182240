"""The grid so far as tiles: which have changed since they were sent last, and all of them."""

import math
import zlib
from collections.abc import Iterable, Iterator

import numpy as np

from gvgbot.autonomy.pipeline import Keyframe
from gvgbot.maps.occupancy import GrowingGrid, OccupancyGrid
from gvgbot.topics import Grid, Tile

_RESOLUTION_M, _REACH_M = 0.05, 8.0  # a shorter reach than the saved grid's: cheap to send
_SIDE = 64  # cells of a tile
_MOST_TILES = 128  # in a message; the others have to wait for the next
_EFFORT = 1  # of compression, of 9: half as large again as with most, at a tenth of the time

Place = tuple[int, int]  # row and column of a tile


class LiveGrid:
    """Grows with each keyframe that shows something new."""

    def __init__(self, began: float) -> None:
        self._grid = GrowingGrid(_RESOLUTION_M, _REACH_M)
        self._began, self._number = began, 0
        self._sent: dict[Place, bytes] = {}
        self._tiles: dict[Place, Tile] = {}
        self.has_more = False  # tiles that could not all be sent at once

    def add(self, keyframes: Iterable[Keyframe]) -> None:
        """Let scans vote."""
        for keyframe in keyframes:
            if keyframe.scan is not None:
                self._grid.add(keyframe.map_base, keyframe.scan)

    def changes(self, stamp: float) -> Grid | None:
        """The tiles that have changed since the last call, or as many as are sent at once."""
        changed: list[Tile] = []
        self.has_more = False
        for place, cells in _tiled(self._grid.grid()):
            if cells != self._sent.get(place, _BLANK):
                if len(changed) == _MOST_TILES:
                    self.has_more = True
                    break
                self._sent[place] = cells
                self._tiles[place] = _tile(place, cells)
                changed.append(self._tiles[place])
        if not changed:
            return None
        self._number += 1
        return self._message(stamp, changed)

    def whole(self, stamp: float) -> Grid:
        """All tiles that have been sent."""
        return self._message(stamp, self._tiles.values())

    def _message(self, stamp: float, tiles: Iterable[Tile]) -> Grid:
        return Grid(
            stamp=stamp,
            began=self._began,
            number=self._number,
            resolution=_RESOLUTION_M,
            side=_SIDE,
            tiles=tuple(tiles),
        )


_BLANK = bytes(np.full(_SIDE * _SIDE, -1, np.int8))


def _tile(place: Place, cells: bytes) -> Tile:
    row, column = place
    return Tile(column=column, row=row, cells=zlib.compress(cells, _EFFORT))


def _tiled(grid: OccupancyGrid) -> Iterator[tuple[Place, bytes]]:
    """The cells of each tile that a grid lies on."""
    left, bottom = (round(x / grid.resolution_m) for x in grid.origin)
    row, column = bottom // _SIDE, left // _SIDE
    inside = np.s_[bottom - row * _SIDE :, left - column * _SIDE :]
    filled = np.add(grid.cells.shape, [bottom - row * _SIDE, left - column * _SIDE])
    rows, columns = (math.ceil(cells / _SIDE) for cells in filled)
    cells = np.full((rows * _SIDE, columns * _SIDE), -1, np.int8)
    cells[inside][: grid.cells.shape[0], : grid.cells.shape[1]] = grid.cells
    tiles = cells.reshape(rows, _SIDE, columns, _SIDE).swapaxes(1, 2)
    for up in range(rows):
        for along in range(columns):
            yield (row + up, column + along), tiles[up, along].tobytes()
