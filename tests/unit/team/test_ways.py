"""Edges driven in pieces: lines drawn by hand, and what geometry says of where they lead."""

import math
from itertools import pairwise

import numpy as np
import pytest

from gvgbot.geometry import Array
from gvgbot.team.ways import Ways

PLACES = np.array([(0.0, 0.0), (10.0, 0.0)])
EAST, WEST = 0.0, math.pi


def straight(*corners: tuple[float, float], spacing: float = 0.2) -> Array:
    pieces = [
        np.linspace(a, b, 1 + math.ceil(math.dist(a, b) / spacing)) for a, b in pairwise(corners)
    ]
    return np.concatenate(pieces)


FROM_WEST = straight((0.0, 0.0), (4.8, 0.1)), 0.7
FROM_EAST = straight((10.0, 0.0), (5.4, -0.1)), 0.6
BESIDE = straight((5.1, 0.9), (5.1, 4.0)), 0.5  # a third one, in a room beside


@pytest.mark.parametrize(("start", "bearing"), [(0, EAST), (1, WEST)])
def test_two_that_met_half_way_have_driven_an_edge_together(start: int, bearing: float) -> None:
    walk = Ways([BESIDE, FROM_WEST, FROM_EAST], PLACES).behind(start, bearing)
    assert walk is not None
    assert walk.place == 1 - start
    assert walk.length == pytest.approx(10.0, abs=0.1)
    assert walk.min_clearance == 0.6
    np.testing.assert_allclose(walk.line[[0, -1]], PLACES[[start, 1 - start]], atol=0.05)


def test_who_started_in_the_middle_has_driven_over_where_others_were() -> None:
    middle = straight((3.0, 0.0), (8.0, 0.0)), 0.5
    short = straight((0.0, 0.0), (3.4, 0.0)), 0.9
    rest = straight((10.0, 0.0), (7.0, 0.0)), 0.9
    for lines in ([short, middle, rest], [rest, (middle[0][::-1], 0.5), short]):
        walk = Ways(lines, PLACES).behind(0, EAST)
        assert walk is not None
        assert (walk.place, walk.min_clearance) == (1, 0.5)
        assert walk.length == pytest.approx(10.0, abs=0.1)


@pytest.mark.parametrize(("start", "bearing"), [(0, EAST), (1, WEST)])
def test_where_one_went_round_the_other_its_way_does_not_end(start: int, bearing: float) -> None:
    round_it = straight((0.0, 0.0), (4.6, 0.0), (5.1, 0.6)), 0.7
    walk = Ways([round_it, FROM_EAST], PLACES).behind(start, bearing)
    assert walk is not None
    assert walk.place == 1 - start
    assert walk.length == pytest.approx(10.0, abs=0.3)
    assert np.abs(walk.line[:, 1]).max() < 0.4


@pytest.mark.parametrize(
    "other",
    [
        straight((10.0, 0.0), (6.5, 0.0)),  # nobody was between
        straight((10.0, 1.1), (4.0, 1.1)),  # in the next corridor
        straight((5.0, -4.0), (5.0, 4.0)),  # across
    ],
)
def test_what_nobody_has_driven_is_not_known(other: Array) -> None:
    assert Ways([FROM_WEST, (other, 0.6)], PLACES).behind(0, EAST) is None


def test_there_is_nothing_behind_a_departure_that_nobody_took() -> None:
    assert Ways([FROM_WEST, FROM_EAST], PLACES).behind(0, WEST) is None
    assert Ways([FROM_WEST, FROM_EAST], PLACES).behind(0, math.pi / 2) is None


def test_it_ends_at_the_first_vertex_on_the_way() -> None:
    places = np.array([*PLACES, (7.0, 0.2)])
    walk = Ways([FROM_WEST, FROM_EAST], places).behind(0, EAST)
    assert walk is not None
    assert walk.place == 2
    assert walk.length == pytest.approx(7.0, abs=0.1)


def test_from_a_vertex_right_beside_another_one_nothing_is_behind() -> None:
    places = np.array([(0.0, 0.3), (0.0, 0.0)])
    assert Ways([FROM_WEST], places).behind(0, EAST) is None


def test_a_loop_comes_back_to_its_vertex() -> None:
    angles = np.linspace(0.0, 2 * np.pi, 200)
    ring = 4.0 * np.stack([np.cos(angles) - 1.0, np.sin(angles)], axis=1)
    ways = Ways([(ring[:110], 0.7), (ring[:95:-1], 0.7)], PLACES[:1])
    walk = ways.behind(0, math.pi / 2)
    assert walk is not None
    assert walk.place == 0
    assert walk.length == pytest.approx(8.0 * math.pi, rel=0.01)


def test_who_turned_on_the_spot_has_not_driven_round_anything() -> None:
    there_and_back = straight((0.0, 0.0), (1.0, 0.0), (1.0, 0.1), (0.0, 0.1)), 0.5
    assert Ways([there_and_back], PLACES[:1]).behind(0, EAST) is None
    round_it = straight((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (0.0, 0.0)), 0.5
    walk = Ways([round_it], PLACES[:1]).behind(0, EAST)
    assert walk is not None
    assert walk.place == 0
    assert walk.length == pytest.approx(8.0, abs=0.1)


def test_who_stepped_aside_has_not_driven_the_way_that_leads_on_past_it() -> None:
    """A metre into a side way, from a vertex whose other edge leads on to the next vertex."""
    aside = straight((0.0, 0.0), (0.3, 0.05), (0.6, 1.1)), 0.5
    edge = straight((0.0, 0.0), (10.0, 0.0)), 0.7
    ways = Ways([aside, edge], PLACES)
    assert ways.behind(0, math.radians(60.0), [edge[0]]) is None
    assert ways.behind(0, math.radians(60.0)) is None
