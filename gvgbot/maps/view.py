"""Which part of the map a picture shows, and where a point of it lies in the picture."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gvgbot.geometry import Array

_SMALLEST = 2.0  # m; a map of next to nothing is still shown this large
_BORDER = 0.02  # of the larger side


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """An upright rectangle in the map frame: its corners (2,), m."""

    low: Array
    high: Array

    @property
    def size(self) -> Array:
        """Width and height (2,), m."""
        return self.high - self.low

    def grown(self, margin: float) -> "Box":
        """The box with a margin (m) on every side."""
        return Box(self.low - margin, self.high + margin)

    def holds(self, points: Array) -> NDArray[np.bool_]:
        """Which of some points (N, 2) lie in it."""
        return np.asarray(((points >= self.low) & (points <= self.high)).all(axis=1))

    def stretched(self, points: Array, limit: float) -> "Box":
        """The box grown to hold these points (N, 2), by no more than `limit` (m) on any side."""
        near = self.grown(limit)
        inside = np.clip(points, near.low, near.high)
        return box_around(np.concatenate([inside, [self.low, self.high]]))


def box_around(points: Array) -> Box:
    """The smallest box around points (N, 2); around the origin if there is none."""
    if not len(points):
        return Box(np.zeros(2), np.zeros(2))
    return Box(points.min(axis=0), points.max(axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A box of the map in a picture: `corner` (2,) is its upper left pixel, `scale` in pixels/m."""

    box: Box
    corner: Array
    scale: float

    @classmethod
    def fitted(cls, box: Box, corner: tuple[float, float], *, width: float, height: float) -> Self:
        """The view that fills the width (pixels), or the height if the map is too tall for that."""
        missing = np.maximum(_SMALLEST - box.size, 0.0) / 2
        box = Box(box.low - missing, box.high + missing)
        box = box.grown(_BORDER * float(box.size.max()))
        scale = float(min(width / box.size[0], height / box.size[1]))
        return cls(box, np.array(corner), scale)

    def centred(self, width: float) -> "View":
        """The view in the middle of so many pixels, if it is narrower."""
        spare = max(0.0, width - float(self.size[0]))
        return View(self.box, self.corner + np.array([spare / 2, 0.0]), self.scale)

    @property
    def size(self) -> Array:
        """Width and height (2,), pixels."""
        return self.box.size * self.scale

    def pixels(self, points: Array) -> Array:
        """Where points (..., 2), m, map frame, lie in the picture: pixels from its upper left."""
        upper_left = np.array([self.box.low[0], self.box.high[1]])
        flipped: Array = (points - upper_left) * np.array([1.0, -1.0])
        return self.corner + self.scale * flipped

    def pixel(self, point: Array | tuple[float, float]) -> tuple[float, float]:
        """As `pixels`, of one point."""
        return pair(self.pixels(np.asarray(point)))


def pair(values: Array) -> tuple[float, float]:
    """An array (2,) as two floats."""
    return float(values[0]), float(values[1])
