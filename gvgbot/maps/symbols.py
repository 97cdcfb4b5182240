"""The signs that a map is drawn with; the same ones explain it in the legend.

Points (N, 2) and sizes are in pixels.
"""

import math

import numpy as np

from gvgbot.geometry import Array
from gvgbot.maps.canvas import Ink, Point
from gvgbot.maps.surface import Surface

VERTEX_RADIUS = 6.0
_EDGE_WIDTH = 5.5
_FRONTIER_LENGTH = 30.0
_CIRCLE = np.linspace(0.0, math.tau, 60, endpoint=False)
_UNIT_CIRCLE = np.column_stack([np.cos(_CIRCLE), np.sin(_CIRCLE)])


def draw_edge(canvas: Surface, points: Array) -> None:
    """A GVG edge."""
    canvas.line(points, Ink.SKY, _EDGE_WIDTH)


def draw_lone_edge(canvas: Surface, points: Array) -> None:
    """A GVG edge that another map has not."""
    canvas.line(points, Ink.RED, _EDGE_WIDTH + 3.0)


def draw_lone_vertex(canvas: Surface, at: Point) -> None:
    """A ring around a vertex that another map has not."""
    points = np.asarray(at) + (VERTEX_RADIUS + 8.0) * _UNIT_CIRCLE
    canvas.polygon(points, fill=None, outline=Ink.RED, width=3.5)


def draw_estimate(canvas: Surface, points: Array) -> None:
    """The trajectory as estimated."""
    canvas.line(_thinned(points), Ink.GREEN, 2.0)


def draw_odometry(canvas: Surface, points: Array) -> None:
    """The trajectory by odometry alone."""
    canvas.line(_thinned(points), Ink.RED, 1.4)


def draw_virtual_wall(canvas: Surface, points: Array) -> None:
    """A line of dots, each a point of it."""
    for point in points:
        canvas.disc((float(point[0]), float(point[1])), 2.5, fill=Ink.RED)


def draw_meetpoint(canvas: Surface, at: Point) -> None:
    """A filled disc."""
    canvas.disc(at, VERTEX_RADIUS + 1.0, fill=Ink.WHITE)
    canvas.disc(at, VERTEX_RADIUS, fill=Ink.BLUE)


def draw_endpoint(canvas: Surface, at: Point) -> None:
    """A hollow disc."""
    canvas.disc(at, VERTEX_RADIUS, fill=Ink.BLUE)
    canvas.disc(at, VERTEX_RADIUS - 2.0, fill=Ink.WHITE)


def draw_ellipse(canvas: Surface, at: Point, axes: Array) -> None:
    """An ellipse whose two half axes are the columns of `axes` (2, 2)."""
    points = np.asarray(at) + _UNIT_CIRCLE @ axes.T
    canvas.polygon(points, fill=None, outline=Ink.PURPLE, width=1.7)


def draw_frontier(canvas: Surface, at: Point, bearing: float) -> None:
    """An arrow from a vertex; the bearing is as on the map, anticlockwise from the right."""
    ahead = np.array([math.cos(bearing), -math.sin(bearing)])
    aside = np.array([-ahead[1], ahead[0]])
    tip = np.asarray(at) + _FRONTIER_LENGTH * ahead
    neck = tip - 10.0 * ahead
    canvas.line(np.array([np.asarray(at), neck]), Ink.ORANGE, 3.5)
    head = np.array([tip, neck + 6.0 * aside, neck - 6.0 * aside])
    canvas.polygon(head, fill=Ink.ORANGE, outline=Ink.ORANGE, width=1.0)


def draw_start(canvas: Surface, at: Point, heading: float) -> None:
    """A kite that points where the robot looked; the heading is anticlockwise from the right."""
    turns = heading + np.array([0.0, 2.5, math.pi, -2.5])
    radii = np.array([[15.0], [12.0], [5.0], [12.0]])
    points = np.asarray(at) + radii * np.column_stack([np.cos(turns), -np.sin(turns)])
    canvas.polygon(points, fill=Ink.BLACK, outline=Ink.WHITE, width=1.3)


def draw_robot(canvas: Surface, at: Point, heading: float) -> None:
    """A round robot with its nose ahead; the heading is anticlockwise from the right."""
    canvas.disc(at, 11.0, fill=Ink.WHITE)
    canvas.disc(at, 9.5, fill=Ink.BLACK)
    nose = np.asarray(at) + 8.0 * np.array([math.cos(heading), -math.sin(heading)])
    canvas.line(np.array([at, nose]), Ink.WHITE, 3.0)


def _thinned(points: Array) -> Array:
    """The points (N, 2) without those that a line of pixels cannot tell apart."""
    if len(points) < 2:
        return points
    rough = np.rint(points * 1.5)
    moved = np.any(rough[1:] != rough[:-1], axis=1)
    kept: Array = points[np.concatenate([[True], moved])]
    return kept
