"""A drawing surface that keeps shapes, for formats that can be enlarged without end."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gvgbot.geometry import Array
from gvgbot.maps.canvas import Ink, Point
from gvgbot.maps.surface import Anchor

MIDDLE = 0.35  # of a text's size: from its baseline to the middle of its capitals
HALO = 4.0  # pixels, both sides together


@dataclass(frozen=True, slots=True, eq=False)
class Stroke:
    """A line through points (N, 2), drawn with a round pen; a closed one may be filled."""

    points: Array
    width: float = 1.0  # of the pen
    ink: Ink | None = None  # of the line
    fill: Ink | None = None
    is_closed: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Raster:
    """Palette indices (rows, columns), first row at the top, over a rectangle."""

    shades: NDArray[np.uint8]
    corner: Point
    size: Point


@dataclass(frozen=True, slots=True)
class Words:
    """A line of text with a white halo."""

    at: Point
    words: str
    size: float
    anchor: Anchor


@dataclass(frozen=True, slots=True)
class Window:
    """Shapes that are seen inside a rectangle only."""

    corner: Point
    size: Point
    shapes: tuple[Stroke | Raster, ...]


class Drawing:
    """A white sheet of `width` by `height` pixels; y grows downwards, and sizes are in pixels."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self.windows: list[Window] = []  # under all other shapes
        self.words: list[Words] = []  # over them
        self._shapes: list[Stroke | Raster] = []

    @property
    def shapes(self) -> tuple[Window | Stroke | Raster | Words, ...]:
        """Everything, the lowest first."""
        return (*self.windows, *self._shapes, *self.words)

    def raster(self, shades: NDArray[np.uint8], corner: Point, size: Point) -> None:
        """Palette indices (rows, columns), first row at the top, stretched over a rectangle."""
        self._shapes.append(Raster(shades, corner, size))

    def box(self, corner: Point, size: Point, *, fill: Ink, outline: Ink | None = None) -> None:
        """An upright rectangle from its upper left corner, with a border one pixel wide."""
        self._shapes.append(Stroke(_corners(corner, size), ink=outline, fill=fill, is_closed=True))

    def frame(self, corner: Point, size: Point) -> None:
        """A border one pixel wide; all that was drawn outside of it so far is not seen."""
        self.windows.append(Window(corner, size, tuple(self._shapes)))
        self._shapes = [Stroke(_corners(corner, size), ink=Ink.GREY, is_closed=True)]

    def line(self, points: Array, ink: Ink, width: float) -> None:
        """A line through points (N, 2) with round joints and ends; a point alone draws nothing."""
        if len(points) > 1:
            self._shapes.append(Stroke(points, width, ink))

    def polygon(self, points: Array, *, fill: Ink | None, outline: Ink, width: float) -> None:
        """A closed outline through points (N, 2)."""
        self._shapes.append(Stroke(points, width, outline, fill, is_closed=True))

    def disc(self, centre: Point, radius: float, *, fill: Ink) -> None:
        """A filled circle: where a round pen touches the paper once."""
        self._shapes.append(Stroke(np.array([centre, centre]), 2.0 * radius, fill))

    def text(self, at: Point, words: str, size: int, anchor: Anchor = "lm") -> None:
        """Words with a white halo, over all that is drawn."""
        self.words.append(Words(at, words, size, anchor))

    def paste(self, other: Self, corner: Point, *, shrunk: int = 1) -> None:
        """Put another drawing on this one, so many times smaller, over all that is drawn."""
        moved = _Moved(np.array(corner), 1.0 / shrunk)
        self.windows += [moved.window(window) for window in other.windows]
        self._shapes += [moved.shape(shape) for shape in other._shapes]
        self.words += [moved.text(words) for words in other.words]


@dataclass(frozen=True, slots=True, eq=False)
class _Moved:
    """Shapes of a drawing on another one: scaled, then moved by `corner` (2,)."""

    corner: Array
    scale: float

    def window(self, window: Window) -> Window:
        shapes = tuple(self.shape(shape) for shape in window.shapes)
        return Window(self._at(window.corner), self._size(window.size), shapes)

    def shape(self, shape: Stroke | Raster) -> Stroke | Raster:
        if isinstance(shape, Raster):
            return replace(shape, corner=self._at(shape.corner), size=self._size(shape.size))
        points = self.corner + self.scale * shape.points
        return replace(shape, points=points, width=self.scale * shape.width)

    def text(self, words: Words) -> Words:
        return replace(words, at=self._at(words.at), size=self.scale * words.size)

    def _at(self, point: Point) -> Point:
        x, y = (self.corner + self.scale * np.array(point)).tolist()
        return x, y

    def _size(self, size: Point) -> Point:
        return self.scale * size[0], self.scale * size[1]


def _corners(corner: Point, size: Point) -> Array:
    (left, top), (width, height) = corner, size
    right, bottom = left + width, top + height
    return np.array([(left, top), (right, top), (right, bottom), (left, bottom)])
