"""Virtual walls: lines on the map that the robot does not cross, though nothing stands there."""

from collections.abc import Sequence
from typing import Annotated

from gvgbot.geometry import Array, sampled
from gvgbot.ranges import Range

Coordinate = Annotated[float, Range(-1e4, 1e4)]  # m, map frame
_SPACING_M = 0.1  # of the points that stand for a wall: no robot fits between two
VirtualWall = tuple[tuple[Coordinate, Coordinate], ...]  # from corner to corner


def checked(walls: Sequence[VirtualWall]) -> None:
    """Raises ValueError for a wall that is no line."""
    for number, wall in enumerate(walls):
        if len(set(wall)) < 2:
            raise ValueError(f"virtual_walls[{number}]: a wall needs two different points, x and y")


def points_of(walls: Sequence[VirtualWall]) -> Array:
    """Points (N, 2) that stand for the walls, map frame."""
    return sampled(walls, _SPACING_M)
