"""Gaps in hand-drawn maps: a metre for each letter, a cell each decimetre; expected by looking."""

import tracemalloc

import numpy as np
import pytest

from gvgbot.geometry import Array
from gvgbot.maps.gaps import gaps, reachable
from gvgbot.maps.occupancy import UNKNOWN, OccupancyGrid

PASSAGE = 0.25  # m
PERCENT = {"#": 100, ".": 0, " ": UNKNOWN}


def drawn(*rows: str, cell: float = 0.1) -> OccupancyGrid:
    """A map drawn with the top row first, whose lower left corner is at (-1, -2)."""
    letters = np.array([[PERCENT[letter] for letter in row] for row in rows[::-1]], np.int8)
    times = round(1.0 / cell)
    cells = np.kron(letters, np.ones((times, times), np.int8))
    return OccupancyGrid(cells, cell, (-1.0, -2.0))


def found(grid: OccupancyGrid, x: float = 1.0, y: float = 0.0) -> Array:
    return gaps(grid, np.array([x, y]), PASSAGE)


ROOM = ("#######", "#.....#", "#.....#", "#.....#", "#######")


def test_a_room_that_has_been_seen_has_none() -> None:
    assert len(found(drawn(*ROOM))) == 0


@pytest.mark.parametrize("cell", [0.05, 0.1])
def test_a_door_that_nobody_has_looked_through_is_one(cell: float) -> None:
    room = ("#######  ", "#.....#  ", "#.....   ", "#.....#  ", "#######  ")
    (place,) = found(drawn(*room, cell=cell))
    # The door spans x from 5 to 6 and y from 0 to 1: before it is the last seen floor.
    assert place == pytest.approx([5.0, 0.5], abs=0.15)


def test_nothing_is_told_of_floor_that_cannot_be_reached() -> None:
    beside = ("#######  ", "#.....#  ", "#.....#..", "#.....#..", "#######  ")
    assert len(found(drawn(*beside))) == 0
    assert len(found(drawn(*beside), x=7.5)) > 0


def painted(*areas: tuple[slice, slice, int]) -> OccupancyGrid:
    """The room with some cells (rows, columns, percent) drawn anew, one after the other."""
    cells = drawn(*ROOM).cells.copy()
    for rows, columns, percent in areas:
        cells[rows, columns] = percent
    return OccupancyGrid(cells, 0.1, (-1.0, -2.0))


@pytest.mark.parametrize(("rows", "number"), [(4, 0), (8, 1)])  # the robot needs 0.5 m
def test_a_slit_too_narrow_for_the_robot_is_none(rows: int, number: int) -> None:
    beyond = slice(None), slice(62, None), UNKNOWN
    assert len(found(painted(beyond, (slice(20, 20 + rows), slice(60, 62), UNKNOWN)))) == number


def test_the_shadow_of_a_post_is_none_but_that_of_a_cupboard_is() -> None:
    shadow = slice(24, 26), slice(31, 40), UNKNOWN
    assert len(found(painted((slice(24, 26), slice(30, 31), 100), shadow))) == 0
    shadow = slice(15, 35), slice(31, 45), UNKNOWN
    assert len(found(painted((slice(20, 30), slice(30, 31), 100), shadow))) >= 1


@pytest.mark.parametrize("cell", [0.05, 0.1, 0.2])
def test_two_gaps_are_told_apart(cell: float) -> None:
    room = ("### ###", "#.....#", "#.....#", "#.....#", "### ###")
    places = found(drawn(*room, cell=cell))
    assert sorted(places[:, 1].round().tolist()) == [-1.0, 2.0]
    assert places[:, 0] == pytest.approx([2.5, 2.5], abs=0.1)


def test_where_floor_ends_all_round_the_gap_is_where_it_ends_next_to_the_robot() -> None:
    """A laser of short range has been driven round a pillar in the middle of a hall."""
    cells = np.full((100, 120), UNKNOWN, np.int8)
    cells[10:80, 20:100] = 0
    cells[42:48, 57:63] = 100
    grid = OccupancyGrid(cells, 0.1, (-1.0, -2.0))
    # The floor spans x from 1 to 9 and y from -1 to 6.
    assert found(grid, x=4.0, y=0.0) == pytest.approx(np.array([[4.0, -1.0]]), abs=0.15)
    assert found(grid, x=8.0, y=3.0) == pytest.approx(np.array([[9.0, 3.0]]), abs=0.15)


def test_without_any_wall_there_is_no_gap() -> None:
    assert len(found(drawn(".....", ".....", "....."))) == 0
    assert len(found(drawn("     "))) == 0


def test_the_floor_that_hangs_together_is_found_in_the_memory_of_a_grid_of_numbers() -> None:
    """A floor as large as a hall of 60 m has a million cells and more."""
    floor = np.ones((400, 500), np.bool_)
    floor[:, 250] = False
    tracemalloc.start()
    part = reachable(floor, np.array([3.0, 400.0]))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert (part == (np.arange(500) > 250)).all()
    assert peak < 12 * floor.size
