"""Pictures in the formats that can be asked for by a file's name."""

from collections.abc import Callable
from typing import Protocol

from gvgbot.maps.canvas import Canvas
from gvgbot.maps.drawing import Drawing
from gvgbot.maps.pdf import pdf
from gvgbot.maps.surface import S
from gvgbot.maps.svg import svg


class Paint(Protocol):
    """Draws something on a new sheet of the kind that is given, of whatever size it needs."""

    def __call__(self, sheet: Callable[[int, int], S], /) -> S:
        """The sheet, finished."""


PICTURES: dict[str, Callable[[Paint], bytes]] = {
    ".png": lambda paint: paint(Canvas).png(),
    ".svg": lambda paint: svg(paint(Drawing)),
    ".pdf": lambda paint: pdf(paint(Drawing)),
}
