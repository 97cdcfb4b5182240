"""From the middle of a room to the nearest edge that no wall keeps the robot from."""

from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.exploration.access import (
    access,
    bent_way,
    straight_way,
    way_into_the_open,
    way_to_edge,
)
from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.views import View
from gvgbot.geometry import Pose
from tests.unit.autonomy.local_graphs import Point, drawn
from tests.unit.autonomy.sights import LASER_270, Rectangle, carved, looked

ROOM_AND_CORRIDOR = carved([(-4.0, -2.0, 4.0, 2.0), (-4.0, -4.0, 4.0, -2.2)])
NEAR: dict[int, tuple[int, int, list[Point]]] = {10: (1, 2, []), 11: (3, 4, [])}
HERE = Pose(0.0, -1.2, 0.0)


def view_of(gvg: LocalGvg) -> View:
    """What is seen of the room from within; the corridor behind its wall is not."""
    return View(0, 0.0, 0.0, HERE, gvg, looked(ROOM_AND_CORRIDOR, [HERE]))


def test_the_edge_behind_a_wall_is_not_the_way_although_it_is_nearer() -> None:
    corridor = {1: (-3.0, -3.1), 2: (3.0, -3.1)}  # 1.9 m away, the room's middle 2.4 m
    gvg = drawn(corridor | {3: (-2.0, 1.2), 4: (2.0, 1.2)}, NEAR)
    way = way_to_edge(view_of(gvg))
    assert way is not None
    line, room = way
    assert line[0] == pytest.approx(HERE.position)
    assert line[-1] == pytest.approx((0.0, 1.2), abs=0.06)
    assert room[0] == pytest.approx(0.8, abs=0.05)
    assert np.all(room > 0.7)


def test_who_is_near_an_edge_behind_a_wall_goes_to_one_that_is_farther_off() -> None:
    """Ahead the guard would stop it, however often it tried."""
    corridor = {1: (-3.0, -3.1), 2: (3.0, -3.1)}  # 1.45 m away, the room's middle 2.85 m
    gvg = drawn(corridor | {3: (-2.0, 1.2), 4: (2.0, 1.2)}, NEAR)
    here = Pose(0.0, -1.65, -np.pi / 2)
    walls = looked(ROOM_AND_CORRIDOR, [here])
    found = access(View(0, 0.0, 0.0, here, gvg, walls))
    assert found is not None
    assert found.place.distance == pytest.approx(2.85, abs=0.06)
    assert found.line[-1] == pytest.approx((0.0, 1.2), abs=0.06)
    corridor_alone = drawn(corridor, {10: (1, 2, [])})
    stands = access(View(0, 0.0, 0.0, here, corridor_alone, walls))
    assert stands is not None
    assert stands.place.distance == pytest.approx(1.45)


def test_a_virtual_wall_is_before_an_edge_as_well() -> None:
    gvg = drawn({1: (-3.0, 1.2), 2: (3.0, 1.2)}, {10: (1, 2, [])})
    view = view_of(gvg)
    assert way_to_edge(view) is not None
    across = np.stack([np.linspace(-4.0, 4.0, 81), np.full(81, 0.5)], axis=1)
    assert way_to_edge(replace(view, virtual_walls=across)) is None
    aside = np.array([[0.5, 0.0]])
    way = way_to_edge(replace(view, virtual_walls=aside))
    assert way is not None
    assert way[1].min() == pytest.approx(0.5, abs=0.05)


def test_with_walls_before_every_edge_there_is_no_way() -> None:
    gvg = drawn({1: (-3.0, -3.1), 2: (3.0, -3.1)}, {10: (1, 2, [])})
    assert way_to_edge(view_of(gvg)) is None


@pytest.mark.parametrize("has_turned", [False, True])
def test_no_straight_way_leads_over_floor_that_nobody_has_seen(*, has_turned: bool) -> None:
    """Behind a laser that sees three quarters of all directions there may be anything."""
    looks = [HERE, Pose(HERE.x, HERE.y, np.pi)][: 1 + has_turned]
    walls = looked(ROOM_AND_CORRIDOR, looks, field_of_view=LASER_270)
    view = View(0, 0.0, 0.0, HERE, LocalGvg(), walls)
    assert straight_way(view, np.array([2.0, -1.2]), 0.35) is not None
    assert (straight_way(view, np.array([-2.0, -1.2]), 0.35) is not None) == has_turned


@pytest.mark.parametrize("heading", [1.4, -0.7])
def test_out_of_a_slot_there_is_a_way_whichever_way_one_looks(heading: float) -> None:
    """One of 43 cm, narrower than an edge may be, whose mouth is a metre away."""
    here = Pose(0.0, 0.0, heading)
    slot = carved([(-0.215, -0.3, 0.215, 1.0), (-3.0, 1.0, 3.0, 2.6)])
    gvg = drawn({1: (-2.0, 9.0), 2: (2.0, 9.0)}, {10: (1, 2, [])})
    way = way_into_the_open(View(0, 0.0, 0.0, here, gvg, looked(slot, [here])), [])
    assert way is not None
    line, room = way
    assert line[-1, 1] > 1.0
    assert room.min() > 0.19


def test_a_robot_whose_laser_is_at_its_front_leaves_a_slot() -> None:
    """Of where its middle is, nothing was seen: it is 1.2 m across and has not moved yet."""
    here, front = Pose(), Pose(0.47, 0.0, 0.0)
    slot = carved([(-0.7, -0.63, 1.7, 0.63), (1.7, -4.0, 6.0, 4.0)])
    view = View(
        0,
        0.0,
        0.0,
        here,
        LocalGvg(),
        looked(slot, [front], field_of_view=LASER_270),
        robot_radius=0.6,
    )
    assert not view.local_map.known(np.zeros((1, 2))).any()
    way = way_into_the_open(view, [])
    assert way is not None
    assert way[1].min() > 0.6


