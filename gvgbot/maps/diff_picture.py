"""Two maps side by side, the second turned like the first, with what only one has in red."""

from collections.abc import Callable

import numpy as np

from gvgbot.maps import legend, symbols
from gvgbot.maps.alignment import Comparison
from gvgbot.maps.canvas import fitted
from gvgbot.maps.moved import moved_grid
from gvgbot.maps.occupancy import OccupancyGrid
from gvgbot.maps.picture import draw_ground, draw_vertex, known_corners
from gvgbot.maps.surface import S, Surface
from gvgbot.maps.view import View, box_around, pair

_SIDE, _NARROWEST = 900, 500  # pixels of a map: the most, and the least it takes in width
_MARGIN = 28  # pixels around everything
_TITLE, _TITLE_SIZE = 44, 22  # pixels over a map, and of the letters there
_ENTRIES = (legend.EDGE, legend.MEETPOINT, legend.ENDPOINT, legend.LONE_EDGE, legend.LONE_VERTEX)

Grids = tuple[OccupancyGrid, OccupancyGrid]
Titles = tuple[str, str]


def draw_diff(
    sheet: Callable[[int, int], S], found: Comparison, grids: Grids, titles: Titles, caption: str
) -> S:
    """Both maps on a new sheet, in the frame of the first, on one scale; grids in their own."""
    grids = (grids[0], moved_grid(grids[1], found.a_b))
    points = [known_corners(grid) for grid in grids] + [graph.points for graph in found.graphs]
    view = View.fitted(box_around(np.concatenate(points)), (_MARGIN, 0), width=_SIDE, height=_SIDE)
    view = view.centred(_NARROWEST)
    width = max(round(view.size[0]), _NARROWEST) + 2 * _MARGIN
    height = round(view.size[1]) + _MARGIN
    signs = legend.arranged(_ENTRIES, caption, width=2 * (width - _MARGIN), scale=view.scale)
    both = sheet(2 * width, _TITLE + height + round(signs.height) + _MARGIN)
    for which, title in enumerate(titles):
        canvas = sheet(width, height)
        _draw(canvas, view, found, which, grids[which])
        both.paste(canvas, (which * width, _TITLE))
        words = fitted(title, _TITLE_SIZE, width - 2 * _MARGIN)
        both.text(((which + 0.5) * width, _TITLE / 2), words, _TITLE_SIZE, anchor="mm")
    signs.draw(both, (_MARGIN, _TITLE + height), 2 * (width - _MARGIN))
    return both


def _draw(canvas: Surface, view: View, found: Comparison, which: int, grid: OccupancyGrid) -> None:
    """One of the maps."""
    draw_ground(canvas, view, grid)
    for edge in found.graphs[which].edges:
        symbols.draw_edge(canvas, view.pixels(edge.polyline))
    for edge in found.lone_edges(which):
        symbols.draw_lone_edge(canvas, view.pixels(edge.polyline))
    for vertex in found.lone_vertices(which):
        symbols.draw_lone_vertex(canvas, view.pixel(vertex.position))
    for vertex in found.graphs[which].vertices:
        draw_vertex(canvas, vertex, view.pixel(vertex.position))
    canvas.frame(pair(view.corner), pair(view.size))
