"""The strip under a map: scale bar, the signs used with their meaning, and a caption."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gvgbot.geometry import Array
from gvgbot.maps import symbols
from gvgbot.maps.canvas import Ink, Point, fitted, text_width
from gvgbot.maps.surface import Surface

TEXT_SIZE = 20
_ROW = 36.0
_SIGN = 46.0  # width that a sign takes
_GAP = 30.0  # between an entry and the next
_LONGEST_BAR = 260.0
_BAR_GAP = 12.0  # between the bar and its length
_BAR_SHARE = 0.25  # of the legend's width that the bar may take


@dataclass(frozen=True, slots=True)
class Entry:
    """A sign, drawn about a point, and what it means."""

    label: str
    draw: Callable[[Surface, Point], None]

    @property
    def width(self) -> float:
        """Pixels, with the gap to the next entry."""
        return _SIGN + text_width(self.label, TEXT_SIZE) + _GAP


def _stroke(draw: Callable[[Surface, Array], None]) -> Callable[[Surface, Point], None]:
    def sign(canvas: Surface, at: Point) -> None:
        draw(canvas, np.array([[at[0] - 17.0, at[1]], [at[0] + 17.0, at[1]]]))

    return sign


EDGE = Entry("GVG edge", _stroke(symbols.draw_edge))
ESTIMATE = Entry("estimated path", _stroke(symbols.draw_estimate))
ODOMETRY = Entry("raw odometry", _stroke(symbols.draw_odometry))
VIRTUAL_WALL = Entry(
    "virtual wall",
    lambda canvas, at: symbols.draw_virtual_wall(
        canvas, np.column_stack([at[0] + np.linspace(-16.0, 16.0, 5), np.full(5, at[1])])
    ),
)
MEETPOINT = Entry("meetpoint", symbols.draw_meetpoint)
ENDPOINT = Entry("endpoint", symbols.draw_endpoint)
ELLIPSE = Entry(
    "3-sigma ellipse",
    lambda canvas, at: symbols.draw_ellipse(canvas, at, np.diag([15.0, 8.0])),
)
FRONTIER = Entry(
    "frontier left",
    lambda canvas, at: symbols.draw_frontier(canvas, (at[0] - 16.0, at[1]), 0.0),
)
LONE_EDGE = Entry("edge in this map only", _stroke(symbols.draw_lone_edge))
LONE_VERTEX = Entry("vertex in this map only", symbols.draw_lone_vertex)
WAY = replace(ESTIMATE, label="path")
FRONTIER_NOW = replace(FRONTIER, label="frontier")
ROBOT = Entry("robot", lambda canvas, at: symbols.draw_robot(canvas, at, 0.0))
START = Entry("start", lambda canvas, at: symbols.draw_start(canvas, at, math.pi / 2))


@dataclass(frozen=True, slots=True)
class Legend:
    """What stands under a map of some width (pixels): rows of entries, caption and scale bar."""

    rows: Sequence[Sequence[Entry]]
    caption: str
    bar_length_m: float
    bar_width: float

    @property
    def height(self) -> float:
        """Pixels."""
        return _ROW * (len(self.rows) + 1)

    def draw(self, canvas: Surface, corner: Point, width: float) -> None:
        """Draw it with its upper left at the corner, the scale bar to the right of the caption."""
        left, top = corner
        room = width - _GAP - self.bar_width - _BAR_GAP - text_width(self._bar_label, TEXT_SIZE)
        canvas.text((left, top + _ROW / 2), fitted(self.caption, TEXT_SIZE, room), TEXT_SIZE)
        self._draw_bar(canvas, (left + width, top + _ROW / 2))
        for number, row in enumerate(self.rows, start=1):
            _draw_row(canvas, row, (left, top + _ROW * (number + 0.5)))

    def _draw_bar(self, canvas: Surface, end: Point) -> None:
        """Four alternating fields that end at a point, and their length before them."""
        right, y = end
        left, field = right - self.bar_width, self.bar_width / 4
        for number in range(4):
            ink = Ink.BLACK if number % 2 == 0 else Ink.WHITE
            at = (left + number * field, y - 4.0)
            canvas.box(at, (field, 8.0), fill=ink, outline=Ink.BLACK)
        canvas.text((left - _BAR_GAP, y), self._bar_label, TEXT_SIZE, anchor="rm")

    @property
    def _bar_label(self) -> str:
        return f"{self.bar_length_m:g} m"


def arranged(entries: Iterable[Entry], caption: str, *, width: float, scale: float) -> Legend:
    """The legend of a map with this many pixels per metre, wrapped to the width (pixels)."""
    rows: list[list[Entry]] = [[]]
    for entry in entries:
        if rows[-1] and sum(e.width for e in rows[-1]) + entry.width - _GAP > width:
            rows.append([])
        rows[-1].append(entry)
    length = round_length(min(_LONGEST_BAR, _BAR_SHARE * width) / scale)
    return Legend(rows, caption, length, length * scale)


def round_length(longest: float) -> float:
    """The largest of 1, 2, 5, 10, 20, ... (and of 0.5, 0.2, ...) that is not longer."""
    power = 10.0 ** math.floor(math.log10(longest))
    return max(digit * power for digit in (1.0, 2.0, 5.0) if digit * power <= longest)


def _draw_row(canvas: Surface, row: Sequence[Entry], at: Point) -> None:
    x, y = at
    for entry in row:
        entry.draw(canvas, (x + _SIGN / 2 - 6.0, y))
        canvas.text((x + _SIGN, y), entry.label, TEXT_SIZE)
        x += entry.width
