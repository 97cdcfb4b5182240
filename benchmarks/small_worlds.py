"""Worlds so small that a whole exploration of one takes a few seconds of computing."""

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
    """A ring of corridors and a short branch: two vertices and some twenty metres."""
    canvas = Canvas(9.5, 8.0)
    canvas.carve_path([(1.5, 1.5), (6.0, 1.5), (6.0, 6.5), (1.5, 6.5), (1.5, 1.5)], 1.2)
    canvas.carve_path([(6.0, 4.0), (8.2, 4.0)], 1.0)
    return Place(canvas.world("one ring"), Pose(1.5, 3.0, 1.2))
