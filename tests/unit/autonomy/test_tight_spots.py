"""Walls give way where the robot has been, and nowhere else."""

import numpy as np
import pytest
from numpy.typing import NDArray

from gvgbot.autonomy.gvg.voronoi import fine_graph
from gvgbot.autonomy.tight_spots import TightSpots
from gvgbot.geometry import Array

ROOM, MEMORY = 0.22, 10.0  # m


class Walls:
    """A space that is known all over."""

    def __init__(self, points: Array) -> None:
        self._points = points

    def points(self) -> Array:
        return self._points

    def known(self, points: Array) -> NDArray[np.bool_]:
        return np.ones(points.shape[:-1], bool)


def two_rooms(gap: float) -> Walls:
    """Two rooms of 4 by 4 m beside each other, and a gap in the wall of 0.1 m between them."""
    along, across = np.arange(-4.0, 4.01, 0.1), np.arange(-2.0, 2.01, 0.1)
    beyond = np.arange(gap / 2, 2.0, 0.1)
    pieces = [np.column_stack([along, np.full_like(along, y)]) for y in (-2.0, 2.0)]
    pieces += [np.column_stack([np.full_like(across, x), across]) for x in (-4.0, 4.0)]
    pieces += [
        np.column_stack([np.full_like(beyond, x), side * beyond])
        for x in (-0.05, 0.05)
        for side in (-1.0, 1.0)
    ]
    return Walls(np.concatenate(pieces))


def driven(metres: float, walls: Walls) -> TightSpots:
    """After so many metres from 1 m before the gap on, 3 cm beside its middle."""
    spots = TightSpots(ROOM, MEMORY)
    for x in np.arange(-1.0, metres - 1.0 + 1e-9, 0.25):
        spots.note(np.array([x, 0.03]), walls.points(), float(x))
    return spots


def reaches_beyond(spots: TightSpots, walls: Walls) -> bool:
    """Whether the graph of the first room goes on into the other one."""
    graph = fine_graph(
        Walls(spots.eased(walls.points())),
        np.array([-1.0, 0.0]),
        min_clearance=ROOM,
        roughness=0.03,
    )
    return bool((graph.points[:, 0] > 1.0).any())


@pytest.mark.parametrize("gap", [0.38, 0.40, 0.42])
def test_a_gap_that_the_robot_came_through_is_open_however_narrow_it_looks(gap: float) -> None:
    walls = two_rooms(gap)
    assert not reaches_beyond(TightSpots(ROOM, MEMORY), walls)
    assert not reaches_beyond(driven(0.5, walls), walls)
    assert reaches_beyond(driven(2.0, walls), walls)


def test_what_has_come_to_where_the_robot_was_closes_the_gap() -> None:
    """A door that has been shut behind it."""
    before, door = two_rooms(0.42), np.arange(-0.2, 0.21, 0.05)
    spots = driven(2.0, before)
    shut = np.concatenate([before.points(), np.column_stack([np.zeros_like(door), door])])
    assert not reaches_beyond(spots, Walls(shut))


def test_no_wall_comes_nearer_and_none_gives_way_by_more_than_the_robot_needs() -> None:
    walls = two_rooms(0.40)
    eased = driven(2.0, walls).eased(walls.points())
    moved = np.hypot(*(eased - walls.points()).T)
    assert 0.0 < moved.max() < 0.06
    away = np.hypot(*(eased - [0.0, 0.03]).T)
    assert away.min() >= ROOM
    assert (away >= np.hypot(*(walls.points() - [0.0, 0.03]).T) - 1e-9).all()


def test_where_there_is_room_nothing_is_remembered() -> None:
    walls = two_rooms(0.8)
    assert driven(2.0, walls).eased(walls.points()) is walls.points()


def test_a_spot_is_forgotten_when_the_robot_has_driven_on() -> None:
    walls = two_rooms(0.40)
    spots = driven(2.0, walls)
    spots.note(np.array([2.0, 0.0]), walls.points(), 1.0 + MEMORY)
    assert not reaches_beyond(spots, walls)


def test_who_was_carried_through_a_wall_has_not_driven_there() -> None:
    walls = two_rooms(0.40)
    spots = TightSpots(ROOM, MEMORY)
    for x, travelled in ((-0.26, 0.0), (0.26, 0.52)):
        spots.note(np.array([x, 0.0]), walls.points(), travelled)
    assert not reaches_beyond(spots, walls)


def test_a_robot_that_stands_remembers_no_more_than_one_that_drives() -> None:
    walls, spots = two_rooms(0.40), TightSpots(ROOM, MEMORY)
    for _ in range(1000):
        spots.note(np.array([0.0, 0.001]), walls.points(), 0.0)
    assert len(spots._spots) == 1
