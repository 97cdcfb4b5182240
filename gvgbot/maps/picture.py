"""The map as a picture that could stand in a paper: grid, graph, uncertainty and trajectories."""

import math
from collections.abc import Callable, Iterator, Sized

import numpy as np
from numpy.typing import NDArray

from gvgbot.geometry import Array, wrap_angle
from gvgbot.maps import legend, symbols
from gvgbot.maps.canvas import Canvas, Ink, Point
from gvgbot.maps.occupancy import UNKNOWN, OccupancyGrid
from gvgbot.maps.route_graph import RouteGraph, RouteNode
from gvgbot.maps.surface import S, Surface
from gvgbot.maps.trajectory import Trajectory
from gvgbot.maps.view import Box, View, box_around, pair
from gvgbot.words import counted

_WIDTH, _TALLEST, _NARROWEST = 1344, 1344, 900  # pixels of the map; a tall one is less wide
_MARGIN = 28  # pixels around everything
_ID_SIZE = 16  # pixels
_SIGMAS = 3.0  # of the ellipses
_ASTRAY = 0.15  # of the map's size: how far odometry and ellipses may leave it uncut

_NO_POINTS = np.empty((0, 2))


def draw_map(
    graph: RouteGraph,
    *,
    grid: OccupancyGrid | None = None,
    estimate: Trajectory | None = None,
    odometry: Trajectory | None = None,
    virtual_walls: Array = _NO_POINTS,
    title: str = "",
) -> bytes:
    """A PNG of all that is given, in the map frame with x to the right, cut to what is known.

    `virtual_walls` are points (N, 2) of such, m.
    """
    return draw_map_on(
        Canvas,
        graph,
        grid=grid,
        estimate=estimate,
        odometry=odometry,
        virtual_walls=virtual_walls,
        title=title,
    ).png()


def draw_map_on(
    sheet: Callable[[int, int], S],
    graph: RouteGraph,
    *,
    grid: OccupancyGrid | None,
    estimate: Trajectory | None,
    odometry: Trajectory | None,
    virtual_walls: Array,
    title: str,
) -> S:
    """The same, on a new sheet of the kind that is given."""
    path = _NO_POINTS if estimate is None else estimate.positions
    raw = _NO_POINTS if odometry is None else odometry.positions
    box = _content(graph, grid, path, raw)
    view = View.fitted(box, (_MARGIN, _MARGIN), width=_WIDTH, height=_TALLEST).centred(_NARROWEST)
    width = max(view.size[0], _NARROWEST)
    walls = virtual_walls[box.holds(virtual_walls)]
    signs = legend.arranged(
        _entries(graph, path, raw, walls), _caption(graph, title), width=width, scale=view.scale
    )
    bottom = view.corner[1] + view.size[1]
    canvas = sheet(round(width) + 2 * _MARGIN, round(bottom + signs.height) + _MARGIN)
    draw_ground(canvas, view, grid)
    symbols.draw_virtual_wall(canvas, view.pixels(walls))
    for stretch in _stretches(odometry):
        symbols.draw_odometry(canvas, view.pixels(stretch))
    _draw_graph(canvas, view, graph, _stretches(estimate))
    if estimate is not None and len(path):
        symbols.draw_start(canvas, view.pixel(path[0]), float(estimate.poses[0, 2]))
    canvas.frame(pair(view.corner), pair(view.size))
    signs.draw(canvas, (_MARGIN, bottom + _MARGIN / 2), width)
    return canvas


def _content(graph: RouteGraph, grid: OccupancyGrid | None, path: Array, raw: Array) -> Box:
    """The part of the map frame that is worth showing."""
    corners = _NO_POINTS if grid is None else known_corners(grid)
    box = box_around(np.concatenate([corners, graph.points, path]))
    astray = [raw, *(_ellipse_corners(vertex) for vertex in graph.vertices)]
    return box.stretched(np.concatenate(astray), _ASTRAY * float(box.size.max()))


def _ellipse_corners(vertex: RouteNode) -> Array:
    """Two opposite corners (2, 2) of the upright box around a vertex's ellipse, m, map frame."""
    variances = np.array([vertex.covariance[0], vertex.covariance[3]])
    reach = _SIGMAS * np.sqrt(np.maximum(variances, 0.0))
    return np.array([vertex.position - reach, vertex.position + reach])


def known_corners(grid: OccupancyGrid) -> Array:
    """Two opposite corners (2, 2) of the known cells, m, map frame; (0, 2) if none is known."""
    known = grid.cells != UNKNOWN
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not len(rows):
        return _NO_POINTS
    cells = np.array([[columns[0], rows[0]], [columns[-1] + 1, rows[-1] + 1]])
    return np.asarray(grid.origin) + cells * grid.resolution_m


