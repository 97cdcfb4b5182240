"""The grid as it travels on the network: walls and floor, in tiles."""

import zlib
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

_LARGEST_SIDE = 1024  # cells, of a tile
_MOST_CELLS = 2**28  # of a grid: a square of 800 m with cells of 5 cm


class Tile(msgspec.Struct, frozen=True, kw_only=True):
    """A square part of the grid. That at column 0, row 0 has a corner at the map's origin."""

    column: int  # of tiles, along x
    row: int  # of tiles, along y
    cells: bytes  # zlib of int8, row by row from the lower left: percent occupied, -1 unknown


@dataclass(frozen=True, slots=True, eq=False)
class Raster:
    """Cells (rows, columns), percent occupied, -1 where unknown, row 0 at the bottom; read-only.

    `origin` (m, map frame) is the outer corner of cell [0, 0], `resolution` (m) a cell's side.
    """

    cells: NDArray[np.int8]
    resolution: float
    origin: tuple[float, float]


class Grid(msgspec.Struct, frozen=True, kw_only=True):
    """Walls and floor, in tiles. Sent with those that changed since the message before.

    The answer to a query has all tiles, and the number of the last message that is in them. Who
    finds a number missing, or another `began`, asks for all again. When a loop closes, cells that
    lie elsewhere by then are sent again where they belong.
    """

    stamp: float  # s, the robot's monotonic clock
    began: float  # s, when this grid was begun; those of another one are void
    number: int  # of the message, from 1
    resolution: float  # m, the side of a cell
    side: int  # cells along the side of a tile
    tiles: tuple[Tile, ...]

    def __post_init__(self) -> None:
        """Raises ValueError for tiles of no size, or of far too many cells."""
        if not 0 < self.side <= _LARGEST_SIDE:
            raise ValueError(f"tiles of {self.side} cells a side")

    def raster(self) -> Raster:
        """The tiles laid side by side; unknown between them. Raises ValueError for damaged ones."""
        if not self.tiles:
            return Raster(np.full((1, 1), -1, np.int8), self.resolution, (0.0, 0.0))
        places = np.array([(tile.row, tile.column) for tile in self.tiles])
        corner = places.min(axis=0)
        rows, columns = (int(n) * self.side for n in places.max(axis=0) + 1 - corner)
        if rows * columns > _MOST_CELLS:
            raise ValueError(f"a grid of {rows} by {columns} cells is no building's")
        cells = np.full((rows, columns), -1, np.int8)
        for (row, column), tile in zip((places - corner) * self.side, self.tiles, strict=True):
            cells[row : row + self.side, column : column + self.side] = self._unpacked(tile)
        cells.setflags(write=False)
        width = self.side * self.resolution
        return Raster(cells, self.resolution, (int(corner[1]) * width, int(corner[0]) * width))

    def _unpacked(self, tile: Tile) -> NDArray[np.int8]:
        try:
            cells = zlib.decompressobj().decompress(tile.cells, self.side**2 + 1)
            return np.frombuffer(cells, np.int8).reshape(self.side, self.side)
        except (zlib.error, ValueError) as error:
            raise ValueError(f"a damaged tile at {tile.column}, {tile.row}: {error}") from error
