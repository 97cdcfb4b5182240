"""Which part of the map the screen shows, and where a point of it lies among the dots."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gvgbot.monitor.braille import DOTS_HIGH, DOTS_WIDE, Dots

_SMALLEST_M = 4.0  # a map of next to nothing is still shown this large

Points = NDArray[np.floating]


@dataclass(frozen=True, slots=True)
class View:
    """A window of `width` x `height` characters; `left`, `top` (m) is its upper left corner."""

    width: int
    height: int
    left: float
    top: float
    metres_per_dot: float

    @classmethod
    def around(cls, low: Points, high: Points, width: int, height: int) -> Self:
        """The view in whose middle a box of corners (2,), m, is as large as it can be."""
        dots = np.array([width * DOTS_WIDE, height * DOTS_HIGH])
        size = np.maximum(high - low, _SMALLEST_M)
        scale = float((size / dots).max())
        left, top = (low + high) / 2 + np.array([-0.5, 0.5]) * dots * scale
        return cls(width, height, float(left), float(top), scale)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of dots."""
        return self.height * DOTS_HIGH, self.width * DOTS_WIDE

    def dots_of(self, points: Points) -> NDArray[np.int64]:
        """(row, column) of the dot (N, 2) of each point (N, 2), m; perhaps outside the view."""
        offsets = (points - np.array([self.left, self.top])) / self.metres_per_dot
        dots: NDArray[np.int64] = np.floor(offsets[:, ::-1] * [-1.0, 1.0]).astype(np.int64)
        return dots

    def character_of(self, point: tuple[float, float]) -> tuple[int, int] | None:
        """(row, column) of the character that a point, m, lies in; None outside the view."""
        row, column = (self.dots_of(np.array([point])) // (DOTS_HIGH, DOTS_WIDE))[0].tolist()
        return (row, column) if 0 <= row < self.height and 0 <= column < self.width else None

    def centres(self) -> tuple[Points, Points]:
        """The x of each column of dots, y of each row, m."""
        rows, columns = self.shape
        x = self.left + (np.arange(columns) + 0.5) * self.metres_per_dot
        y = self.top - (np.arange(rows) + 0.5) * self.metres_per_dot
        return x, y

    def plot(self, dots: Dots, points: Points) -> None:
        """Light the dots (rows, columns) of points (N, 2), m."""
        at = self.dots_of(points)
        inside = ((at >= 0) & (at < self.shape)).all(axis=1)
        dots[at[inside, 0], at[inside, 1]] = True

    def draw(self, dots: Dots, polyline: Points) -> None:
        """Light the dots along a polyline (N, 2), m, without a gap."""
        if len(polyline) < 2:
            return
        steps = np.diff(polyline, axis=0)
        counts = np.ceil(np.abs(steps).max(axis=1) / self.metres_per_dot * 2.0).astype(int)
        counts = counts.clip(1)
        nth = np.arange(counts.sum()) - np.repeat(counts.cumsum() - counts, counts)
        share = (nth / np.repeat(counts, counts))[:, None]
        between = np.repeat(polyline[:-1], counts, axis=0) + share * np.repeat(
            steps, counts, axis=0
        )
        self.plot(dots, np.concatenate([between, polyline[-1:]]))
