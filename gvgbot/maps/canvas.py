"""A drawing surface with smooth lines: drawn at twice the size, then reduced.

Indexed colours, one byte per large pixel, keep it small; text comes last, on the reduced image.
"""

import io
from collections.abc import Sequence
from enum import IntEnum, auto, unique
from itertools import combinations
from typing import Self

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from gvgbot.geometry import Array
from gvgbot.words import shortened

OVERSAMPLING = 2
_STRIP = 64  # rows that are stretched or reduced at a time

Point = tuple[float, float]
Colour = tuple[int, int, int]


@unique
class Ink(IntEnum):
    """The colours, after the 101 shades of grey from 0 (white) to 100 (a wall).

    They come from Okabe and Ito's palette, which colour-blind readers tell apart.
    """

    UNKNOWN = 101
    WHITE = auto()
    BLACK = auto()
    GREY = auto()
    SKY = auto()
    BLUE = auto()
    GREEN = auto()
    RED = auto()
    PURPLE = auto()
    ORANGE = auto()


# red, green, blue
COLOURS: dict[Ink, Colour] = {
    Ink.UNKNOWN: (238, 238, 238),
    Ink.WHITE: (255, 255, 255),
    Ink.BLACK: (20, 20, 20),
    Ink.GREY: (120, 120, 120),
    Ink.SKY: (86, 180, 233),
    Ink.BLUE: (0, 90, 150),
    Ink.GREEN: (0, 120, 85),
    Ink.RED: (213, 94, 0),
    Ink.PURPLE: (170, 51, 119),
    Ink.ORANGE: (230, 159, 0),
}


