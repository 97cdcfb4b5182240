"""Who stood where, in hand-drawn maps: a metre for each letter, a cell each decimetre."""

import numpy as np
import pytest

from gvgbot.geometry import Array
from gvgbot.maps.occupancy import UNKNOWN, OccupancyGrid
from gvgbot.maps.spots import spots
from tests.unit.maps.test_gaps import PASSAGE, ROOM, drawn

PLACE, RADIUS = (2.5, 0.5), 0.2  # m; the room spans x from 0 to 5 and y from -1 to 2


def found(percent: int, place: tuple[float, float] = PLACE) -> Array:
    """What is told of a place if the cells within four decimetres of PLACE are of a kind."""
    grid = drawn(*ROOM)
    cells = grid.cells.copy()
    cells[23:27, 33:37] = percent
    grid = OccupancyGrid(cells, grid.resolution_m, grid.origin)
    return spots(grid, np.array([place]), np.array([RADIUS]), np.array([0.5, 0.5]), PASSAGE)


def test_where_nobody_has_looked_since_somebody_stood_there_is_one_beside_which_is_floor() -> None:
    (place,) = found(UNKNOWN)
    assert np.hypot(*(place - PLACE)) == pytest.approx(RADIUS + PASSAGE, abs=0.1)


def test_who_has_gone_or_is_in_the_map_makes_none() -> None:
    assert len(found(0)) == 0
    assert len(found(100)) == 0


def test_a_glance_at_its_rim_is_not_enough_to_know_that_it_has_gone() -> None:
    """The floor of a third of the disc was seen, where the rest is not known."""
    cells = drawn(*ROOM).cells.copy()
    cells[23:27, 33:37] = UNKNOWN
    cells[23:27, 33] = 0
    grid = OccupancyGrid(cells, 0.1, drawn(*ROOM).origin)
    places, radii = np.array([PLACE]), np.array([RADIUS])
    assert len(spots(grid, places, radii, np.array([0.5, 0.5]), PASSAGE)) == 1


def test_what_stands_where_the_robot_cannot_drive_makes_none() -> None:
    assert len(found(UNKNOWN, place=(9.0, 9.0))) == 0
    assert len(found(UNKNOWN, place=(-1.0, -2.0))) == 0
