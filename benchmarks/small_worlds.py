"""Worlds so small that a whole exploration of one takes a few seconds of computing."""

from itertools import pairwise

from gvgbot.geometry import Pose
from gvgbot.simulation import Place
from gvgbot.worlds.canvas import Canvas


def two_rings() -> Place:
    """Two rings of corridors side by side, and a branch: four vertices and some forty metres."""
    canvas = Canvas(15.0, 8.5)
    canvas.carve_path([(1.5, 1.5), (11.5, 1.5), (11.5, 7.0), (1.5, 7.0), (1.5, 1.5)], 1.4)
    canvas.carve_path([(5.5, 1.5), (5.5, 7.0)], 1.2)
    canvas.carve_path([(11.5, 4.2), (14.0, 4.2)], 1.2)
    return Place(canvas.world("two rings"), Pose(1.5, 3.0, 1.2))


def one_ring() -> Place:
    """A ring of four corridors, no two alike, and a branch: two vertices and some twenty metres."""
    canvas = Canvas(9.5, 8.0)
    corners = [(1.5, 1.5), (6.0, 1.5), (6.0, 6.5), (1.5, 6.5), (1.5, 1.5)]
    for corridor, width in zip(pairwise(corners), (1.2, 1.55, 1.0, 1.35), strict=True):
        canvas.carve_path(list(corridor), width)
        canvas.carve_path([corridor[1], corridor[1]], width)
    canvas.carve_path([(6.0, 4.0), (8.4, 4.0)], 1.0)
    return Place(canvas.world("one ring"), Pose(1.5, 3.0, 1.2))
