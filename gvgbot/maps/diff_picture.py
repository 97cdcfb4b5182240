"""Two maps side by side, the second turned like the first, with what only one has in red."""

import numpy as np
from PIL import Image

from gvgbot.maps import legend, symbols
from gvgbot.maps.alignment import Comparison
from gvgbot.maps.canvas import Canvas, png
from gvgbot.maps.moved import moved_grid
from gvgbot.maps.occupancy import OccupancyGrid
from gvgbot.maps.picture import draw_ground, draw_vertex, known_corners
from gvgbot.maps.view import View, box_around, pair

_SIDE, _NARROWEST = 900, 500  # pixels of a map: the most, and the least it takes in width
_MARGIN = 28  # pixels around everything
_TITLE, _TITLE_SIZE = 44, 22  # pixels over a map, and of the letters there
_ENTRIES = (legend.EDGE, legend.MEETPOINT, legend.ENDPOINT, legend.LONE_EDGE, legend.LONE_VERTEX)

Grids = tuple[OccupancyGrid, OccupancyGrid]
Titles = tuple[str, str]


def draw_diff(found: Comparison, grids: Grids, titles: Titles, caption: str) -> bytes:
    """A PNG of both maps in the frame of the first, on one scale; grids in their own frames."""
    grids = (grids[0], moved_grid(grids[1], found.a_b))
    points = [known_corners(grid) for grid in grids] + [graph.points for graph in found.graphs]
    view = View.fitted(box_around(np.concatenate(points)), (_MARGIN, 0), width=_SIDE, height=_SIDE)
    view = view.centred(_NARROWEST)
    maps = [_drawn(view, found, which, grids[which]) for which in (0, 1)]
    return png(_side_by_side(maps, titles, caption, view.scale))


def _drawn(view: View, found: Comparison, which: int, grid: OccupancyGrid) -> Image.Image:
    """One of the maps."""
    width = max(round(view.size[0]), _NARROWEST) + 2 * _MARGIN
    canvas = Canvas(width, round(view.size[1]) + _MARGIN)
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
    return canvas.image()


def _side_by_side(
    maps: list[Image.Image], titles: Titles, caption: str, scale: float
) -> Image.Image:
    """Titles, maps, and one legend under both."""
    width, height = maps[0].size
    inside = 2 * (width - _MARGIN)
    signs = legend.arranged(_ENTRIES, caption, width=inside, scale=scale)
    sheet = Canvas(2 * width, _TITLE + height + round(signs.height) + _MARGIN)
    for which, title in enumerate(titles):
        sheet.text(((which + 0.5) * width, _TITLE / 2), title, _TITLE_SIZE, anchor="mm")
    signs.draw(sheet, (_MARGIN, _TITLE + height), inside)
    image = sheet.image()
    for which, picture in enumerate(maps):
        image.paste(picture, (which * width, _TITLE))
    return image
