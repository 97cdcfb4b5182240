"""An exploration in moving pictures: a GIF, or some moments side by side."""

import io
import math
from collections.abc import Callable

import numpy as np
from PIL import Image

from gvgbot.maps import legend, symbols
from gvgbot.maps.canvas import Canvas, indexed
from gvgbot.maps.growth import Growth, frontiers
from gvgbot.maps.picture import counts, draw_ground, known_corners
from gvgbot.maps.route_graph import RouteEdge, RouteNode
from gvgbot.maps.surface import S, Surface
from gvgbot.maps.view import View, box_around, pair

_WIDTH, _TALLEST, _NARROWEST = 800, 640, 560  # pixels of the map in a picture
_MARGIN = 16  # pixels around everything
_FRAME_MS, _LAST_FRAME_MS = 120, 3000
_STRIP_WIDTH, _MOST_COLUMNS = 1300, 6  # of the pictures side by side, in pixels and in number
_TITLE = 30  # pixels over a picture of the strip

_ENTRIES = (
    legend.EDGE,
    legend.MEETPOINT,
    legend.ENDPOINT,
    legend.FRONTIER_NOW,
    legend.WAY,
    legend.ROBOT,
)


def gif(growth: Growth, frames: int) -> bytes:
    """A GIF of so many frames, equally long apart, that begins anew after a pause."""
    scene = _Scene(growth)
    images = [indexed(_frame(scene, growth, time)) for time in _times(growth, frames)]
    pauses = [_FRAME_MS] * (frames - 1) + [_LAST_FRAME_MS]
    file = io.BytesIO()
    images[0].save(file, "GIF", save_all=True, append_images=images[1:], duration=pauses, loop=0)
    return file.getvalue()


def _frame(scene: "_Scene", growth: Growth, time: float) -> Image.Image:
    """The map at a time, and what stands under it."""
    width, height = scene.size
    signs = _footer(Canvas, _caption(growth, time), width, scene.scale)
    whole = Canvas(width, height + signs.height)
    whole.paste(scene.picture(Canvas, time), (0, 0))
    whole.paste(signs, (0, height))
    return whole.image()


def draw_strip(sheet: Callable[[int, int], S], growth: Growth, moments: int) -> S:
    """So many moments, equally long apart, side by side, with one legend for all."""
    scene = _Scene(growth, narrowest=2 * _NARROWEST // min(moments, _MOST_COLUMNS))
    width, height = scene.size[0] // 2, scene.size[1] // 2 + _TITLE
    rows = math.ceil(moments / min(_MOST_COLUMNS, _STRIP_WIDTH // width))
    columns = math.ceil(moments / rows)
    caption = f"{growth.run.name}: {_facts(growth, growth.duration)}"
    signs = _footer(sheet, caption, columns * width, scene.scale / 2)
    whole = sheet(columns * width, rows * height + signs.height)
    for i, time in enumerate(_times(growth, moments)):
        x, y = i % columns * width, i // columns * height
        whole.paste(scene.picture(sheet, time), (x, y + _TITLE), shrunk=2)
        whole.text((x + width / 2, y + _TITLE / 2 + 4), clock(time), 18, anchor="mm")
    whole.paste(signs, (0, rows * height))
    return whole


def clock(time: float) -> str:
    """Minutes and seconds, as in 12:05; with hours from the first one on."""
    minutes, seconds = divmod(round(time), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}" if hours else f"{minutes}:{seconds:02}"


class _Scene:
    """The map of a run at any time, always in the same size."""

    def __init__(self, growth: Growth, narrowest: int = _NARROWEST) -> None:
        self._growth = growth
        run = growth.run
        points = [known_corners(run.grid), run.graph.points, run.estimate.positions]
        box = box_around(np.concatenate(points))
        view = View.fitted(box, (_MARGIN, _MARGIN), width=_WIDTH, height=_TALLEST)
        self._view = view.centred(narrowest)
        width = max(round(view.size[0]), narrowest)
        self.size = (width + 2 * _MARGIN, round(view.size[1]) + 2 * _MARGIN)
        self.scale = view.scale

    def picture(self, sheet: Callable[[int, int], S], time: float) -> S:
        """The map, all that was known of it, and the robot."""
        view, canvas = self._view, sheet(*self.size)
        vertices, edges = self._growth.graph(time)
        path = self._growth.path(time)
        draw_ground(canvas, view, self._growth.grid(time))
        for edge in edges:
            symbols.draw_edge(canvas, view.pixels(edge.polyline))
        for stretch in path.stretches:
            symbols.draw_estimate(canvas, view.pixels(stretch))
        for vertex in vertices:
            _draw_vertex(canvas, view, vertex, edges)
        symbols.draw_robot(canvas, view.pixel(path.positions[-1]), float(path.poses[-1, 2]))
        canvas.frame(pair(view.corner), pair(view.size))
        return canvas


def _draw_vertex(canvas: Surface, view: View, vertex: RouteNode, edges: list[RouteEdge]) -> None:
    """The vertex, with the frontiers that it has as long as there are only these edges."""
    at = view.pixel(vertex.position)
    for bearing in frontiers(vertex, edges):
        symbols.draw_frontier(canvas, at, bearing)
    draw = symbols.draw_meetpoint if vertex.kind == "meetpoint" else symbols.draw_endpoint
    draw(canvas, at)


def _footer(sheet: Callable[[int, int], S], caption: str, width: int, scale: float) -> S:
    signs = legend.arranged(_ENTRIES, caption, width=width - 2 * _MARGIN, scale=scale)
    canvas = sheet(width, round(signs.height) + _MARGIN)
    signs.draw(canvas, (_MARGIN, 0.0), width - 2 * _MARGIN)
    return canvas


def _times(growth: Growth, count: int) -> list[float]:
    """So many times from 0 to the end of the run, s."""
    times: list[float] = np.linspace(0.0, growth.duration, count).tolist()
    return times


def _caption(growth: Growth, time: float) -> str:
    return f"{clock(time)}   {_facts(growth, time)}"


def _facts(growth: Growth, time: float) -> str:
    vertices, edges = growth.graph(time)
    return f"{counts(vertices, edges)}, {growth.driven(time):.0f} m driven"
