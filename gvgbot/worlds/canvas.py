"""A block of solid wall to carve worlds from."""

from itertools import pairwise

import numpy as np

from gvgbot.drivers.ray_casting import Mask
from gvgbot.drivers.world import World

RESOLUTION = 0.05  # m per cell of every built-in world


class Canvas:
    """A rectangle of wall, in metres from its lower left corner, to carve free space from."""

    def __init__(self, width: float, height: float) -> None:
        self.occupied: Mask = np.ones((_cells(height), _cells(width)), dtype=np.bool_)

    def carve(self, x0: float, y0: float, x1: float, y1: float) -> None:
        """Free the rectangle between two opposite corners."""
        self.occupied[_cells(y0) : _cells(y1), _cells(x0) : _cells(x1)] = False

    def build(self, x0: float, y0: float, x1: float, y1: float) -> None:
        """Fill the rectangle between two opposite corners."""
        self.occupied[_cells(y0) : _cells(y1), _cells(x0) : _cells(x1)] = True

    def carve_path(self, corners: list[tuple[float, float]], width: float) -> None:
        """Free a corridor along axis-parallel centre lines."""
        half = width / 2
        for (xa, ya), (xb, yb) in pairwise(corners):
            self.carve(
                min(xa, xb) - half, min(ya, yb) - half, max(xa, xb) + half, max(ya, yb) + half
            )

    def carve_disc(self, x: float, y: float, radius: float) -> None:
        """Free a disc."""
        window, disc = self._disc(x, y, radius)
        self.occupied[window] &= ~disc

    def build_disc(self, x: float, y: float, radius: float) -> None:
        """Fill a disc."""
        window, disc = self._disc(x, y, radius)
        self.occupied[window] |= disc

    def _disc(self, x: float, y: float, radius: float) -> tuple[tuple[slice, slice], Mask]:
        rows = slice(_cells(y - radius), _cells(y + radius) + 1)
        columns = slice(_cells(x - radius), _cells(x + radius) + 1)
        dy = (np.arange(rows.start, rows.stop) + 0.5) * RESOLUTION - y
        dx = (np.arange(columns.start, columns.stop) + 0.5) * RESOLUTION - x
        return (rows, columns), dy[:, None] ** 2 + dx[None, :] ** 2 <= radius**2

    def world(self, name: str) -> World:
        """The world as carved."""
        return World(self.occupied, RESOLUTION, (0.0, 0.0), name)


def _cells(metres: float) -> int:
    return round(float(metres) / RESOLUTION)
