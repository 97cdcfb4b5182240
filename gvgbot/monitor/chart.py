"""The map as characters: walls, edges, way and plan in dots; vertices and the robot as signs."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from gvgbot.monitor.braille import Dots, lit, patterns
from gvgbot.monitor.view import Points, View
from gvgbot.tiles import Raster
from gvgbot.topics import Map, Plan

Layer = Literal["empty", "wall", "trail", "edge", "plan", "frontier", "vertex", "mate", "robot"]

LAYERS: tuple[Layer, ...] = get_args(Layer)
_OCCUPIED = 65  # percent, as map_server has it
_ARROWS = "→↗↑↖←↙↓↘"
_SIGNS = {"meetpoint": "●", "endpoint": "○"}
_FRONTIER_M = 0.8  # from its vertex, where a frontier's mark stands
_LEAST_DOTS = 3.0  # or so far, if that is more, so that it does not stand on the vertex
_MARGIN_M = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What is to be drawn, as far as it is known; `trail` is the way driven, in lines (N, 2), m."""

    graph: Map | None = None
    floor: Raster | None = None
    trail: Sequence[Points] = ()
    plan: Plan | None = None
    pose: tuple[float, float, float] | None = None
    team: tuple[tuple[float, float, float], ...] = ()  # poses of other robots


@dataclass(frozen=True, slots=True, eq=False)
class Chart:
    """Characters (rows, columns) as code points, and the index in `LAYERS` of each; read-only.

    `floor` (rows, columns) tells where the floor is known to be free. `scale` is m per character.
    """

    codes: NDArray[np.uint32]
    layers: NDArray[np.uint8]
    floor: NDArray[np.bool_]
    scale: float

    def text(self) -> list[str]:
        """The characters, a line each; a blank where there is nothing."""
        codes = np.where(self.layers == 0, ord(" "), self.codes)
        return ["".join(map(chr, row)) for row in codes.tolist()]


def chart(scene: Scene, width: int, height: int) -> Chart:
    """The whole of a scene in so many characters."""
    view = View.around(*_box(scene), width, height)
    canvas, floor = _Canvas(view), np.zeros((height, width), bool)
    if scene.floor is not None:
        cells = _sampled(scene.floor, view)
        canvas.lay("wall", _walls(scene.floor, view, cells))
        floor = lit(cells >= 0)  # or a wall
    if scene.graph is not None:
        canvas.lay("wall", _dotted(view, scene.graph.forbidden))  # virtual ones
    canvas.lay("trail", _drawn(view, scene.trail))
    if scene.graph is not None:
        canvas.lay("edge", _drawn(view, [edge.polyline for edge in scene.graph.edges]))
    if scene.plan is not None:
        canvas.lay("plan", _drawn(view, [scene.plan.ahead, scene.plan.further]))
    if scene.graph is not None:
        _mark_vertices(canvas, scene.graph)
    for x, y, theta in scene.team:
        canvas.mark("mate", (x, y), _arrow(theta))
    if scene.pose is not None:
        canvas.mark("robot", scene.pose[:2], _arrow(scene.pose[2]))
    return Chart(canvas.codes, canvas.layers, floor, 2.0 * view.metres_per_dot)


class _Canvas:
    """Layers that are laid one over the other; what comes later hides what was there."""

    def __init__(self, view: View) -> None:
        self._view = view
        self._dots = np.zeros(view.shape, bool)
        self.codes = patterns(self._dots)
        self.layers = np.zeros((view.height, view.width), np.uint8)

    def lay(self, layer: Layer, dots: Dots) -> None:
        """Add dots; a character has the colour of the last layer with a dot in it."""
        self._dots |= dots
        self.codes = patterns(self._dots)
        self.layers[lit(dots)] = LAYERS.index(layer)

    def mark(self, layer: Layer, point: tuple[float, float], sign: str) -> None:
        """Put a sign in place of the character at a point, m."""
        at = self._view.character_of(point)
        if at is not None:
            self.codes[at], self.layers[at] = ord(sign), LAYERS.index(layer)

    @property
    def metres_per_dot(self) -> float:
        """The scale."""
        return self._view.metres_per_dot


def _box(scene: Scene) -> tuple[Points, Points]:
    """Corners (2,), m, of all there is to show."""
    points = [np.zeros((1, 2)), *scene.trail]
    if scene.pose is not None:
        points.append(np.array([scene.pose[:2]]))
    points.append(np.array([pose[:2] for pose in scene.team]).reshape(-1, 2))
    if scene.floor is not None:
        points.append(_outline(scene.floor)[0])
    if scene.graph is not None:
        points.append(np.array([one.position for one in scene.graph.vertices]).reshape(-1, 2))
    every = np.concatenate(points)
    return every.min(axis=0) - _MARGIN_M, every.max(axis=0) + _MARGIN_M


@lru_cache(maxsize=1)
def _outline(floor: Raster) -> tuple[Points, Points]:
    """Two opposite corners (2, 2), m, of what is known, (0, 2) if nothing is; all walls (N, 2).

    Looking at every cell of a large building takes longer than the time between two pictures.
    """
    known = floor.cells >= 0
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    corners = _centres(floor, rows[[0, -1]], columns[[0, -1]]) if len(rows) else np.zeros((0, 2))
    return corners, _centres(floor, *np.nonzero(floor.cells >= _OCCUPIED))


def _centres(floor: Raster, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Points:
    """The middles (N, 2), m, of cells."""
    centres: Points = np.column_stack([columns + 0.5, rows + 0.5]) * floor.resolution + floor.origin
    return centres


def _walls(floor: Raster, view: View, cells: NDArray[np.int8]) -> Dots:
    """Dots within a wall's cell, and those in which a wall's cell has its centre."""
    dots: Dots = cells >= _OCCUPIED
    view.plot(dots, _outline(floor)[1])
    return dots


def _sampled(floor: Raster, view: View) -> NDArray[np.int8]:
    """The cell in which each dot (rows, columns) has its centre; -1 outside."""
    x, y = view.centres()
    high, wide = floor.cells.shape
    columns = np.floor((x - floor.origin[0]) / floor.resolution).astype(np.int64)
    rows = np.floor((y - floor.origin[1]) / floor.resolution).astype(np.int64)
    inside = ((rows >= 0) & (rows < high))[:, None] & ((columns >= 0) & (columns < wide))
    sampled = floor.cells[rows.clip(0, high - 1)[:, None], columns.clip(0, wide - 1)]
    return np.where(inside, sampled, np.int8(-1))


def _drawn(view: View, polylines: Iterable[Points]) -> Dots:
    dots = np.zeros(view.shape, bool)
    for polyline in polylines:
        view.draw(dots, polyline)
    return dots


def _dotted(view: View, points: Points) -> Dots:
    """Every third of points along lines, so that these are no walls to the eye."""
    dots = np.zeros(view.shape, bool)
    view.plot(dots, points[::3])
    return dots


def _mark_vertices(canvas: _Canvas, known: Map) -> None:
    away = max(_FRONTIER_M, _LEAST_DOTS * canvas.metres_per_dot)
    for vertex in known.vertices:
        x, y = vertex.position
        for bearing in vertex.frontiers:
            canvas.mark(
                "frontier", (x + away * math.cos(bearing), y + away * math.sin(bearing)), "?"
            )
    for vertex in known.vertices:
        canvas.mark("vertex", vertex.position, _SIGNS[vertex.kind])


def _arrow(theta: float) -> str:
    """The arrow nearest to a direction, rad."""
    return _ARROWS[round(theta / (math.pi / 4)) % 8]
