"""The local GVG of worlds whose Voronoi diagram follows from school geometry."""

import math

import numpy as np
import pytest

from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose
from tests.unit.autonomy.sights import (
    LASER_270,
    RADIUS,
    Rectangle,
    all_points,
    carved,
    endpoints,
    line,
    looked,
    meetpoints,
    seen,
)

NOISE = 0.01  # m, of the laser
FREE_OF_NOISE, NOISY = 0.05, 0.1  # m from where geometry says


def is_near(points: Array, wanted: list[tuple[float, float]], tolerance: float) -> bool:
    """Whether the points are the wanted ones in some order."""
    if len(points) != len(wanted):
        return False
    gaps = np.hypot(*(points[:, None] - np.array(wanted).reshape(-1, 1, 2).swapaxes(0, 1)).T)
    return bool((gaps.min(axis=0) < tolerance).all() and (gaps.min(axis=1) < tolerance).all())


def nearest(gvg: LocalGvg, point: tuple[float, float]) -> tuple[float, float]:
    """Metres from a point to the graph, and the clearance that the graph has there."""
    place = gvg.place(np.array(point))
    assert place is not None
    edge = gvg.edges[place.edge]
    return place.distance, float(np.interp(place.station, edge.stations, edge.clearance))


# -- corridor -------------------------------------------------------------------------------------


@pytest.mark.parametrize("width", [0.8, 1.4, 2.0, 3.0])
@pytest.mark.parametrize("beside", [0.0, 0.15, -0.15])
def test_the_edge_of_a_corridor_is_its_centre_line(width: float, beside: float) -> None:
    world = carved([(-8.0, -width / 2, 8.0, width / 2)])
    gvg = seen(looked(world, [Pose(0.0, beside, 0.0)]), (0.0, beside))
    for x in (-2.0, 0.0, 2.0):
        distance, clearance = nearest(gvg, (x, 0.0))
        assert distance < 0.06  # points of an edge are a decimetre apart
        assert clearance == pytest.approx(width / 2, abs=0.03)
    inside = all_points(gvg)[np.abs(all_points(gvg)[:, 0]) < 3.0]
    assert np.abs(inside[:, 1]).max() < 0.03


def test_noise_bends_the_centre_line_by_less_than_it_is_itself_after_a_few_scans() -> None:
    world = carved([(-8.0, -1.0, 8.0, 1.0)])
    rng = np.random.default_rng(1)
    local_map = looked(world, line(-1.0, 0.2, 1.0, 0.2, 0.0, 9), sigma=NOISE, rng=rng)
    points = all_points(seen(local_map, (1.0, 0.0)))
    inside = points[np.abs(points[:, 0]) < 2.0]
    assert len(inside) > 20
    assert np.sqrt(np.mean(inside[:, 1] ** 2)) < NOISE
    assert not len(meetpoints(seen(local_map, (1.0, 0.0))))


def test_a_corridor_narrower_than_the_robot_is_no_edge() -> None:
    world = carved([(-8.0, -0.9 * RADIUS, 8.0, 0.9 * RADIUS)])
    local_map = looked(world, line(-2.0, 0.0, 2.0, 0.0, 0.0))
    edges = seen(local_map, (0.0, 0.0)).edges.values()
    assert max((edge.length for edge in edges), default=0.0) < 0.01


