"""Maps drawn by hand against characters whose dots were counted by hand."""

import math
import unicodedata
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from gvgbot.monitor.braille import Dots, patterns
from gvgbot.monitor.chart import LAYERS, Chart, Scene, chart
from gvgbot.monitor.view import View
from gvgbot.topics import Map, Plan, packed
from tests.unit.monitor.maps import a_floor, a_map, vertex


def names(dots: Dots) -> str:
    return unicodedata.name(chr(int(patterns(dots)[0, 0])))


@pytest.mark.parametrize(
    ("row", "column", "number"),
    [(0, 0, 1), (1, 0, 2), (2, 0, 3), (0, 1, 4), (1, 1, 5), (2, 1, 6), (3, 0, 7), (3, 1, 8)],
)
def test_each_dot_is_the_one_that_unicode_numbers_so(row: int, column: int, number: int) -> None:
    dots = np.zeros((4, 2), bool)
    dots[row, column] = True
    assert names(dots) == f"BRAILLE PATTERN DOTS-{number}"


def test_no_dot_is_the_blank_pattern_and_all_are_all() -> None:
    assert names(np.zeros((4, 2), bool)) == "BRAILLE PATTERN BLANK"
    assert names(np.ones((4, 2), bool)) == "BRAILLE PATTERN DOTS-12345678"


def drawn(drawing: str, width: int, height: int, graph: Map | None = None) -> Chart:
    return chart(Scene(graph, a_floor(drawing, origin=HALF)), width, height)


# Cells of a metre about the points 0..15, with half a metre around their centres: 16 x 16 m.
ROOM = """
################
#......#.......#
#......#.......#
#......#.......#
#..............#
#..............#
#..............#
#......#########
#..............#
#..............#
#..#...........#
#..............#
#..............#
#..............#
#.............##
################
"""
WALLS = np.array([[sign == "#" for sign in line] for line in ROOM.split()])
HALF = (-0.5, -0.5)


def test_where_a_dot_is_as_large_as_a_cell_the_dots_are_the_walls() -> None:
    room = drawn(ROOM, 8, 4)
    assert room.scale == 2.0  # of a character: two dots of a metre
    assert (dots_of(room) == WALLS).all()
    assert room.text()[0] == "⡏⠉⠉⢹⠉⠉⠉⢹"
    assert room.floor.all()


def test_where_dots_are_finer_than_cells_walls_stay_closed() -> None:
    room = drawn(ROOM, 16, 8)
    assert (dots_of(room) == np.kron(WALLS, np.ones((2, 2), bool))).all()


def test_where_dots_are_coarser_than_cells_no_wall_is_lost() -> None:
    room = drawn(ROOM, 4, 2)
    blocks = WALLS.reshape(8, 2, 8, 2).any(axis=(1, 3))
    assert (dots_of(room) == blocks).all()


class Counted(np.ndarray):
    """Cells that count how many of them were compared."""

    compared = 0

    def __ge__(self, other: object) -> np.ndarray:
        Counted.compared += self.size
        return np.asarray(np.asarray(self) >= other)


def test_the_cells_of_a_large_building_are_looked_at_once_and_not_for_each_picture() -> None:
    floor = a_floor("\n".join(["#" * 500] * 500), resolution=0.4)
    scene = Scene(floor=replace(floor, cells=floor.cells.view(Counted)))
    first = chart(scene, 40, 20)
    looked = Counted.compared
    assert looked >= floor.cells.size
    assert (chart(scene, 40, 20).codes == first.codes).all()
    assert Counted.compared == looked


def test_a_wide_terminal_shows_the_map_in_its_middle() -> None:
    room = drawn(ROOM, 12, 4)
    assert (dots_of(room)[:, 4:20] == WALLS).all()
    assert not dots_of(room)[:, :4].any()
    assert not dots_of(room)[:, 20:].any()


def test_unknown_floor_is_told_from_known() -> None:
    half = ROOM.replace("#.", " .").strip("\n").split("\n")
    drawing = "\n".join(line[:8] + " " * 8 for line in half)
    far = vertex((15.0, 8.0))  # keeps the view as wide as before
    room = drawn(drawing, 8, 4, a_map((far,)))
    assert room.floor[:, :4].all()
    assert not room.floor[:, 4:].any()


def test_floor_is_where_it_is_however_far_its_corner_is_from_the_middle_of_the_map() -> None:
    """The northern half of sixteen metres, from (0, 8) on; the map begins at its origin."""
    floor = a_floor("\n".join(["." * 16] * 8), origin=(-0.5, 7.5))
    room = chart(Scene(a_map((vertex((15.0, 0.0)),)), floor), 8, 4)
    assert room.floor[:2].all()
    assert not room.floor[2:].any()


EMPTY = "\n".join(["." * 16] * 16)


def test_an_edge_is_a_line_without_gaps_and_hides_the_trail_under_it() -> None:
    upright = [(2.0, 2.0), (2.0, 12.0)]
    way = np.array([[2.0, 2.0], [12.0, 2.0]])
    found = chart(Scene(a_map(lines=(upright,)), a_floor(EMPTY, origin=HALF), [way]), 8, 4)
    expected = np.zeros((16, 16), bool)
    for i in range(2, 13):
        expected[15 - i, 2] = True  # row 0 is the north
        expected[13, i] = True
    assert (dots_of(found) == expected).all()
    edge, trail = LAYERS.index("edge"), LAYERS.index("trail")
    assert found.layers[3].tolist() == [0, edge, trail, trail, trail, trail, trail, 0]


