"""The grid so far as tiles: which have changed since they were sent last, and all of them."""

import zlib
from collections.abc import Iterable
from itertools import product

import numpy as np

from gvgbot.autonomy.keyframes import Keyframe
from gvgbot.maps.occupancy import GrowingGrid
from gvgbot.tiles import Grid, Tile

_RESOLUTION_M, _REACH_M = 0.05, 8.0  # a shorter reach than the saved grid's: cheap to send
_SIDE = 64  # cells of a tile
_MOST_TILES = 128  # in a message; the others have to wait for the next
_EFFORT = 1  # of compression, of 9: half as large again as with most, at a tenth of the time

Place = tuple[int, int]  # row and column of a tile


class LiveGrid:
    """Grows with each keyframe that shows something new, and can be drawn anew."""

    def __init__(self, began: float) -> None:
        self._grid = GrowingGrid(_RESOLUTION_M, _REACH_M)
        self._began, self._number = began, 0
        self._touched: dict[Place, None] = {}  # since they were sent, the longest ago first
        self._tiles: dict[Place, Tile] = {}  # as they were sent last

    @property
    def has_more(self) -> bool:
        """Whether some tiles still have to be sent."""
        return bool(self._touched)

    def add(self, keyframes: Iterable[Keyframe]) -> None:
        """Let scans vote."""
        for keyframe in keyframes:
            if keyframe.scan is not None:
                self._grid.add(keyframe.map_base, keyframe.scan.unpacked())
                low, high = self._grid.around(keyframe.map_base, keyframe.scan)
                rows, columns = zip(low // _SIDE, (high - 1) // _SIDE + 1, strict=True)
                self._touched |= dict.fromkeys(product(range(*rows), range(*columns)))

    def redraw(self, keyframes: Iterable[Keyframe]) -> None:
        """Begin anew with these; every tile that was sent is looked at again."""
        self._grid = GrowingGrid(_RESOLUTION_M, _REACH_M)
        self._touched = dict.fromkeys(self._tiles)
        self.add(keyframes)

    def changes(self, stamp: float) -> Grid | None:
        """The tiles that have changed since the last call, or as many as are sent at once."""
        changed: list[Tile] = []
        while self._touched and len(changed) < _MOST_TILES:
            place = next(iter(self._touched))
            del self._touched[place]
            row, column = place
            cells = self._grid.square(row * _SIDE, column * _SIDE, _SIDE).tobytes()
            if cells != self._sent(place):
                packed = zlib.compress(cells, _EFFORT)
                self._tiles[place] = Tile(column=column, row=row, cells=packed)
                changed.append(self._tiles[place])
        if not changed:
            return None
        self._number += 1
        return self._message(stamp, changed)

    def _sent(self, place: Place) -> bytes:
        """The cells of a tile as they are known where it was sent."""
        tile = self._tiles.get(place)
        return _BLANK if tile is None else zlib.decompress(tile.cells)

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
