"""Two halves of a room, seen in different frames, are one room in the joined grid."""

import math
import tracemalloc

import numpy as np
import pytest

from gvgbot.geometry import Pose
from gvgbot.maps.joined_grid import joined_grid
from gvgbot.maps.occupancy import UNKNOWN, OccupancyGrid

CELL = 0.05


def grid(rows: list[str], origin: tuple[float, float] = (0.0, 0.0)) -> OccupancyGrid:
    """Drawn with y upwards: # wall, . free, ? unknown."""
    meaning = {"#": 100, ".": 0, "?": UNKNOWN}
    cells = np.array([[meaning[c] for c in row] for row in rows[::-1]], np.int8)
    seen = np.where(cells == UNKNOWN, np.inf, 1.0).astype(np.float32)
    return OccupancyGrid(cells, CELL, origin, seen)


def drawn(joined: OccupancyGrid) -> list[str]:
    marks = {100: "#", 0: ".", UNKNOWN: "?"}
    return ["".join(marks[int(value)] for value in row) for row in joined.cells[::-1]]


@pytest.mark.parametrize("x", [-0.35, 0.35])  # which is no seven times 0.05 to a computer
def test_one_grid_is_itself(x: float) -> None:
    one = grid(["##?", "..#"], origin=(x, 1.0))
    joined = joined_grid([(one, Pose())])
    assert drawn(joined) == ["##?", "..#"]
    assert np.allclose(joined.origin, one.origin)


def test_what_one_robot_has_not_seen_is_as_the_other_one_saw_it() -> None:
    """The other one's frame lies five cells to the right and is turned to the left by a quarter."""
    one, two = grid(["##??", "#..?"]), grid([".#", ".#", "##"])
    joined = joined_grid([(one, Pose()), (two, Pose(5 * CELL, 0.0, math.pi / 2))])
    assert drawn(joined) == ["#####", "#...#"]  # its bottom row stands upright at the right
    assert joined.seen_s is not None
    assert np.isfinite(joined.seen_s).all()


def test_where_two_differ_it_is_a_wall() -> None:
    assert drawn(joined_grid([(grid(["#.?"]), Pose()), (grid([".#?"]), Pose())])) == ["##?"]


def test_cells_of_another_size_lie_where_they_were_measured() -> None:
    """A cell of 10 cm is four of the first one's, twice as far from the corner in cells."""
    coarse = OccupancyGrid(np.array([[0, 100]], np.int8), 2 * CELL, (0.0, 0.0))
    joined = joined_grid([(grid(["??????"]), Pose()), (coarse, Pose(2 * CELL, 0.0))])
    assert drawn(joined) == ["??..##", "??..##"]
    assert joined.resolution_m == CELL


def test_a_grid_as_large_as_two_buildings_is_joined_in_little_memory() -> None:
    """A cell of the result takes five bytes, and those that are worked on at a time few more."""
    one = OccupancyGrid(np.zeros((600, 500), np.int8), CELL, (0.0, 0.0))
    tracemalloc.start()
    joined = joined_grid([(one, Pose()), (one, Pose(20.0, 30.0))])
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert joined.cells.shape == (1200, 900)
    assert (joined.cells == 0).sum() == 2 * one.cells.size
    assert peak < 20 * joined.cells.size