# -- junctions ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("across", "down"), [(2.0, 2.0), (2.0, 1.4), (1.6, 2.4), (2.4, 0.8)])
@pytest.mark.parametrize("noisy", [False, True])
def test_a_t_junction_meets_where_the_wall_is_as_far_as_both_corners(
    across: float, down: float, noisy: bool
) -> None:
    """Wall at y = a/2, corners at (-+b/2, -a/2): (a/2 - y)^2 = (b/2)^2 + (y + a/2)^2."""
    y = -(down**2) / (8 * across)
    world = carved([(-6.0, -across / 2, 6.0, across / 2), (-down / 2, -6.0, down / 2, across / 2)])
    rng = np.random.default_rng(2) if noisy else None
    gvg = seen(looked(world, line(-3.0, 0.0, 0.0, y, 0.0), sigma=NOISE, rng=rng), (0.0, y))
    tolerance = NOISY if noisy else FREE_OF_NOISE
    near = meetpoints(gvg)
    assert is_near(near[np.hypot(*near.T) < 5.0], [(0.0, y)], tolerance)
    node = next(n for n in gvg.nodes.values() if n.is_meetpoint and np.hypot(*n.position) < 5.0)
    assert node.degree == 3
    assert node.clearance == pytest.approx(across / 2 - y, abs=tolerance)
    bearings = sorted(gvg.bearing(branch, node.clearance) for branch in node.branches)
    straight = math.atan2(-y, max(0.5, 0.9 * node.clearance))  # the arms rise to the centre line
    assert bearings[0] == pytest.approx(-math.pi / 2, abs=0.1)
    assert -0.1 < bearings[1] < straight + 0.1
    assert math.pi - straight - 0.1 < abs(bearings[2]) <= math.pi


@pytest.mark.parametrize("width", [1.2, 2.0])
@pytest.mark.parametrize("noisy", [False, True])
def test_a_crossing_meets_once_in_its_middle_with_four_departures(
    width: float, noisy: bool
) -> None:
    half = width / 2
    world = carved([(-7.0, -half, 7.0, half), (-half, -7.0, half, 7.0)])
    rng = np.random.default_rng(3) if noisy else None
    path = line(-3.0, 0.0, 0.0, 0.0, 0.0, 7)
    gvg = seen(looked(world, path, sigma=NOISE, rng=rng), (0.0, 0.0))
    assert is_near(meetpoints(gvg), [(0.0, 0.0)], NOISY if noisy else FREE_OF_NOISE)
    (node,) = (n for n in gvg.nodes.values() if n.is_meetpoint)
    assert node.degree == 4
    assert node.clearance == pytest.approx(math.sqrt(2) * half, abs=0.06)
    for branch in node.branches:
        quarter = gvg.bearing(branch, node.clearance) / (math.pi / 2)
        assert abs(quarter - round(quarter)) < 0.1


def test_a_junction_of_three_equal_corridors_at_any_angle_is_found_where_it_is() -> None:
    """The same crossing seen from a frame that is turned and shifted is the crossing there."""
    world = carved([(-7.0, -1.0, 7.0, 1.0), (-1.0, -7.0, 1.0, 1.0)])
    path = line(-3.0, 0.0, 0.0, 0.0, 0.0)
    for angle in (0.3, 0.785, 1.2, 2.5, -2.0):
        local_world = Pose(1.0, -2.0, angle)
        local_map = looked(world, path, local_world=local_world)
        found = meetpoints(seen(local_map, (1.0, -2.0)))
        expected = local_world.transform(np.array([[0.0, -0.25]]))
        assert found == pytest.approx(expected, abs=NOISY)
        ends = endpoints(seen(local_map, (1.0, -2.0)))
        tips = local_world.transform(np.array([[-6.0, 0.0], [6.0, 0.0], [0.0, -6.0]]))
        assert is_near(ends, [(float(x), float(y)) for x, y in tips], NOISY)


def test_a_meetpoint_in_sight_stays_where_it_is_while_the_robot_comes_near() -> None:
    """Only what no unseen wall could change is shown, so nothing is ever taken back."""
    world = carved([(-7.0, -1.0, 7.0, 1.0), (-1.0, -7.0, 1.0, 7.0)])
    path = line(-6.0, 0.0, 0.0, 0.0, 0.0, 25)
    seen_before = 0
    for count in range(1, len(path) + 1):
        here = path[count - 1]
        gvg = seen(looked(world, path[:count], field_of_view=LASER_270), (here.x, here.y))
        found = meetpoints(gvg)
        assert len(found) in ((0, 1) if not seen_before else (1,))
        assert (np.hypot(*found.T) < NOISY).all()
        seen_before += len(found)
    assert seen_before >= 3


