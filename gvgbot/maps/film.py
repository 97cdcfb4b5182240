"""An exploration in moving pictures: a GIF, or some moments side by side."""

import io
import math

import numpy as np
from PIL import Image

from gvgbot.maps import legend, symbols
from gvgbot.maps.canvas import Canvas, indexed, png
from gvgbot.maps.growth import Growth, frontiers
from gvgbot.maps.picture import counts, draw_ground, known_corners
from gvgbot.maps.route_graph import MapEdge, MapVertex
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
    images = [
        indexed(_stacked(scene.picture(time), scene.footer(_caption(growth, time))))
        for time in _times(growth, frames)
    ]
    pauses = [_FRAME_MS] * (frames - 1) + [_LAST_FRAME_MS]
    file = io.BytesIO()
    images[0].save(file, "GIF", save_all=True, append_images=images[1:], duration=pauses, loop=0)
    return file.getvalue()


def strip(growth: Growth, moments: int) -> bytes:
    """A PNG of so many moments, equally long apart, side by side, with one legend for all."""
    scene = _Scene(growth, narrowest=2 * _NARROWEST // min(moments, _MOST_COLUMNS))
    times = _times(growth, moments)
    width, height = scene.size[0] // 2, scene.size[1] // 2 + _TITLE
    rows = math.ceil(moments / min(_MOST_COLUMNS, _STRIP_WIDTH // width))
    columns = math.ceil(moments / rows)
    corners = [(i % columns * width, i // columns * height) for i in range(moments)]
    sheet = Canvas(columns * width, rows * height)
    for (x, y), time in zip(corners, times, strict=True):
        sheet.text((x + width / 2, y + _TITLE / 2 + 4), clock(time), 18, anchor="mm")
    image = sheet.image()
    for (x, y), time in zip(corners, times, strict=True):
        image.paste(scene.picture(time).reduce(2), (x, y + _TITLE))
    caption = f"{growth.run.name}: {_facts(growth, growth.duration)}"
    return png(_stacked(image, _footer(caption, image.width, scene.scale / 2)))


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

    def picture(self, time: float) -> Image.Image:
        """The map, all that was known of it, and the robot."""
        view, canvas = self._view, Canvas(*self.size)
        vertices, edges = self._growth.graph(time)
        path = self._growth.path(time)
        draw_ground(canvas, view, self._growth.grid(time))
        for edge in edges:
            symbols.draw_edge(canvas, view.pixels(edge.polyline))
        symbols.draw_estimate(canvas, view.pixels(path[:, :2]))
        for vertex in vertices:
            _draw_vertex(canvas, view, vertex, edges)
        symbols.draw_robot(canvas, view.pixel(path[-1, :2]), float(path[-1, 2]))
        canvas.frame(pair(view.corner), pair(view.size))
        return canvas.image()

    def footer(self, caption: str) -> Image.Image:
        """What stands under the picture."""
        return _footer(caption, self.size[0], self.scale)


def _draw_vertex(canvas: Canvas, view: View, vertex: MapVertex, edges: list[MapEdge]) -> None:
    """The vertex, with the frontiers that it has as long as there are only these edges."""
    at = view.pixel(vertex.position)
    if vertex.kind == "endpoint":
        symbols.draw_endpoint(canvas, at)
        return
    for bearing in frontiers(vertex, edges):
        symbols.draw_frontier(canvas, at, bearing)
    symbols.draw_meetpoint(canvas, at)


def _footer(caption: str, width: int, scale: float) -> Image.Image:
    signs = legend.arranged(_ENTRIES, caption, width=width - 2 * _MARGIN, scale=scale)
    canvas = Canvas(width, round(signs.height) + _MARGIN)
    signs.draw(canvas, (_MARGIN, 0.0), width - 2 * _MARGIN)
    return canvas.image()


def _stacked(upper: Image.Image, lower: Image.Image) -> Image.Image:
    """One picture over another that is as wide."""
    whole = Image.new("RGB", (upper.width, upper.height + lower.height))
    whole.paste(upper, (0, 0))
    whole.paste(lower, (0, upper.height))
    return whole


def _times(growth: Growth, count: int) -> list[float]:
    """So many times from 0 to the end of the run, s."""
    times: list[float] = np.linspace(0.0, growth.duration, count).tolist()
    return times


def _caption(growth: Growth, time: float) -> str:
    return f"{clock(time)}   {_facts(growth, time)}"


def _facts(growth: Growth, time: float) -> str:
    vertices, edges = growth.graph(time)
    steps = np.diff(growth.path(time)[:, :2], axis=0)
    driven = float(np.hypot(steps[:, 0], steps[:, 1]).sum())
    return f"{counts(vertices, edges)}, {driven:.0f} m driven"
