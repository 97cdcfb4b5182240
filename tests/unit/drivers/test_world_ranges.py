"""Beams in the simulated world, against analytic rooms and against every square one by one."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose

FAN = np.deg2rad(np.linspace(-135.0, 135.0, 271))
TURN = np.linspace(-math.pi, math.pi, 361)


def every_square_tried(world: World, pose: Pose, bearings: Array) -> Array:
    """Nearest entry into any occupied square by the slab test, beam by square; inf if none."""
    rows, columns = np.nonzero(world.occupied)
    low = np.column_stack((columns, rows)) * world.resolution_m + world.origin
    directions = np.column_stack((np.cos(pose.theta + bearings), np.sin(pose.theta + bearings)))
    a = (low - pose.position)[None] / directions[:, None]
    b = (low + world.resolution_m - pose.position)[None] / directions[:, None]
    enters, leaves = np.minimum(a, b).max(axis=2), np.maximum(a, b).min(axis=2)
    hits = np.where((enters <= leaves) & (leaves > 0.0), enters, np.inf)
    return np.asarray(hits.min(axis=1, initial=np.inf))


def room(width: int, height: int) -> World:
    """A closed room whose walls are one square of 10 cm; inside it runs from (0, 0)."""
    occupied = np.ones((height + 2, width + 2), dtype=np.bool_)
    occupied[1:-1, 1:-1] = False
    return World(occupied, 0.1, (-0.1, -0.1))


def staircase_ring(radius: int) -> World:
    """A diamond of squares that touch only at their corners, closed around the origin."""
    occupied = np.zeros((2 * radius + 1, 2 * radius + 1), dtype=np.bool_)
    for k in range(-radius, radius + 1):
        for side in (-1, 1):
            occupied[radius + side * (radius - abs(k)), radius + k] = True
    edge = -(radius + 0.5) * 0.1
    return World(occupied, 0.1, (edge, edge))


@pytest.mark.parametrize("theta", [0.0, 0.3, math.pi / 2, -2.5, math.pi])
def test_a_rectangular_room_gives_the_ranges_of_its_four_walls(theta: float) -> None:
    x, y, width, height = 2.03, 1.37, 7.0, 3.0
    ranges = room(70, 30).cast(Pose(x, y, theta), FAN, 100.0)
    c, s = np.cos(FAN + theta), np.sin(FAN + theta)
    with np.errstate(divide="ignore"):
        to_side = np.where(c > 0, width - x, x) / np.abs(c)
        to_end = np.where(s > 0, height - y, y) / np.abs(s)
    np.testing.assert_allclose(ranges, np.minimum(to_side, to_end), rtol=1e-9)


@given(
    seed=st.integers(0, 10**6),
    density=st.floats(0.01, 0.4),
    resolution=st.sampled_from([0.02, 0.05, 0.112]),
)
def test_any_bitmap_gives_the_nearest_square_of_each_beam(
    seed: int, density: float, resolution: float
) -> None:
    rng = np.random.default_rng(seed)
    world = World(rng.random((24, 31)) < density, resolution, (-3.0, 7.0))
    x0, y0, x1, y1 = world.extent
    x, y, theta = rng.uniform((x0 - 0.3, y0 - 0.3, -10.0), (x1 + 0.3, y1 + 0.3, 10.0))
    bearings = np.sort(rng.uniform(-math.pi, math.pi, 90))
    pose = Pose(x, y, theta)
    expected = np.maximum(every_square_tried(world, pose, bearings), 0.0)
    np.testing.assert_allclose(world.cast(pose, bearings, 50.0), expected, atol=1e-9)


@pytest.mark.parametrize("radius", [3, 7, 40])
def test_no_beam_slips_between_squares_that_touch_at_a_corner(radius: int) -> None:
    world = staircase_ring(radius)
    corners = [
        (sx * 0.1 * (k + 0.5), sy * 0.1 * (radius - k - 0.5))
        for k in range(radius)
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    at_corners = np.sort([math.atan2(y, x) for x, y in corners])
    between = np.linspace(-math.pi, math.pi, 5000)
    for bearings in (at_corners, between):
        assert world.cast(Pose(), bearings, 100.0).max() < 0.1 * (radius + 1)


@pytest.mark.parametrize("offset", [1e-9, 1e-7, 1e-4])
def test_beams_that_graze_a_long_wall_stay_true(offset: float) -> None:
    world, slopes = room(400, 20), np.array([-1e-2, -1e-3, -1e-4, 1e-4, 1e-3, 1e-2])
    ranges = world.cast(Pose(0.5, 1.0 - offset, 0.0), slopes, 100.0)
    low = np.minimum(39.5, (1.0 - offset) / np.abs(slopes))
    high = np.minimum(39.5, (1.0 + offset) / slopes.clip(1e-300))
    np.testing.assert_allclose(ranges, np.where(slopes < 0, low, high), rtol=1e-4)


@pytest.mark.parametrize("aside", [-0.005, 0.005])
def test_a_moved_beam_along_a_square_ends_on_it(aside: float) -> None:
    square = World(np.ones((1, 1), dtype=np.bool_), 0.1, (2.0, -0.1))
    a_millimetre_above, moved = Pose(0.0, 0.001, 0.0), np.array([[0.0, aside]])
    bearing = np.array([-0.001 / 2.05])  # from there, to the middle of its upper side
    (metres,) = square.cast(a_millimetre_above, bearing, 30.0, moved)
    assert 1.99 < metres < 2.11


@given(seed=st.integers(0, 10**6), density=st.floats(0.01, 0.4))
def test_moved_beams_end_as_near_to_a_wall_as_they_are_moved(seed: int, density: float) -> None:
    rng = np.random.default_rng(seed)
    world = World(rng.random((24, 31)) < density, 0.05)
    x, y, theta = rng.uniform((0.0, 0.0, -10.0), (1.55, 1.2, 10.0))
    moved = rng.uniform(-0.005, 0.005, (len(FAN), 2))
    ranges = world.cast(Pose(x, y, theta), FAN, 50.0, moved)
    seen = np.isfinite(ranges) & (ranges > 0.02)  # nearer, the beam may begin in the wall
    directions = np.column_stack((np.cos(theta + FAN), np.sin(theta + FAN)))
    ends = np.array([x, y]) + moved + ranges[:, None] * directions
    for end_x, end_y in ends[seen].tolist():
        assert len(world.wall_offsets(end_x, end_y, 0.008))


def test_turning_the_sensor_one_way_is_turning_its_beams_the_other() -> None:
    world, turn = room(53, 41), 0.7
    turned = world.cast(Pose(1.0, 2.0, turn), FAN, 100.0)
    np.testing.assert_allclose(turned, world.cast(Pose(1.0, 2.0, 0.0), FAN + turn, 100.0))


def test_a_whole_turn_of_beams_begins_and_ends_alike() -> None:
    ranges = room(53, 41).cast(Pose(1.23, 2.34, 0.4), TURN, 100.0)
    assert np.isfinite(ranges).all()
    assert ranges[0] == pytest.approx(ranges[-1])


def test_nothing_is_seen_beyond_the_greatest_range() -> None:
    bearings = np.array([0.0, 0.6, 1.0, math.pi / 2])
    ranges = room(70, 30).cast(Pose(1.0, 1.5, 0.0), bearings, 2.0)
    np.testing.assert_allclose(ranges, [np.inf, np.inf, 1.5 / math.sin(1.0), 1.5])


def test_a_world_without_walls_returns_nothing() -> None:
    empty = World(np.zeros((10, 10), dtype=np.bool_), 0.1)
    assert np.isinf(empty.cast(Pose(0.5, 0.5, 0.0), FAN, 30.0)).all()


def test_walls_are_seen_from_outside_the_bitmap() -> None:
    world = room(10, 10)
    assert world.cast(Pose(-2.1, 0.5, 0.0), np.zeros(1), 30.0)[0] == pytest.approx(2.0)


def test_a_sensor_inside_a_wall_sees_nothing_but_the_wall() -> None:
    assert (room(10, 10).cast(Pose(-0.05, 0.5, 0.0), FAN, 30.0) == 0.0).all()


@pytest.mark.parametrize("bearings", [np.array([0.1, 0.0]), np.array([-3.2, 3.2])])
def test_a_fan_that_descends_or_overlaps_itself_is_refused(bearings: Array) -> None:
    with pytest.raises(ValueError, match="ascend"):
        room(10, 10).cast(Pose(0.5, 0.5, 0.0), bearings, 30.0)