# -- ends -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("width", [0.8, 1.4, 2.0])
@pytest.mark.parametrize("noisy", [False, True])
def test_a_dead_end_stops_half_its_width_before_the_wall(width: float, noisy: bool) -> None:
    """The point equally far from the end and both sides; the corners beyond it are no branches."""
    world = carved([(-6.0, -width / 2, 3.0, width / 2)])
    rng = np.random.default_rng(4) if noisy else None
    gvg = seen(looked(world, line(-3.0, 0.0, 0.0, 0.0, 0.0), sigma=NOISE, rng=rng), (0.0, 0.0))
    ends = endpoints(gvg)
    ahead = ends[ends[:, 0] > 0.0]
    assert is_near(ahead, [(3.0 - width / 2, 0.0)], NOISY if noisy else FREE_OF_NOISE)
    assert not len(meetpoints(gvg))


@pytest.mark.parametrize("width", [1.0, 2.0])
def test_a_right_angled_bend_is_no_vertex(width: float) -> None:
    half = width / 2
    world = carved([(-6.0, -half, half, half), (-half, -6.0, half, half)])
    path = [*line(-4.0, 0.0, 0.0, 0.0, 0.0), *line(0.0, -1.0, 0.0, -4.0, -math.pi / 2)]
    gvg = seen(looked(world, path), (0.0, 0.0))
    assert not len(meetpoints(gvg))
    tips = [(-6.0 + half, 0.0), (0.0, -6.0 + half)]
    assert is_near(endpoints(gvg), tips, FREE_OF_NOISE)
    assert len(gvg.edges) == 1


@pytest.mark.parametrize(("width", "depth"), [(0.8, 0.3), (1.2, 0.5), (2.0, 0.4)])
def test_an_alcove_less_deep_than_the_clearance_before_it_is_no_branch(
    width: float, depth: float
) -> None:
    world = carved([(-6.0, -1.0, 6.0, 1.0), (-width / 2, -1.0 - depth, width / 2, 1.0)])
    gvg = seen(looked(world, line(-2.0, 0.0, 2.0, 0.0, 0.0)), (0.0, 0.0))
    assert not len(meetpoints(gvg))


def test_a_recess_much_deeper_than_the_clearance_before_it_is_a_dead_end() -> None:
    world = carved([(-6.0, -1.0, 6.0, 1.0), (-0.6, -4.0, 0.6, 1.0)])
    gvg = seen(looked(world, line(-2.0, 0.0, 2.0, 0.0, 0.0)), (0.0, 0.0))
    assert is_near(meetpoints(gvg), [(0.0, -(1.2**2) / 16)], NOISY)
    ends = endpoints(gvg)
    assert is_near(ends[ends[:, 1] < -1.0], [(0.0, -3.4)], NOISY)


def beside_recess(back: float, *furniture: Rectangle) -> LocalGvg:
    """The GVG of a corridor and a recess of 2.36 m up to y = `back`, as seen from the corridor."""
    world = carved([(-6.0, -0.8, 6.0, 0.8), (-1.18, back, 1.18, 0.8)], furniture)
    return seen(looked(world, line(-2.0, 0.0, 2.0, 0.0, 0.0)), (0.0, 0.0))


@pytest.mark.parametrize("with_desk", [False, True])
def test_a_recess_is_as_deep_with_a_desk_in_its_corner(with_desk: bool) -> None:
    """Up to (0, -1.62), as far from its sides as from its back; or as from the desk before it."""
    gvg = beside_recess(-2.8, *([(-1.18, -2.8, -0.38, -2.2)] if with_desk else []))
    assert is_near(meetpoints(gvg), [(0.0, -(2.36**2) / (8 * 1.6))], NOISY)
    (end,) = (tip for tip in endpoints(gvg) if tip[1] < -0.9)
    if with_desk:
        side, front = 1.18, -2.2  # its corner is at x = -0.38
        assert end == pytest.approx([0.0, front + math.sqrt(side**2 - 0.38**2)], abs=NOISY)
    else:
        assert end == pytest.approx([0.0, -2.8 + 1.18], abs=NOISY)


def test_a_recess_goes_on_beside_a_desk_where_a_robot_fits_in() -> None:
    """Its end is as far from the desk's side as from its own side and back."""
    gvg = beside_recess(-3.16, (-1.18, -3.16, -0.38, -2.36))
    (end,) = (tip for tip in endpoints(gvg) if tip[1] < -0.9)
    middle, half = (-0.38 + 1.18) / 2, (1.18 - -0.38) / 2
    assert end == pytest.approx([middle, -3.16 + half], abs=NOISY)