def test_who_has_come_between_things_gets_out_to_another_point_of_the_edge() -> None:
    """Before the nearest point is a wall; beside its end there is as much room as on errands."""
    hall, wall, end = (-3.5, -0.8, 3.6, 2.8), (-3.5, 0.6, 0.4, 0.8), (3.0, 2.0)
    walls = looked(carved([hall], [wall]), [Pose(), Pose(*end)])
    gvg = drawn({1: (-3.0, 2.0), 2: end}, {10: (1, 2, [])})
    way = way_to_edge(View(0, 0.0, 0.0, Pose(), gvg, walls))
    assert way is not None
    x, y = way[0][-1]
    assert 2.4 < x <= 3.0  # farther to the left the wall's end is 0.2 m away
    assert y == pytest.approx(2.0)


def test_on_an_edge_there_is_no_way_to_go() -> None:
    gvg = drawn({1: (-2.0, -1.1), 2: (2.0, -1.1)}, {10: (1, 2, [])})
    found = access(view_of(gvg))
    assert found is not None
    assert found.place.distance == pytest.approx(0.1, abs=0.03)
    assert len(found.line) == len(found.room) == 0


def test_the_robot_is_not_on_an_edge_behind_a_wall_although_that_is_nearer() -> None:
    """The wall from y = -2.2 to -2.0 is between: 1.3 m and 1.4 m away."""
    here = Pose(0.0, -1.6, 0.0)
    gvg = drawn({1: (-3.0, -2.9), 2: (3.0, -2.9), 3: (-2.0, -0.2), 4: (2.0, -0.2)}, NEAR)
    found = access(View(0, 0.0, 0.0, here, gvg, looked(ROOM_AND_CORRIDOR, [here])))
    assert found is not None
    assert found.place.edge == 11
    assert found.line[0] == pytest.approx(here.position)
    assert found.line[0][1] < found.line[-1][1] == pytest.approx(-0.2, abs=0.16)


def test_who_would_scrape_along_a_post_drives_away_from_it_to_another_edge() -> None:
    """Straight ahead, 0.85 m off, is the nearest edge, and a post of 10 cm to the right of the way.

    The other one is the parabola between the post and the wall at y = 2.
    """
    room = carved([(-4.0, -2.0, 4.0, 2.0)], [(0.10, -0.26, 0.20, -0.16)])
    along = np.linspace(-2.0, 0.6, 20)
    parabola = [(float(x), float(0.92 - (x - 0.14) ** 2 / 4.32)) for x in along]
    points = {1: (0.85, -1.5), 2: (0.85, 0.6), 3: parabola[0], 4: parabola[-1]}
    gvg = drawn(points, {10: (1, 2, []), 11: (3, 4, parabola[1:-1])})
    here = Pose(0.0, 0.0, 0.0)
    local_map = looked(room, [here, Pose(0.0, 0.5, 0.0)])
    found = access(View(0, 0.0, 0.0, here, gvg, local_map))
    assert found is not None
    assert found.place.edge == 11
    dx, dy = found.line[1] - found.line[0]
    assert np.degrees(np.arctan2(dy, dx)) == pytest.approx(180.0 - 58.0, abs=20.0)
    assert np.all(np.diff(found.room) > 0.0)
    assert found.room[-1] > 0.7


def test_between_two_posts_it_is_not_the_nearest_edge_but_one_that_the_robot_fits_to() -> None:
    """The nearest edge is behind the right post; straight to the other it would scrape the left."""
    room = carved(
        [(-4.0, -4.0, 4.0, 2.0)], [(-0.25, -0.025, -0.2, 0.025), (0.2, -0.025, 0.25, 0.025)]
    )
    points = {1: (0.6, -0.5), 2: (0.6, 0.5), 3: (-0.9, 0.3), 4: (-0.25, -1.1)}
    here = Pose(0.0, -0.1, 0.0)
    local_map = looked(room, [here, Pose(0.0, 0.4, 0.0)])
    found = access(View(0, 0.0, 0.0, here, drawn(points, NEAR), local_map))
    assert found is not None
    assert found.place.edge == 11
    assert np.all(found.room > 0.19)  # 0.15 m on the shortest way


@pytest.mark.parametrize("gap", [0.6, 0.3])
def test_a_door_beside_the_robot_is_entered_from_before_it_if_it_is_wide_enough(gap: float) -> None:
    """The wall is from y = 2 to 2.2; straight on, the way would pass a jamb too close."""
    rooms: list[Rectangle] = [(-4.0, -2.0, 4.0, 2.0), (-4.0, 2.2, 4.0, 6.0)]
    world = carved([*rooms, (-gap / 2, 2.0, gap / 2, 2.2)])
    here, goal, least = Pose(-1.4, 0.5, 0.0), np.array([0.0, 2.6]), 0.24
    gvg = drawn({1: (-3.0, 0.5), 2: (3.0, 0.5)}, {10: (1, 2, [])})
    view = View(0, 0.0, 0.0, here, gvg, looked(world, [Pose(), here]))
    assert straight_way(view, goal, least) is None
    way = bent_way(view, goal, least)
    assert (way is not None) == (gap / 2 > least)
    if way is not None:
        line, room = way
        np.testing.assert_allclose(line[[0, -1]], [here.position, goal])
        assert np.hypot(*np.diff(line, axis=0).T).sum() < 1.4 + 2.1  # at right angles
        assert room.min() >= least
        jambs = np.array([(side * gap / 2, y) for side in (-1, 1) for y in (2.0, 2.2)])
        assert min(np.hypot(*(jambs - point).T).min() for point in line) > least - 0.03