def draw_ground(canvas: Surface, view: View, grid: OccupancyGrid | None) -> None:
    """Unknown everywhere, and over it the occupancy grid."""
    canvas.box(pair(view.corner), pair(view.size), fill=Ink.UNKNOWN)
    if grid is None:
        return
    rows, columns = grid.cells.shape
    size = np.array([columns, rows]) * grid.resolution_m
    upper_left = np.array([grid.origin[0], grid.origin[1] + size[1]])
    canvas.raster(_shades(grid), view.pixel(upper_left), pair(size * view.scale))


def _shades(grid: OccupancyGrid) -> NDArray[np.uint8]:
    """The grid in palette indices, first row at the top; a cell in doubt is a light grey."""
    percent = np.clip(2 * grid.cells[::-1].astype(np.int16) - 50, 0, 100)
    return np.where(grid.cells[::-1] == UNKNOWN, Ink.UNKNOWN, percent).astype(np.uint8)


def _stretches(trajectory: Trajectory | None) -> list[Array]:
    """The lines (N, 2), m, that were driven."""
    return [] if trajectory is None else trajectory.stretches


def _draw_graph(canvas: Surface, view: View, graph: RouteGraph, path: list[Array]) -> None:
    """Edges, then the path over them, then the vertices with their ids on top."""
    for edge in graph.edges:
        symbols.draw_edge(canvas, view.pixels(edge.polyline))
    for stretch in path:
        symbols.draw_estimate(canvas, view.pixels(stretch))
    for vertex in graph.vertices:
        at = view.pixel(vertex.position)
        symbols.draw_ellipse(canvas, at, _half_axes(vertex) * view.scale)
        for bearing in vertex.frontiers:
            symbols.draw_frontier(canvas, at, bearing)
    for vertex in graph.vertices:
        draw_vertex(canvas, vertex, view.pixel(vertex.position))


def draw_vertex(canvas: Surface, vertex: RouteNode, at: Point) -> None:
    """The vertex, and its id where no edge leaves it."""
    draw = symbols.draw_meetpoint if vertex.kind == "meetpoint" else symbols.draw_endpoint
    draw(canvas, at)
    away, name = widest_gap(vertex.bearings), str(vertex.id)
    distance = symbols.VERTEX_RADIUS + 9.0 + 2.5 * (len(name) - 1) * abs(math.cos(away))
    label = (at[0] + distance * math.cos(away), at[1] - distance * math.sin(away))
    canvas.text(label, name, _ID_SIZE, anchor="mm")


def widest_gap(bearings: tuple[float, ...]) -> float:
    """The middle (rad, in (-pi, pi]) of the widest sector between neighbouring bearings."""
    if not bearings:
        return math.pi / 2
    turns = sorted(bearing % math.tau for bearing in bearings)
    gaps = np.diff([*turns, turns[0] + math.tau])
    widest = int(np.argmax(gaps))
    return wrap_angle(turns[widest] + float(gaps[widest]) / 2)


def _half_axes(vertex: RouteNode) -> Array:
    """The half axes (m) of the ellipse, as columns (2, 2), for a picture whose y points down."""
    covariance = np.array(vertex.covariance).reshape(2, 2)
    variances, directions = np.linalg.eigh((covariance + covariance.T) / 2)
    axes: Array = directions * (_SIGMAS * np.sqrt(np.maximum(variances, 0.0)))
    axes[1] *= -1.0
    return axes


def _entries(graph: RouteGraph, path: Array, raw: Array, walls: Array) -> Iterator[legend.Entry]:
    """The signs that the picture uses."""
    kinds = {vertex.kind for vertex in graph.vertices}
    used = [
        (legend.EDGE, bool(graph.edges)),
        (legend.MEETPOINT, "meetpoint" in kinds),
        (legend.ENDPOINT, "endpoint" in kinds),
        (legend.ELLIPSE, bool(kinds)),
        (legend.FRONTIER, any(vertex.frontiers for vertex in graph.vertices)),
        (legend.ESTIMATE, len(path) > 1),
        (legend.ODOMETRY, len(raw) > 1),
        (legend.START, len(path) > 0),
        (legend.VIRTUAL_WALL, len(walls) > 0),
    ]
    return (entry for entry, is_used in used if is_used)


def _caption(graph: RouteGraph, title: str) -> str:
    length = sum(edge.length for edge in graph.edges)
    facts = f"{counts(graph.vertices, graph.edges)} of {length:.0f} m"
    return f"{title}: {facts}" if title else facts


def counts(vertices: Sized, edges: Sized) -> str:
    """How many there are, in words."""
    return f"{counted(len(vertices), 'vertex', 'vertices')}, {counted(len(edges), 'edge')}"
