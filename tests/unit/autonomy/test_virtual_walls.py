"""Which side of a virtual wall a place is on."""

import numpy as np
import pytest

from gvgbot.autonomy.virtual_walls import crossings, nearest_before, points_of
from gvgbot.geometry import Array

WALL = points_of([((-1.0, 0.0), (1.0, 0.0))])
HERE = np.array([0.0, 0.5])
PLACES = np.array([(0.0, -0.2), (0.3, -0.4), (0.0, 2.0), (3.0, 0.5)])


def nearest(walls: Array, here: Array, places: Array = PLACES) -> int | None:
    return nearest_before(walls, here, places, np.hypot(*(places - here).T))


@pytest.mark.parametrize("x", np.arange(-1.2, 1.21, 0.3))
@pytest.mark.parametrize("lean", [-0.6, 0.0, 0.6])
def test_a_line_crosses_a_wall_where_it_meets_it(x: float, lean: float) -> None:
    """By the intercept theorem: half way, if the wall goes that far."""
    line = np.array([[x - lean, -1.0], [x + lean, 1.0]])
    half = float(np.hypot(lean, 1.0))
    (at,) = crossings(WALL, [line])
    assert at == (pytest.approx([half], abs=0.1) if abs(x) < 1.0 else ())


def test_one_that_comes_back_crosses_it_twice_and_one_beside_it_never() -> None:
    there_and_back = np.array([(-0.5, -1.0), (-0.5, 1.0), (0.5, 1.0), (0.5, -1.0)])
    beside = np.array([(-2.0, 0.3), (2.0, 0.3)])
    twice, never = crossings(WALL, [there_and_back, beside])
    assert twice == pytest.approx([1.0, 4.0], abs=0.1)
    assert never == ()
    assert crossings(WALL, []) == []


def test_what_is_nearer_beyond_a_wall_does_not_count() -> None:
    assert nearest(np.empty((0, 2)), HERE) == 0
    assert nearest(WALL, HERE) == 2
    assert nearest(WALL, HERE, PLACES[:2]) is None


@pytest.mark.parametrize("x", np.arange(-0.94, 0.95, 0.07))
def test_no_way_leads_between_the_points_of_a_wall(x: float) -> None:
    for lean in (-0.6, 0.0, 0.6):
        beyond = np.array([[x + lean, -0.5]])
        assert nearest(WALL, np.array([x - lean, 0.5]), beyond) is None


def test_a_way_leads_past_the_end_of_a_wall() -> None:
    assert nearest(WALL, np.array([1.1, 0.5]), np.array([[1.1, -0.5]])) == 0


def test_who_stands_on_a_wall_is_on_neither_side() -> None:
    assert nearest(WALL, np.array([0.02, 0.03]), np.array([[0.0, -1.0]])) == 0