@pytest.mark.parametrize("with_box", [False, True])
def test_a_box_in_its_corner_makes_a_recess_no_deeper(with_box: bool) -> None:
    """It is hardly deeper than wide: no more than a wide place of the corridor."""
    gvg = beside_recess(-2.45, *([(-1.18, -2.45, -0.94, -2.21)] if with_box else []))
    assert not any(tip[1] < -0.9 for tip in endpoints(gvg))
    assert len(meetpoints(gvg)) == 0


# -- doors ----------------------------------------------------------------------------------------


def two_halves(door: float) -> World:
    """A corridor along x, divided at x = 4 by a wall with a door in its middle."""
    walls = [(4.0, -1.0, 4.2, -door / 2), (4.0, door / 2, 4.2, 1.0)]
    return carved([(-3.0, -1.0, 9.0, 1.0)], walls)


@pytest.mark.parametrize("door", [0.2, 0.36])
def test_a_door_narrower_than_the_robot_is_no_edge(door: float) -> None:
    gvg = seen(looked(two_halves(door), line(0.0, 0.0, 3.4, 0.0, 0.0)), (3.0, 0.0))
    assert all_points(gvg)[:, 0].max() < 4.0
    assert not len(meetpoints(gvg))


@pytest.mark.parametrize("door", [0.6, 0.9, 1.2])
def test_a_door_wider_than_the_robot_is_passed_in_its_middle(door: float) -> None:
    path = line(0.0, 0.0, 6.0, 0.0, 0.0, 13)
    gvg = seen(looked(two_halves(door), path), (3.0, 0.0))
    distance, clearance = nearest(gvg, (4.1, 0.0))
    assert distance < 0.06
    assert clearance == pytest.approx(door / 2, abs=0.06)
    assert all_points(gvg)[:, 0].max() > 6.0


# -- a pillar -------------------------------------------------------------------------------------


def test_a_square_pillar_in_a_square_room_is_gone_round_on_a_ring_without_a_vertex() -> None:
    world = carved([(-4.0, -4.0, 4.0, 4.0)], [(-1.0, -1.0, 1.0, 1.0)])
    around = [
        Pose(2.5 * math.cos(a), 2.5 * math.sin(a), a + math.pi / 2) for a in np.arange(12) * 0.53
    ]
    gvg = seen(looked(world, around), (2.5, 0.0))
    assert not len(meetpoints(gvg))
    assert not len(endpoints(gvg))
    (ring,) = gvg.edges.values()
    assert ring.a == ring.b
    turn = np.diff(np.unwrap(np.arctan2(ring.polyline[:, 1], ring.polyline[:, 0]))).sum()
    assert abs(turn) == pytest.approx(math.tau, abs=0.1)
    for side in ((2.5, 0.0), (0.0, 2.5), (-2.5, 0.0), (0.0, -2.5)):
        distance, clearance = nearest(gvg, side)
        assert distance < 0.06
        assert clearance == pytest.approx(1.5, abs=0.03)


def test_a_pillar_in_a_corridor_makes_two_meetpoints_as_far_from_it_as_from_the_walls() -> None:
    """A square pillar of side 2s on the centre line x = 0 of a corridor of half-width h: the point
    (x, 0) is x - s from the pillar's face and h from the walls.
    """
    world = carved([(-7.0, -2.0, 7.0, 2.0)], [(-0.6, -0.6, 0.6, 0.6)])
    path = [*line(-4.0, 0.0, -2.6, 0.0, 0.0), *line(-1.5, 1.3, 1.5, 1.3, 0.0)]
    path += [*line(2.6, 0.0, 3.0, 0.0, math.pi), *line(1.5, -1.3, -1.5, -1.3, math.pi)]
    gvg = seen(looked(world, path), (-2.6, 0.0))
    assert is_near(meetpoints(gvg), [(-2.6, 0.0), (2.6, 0.0)], NOISY)
