"""The way back through a door, by its geometry."""

from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.own_way import own_way
from gvgbot.autonomy.views import View
from gvgbot.geometry import Pose, resampled
from tests.unit.autonomy.local_graphs import drawn
from tests.unit.autonomy.sights import carved, line, looked

DOOR = looked(  # 0.45 m wide, between y = -0.225 and 0.225, in a wall 0.1 m thick
    carved([(-3.0, -2.0, 0.0, 2.0), (0.0, -0.225, 0.1, 0.225), (0.1, -2.0, 3.0, 2.0)]),
    [*line(-2.0, 0.0, 2.0, 0.0, 0.0), *line(1.5, -1.0, 1.5, 1.0, np.pi)],
)
VIEW = View(0, 0.0, 0.0, Pose(), drawn({1: (0.0, 0.0), 2: (2.0, 0.0)}, {10: (1, 2, [])}), DOOR)


@pytest.mark.parametrize("slant", [0.0, 0.04, -0.04])
def test_it_leads_through_the_middle_of_a_door_that_was_grazed(slant: float) -> None:
    grazed = np.array([[1.5, -0.8], [0.5, -0.3], [0.1, slant], [0.0, slant], [-1.5, slant]])
    track = own_way(grazed, VIEW, [])
    x, y = resampled(track.polyline, 0.01).T
    assert np.abs(y[np.abs(x - 0.05) < 0.15]).max() < 0.02
    assert track.clearance.min() > 0.2
    assert track.polyline[-1] == pytest.approx((-1.5, slant), abs=0.01)


def test_where_there_is_room_it_is_as_it_was() -> None:
    driven = np.array([[-2.4, 1.0], [-1.0, 1.0], [-1.0, -1.0]])
    track = own_way(driven, VIEW, [])
    corner = np.hypot(*(track.polyline - driven[1]).T).min()
    assert corner < 0.03  # half a step
    assert track.length == pytest.approx(3.4, abs=0.05)


def test_it_keeps_off_virtual_walls() -> None:
    """Driven 10 cm beside one: it goes to the side where there is more room, by 17.5 cm at most."""
    wall = resampled(np.array([[-2.5, 0.5], [-0.5, 0.5]]), 0.1)
    view = replace(VIEW, virtual_walls=wall)
    _, y = own_way(np.array([[-2.2, 0.4], [-0.8, 0.4]]), view, []).polyline.T
    assert y == pytest.approx(np.full(len(y), 0.225), abs=0.02)


def test_it_ends_before_a_virtual_wall_that_was_driven_over() -> None:
    wall = resampled(np.array([[-1.5, -2.0], [-1.5, 2.0]]), 0.1)
    view = replace(VIEW, virtual_walls=wall)
    track = own_way(np.array([[-0.8, 0.4], [-2.2, 0.4]]), view, [])
    assert track.polyline[:, 0].min() > -1.5 + 0.1


def test_of_no_way_there_is_no_track() -> None:
    assert own_way(np.empty((0, 2)), VIEW, []).polyline.shape == (0, 2)
