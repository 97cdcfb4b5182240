"""Hollows in hand-drawn maps: a metre for each letter; expected by looking."""

import numpy as np
import pytest

from gvgbot.geometry import Array
from gvgbot.maps.hollows import hollows
from tests.unit.maps.test_blanks import way
from tests.unit.maps.test_gaps import drawn

OPEN = 6.0  # m from walls
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


def test_ways_that_do_not_close_enclose_nothing() -> None:
    assert len(found("..", *CORNERS[:-1])) == 0


def test_two_ways_side_by_side_enclose_nothing() -> None:
    """They are one edge, or two that meet, drawn a little beside each other."""
    assert len(found("..", (0.5, 0.4), (3.5, 0.4), (3.5, 0.6), (0.5, 0.6), (0.5, 0.4))) == 0


def test_in_the_open_edges_go_round_the_floor() -> None:
    assert len(found(open_m=2.0)) == 0
    assert len(hollows(drawn("###", "#.#", "###"), np.empty((0, 2)), OPEN)) == 0
