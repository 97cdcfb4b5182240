"""From where to look, in hand-drawn maps: a metre for each letter; expected by looking."""

import numpy as np
import pytest

from gvgbot.geometry import Array
from gvgbot.maps.viewpoints import viewpoints
from tests.unit.maps.test_blanks import way
from tests.unit.maps.test_gaps import drawn

# A corridor along y = 0.5 and above it a room, with a door of 1 m at x from 4 to 5 between them.
# The corner of the map is at (-1, -2).
HOUSE = (
    "##########",
    "#........#",
    "#........#",
    "#####.####",
    "#........#",
    "##########",
    "##########",
)
CORRIDOR = way((0.5, 0.5), (7.5, 0.5))


OFF_M = 2.0


def found(*places: tuple[float, float], off_m: float = OFF_M) -> Array:
    off, at = np.full(len(places), off_m), np.array(places).reshape(-1, 2)
    views = viewpoints(drawn(*HOUSE), CORRIDOR, at, np.array([1.5, 0.5]), 0.25, off)
    assert views is not None
    return views


def test_a_room_is_looked_at_through_its_door_and_not_from_behind_its_wall() -> None:
    (view,) = found((0.5, 3.5))  # the corridor is 3 m from there, the door 4 m
    assert 4.0 < view[0] < 5.0
    assert 1.0 < view[1] < 3.0


@pytest.mark.parametrize("off_m", [0.5, 1.0, 1.5])
def test_the_robot_goes_so_far_off_its_way_and_no_farther(off_m: float) -> None:
    """Beside the way, within two decimetres, counts as on it; the path leads straight up there."""
    ((_, y),) = found((4.5, 3.5), off_m=off_m)
    assert 0.5 + off_m <= y <= 0.5 + off_m + 0.3


def test_what_is_near_a_way_is_gone_to() -> None:
    (view,) = found((2.0, 0.7))
    assert view == pytest.approx([2.0, 0.7], abs=0.15)


@pytest.mark.parametrize("away", [3.0, 7.8, 7.9, 8.0, 8.1, 8.2, 13.0])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_however_far_off_the_nearest_way_is_the_robot_goes_from_there(
    away: float, side: float
) -> None:
    """Of the middle of a hall 28 m long, and as well of what is at the border of a search."""
    hall = drawn("#" * 30, "#" + "." * 28 + "#", "#" * 30)
    place, ways = np.array([[14.05, -0.45]]), np.array([[14.05 + side * away, -0.45]])
    views = viewpoints(hall, ways, place, np.array([14.0, -0.5]), 0.25, np.array([OFF_M]))
    assert views is not None
    (view,) = views
    assert 1.7 < side * (ways[0, 0] - view[0]) < 2.3  # from the way towards the place


@pytest.mark.parametrize(("within", "gone"), [(1.0, 7.0), (3.0, 5.0), (7.0, 2.0)])
def test_so_far_from_all_ways_the_robot_goes_as_near_as_what_is_there_can_be_seen(
    within: float, gone: float
) -> None:
    """To the middle of a hall, eight metres from the way."""
    hall = drawn("#" * 30, "#" + "." * 28 + "#", "#" * 30)
    place, ways = np.array([[14.05, -0.45]]), np.array([[6.05, -0.45]])
    here, off = np.array([14.0, -0.5]), np.array([OFF_M])
    views = viewpoints(hall, ways, place, here, 0.25, off, within)
    assert views is not None
    ((x, _),) = views
    assert x - ways[0, 0] == pytest.approx(gone, abs=0.3)


def test_where_no_floor_leads_there_is_no_viewpoint() -> None:
    assert len(found((1.5, 1.5))) == 0  # in the wall
    assert len(found()) == 0


def test_where_no_way_has_room_there_is_nothing_to_look_from() -> None:
    """The corridor is a metre wide: its middle is half a metre from the walls."""
    place, off = np.array([[0.5, 3.5]]), np.array([OFF_M])
    here = np.array([1.5, 0.5])
    assert viewpoints(drawn(*HOUSE), CORRIDOR, place, here, 0.4, off) is not None
    assert viewpoints(drawn(*HOUSE), CORRIDOR, place, here, 0.7, off) is None
