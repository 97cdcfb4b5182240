"""A block of solid wall to carve worlds from."""

import math
from itertools import pairwise

import numpy as np

from gvgbot.drivers.ray_casting import Mask
from gvgbot.drivers.world import World
from gvgbot.geometry import Array

Window = tuple[slice, slice]

RESOLUTION = 0.05  # m per cell, unless a world needs it finer


class Canvas:
    """A rectangle of wall, in metres from its lower left corner, to carve free space from."""

    def __init__(self, width: float, height: float, resolution: float = RESOLUTION) -> None:
        self.resolution = resolution
        shape = self._cells(height), self._cells(width)
        self.occupied: Mask = np.ones(shape, dtype=np.bool_)
        self._glass: Mask = np.zeros(shape, dtype=np.bool_)

    def carve(self, x0: float, y0: float, x1: float, y1: float) -> None:
        """Free the rectangle between two opposite corners."""
        self.occupied[self._rectangle(x0, y0, x1, y1)] = False

    def build(self, x0: float, y0: float, x1: float, y1: float) -> None:
        """Fill the rectangle between two opposite corners."""
        self.occupied[self._rectangle(x0, y0, x1, y1)] = True

    def glaze(self, x0: float, y0: float, x1: float, y1: float) -> None:
        """Make what is wall between two opposite corners glass."""
        self._glass[self._rectangle(x0, y0, x1, y1)] = True

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

    def carve_turned(self, x: float, y: float, length: float, width: float, angle: float) -> None:
        """Free the rectangle about (x, y) whose length points along the angle (rad)."""
        reach = math.hypot(length, width) / 2
        window, dx, dy = self._around(x, y, reach)
        c, s = math.cos(angle), math.sin(angle)
        along, across = c * dx + s * dy, c * dy - s * dx
        self.occupied[window] &= (np.abs(along) > length / 2) | (np.abs(across) > width / 2)

    def world(self, name: str) -> World:
        """The world as carved."""
        glass = self._glass & self.occupied
        return World(
            self.occupied, self.resolution, (0.0, 0.0), name, glass if glass.any() else None
        )

    def _disc(self, x: float, y: float, radius: float) -> tuple[Window, Mask]:
        window, dx, dy = self._around(x, y, radius)
        return window, dy**2 + dx**2 <= radius**2

    def _around(self, x: float, y: float, reach: float) -> tuple[Window, Array, Array]:
        """The cells in reach of a point, and their centres relative to it, m."""
        rows = slice(max(self._cells(y - reach), 0), self._cells(y + reach) + 1)
        columns = slice(max(self._cells(x - reach), 0), self._cells(x + reach) + 1)
        shape = self.occupied[rows, columns].shape
        dy = (np.arange(shape[0], dtype=np.float64) + rows.start + 0.5) * self.resolution - y
        dx = (np.arange(shape[1], dtype=np.float64) + columns.start + 0.5) * self.resolution - x
        return (rows, columns), dx[None, :], dy[:, None]

    def _rectangle(self, x0: float, y0: float, x1: float, y1: float) -> Window:
        return slice(self._cells(y0), self._cells(y1)), slice(self._cells(x0), self._cells(x1))

    def _cells(self, metres: float) -> int:
        return round(float(metres) / self.resolution)
