"""Passages in hand-drawn maps: a metre for each letter; expected by looking."""

import numpy as np
import pytest

from gvgbot.geometry import Array
from gvgbot.maps.distances import cells_to
from gvgbot.maps.gaps import is_wall
from gvgbot.maps.passages import Way, passages
from tests.unit.maps.test_gaps import drawn

PASSAGE, OPEN = 0.25, 8.0  # m

# Two rooms that share a door at the top, and a corridor at the bottom. (-1, -2) is the corner.
ROOMS = (
    "#########",
    "#...#...#",
    "#.......#",
    *(["#...#...#"] * 6),
    "##.###.##",
    "#.......#",
    "#########",
)
CLOSED = tuple(row if row != "#.......#" or n > 5 else "#...#...#" for n, row in enumerate(ROOMS))
LEFT, RIGHT, DOOR = (1.5, 7.5), (5.5, 7.5), (3.5, 7.5)  # in the rooms, level with the door
BELOW_LEFT, BELOW_RIGHT = (1.5, -0.5), (5.5, -0.5)  # in the corridor
DOOR_HALFWAY = 0.6  # m off its middle, at most
LOWER = [  # the edges of both rooms, and of the corridor that joins them
    Way(1, 2, np.array([LEFT, BELOW_LEFT])),
    Way(2, 3, np.array([BELOW_LEFT, BELOW_RIGHT])),
    Way(3, 4, np.array([BELOW_RIGHT, RIGHT])),
]


def found(
    *rows: str,
    ways: list[Way],
    cell: float = 0.1,
    open_m: float = OPEN,
    at: tuple[float, ...] = LEFT,
) -> Array:
    return passages(drawn(*rows, cell=cell), ways, np.array(at), PASSAGE, open_m)


@pytest.mark.parametrize("cell", [0.05, 0.1])
def test_a_door_between_two_rooms_that_no_edge_leads_through_is_one(cell: float) -> None:
    (place,) = found(*ROOMS, ways=LOWER, cell=cell)
    assert place == pytest.approx(DOOR, abs=DOOR_HALFWAY)


def test_a_place_in_a_narrow_door_is_where_the_robot_has_room() -> None:
    grid, room = drawn(*ROOMS, cell=0.05), 0.49  # of the 0.5 m to either side of the door
    (place,) = passages(grid, LOWER, np.array(LEFT), room, OPEN)
    assert place == pytest.approx(DOOR, abs=DOOR_HALFWAY)
    column, row = ((place - grid.origin) / grid.resolution_m).astype(int)
    assert cells_to(is_wall(grid.cells))[row, column] * grid.resolution_m > room


def test_a_door_that_an_edge_leads_through_is_none() -> None:
    assert len(found(*ROOMS, ways=[*LOWER, Way(1, 4, np.array([LEFT, RIGHT]))])) == 0


def test_a_closed_door_is_none() -> None:
    assert len(found(*CLOSED, ways=LOWER)) == 0


def test_edges_that_nothing_joins_are_as_far_from_each_other_as_can_be() -> None:
    places = found(*ROOMS, ways=[LOWER[0], LOWER[2]], at=BELOW_LEFT)
    in_corridor = places[np.argmin(places[:, 1])]
    assert in_corridor == pytest.approx((3.5, -0.5), abs=DOOR_HALFWAY)


HALL = ("#" * 30, *(["#" + 28 * "." + "#"] * 10), "#" * 30)  # 28 m by 10 m
CORNERS = [(2.0, 1.0), (26.0, 1.0), (26.0, 7.0), (2.0, 7.0), (2.0, 1.0)]
COAST = [Way(1, 1, np.array(CORNERS))]


def test_the_middle_of_a_hall_is_none_where_the_walls_are_followed() -> None:
    """From one long side to the other it is 6 m across the middle, 5 m from the walls."""
    assert len(found(*HALL, ways=COAST, open_m=4.0, at=CORNERS[0])) == 0
    assert len(found(*HALL, ways=COAST, open_m=OPEN, at=CORNERS[0])) > 0


def test_an_edge_round_a_pillar_goes_the_long_way_round_nothing() -> None:
    pillar = ("#######", "#.....#", "#.....#", "#..#..#", "#.....#", "#.....#", "#######")
    around_it = [(0.75, -0.25), (4.25, -0.25), (4.25, 3.25), (0.75, 3.25), (0.75, -0.25)]
    ring = [Way(1, 1, np.array(around_it))]
    assert len(found(*pillar, ways=ring, at=(0.75, -0.25))) == 0


def test_without_edges_there_is_none() -> None:
    assert len(found(*ROOMS, ways=[])) == 0


def test_a_map_without_floor_has_none() -> None:
    assert len(found("###", "###", "###", "###", ways=LOWER)) == 0


def test_edges_that_keep_no_room_from_the_walls_are_not_on_the_floor() -> None:
    """All of them run so close to a wall that the robot has less room than it wants."""
    along_wall = [Way(1, 2, np.array([(0.1, -0.5), (0.1, 7.5)]))]
    assert len(found(*ROOMS, ways=along_wall)) == 0


def test_edges_may_reach_out_of_the_grid() -> None:
    """The scans that are kept need not show all that the robot drove through."""
    far = Way(3, 9, np.array([BELOW_RIGHT, (40.0, -0.5)]))
    assert len(found(*ROOMS, ways=[*LOWER, far])) == 1
