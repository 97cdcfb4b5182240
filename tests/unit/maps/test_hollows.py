"""Hollows in hand-drawn maps: a metre for each letter; expected by looking."""

from dataclasses import replace

import numpy as np
import pytest

from gvgbot.geometry import Array
from gvgbot.maps.hollows import bodies, hollows
from gvgbot.maps.occupancy import OccupancyGrid
from tests.unit.maps.test_blanks import way
from tests.unit.maps.test_gaps import drawn

OPEN = 6.0  # m from walls
MIDDLE = 30  # cell, from west and from south
CORNERS = (0.5, -0.5), (3.5, -0.5), (3.5, 2.5), (0.5, 2.5), (0.5, -0.5)


def found(middle: str = "..", *corners: tuple[float, float], open_m: float = OPEN) -> Array:
    """In a hall from (0, -1) to (4, 3), with something between (1, 0) and (3, 2)."""
    grid = drawn("######", "#....#", f"#.{middle}.#", f"#.{middle}.#", "#....#", "######")
    return hollows(grid, way(*(corners or CORNERS)), open_m)


def test_a_ring_round_nothing_is_one() -> None:
    (place,) = found()
    assert place == pytest.approx([2.0, 1.0], abs=0.15)


@pytest.mark.parametrize("middle", ["##", "#.", "  ", " ."])
def test_a_ring_round_walls_or_what_nobody_has_seen_is_none(middle: str) -> None:
    assert len(found(middle)) == 0


def hall_with(side_m: float, percent: int) -> OccupancyGrid:
    """A hall with a square in its middle, at (2, 1), that is so wide and looks like that."""
    grid = drawn("######", "#....#", "#....#", "#....#", "#....#", "######")
    half, cells = round(side_m / 2 / grid.resolution_m), grid.cells.copy()
    beside = slice(MIDDLE - half, MIDDLE + half)
    cells[beside, beside] = percent
    return replace(grid, cells=cells)


def with_walls(grid: OccupancyGrid, *columns: int) -> OccupancyGrid:
    cells = grid.cells.copy()
    cells[MIDDLE, columns] = 100
    return replace(grid, cells=cells)


@pytest.mark.parametrize(("side_m", "count"), [(0.4, 1), (0.8, 0)])
@pytest.mark.parametrize("percent", [-1, 50])
def test_what_a_ring_goes_round_may_have_gone_unseen(
    side_m: float, count: int, percent: int
) -> None:
    """Nobody has looked again where somebody stood, who is no wider than that."""
    grid = hall_with(side_m, percent)
    assert len(hollows(grid, way(*CORNERS), OPEN)) == count
    assert len(hollows(with_walls(grid, MIDDLE), way(*CORNERS), OPEN)) == 0


def test_ways_that_do_not_close_enclose_nothing() -> None:
    assert len(found("..", *CORNERS[:-1])) == 0


def test_two_ways_side_by_side_enclose_nothing() -> None:
    """They are one edge, or two that meet, drawn a little beside each other."""
    assert len(found("..", (0.5, 0.4), (3.5, 0.4), (3.5, 0.6), (0.5, 0.6), (0.5, 0.4))) == 0


def test_somebody_may_have_stood_beside_the_middle() -> None:
    """One way leads round where he stood, the other one, driven later, straight on."""
    (place,) = found("..", (0.5, 0.4), (3.5, 0.4), (3.5, 1.0), (0.5, 1.0), (0.5, 0.4))
    assert place[1] == pytest.approx(0.7, abs=0.1)


def test_in_the_open_edges_go_round_the_floor() -> None:
    assert len(found(open_m=2.0)) == 0
    assert len(hollows(drawn("###", "#.#", "###"), np.empty((0, 2)), OPEN)) == 0


@pytest.mark.parametrize(("side_m", "count"), [(0.1, 0), (0.3, 1), (0.6, 1), (0.8, 0)])
def test_what_a_ring_goes_round_may_be_somebody_if_it_is_small(side_m: float, count: int) -> None:
    places = bodies(hall_with(side_m, 100), way(*CORNERS))
    assert places == pytest.approx(np.array([[2.0, 1.0]] * count).reshape(-1, 2), abs=0.1)
    assert len(bodies(hall_with(side_m, 100), way(*CORNERS[:-1]))) == 0
    chair = with_walls(hall_with(0.0, 0), MIDDLE, MIDDLE + 3)
    assert len(bodies(chair, way(*CORNERS))) == 0
