"""The local map against the walls that the scans were cast at."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gvgbot.autonomy.gvg.beams import without_mixed_pixels
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan
from tests.unit.autonomy.sights import BEAMS, carved, line, looked, sweep

ROOM = carved([(-3.0, -2.0, 3.0, 2.0)])
ORIGIN = Pose()


def cells_of(x0: float, y0: float, x1: float, y1: float) -> Array:
    """The centres (N, 2) of the cells of a rectangle."""
    x, y = np.meshgrid(np.arange(x0, x1, 0.1) + 0.05, np.arange(y0, y1, 0.1) + 0.05)
    return np.stack([x.ravel(), y.ravel()], axis=1)


def wall_points_near(local_map: LocalMap, x: float, y: float, reach: float = 0.3) -> int:
    return int((np.hypot(*(local_map.points() - [x, y]).T) < reach).sum())


def off_the_walls(points: Array) -> Array:
    """Metres (N,) from the nearest wall of the room."""
    return np.minimum(np.abs(np.abs(points[:, 0]) - 3.0), np.abs(np.abs(points[:, 1]) - 2.0))


# -- one scan -------------------------------------------------------------------------------------


def test_all_between_the_robot_and_the_walls_is_known() -> None:
    assert looked(ROOM, [ORIGIN]).known(cells_of(-2.9, -1.9, 2.8, 1.8)).all()


def test_nothing_behind_the_walls_is_known() -> None:
    local_map = looked(ROOM, [ORIGIN])
    for beyond in (cells_of(3.2, -2, 6, 2), cells_of(-6, -2, -3.3, 2), cells_of(-3, 2.2, 3, 6)):
        assert not local_map.known(beyond).any()


def test_nothing_outside_the_field_of_view_is_known() -> None:
    local_map = looked(ROOM, [Pose(0.0, 0.0, math.pi / 2)], field_of_view=math.pi)
    assert local_map.known(cells_of(-2.5, 0.3, 2.5, 1.8)).all()
    assert not local_map.known(cells_of(-2.5, -1.8, 2.5, -0.3)).any()


def test_what_a_pillar_hides_is_unknown() -> None:
    hidden = carved([(-3.0, -2.0, 3.0, 2.0)], [(1.0, -0.4, 1.2, 0.4)])
    local_map = looked(hidden, [ORIGIN])
    assert not local_map.known(cells_of(1.5, -0.3, 2.7, 0.3)).any()
    assert local_map.known(cells_of(1.5, 1.2, 2.7, 1.7)).all()


def test_where_somebody_stands_there_is_floor_and_a_wall_stays_a_wall() -> None:
    local_map = looked(ROOM, [ORIGIN])
    local_map.stand_on(np.array([0.0, 4.0]), 0.2, 0.0)
    local_map.stand_on(np.array([3.0, 0.0]), 0.3, 0.0)
    local_map.insert(sweep(ROOM, ORIGIN), ORIGIN, 0.0)
    assert local_map.known(np.array([0.0, 4.0]))
    assert not local_map.known(np.array([0.5, 4.0]))
    assert wall_points_near(local_map, 3.0, 0.0) > 3


def test_what_is_out_of_the_window_is_unknown() -> None:
    local_map = looked(ROOM, [ORIGIN], config=LocalMapConfig(half_width_m=3.0))
    assert not local_map.known(np.array([[50.0, 0.0], [0.0, -50.0], [1e6, 1e6]])).any()


@pytest.mark.parametrize("sigma", [0.0, 0.01])
def test_points_lie_on_the_walls_more_sharply_than_the_cells_are_large(sigma: float) -> None:
    rng = np.random.default_rng(1)
    points = looked(ROOM, line(-0.5, 0, 0.5, 0, 0.0, 9), sigma=sigma, rng=rng).points()
    off = off_the_walls(points)
    corner = (np.abs(points[:, 0]) > 2.85) & (np.abs(points[:, 1]) > 1.85)  # a cell of two walls
    assert off[~corner].max() < 0.02 + 2 * sigma
    assert off.max() < 0.06 + 2 * sigma


def test_walls_have_no_gap_where_beams_fall_less_than_the_bridge_apart() -> None:
    points = looked(ROOM, [ORIGIN]).points()
    for wall in (points[points[:, 1] > 1.95], points[points[:, 1] < -1.95]):
        x = np.sort(wall[:, 0])
        assert np.diff(x).max() < 0.2
        assert (x[0], x[-1]) == pytest.approx((-3.0, 3.0), abs=0.1)


# -- faults of the laser ----------------------------------------------------------------------


def with_faults(scan: Scan, faulty: list[int], value: float) -> Scan:
    ranges = scan.ranges.copy()
    ranges[faulty] = value
    return Scan(0.0, ranges, scan.angle_min, scan.angle_increment, 0.1, 30.0)


def after(scan: Scan) -> LocalMap:
    local_map = LocalMap(LocalMapConfig())
    local_map.insert(scan, ORIGIN, 0.0)
    return local_map


def test_a_single_dropout_hides_nothing() -> None:
    scan = sweep(ROOM, ORIGIN)
    faulty = after(with_faults(scan, list(range(5, 1080, 7)), math.nan))
    assert faulty.known(cells_of(-2.9, -1.9, 2.8, 1.8)).all()
    assert off_the_walls(faulty.points()).max() < 0.1


def test_a_dropout_beside_an_edge_makes_what_is_nearer_no_wider() -> None:
    """A block 7 m ahead and up to 0.4 m aside; past it a beam fails, where it would be 0.41 m."""
    block = carved([(-3.0, -2.0, 9.0, 2.0)], [(7.0, -0.4, 7.2, 0.4)])
    scan = sweep(block, ORIGIN)
    beside = int(np.flatnonzero(np.isclose(scan.ranges * scan.directions[:, 0], 7.0))[-1]) + 1
    points = after(with_faults(scan, [beside], math.nan)).points()
    aside = np.abs(points[np.abs(points[:, 0] - 7.0) < 0.1, 1])
    assert aside[aside < 1.0].max() < 0.4


def test_a_block_of_lost_beams_is_unknown_rather_than_free() -> None:
    lost = after(with_faults(sweep(ROOM, ORIGIN), list(range(480, 601)), math.nan))
    assert not lost.known(cells_of(1.0, -0.2, 2.8, 0.2)).any()
    assert lost.known(cells_of(-2.8, -0.2, -1.0, 0.2)).all()


def test_before_somebody_who_is_left_out_the_floor_is_free_and_behind_him_unknown() -> None:
    """A block of beams straight ahead, of which all is left out but that 1.5 m are free."""
    scan = sweep(ROOM, ORIGIN)
    ahead = list(range(480, 601))
    free = with_faults(scan, ahead, 1.5).ranges
    local_map = LocalMap(LocalMapConfig())
    local_map.insert(with_faults(scan, ahead, math.nan), ORIGIN, 0.0, free)
    assert local_map.known(cells_of(0.2, -0.1, 1.3, 0.1)).all()
    assert not local_map.known(cells_of(1.7, -0.2, 2.8, 0.2)).any()
    assert wall_points_near(local_map, 1.5, 0.0) == 0


def test_beams_that_hit_nothing_show_free_space_without_a_wall() -> None:
    empty = after(with_faults(sweep(ROOM, ORIGIN), list(range(1081)), math.inf))
    assert empty.known(cells_of(-5, -5, 5, 5)).all()
    assert len(empty.points()) == 0


def test_beams_that_hit_nothing_show_no_more_than_the_laser_can_see() -> None:
    local_map = after(sweep(ROOM, ORIGIN, reach=1.5))
    cells = cells_of(-3, -2, 3, 2)
    away = np.hypot(*cells.T)
    assert local_map.known(cells[away < 1.3]).all()
    assert not local_map.known(cells[away > 1.5]).any()


def test_walls_beyond_the_reach_of_the_laser_are_not_forgotten() -> None:
    local_map = looked(ROOM, [ORIGIN])
    for _ in range(20):
        local_map.insert(sweep(ROOM, ORIGIN, reach=1.5), ORIGIN, 0.0)
    assert wall_points_near(local_map, 0.0, 2.0) > 0


def test_the_scan_itself_is_left_as_it_was() -> None:
    scan = with_faults(sweep(ROOM, ORIGIN), [100, 300], math.nan)
    before = scan.ranges.copy()
    after(scan)
    assert np.array_equal(scan.ranges, before, equal_nan=True)


# -- many scans ----------------------------------------------------------------------


def test_a_wall_that_was_taken_away_is_forgotten_after_a_few_scans() -> None:
    furnished = carved([(-3.0, -2.0, 3.0, 2.0)], [(1.0, -0.4, 1.2, 0.4)])
    local_map = looked(furnished, [ORIGIN] * 10)
    assert wall_points_near(local_map, 1.0, 0.0) > 0
    for _ in range(8):
        local_map.insert(sweep(ROOM, ORIGIN), ORIGIN, 0.0)
    assert wall_points_near(local_map, 1.0, 0.0) == 0
    assert local_map.known(cells_of(1.5, -0.3, 2.7, 0.3)).all()


def test_a_wall_that_appears_is_there_after_one_scan() -> None:
    furnished = carved([(-3.0, -2.0, 3.0, 2.0)], [(1.0, -0.4, 1.2, 0.4)])
    local_map = looked(ROOM, [ORIGIN] * 10)
    local_map.insert(sweep(furnished, ORIGIN), ORIGIN, 0.0)
    assert wall_points_near(local_map, 1.0, 0.0) > 3


def test_when_walls_were_seen_is_told_by_the_looks_at_them() -> None:
    """Ten looks to the left, then four all around."""
    both = sweep(ROOM, ORIGIN)
    bearings = both.angle_min + both.angle_increment * np.arange(len(both.ranges))
    left = replace(both, ranges=np.where(bearings > 0.0, both.ranges, math.nan))
    local_map = LocalMap(LocalMapConfig())
    for look in range(14):
        local_map.insert(left if look < 10 else both, ORIGIN, 0.0)
    looks, x = local_map.looked_at(), local_map.points()
    assert local_map.looks == 14
    on_the_right = (x[:, 1] < -1.8) & (np.abs(x[:, 0]) < 1.0)
    on_the_left = (x[:, 1] > 1.8) & (np.abs(x[:, 0]) < 1.0)
    assert np.allclose(looks[on_the_right], np.mean(range(11, 15)))
    assert np.allclose(looks[on_the_left], np.mean(range(1, 15)), rtol=0.02)  # old hits fade
    spread = local_map.looks_spread()
    assert np.allclose(spread[on_the_right], np.var(range(11, 15)))
    assert np.allclose(spread[on_the_left], np.var(range(1, 15)), rtol=0.05)


def test_standing_walls_survive_a_hundred_noisy_scans_from_all_over_the_room() -> None:
    rng = np.random.default_rng(5)
    poses = [Pose(*rng.uniform((-2.5, -1.5, -3.0), (2.5, 1.5, 3.0))) for _ in range(100)]
    local_map = looked(ROOM, poses, sigma=0.01, rng=rng)
    for x in np.arange(-2.8, 2.9, 0.2):
        assert wall_points_near(local_map, x, 2.0, 0.15) > 0
        assert wall_points_near(local_map, x, -2.0, 0.15) > 0


def test_what_was_seen_too_many_metres_ago_is_forgotten() -> None:
    local_map = LocalMap(LocalMapConfig(memory_m=5.0))
    local_map.insert(sweep(ROOM, ORIGIN), ORIGIN, 0.0)
    blind = Scan(0.0, np.full(100, math.nan), -1.0, 0.02, 0.1, 30.0)
    local_map.insert(blind, ORIGIN, 4.9)
    assert local_map.known(np.zeros((1, 2))).all()
    local_map.insert(blind, ORIGIN, 5.1)
    assert not local_map.known(cells_of(-3, -2, 3, 2)).any()
    assert len(local_map.points()) == 0


def test_scrolling_loses_nothing_that_stays_in_the_window() -> None:
    """A small window that follows the robot agrees with a large one that need not scroll."""
    crossing = carved([(-8.0, -1.0, 8.0, 1.0), (-0.6, -4.0, 0.8, 4.0)])
    path = line(-2.0, 0.0, 2.0, 0.3, 0.0, 30)
    small = looked(crossing, path, config=LocalMapConfig(half_width_m=5.0))
    large = looked(crossing, path, config=LocalMapConfig(half_width_m=30.0))
    always_inside = cells_of(-2.0, -3.5, 2.0, 3.5)
    assert small.known(always_inside).any()
    assert np.array_equal(small.known(always_inside), large.known(always_inside))
    walls, same = (p[np.abs(p[:, 0]) < 1.9] for p in (small.points(), large.points()))
    assert len(walls) > 50
    assert np.allclose(walls, same)


@settings(max_examples=10)
@given(st.floats(-20, 20), st.floats(-20, 20), st.floats(-3.1, 3.1))
def test_the_frame_that_scans_are_inserted_in_changes_nothing_but_the_frame(
    x: float, y: float, theta: float
) -> None:
    local_world = Pose(x, y, theta)
    points = looked(ROOM, line(-1, 0, 1, 0, 0.0, 3), local_world=local_world).points()
    back = local_world.inverse().transform(points)
    off = off_the_walls(back)
    assert np.quantile(off, 0.95) < 0.02
    assert off.max() < 0.08


def test_a_wall_on_the_border_of_two_rows_of_cells_is_where_its_hits_are() -> None:
    """Both rows' means are off, by 6 mm and more; by their hits they make up the wall's place."""
    rng, local_map = np.random.default_rng(2), LocalMap(LocalMapConfig())
    wall = 2.003  # most hits fall into the farther row
    bearings = np.radians(np.linspace(-30.0, 30.0, 241))
    for _ in range(5):
        ranges = (wall + rng.normal(0.0, 0.01, len(bearings))) / np.cos(bearings)
        step = float(bearings[1] - bearings[0])
        local_map.insert(Scan(0.0, ranges, float(bearings[0]), step, 0.1, 30.0), Pose(), 0.0)
    x, hits = local_map.points()[:, 0], local_map.hits()
    assert abs(np.average(x, weights=hits) - wall) < 0.001
    assert np.abs(x - wall).max() < 0.006


# -- glass ----------------------------------------------------------------------------------------

PANE = (1.5, -1.0, 1.0)  # m: its x, and between which y


def through_glass(pose: Pose, rng: np.random.Generator) -> Scan:
    """A scan of the room in which one beam in thirty comes back from the pane."""
    scan = sweep(ROOM, pose)
    x, y = np.cos(scan.bearings), np.sin(scan.bearings)
    with np.errstate(divide="ignore", invalid="ignore"):
        to_pane = (PANE[0] - pose.x) / x
    at = pose.y + to_pane * y
    meets = (to_pane > 0.0) & (at > PANE[1]) & (at < PANE[2])
    echo = meets & (rng.random(len(x)) < 1 / 30)
    return replace(scan, ranges=np.where(echo, to_pane, scan.ranges))


def test_a_pane_stays_although_most_beams_pass_it() -> None:
    """The robot drives along it a metre away, and then looks on from farther off."""
    rng, local_map = np.random.default_rng(0), LocalMap(LocalMapConfig())
    poses = [Pose(0.5, y) for y in np.linspace(-1.5, 1.5, 13)] + [Pose(-1.0, 1.5)] * 10
    for travelled, pose in enumerate(poses):
        local_map.insert(through_glass(pose, rng), pose, 0.2 * travelled)
    for y in np.arange(PANE[1] + 0.15, PANE[2], 0.1):
        assert wall_points_near(local_map, PANE[0], y, reach=0.2) > 0
    assert len(local_map.suspects()) == 0


def test_a_pane_is_suspected_at_the_first_echoes() -> None:
    local_map = LocalMap(LocalMapConfig())
    local_map.insert(through_glass(ORIGIN, np.random.default_rng(1)), ORIGIN, 0.0)
    for _ in range(2):
        local_map.insert(sweep(ROOM, ORIGIN), ORIGIN, 0.0)
    suspects = local_map.suspects()
    assert len(suspects) > 0
    assert np.abs(suspects[:, 0] - PANE[0]).max() < 0.1


def test_a_few_false_echoes_are_forgiven() -> None:
    local_map = LocalMap(LocalMapConfig())
    local_map.insert(through_glass(ORIGIN, np.random.default_rng(1)), ORIGIN, 0.0)
    for _ in range(60):
        local_map.insert(sweep(ROOM, ORIGIN), ORIGIN, 0.0)
    assert len(local_map.suspects()) == 0
    assert wall_points_near(local_map, PANE[0], 0.0, reach=1.0) == 0


def test_hardly_anything_floats_behind_a_pane() -> None:
    """A beam in thirty comes back from the pane, and a third of those from anywhere behind it."""
    rng, local_map, floating = np.random.default_rng(0), LocalMap(LocalMapConfig()), 0
    for travelled, y in enumerate(np.repeat(np.linspace(-1.5, 1.5, 31), 3)):
        pose = Pose(0.5, y)
        true, scan = sweep(ROOM, pose), through_glass(pose, rng)
        floats = (scan.ranges < true.ranges) & (rng.random(len(scan.ranges)) < 1 / 3)
        share = rng.random(len(scan.ranges))
        mixed = scan.ranges + share * (true.ranges - scan.ranges)
        scan = replace(scan, ranges=np.where(floats, mixed, scan.ranges))
        local_map.insert(without_mixed_pixels(scan), pose, 0.03 * travelled)
        points = local_map.points()
        off_the_pane = np.abs(points[:, 0] - PANE[0])
        floating += int((np.minimum(off_the_walls(points), off_the_pane) > 0.35).sum())
    assert floating < 93  # one in each look
    assert wall_points_near(local_map, PANE[0], 0.0, reach=0.2) > 0


def test_what_was_taken_for_glass_goes_when_it_is_seen_through() -> None:
    local_map, wall = LocalMap(LocalMapConfig()), sweep(ROOM, ORIGIN)
    ranges = wall.ranges.copy()
    ranges[BEAMS // 2] = 1.5  # straight on, halfway to the wall
    for _ in range(4):
        local_map.insert(replace(wall, ranges=ranges), ORIGIN, 0.0)
    assert wall_points_near(local_map, 1.5, 0.0) > 0
    for _ in range(400):
        local_map.insert(wall, ORIGIN, 0.0)
    assert wall_points_near(local_map, 1.5, 0.0) == 0


def test_of_a_disc_that_leaves_the_window_nobody_knows_whether_it_is_bare() -> None:
    hall = carved([(-12.0, -12.0, 12.0, 12.0)])
    local_map = looked(hall, [ORIGIN], config=LocalMapConfig(half_width_m=5.0))
    assert local_map.is_bare(np.array([3.0, 0.0]), 1.5)
    assert not local_map.is_bare(np.array([4.0, 0.0]), 1.5)