def test_a_virtual_wall_is_a_line_with_gaps() -> None:
    wall = np.column_stack([np.full(91, 3.0), np.linspace(2.0, 11.0, 91)])
    known = msgspec.structs.replace(a_map(), virtual_walls=packed(wall))
    found = chart(Scene(known, a_floor(EMPTY, origin=HALF)), 32, 16)  # dots of a quarter of a metre
    dots = dots_of(found)
    assert np.flatnonzero(dots.any(axis=0)).tolist() == [14]  # from 3.0 to 3.25 m
    lit, rows = int(dots.sum()), np.flatnonzero(dots.any(axis=1))
    assert lit == 31  # one every 0.3 m
    assert rows[-1] - rows[0] + 1 > lit
    assert set(found.layers[found.layers > 0].tolist()) == {LAYERS.index("wall")}


def test_where_no_way_is_known_no_line_is_drawn() -> None:
    ways = [np.array([[2.0, y], [6.0, y]]) for y in (2.0, 12.0)]
    found = chart(Scene(None, a_floor(EMPTY, origin=HALF), ways), 8, 4)
    expected = np.zeros((16, 16), bool)
    expected[[13, 3], 2:7] = True
    assert (dots_of(found) == expected).all()


def test_the_plan_is_drawn_from_the_robot_to_where_it_goes() -> None:
    plan = Plan(
        stamp=0.0,
        vertex=1,
        bearing=0.0,
        reason="ear",
        track=np.array([[3.0, 0.0], [3.0, 4.0]], "<f4").tobytes(),
        route=np.array([[3.0, 4.0], [9.0, 4.0]], "<f4").tobytes(),
    )
    found = chart(Scene(floor=a_floor(EMPTY, origin=HALF), plan=plan), 8, 4)
    expected = np.zeros((16, 16), bool)
    expected[11:16, 3] = expected[11, 3:10] = True  # row 0 is the north
    assert (dots_of(found) == expected).all()
    assert set(found.layers[found.layers > 0].tolist()) == {LAYERS.index("plan")}


def test_vertices_frontiers_and_the_robot_are_signs_where_they_are() -> None:
    known = a_map(
        (vertex((1.0, 1.0), frontiers=(0.0, math.pi / 2)), vertex((15.0, 15.0), "endpoint"))
    )
    scene = Scene(known, a_floor(EMPTY, origin=HALF), pose=(8.0, 9.0, 0.0))
    found = chart(scene, 8, 4)
    assert found.text() == ["       ○", "    →   ", "?       ", "● ?     "]


def test_other_robots_are_arrows_of_a_layer_of_their_own() -> None:
    team = ((1.0, 1.0, math.pi / 2), (15.0, 15.0, math.pi))
    scene = Scene(floor=a_floor(EMPTY, origin=HALF), pose=(8.0, 9.0, 0.0), team=team)
    found = chart(scene, 8, 4)
    assert found.text() == ["       ←", "    →   ", "        ", "↑       "]
    mates = found.layers == LAYERS.index("mate")
    assert mates[3, 0]
    assert mates[0, 7]
    assert mates.sum() == len(team)


@pytest.mark.parametrize(
    ("degrees", "arrow"),
    [
        *[(0, "→"), (45, "↗"), (90, "↑"), (135, "↖"), (180, "←"), (-180, "←"), (-135, "↙")],
        *[(-90, "↓"), (-45, "↘"), (20, "→"), (25, "↗"), (-20, "→"), (360, "→"), (450, "↑")],
    ],
)
def test_the_arrow_points_where_the_robot_looks(degrees: float, arrow: str) -> None:
    found = chart(Scene(pose=(0.0, 0.0, math.radians(degrees))), 8, 4)
    assert arrow in "".join(found.text())


def test_without_a_map_there_is_a_small_empty_place() -> None:
    found = chart(Scene(), 10, 5)
    assert found.text() == [" " * 10] * 5


def test_what_lies_outside_a_view_is_left_out() -> None:
    view = View(2, 1, 0.0, 4.0, 1.0)
    dots = np.zeros(view.shape, bool)
    view.draw(dots, np.array([[-5.0, 3.5], [20.0, 3.5]]))
    assert dots.tolist() == [[True] * 4, [False] * 4, [False] * 4, [False] * 4]
    assert view.character_of((4.5, 1.0)) is None
    assert view.character_of((3.5, 1.0)) == (0, 1)


def dots_of(found: Chart) -> Dots:
    """The dots of all characters, by their names in the Unicode standard."""
    places = {
        1: (0, 0),
        2: (1, 0),
        3: (2, 0),
        4: (0, 1),
        5: (1, 1),
        6: (2, 1),
        7: (3, 0),
        8: (3, 1),
    }
    rows, columns = found.codes.shape
    dots = np.zeros((4 * rows, 2 * columns), bool)
    for (row, column), code in np.ndenumerate(found.codes):
        pattern, dash, numbers = unicodedata.name(chr(code)).rpartition("-")
        assert not dash or pattern == "BRAILLE PATTERN DOTS", "a sign where dots were expected"
        for number in numbers if dash else "":
            y, x = places[int(number)]
            dots[4 * row + y, 2 * column + x] = True
    return dots
