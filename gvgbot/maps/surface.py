"""What a map can be drawn on, be it pixels or shapes."""

from typing import Literal, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from gvgbot.geometry import Array
from gvgbot.maps.canvas import Ink, Point

Anchor = Literal["lm", "mm", "rm"]  # left end, middle or right end of words, at half their height


class Surface(Protocol):
    """White at first; y grows downwards, and sizes are in pixels."""

    height: int

    def raster(self, shades: NDArray[np.uint8], corner: Point, size: Point) -> None:
        """Palette indices (rows, columns), first row at the top, stretched over a rectangle."""

    def box(self, corner: Point, size: Point, *, fill: Ink, outline: Ink | None = None) -> None:
        """An upright rectangle from its upper left corner, with a border one pixel wide."""

    def frame(self, corner: Point, size: Point) -> None:
        """A border one pixel wide; all that was drawn outside of it so far is not seen."""

    def line(self, points: Array, ink: Ink, width: float) -> None:
        """A line through points (N, 2) with round joints and ends; a point alone draws nothing."""

    def polygon(self, points: Array, *, fill: Ink | None, outline: Ink, width: float) -> None:
        """A closed outline through points (N, 2)."""

    def disc(self, centre: Point, radius: float, *, fill: Ink) -> None:
        """A filled circle."""

    def text(self, at: Point, words: str, size: int, anchor: Anchor = "lm") -> None:
        """Words with a white halo, over all that is drawn."""

    def paste(self, other: Self, corner: Point, *, shrunk: int = 1) -> None:
        """Put another sheet on this one, so many times smaller, over all that is drawn."""


S = TypeVar("S", bound=Surface)
