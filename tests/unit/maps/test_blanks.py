"""Blanks in hand-drawn maps: a metre for each letter; expected by looking."""

from itertools import pairwise

import numpy as np
import pytest

from gvgbot.geometry import Array
from gvgbot.maps.blanks import blanks
from tests.unit.maps.test_gaps import drawn

PASSAGE = 0.25  # m

# Two rooms of 3 m with a door of 1 m between them, the corner of the map at (-1, -2).
ROOMS = ("#########", "#...#...#", "#.......#", "#...#...#", "#########")
LEFT, RIGHT = (1.5, 0.5), (5.5, 0.5)  # their middles


def way(*corners: tuple[float, float]) -> Array:
    """Points along a way."""
    parts = [np.linspace(a, b, 100) for a, b in pairwise(corners)]
    return np.concatenate(parts)


def found(*rows: str, ways: Array) -> Array:
    return blanks(drawn(*rows), ways, np.array(LEFT), PASSAGE)


def test_a_graph_that_leads_into_both_rooms_has_none() -> None:
    assert len(found(*ROOMS, ways=way(LEFT, RIGHT))) == 0


def test_a_room_that_is_only_seen_is_one() -> None:
    (place,) = found(*ROOMS, ways=way((0.5, -0.5), LEFT, (1.5, 1.0)))
    assert place == pytest.approx(RIGHT, abs=0.6)  # the disc about its middle reaches its door


def test_a_room_behind_a_wall_is_not_told_of() -> None:
    closed = ("#########", "#...#...#", "#...#...#", "#...#...#", "#########")
    assert len(found(*closed, ways=way((0.5, -0.5), LEFT))) == 0


def test_a_niche_that_the_largest_disc_beside_it_reaches_into_is_none() -> None:
    """Whoever drives along the middle of a corridor passes it."""
    niche = ("#########", "###...###", "#.......#", "#.......#", "#########")
    assert len(found(*niche, ways=way((0.5, 0.0), (6.5, 0.0)))) == 0


def test_what_was_seen_through_a_door_is_no_wider_than_that() -> None:
    """Beside it may be walls, for all that is known: who stops in the door leaves some of it."""
    seen = ("#########", "#...#   #", "#.......#", "#...#   #", "#########")
    assert len(found(*seen, ways=way((0.5, -0.5), LEFT, (6.5, 0.5)))) == 0
    first, *_ = found(*seen, ways=way((0.5, -0.5), LEFT, (4.4, 0.5)))
    assert 4.9 < first[0] < 7.0


def test_the_middle_of_a_hall_is_none_where_a_wall_is_followed() -> None:
    hall = ("###########", *(["#.........#"] * 9), "###########")
    assert len(found(*hall, ways=way((0.5, 0.0), (0.5, 6.0)))) == 0


def test_without_a_graph_nothing_is_missing_in_it() -> None:
    assert len(found(*ROOMS, ways=np.empty((0, 2)))) == 0
