"""A dead end that leads to a ring of corridors: one meetpoint, one endpoint."""

from gvgbot.drivers.world import World
from gvgbot.geometry import Pose
from tests.unit.autonomy.sights import carved


def lollipop(half_width: float, west: float, east: float) -> World:
    """The dead end comes from the west to the ring's south-west corner; m, as far as to walls."""
    low, high = -half_width, half_width
    return carved(
        [
            (west, low, 0.0, high),
            (low, low, east, high),
            (low, east - 2 * half_width, east, east),
            (low, low, high, east),
            (east - 2 * half_width, low, east, east),
        ]
    )


LOLLIPOP = lollipop(0.7, -4.5, 4.7)  # a dead end of 4 m, and a ring of 16 m
START = Pose(-2.5, -0.1, 0.2)
IN_RING = Pose(4.0, 2.0, -1.2)
STICK_END = Pose(-3.7, 0.2, 3.1)
