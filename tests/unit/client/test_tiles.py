"""The grid at the other end, whatever is lost on the way, comes late, or begins anew."""

import zlib
from collections import deque

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.client.newest import Newest
from gvgbot.client.tiles import Tiles
from gvgbot.tiles import Grid, Tile

SIDE = 4


class Robot:
    """Sends one changed tile at a time, and answers with all."""

    def __init__(self, began: float = 1.0) -> None:
        self.began, self.number = began, 0
        self.tiles: dict[int, Tile] = {}

    def changes(self, column: int) -> Grid:
        self.number += 1
        cells = zlib.compress(bytes([self.number % 100]) * SIDE * SIDE)
        self.tiles[column] = Tile(column=column, row=0, cells=cells)
        return self._grid((self.tiles[column],))

    def whole(self) -> Grid:
        return self._grid(tuple(self.tiles.values()))

    def _grid(self, tiles: tuple[Tile, ...]) -> Grid:
        return Grid(
            stamp=0.0,
            began=self.began,
            number=self.number,
            resolution=0.5,
            side=SIDE,
            tiles=tiles,
        )


class Listener:
    """Asks when it has to; answers come when somebody lets them."""

    def __init__(self) -> None:
        self.newest: Newest[Grid] = Newest()
        self.asked = 0
        self.tiles = Tiles(self.newest, self._ask)

    def _ask(self) -> None:
        self.asked += 1

    def known(self) -> dict[int, Tile]:
        latest = self.newest.latest
        return {} if latest is None else {tile.column: tile for tile in latest.tiles}


def test_without_a_loss_nothing_is_asked_for() -> None:
    robot, listener = Robot(), Listener()
    for column in (0, 1, 0, 2, 1):
        listener.tiles.take(robot.changes(column))
        assert listener.known() == robot.tiles
    assert listener.asked == 0


def test_who_comes_late_asks_for_all_and_once() -> None:
    robot, listener = Robot(), Listener()
    for column in (0, 1, 2):
        robot.changes(column)
    for column in (0, 1):
        listener.tiles.take(robot.changes(column))
    assert listener.asked == 1
    listener.tiles.take_all(robot.whole())
    assert listener.known() == robot.tiles
    listener.tiles.take(robot.changes(3))
    assert listener.known() == robot.tiles
    assert listener.asked == 1


def test_an_answer_that_is_older_than_the_last_message_is_not_the_last_word() -> None:
    robot, listener = Robot(), Listener()
    robot.changes(0)
    listener.tiles.take(robot.changes(1))
    old = robot.whole()
    listener.tiles.take(robot.changes(2))
    listener.tiles.take_all(old)
    assert listener.asked == 2
    listener.tiles.take_all(robot.whole())
    assert listener.known() == robot.tiles


def test_an_answer_that_is_older_than_what_is_known_takes_nothing_back() -> None:
    robot, listener = Robot(), Listener()
    listener.tiles.take(robot.changes(0))
    old = robot.whole()
    listener.tiles.take(robot.changes(0))
    listener.tiles.take_all(old)
    assert listener.known() == robot.tiles
    assert listener.asked == 0


def test_a_robot_that_begins_anew_has_a_new_grid() -> None:
    robot, listener = Robot(), Listener()
    for column in (0, 1, 2):
        listener.tiles.take(robot.changes(column))
    again = Robot(began=2.0)
    listener.tiles.take(again.changes(7))
    assert listener.known() == again.tiles
    assert listener.asked == 0


def test_after_an_answer_that_could_not_be_read_it_asks_again_when_more_comes() -> None:
    robot, listener = Robot(), Listener()
    robot.changes(0)
    listener.tiles.take(robot.changes(1))
    listener.tiles.give_up()
    listener.tiles.take(robot.changes(2))
    assert listener.asked == 2


steps = st.lists(
    st.tuples(st.integers(0, 3), st.sampled_from(["comes", "comes", "is lost", "answer", "anew"])),
    max_size=60,
)


@given(steps)
def test_whatever_is_lost_in_the_end_both_have_the_same(story: list[tuple[int, str]]) -> None:
    robot, listener = Robot(), Listener()
    answers = deque[Grid]()
    for column, what in story:
        if what == "anew":
            robot = Robot(began=robot.began + 1.0)
        changed, before = robot.changes(column), listener.asked
        if what != "is lost":
            listener.tiles.take(changed)
        answers.extend([robot.whole()] * (listener.asked - before))
        if what == "answer" and answers:
            before = listener.asked
            listener.tiles.take_all(answers.popleft())
            answers.extend([robot.whole()] * (listener.asked - before))
    listener.tiles.take(robot.changes(0))
    while answers:
        before = listener.asked
        listener.tiles.take_all(answers.popleft())
        answers.extend([robot.whole()] * (listener.asked - before))
    if listener.known() != robot.tiles:  # an answer of an earlier life was the last to be asked for
        listener.tiles.take(robot.changes(0))
        listener.tiles.take_all(robot.whole())
    assert listener.known() == robot.tiles


def test_tiles_are_laid_side_by_side() -> None:
    cells = np.arange(16, dtype=np.int8).reshape(4, 4)
    tile = Tile(column=-1, row=2, cells=zlib.compress(cells.tobytes()))
    blank = zlib.compress(np.full((4, 4), 50, np.int8).tobytes())
    other = Tile(column=0, row=3, cells=blank)
    grid = Grid(stamp=0.0, began=0.0, number=1, resolution=0.5, side=4, tiles=(tile, other))
    raster = grid.raster()
    assert (raster.origin, raster.cells.shape) == ((-2.0, 4.0), (8, 8))
    assert (raster.cells[:4, :4] == cells).all()
    assert (raster.cells[4:, 4:] == 50).all()
    assert (raster.cells[:4, 4:] == -1).all()
    assert not raster.cells.flags.writeable