class Canvas:
    """A white image of `width` by `height` pixels; y grows downwards, and sizes are in pixels."""

    def __init__(self, width: int, height: int) -> None:
        self.height = height
        self._large = Image.new("P", (width * OVERSAMPLING, height * OVERSAMPLING), Ink.WHITE)
        self._large.putpalette(palette())
        self._pen = ImageDraw.Draw(self._large)
        self._texts: list[tuple[Point, str, int, str]] = []
        self._pasted: list[tuple[Image.Image, tuple[int, int]]] = []

    def raster(self, shades: NDArray[np.uint8], corner: Point, size: Point) -> None:
        """Palette indices (rows, columns), first row at the top, stretched over a rectangle."""
        left, top, right, bottom = _flat([corner, (corner[0] + size[0], corner[1] + size[1])])
        shades = _reduced(shades, int(bottom - top), int(right - left))
        width, tall = max(1, round(right) - round(left)), (bottom - top) / len(shades)
        for first in range(0, len(shades), _STRIP):
            strip = shades[first : first + _STRIP]
            begin = round(top + tall * first)
            end = round(top + tall * (first + len(strip)))
            if end == begin:  # less than a pixel of a picture of something huge
                continue
            stretched = Image.fromarray(strip).resize(
                (width, end - begin), Image.Resampling.NEAREST
            )
            self._large.paste(stretched, (round(left), begin))

    def box(self, corner: Point, size: Point, *, fill: Ink, outline: Ink | None = None) -> None:
        """An upright rectangle from its upper left corner, with a border one pixel wide."""
        self._pen.rectangle(_corners(corner, size), fill, outline, OVERSAMPLING)

    def frame(self, corner: Point, size: Point) -> None:
        """A border one pixel wide; all that was drawn outside of it so far is wiped away."""
        left, top = (round(value) for value in corner)
        width, height = (round(value) for value in size)
        whole = self._large.size  # more than enough on any side
        self.box((0, 0), (whole[0], top), fill=Ink.WHITE)
        self.box((0, 0), (left, whole[1]), fill=Ink.WHITE)
        self.box((left + width, 0), whole, fill=Ink.WHITE)
        self.box((0, top + height), whole, fill=Ink.WHITE)
        self._pen.rectangle(
            _corners((left, top), (width, height)), outline=Ink.GREY, width=OVERSAMPLING
        )

    def line(self, points: Array, ink: Ink, width: float) -> None:
        """A line through points (N, 2) with round joints and ends; a point alone draws nothing."""
        if len(points) < 2:
            return
        thick = max(1, round(width * OVERSAMPLING))
        self._pen.line(_flat(points), ink, thick, joint="curve" if thick > 3 else None)
        if thick > 3:
            for end in (points[0], points[-1]):
                self.disc((float(end[0]), float(end[1])), width / 2, fill=ink)

    def polygon(self, points: Array, *, fill: Ink | None, outline: Ink, width: float) -> None:
        """A closed outline through points (N, 2)."""
        if fill is not None:
            self._pen.polygon(_flat(points), fill)
        self.line(np.concatenate([points, points[:2]]), outline, width)

    def disc(self, centre: Point, radius: float, *, fill: Ink) -> None:
        """A filled circle."""
        x, y = centre
        self._pen.ellipse(_flat([(x - radius, y - radius), (x + radius, y + radius)]), fill)

    def text(self, at: Point, words: str, size: int, anchor: str = "lm") -> None:
        """Words with a white halo; the anchor is Pillow's (horizontal l m r, vertical t m b)."""
        self._texts.append((at, words, size, anchor))

    def paste(self, other: Self, corner: Point, *, shrunk: int = 1) -> None:
        """Put another picture on this one, so many times smaller, over all that is drawn."""
        self._pasted.append((other.image().reduce(shrunk), (round(corner[0]), round(corner[1]))))

    def png(self) -> bytes:
        """The finished picture as a PNG file."""
        return png(self.image())

    def image(self) -> Image.Image:
        """The finished picture in RGB."""
        image = self._finished()
        for picture, corner in self._pasted:
            image.paste(picture, corner)
        pen = ImageDraw.Draw(image)
        for at, words, size, anchor in self._texts:
            pen.text(
                at,
                words,
                COLOURS[Ink.BLACK],
                _font(size),
                anchor,
                stroke_width=2,
                stroke_fill=COLOURS[Ink.WHITE],
            )
        return image

    def _finished(self) -> Image.Image:
        width, height = self._large.size
        image = Image.new("RGB", (width // OVERSAMPLING, height // OVERSAMPLING))
        for top in range(0, image.height, _STRIP):
            bottom = min(top + _STRIP, image.height)
            strip = self._large.crop((0, top * OVERSAMPLING, width, bottom * OVERSAMPLING))
            image.paste(strip.convert("RGB").reduce(OVERSAMPLING), (0, top))
        return image


def _reduced(shades: NDArray[np.uint8], rows: int, columns: int) -> NDArray[np.uint8]:
    """Palette indices of so many pixels at most: each is the darkest of what it covers.

    So a wall stays, however thin. Unknown is what covers nothing else.
    """
    least = np.uint8(Ink.UNKNOWN)
    darkness = shades - least  # of unknown 0, of shades more: they go round
    for axis, most in enumerate((rows, columns)):
        count = shades.shape[axis]
        if count > max(1, most):
            firsts = np.arange(max(1, most)) * count // max(1, most)
            darkness = np.maximum.reduceat(darkness, firsts, axis=axis)
    return darkness + least


def png(image: Image.Image) -> bytes:
    """The picture as a PNG file."""
    file = io.BytesIO()
    image.save(file, "PNG", optimize=False)
    return file.getvalue()


def indexed(image: Image.Image) -> Image.Image:
    """An RGB picture in the nearest colours of one palette: inks, greys, and blends of two inks.

    Pictures that share a palette differ only where they were drawn differently.
    """
    palette = np.array(_blended_palette())
    used = image.getcolors(image.width * image.height) or []
    nearest = np.zeros(1 << 24, np.uint8)  # by the code of a colour
    for _, colour in used:
        nearest[_code(np.array(colour))] = np.argmin(((palette - colour) ** 2).sum(axis=1))
    picture = Image.fromarray(nearest[_code(np.asarray(image))])
    picture.putpalette(palette.ravel().tolist())
    return picture


def _code(colours: NDArray[np.integer]) -> NDArray[np.int64]:
    """Red, green, blue (..., 3) as one number (...)."""
    code: NDArray[np.int64] = colours.astype(np.int64) @ np.array([1 << 16, 1 << 8, 1])
    return code


def _blended_palette() -> list[Colour]:
    """At most 256 colours, as red, green, blue."""
    greys = [(level, level, level) for level in range(0, 256, 5)]
    inks = [COLOURS[ink] for ink in Ink]
    blends = [_blend(*two, share) for two in combinations(inks, 2) for share in (0.25, 0.5, 0.75)]
    return [*inks, *greys, *blends]


def _blend(one: Colour, other: Colour, share: float) -> Colour:
    red, green, blue = (
        round(share * a + (1.0 - share) * b) for a, b in zip(one, other, strict=True)
    )
    return red, green, blue


def text_width(words: str, size: float) -> float:
    """How wide (pixels) the words are."""
    return float(_font(size).getlength(words))


def fitted(words: str, size: float, width: float) -> str:
    """The words, without their middle if they are wider than that (pixels)."""
    longest = len(words)
    while longest > 3 and text_width(shortened(words, longest), size) > width:
        longest -= 1
    return shortened(words, longest)


def _font(size: float) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size)


def palette() -> list[int]:
    """Red, green, blue of every shade and ink, one after the other."""
    shades = [(255 - round(2.2 * percent),) * 3 for percent in range(Ink.UNKNOWN)]
    return [level for colour in [*shades, *(COLOURS[ink] for ink in Ink)] for level in colour]


def _corners(corner: Point, size: Point) -> list[float]:
    """The upper left pixel of a rectangle and its last, which belongs to it, on the large image."""
    left, top, right, bottom = _flat([corner, (corner[0] + size[0], corner[1] + size[1])])
    return [left, top, max(left, right - 1), max(top, bottom - 1)]


def _flat(points: Array | Sequence[Point]) -> list[float]:
    """Coordinates on the large image, one after the other."""
    flat: list[float] = (np.asarray(points, np.float64) * OVERSAMPLING).ravel().tolist()
    return flat
