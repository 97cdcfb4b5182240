"""Narrow ways between two rooms of three by three metres, whose wall is at x = 3."""

import numpy as np
import pytest

from gvgbot.geometry import Array
from gvgbot.maps.narrows import narrows
from gvgbot.maps.occupancy import OccupancyGrid

CELL, RADIUS, PASSAGE = 0.01, 0.177, 0.257  # m
HERE = np.array([1.0, 1.0])


def found(*doors: tuple[float, float], ways: Array | None = None, beyond: float = 3.0) -> Array:
    """By a robot in the western room; doors by their middle along the wall and their width, m."""
    cells = np.full((320, 700), 100, np.int8)
    cells[10:310, 10:310] = 0
    cells[10:310, 320 : 320 + round(beyond / CELL)] = 0
    for middle, width in doors:
        low, high = (round((middle + way * width / 2) / CELL) + 10 for way in (-1, 1))
        cells[low:high, 310:320] = 0
    grid = OccupancyGrid(cells, CELL, (-0.1, -0.1))
    return narrows(grid, HERE[None] if ways is None else ways, HERE, RADIUS, PASSAGE)


@pytest.mark.parametrize(
    ("width", "is_told_of"), [(0.3, False), (0.33, True), (0.4, True), (0.55, False)]
)
def test_a_door_that_the_robot_just_fits_through_is_told_of(
    width: float, *, is_told_of: bool
) -> None:
    places = found((2.0, width))
    assert len(places) == is_told_of
    for place in places:
        assert place == pytest.approx([3.05, 2.0], abs=0.1)


def test_a_room_that_it_has_been_in_has_no_narrow_way_whichever_way_it_came() -> None:
    assert len(found((2.0, 0.4), ways=np.array([[1.0, 1.0], [5.0, 1.0]]))) == 0
    assert len(found((2.0, 0.4), (1.0, 0.7))) == 0


def test_ways_may_lead_out_of_the_grid() -> None:
    """Where they end was seen, or believed to be, from afar."""
    assert len(found((2.0, 0.4), ways=np.array([[1.0, 1.0], [9.0, 1.0], [-5.0, -3.0]]))) == 1


def test_a_niche_is_not_worth_telling_of() -> None:
    assert len(found((2.0, 0.4), beyond=0.6)) == 0
