"""What the footprint would touch, checked by driving it there in small steps."""

import math
from math import inf, pi
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gvgbot.geometry import Array, Pose, Twist
from gvgbot.hal.messages import Odometry, Scan
from gvgbot.hal.sweep import (
    evened,
    free_distance,
    has_sight,
    obstacle_points,
    pose_at,
    seen_from,
)

RADIUS = 0.2


def way(points: list[tuple[float, float]], twist: Twist, margin: float = 0.0) -> float:
    array = np.array(points, dtype=float).reshape(-1, 2)
    return free_distance((array[:, 0], array[:, 1]), twist, radius=RADIUS, margin=margin)


def driven_until_touch(x: float, y: float, twist: Twist, furthest: float, radius: float) -> float:
    """The same by brute force: the distance at which a disc on the arc first covers the point."""
    along = np.linspace(0.0, furthest, 20_001)
    sign = math.copysign(1.0, twist.linear)
    curvature = twist.angular / abs(twist.linear)
    heading = curvature * along
    step = along[1]
    cx = np.concatenate(
        [[0.0], np.cumsum(sign * step * np.cos(heading[:-1] + curvature * step / 2))]
    )
    cy = np.concatenate(
        [[0.0], np.cumsum(sign * step * np.sin(heading[:-1] + curvature * step / 2))]
    )
    touched = np.flatnonzero(np.hypot(cx - x, cy - y) < radius)
    return float(along[touched[0]]) if len(touched) else inf


TABLE = {
    "nothing": ([], Twist(0.3, 0.0), inf),
    "straight ahead": ([(1.0, 0.0)], Twist(0.3, 0.0), 0.8),
    "ahead, off the middle": ([(1.0, 0.12)], Twist(0.3, 0.0), 1.0 - 0.16),
    "just beside the footprint": ([(1.0, 0.2001)], Twist(0.3, 0.0), inf),
    "just inside the footprint": (
        [(1.0, 0.1999)],
        Twist(0.3, 0.0),
        1.0 - math.sqrt(0.04 - 0.1999**2),
    ),
    "abeam": ([(0.0, 0.21)], Twist(0.3, 0.0), inf),
    "behind": ([(-0.3, 0.0)], Twist(0.3, 0.0), inf),
    "behind, backing": ([(-0.3, 0.0)], Twist(-0.1, 0.0), 0.1),
    "ahead, backing": ([(0.3, 0.0)], Twist(-0.1, 0.0), inf),
    "touching ahead": ([(0.2, 0.0)], Twist(0.3, 0.0), 0.0),
    "inside, ahead": ([(0.1, 0.1)], Twist(0.3, 0.0), 0.0),
    "inside, behind": ([(-0.1, 0.1)], Twist(0.3, 0.0), inf),
    "inside, ahead, backing away": ([(0.1, 0.1)], Twist(-0.1, 0.0), inf),
    "the nearest of several": ([(2.0, 0.0), (0.9, 0.0), (1.5, 0.1)], Twist(0.3, 0.0), 0.7),
    "left arc of 1 m, point abreast after a quarter": (
        [(1.0, 1.0)],
        Twist(0.3, 0.3),
        pi / 2 - 2 * math.asin(0.1),
    ),
    "right arc of 1 m, point abreast after a quarter": (
        [(1.0, -1.0)],
        Twist(0.3, -0.3),
        pi / 2 - 2 * math.asin(0.1),
    ),
    "straight ahead of a left arc": ([(1.0, -0.3)], Twist(0.3, 0.3), inf),
    "inside of the arc": ([(0.5, 1.0)], Twist(0.3, 0.3), inf),
    "centre of a tight turn": ([(0.001, 0.3)], Twist(0.03, 0.1), inf),
}


@pytest.mark.parametrize(("points", "twist", "expected"), TABLE.values(), ids=TABLE)
def test_the_free_distance_is_what_geometry_says(
    points: list[tuple[float, float]], twist: Twist, expected: float
) -> None:
    assert way(points, twist) == pytest.approx(expected, abs=1e-6)


@given(
    st.floats(0.05, 1.0),
    st.floats(-0.8, 0.8),
    st.sampled_from([-0.1, 0.05, 0.3]),
    st.floats(-1.2, 1.2),
)
def test_the_free_distance_is_where_a_driven_disc_first_touches(
    x: float, y: float, linear: float, angular: float
) -> None:
    assume(math.hypot(x, y) > RADIUS + 0.01)
    x = math.copysign(x, linear)
    twist = Twist(linear, angular)
    furthest = min(1.0, 0.5 * pi * abs(linear / angular)) if angular else 1.0
    early, late = (
        driven_until_touch(x, y, twist, furthest, radius)
        for radius in (RADIUS + 1e-3, RADIUS - 1e-3)
    )
    found = way([(x, y)], twist)
    assert early - 1e-3 <= (found if found <= furthest else inf) <= late + 1e-3


@given(st.floats(0.3, 1.0), st.floats(-0.5, 0.5), st.floats(-1.0, 1.0))
def test_left_and_right_are_alike(x: float, y: float, angular: float) -> None:
    left, right = way([(x, y)], Twist(0.3, angular)), way([(x, -y)], Twist(0.3, -angular))
    assert left == pytest.approx(right, rel=1e-9)


def test_what_an_arc_grazes_is_touched_abreast_however_it_is_rounded() -> None:
    """A point on the rim of what is swept, but for the last digit."""
    x, y, turn = 1.3040764957793665, 0.7739040911957085, 1.9145154450911486
    points = np.array([x]), np.array([y])
    free = free_distance(points, Twist(0.1, 0.1 / turn), radius=0.177, margin=0.005)
    assert free == pytest.approx(turn * math.atan2(x, turn - y), abs=1e-3)


def test_the_margin_counts_as_footprint() -> None:
    assert way([(1.0, 0.0)], Twist(0.3, 0.0), margin=0.05) == pytest.approx(0.75)


def test_a_robot_within_the_margin_may_go_along_the_wall() -> None:
    wall = [(0.01 * n, 0.22) for n in range(-100, 100)]
    assert way(wall, Twist(0.3, 0.0), margin=0.05) == inf


def test_a_robot_within_the_margin_may_not_turn_into_the_wall() -> None:
    wall = [(0.01 * n, 0.22) for n in range(-100, 100)]
    assert way(wall, Twist(0.3, 0.6), margin=0.05) < 0.15


def test_what_is_within_the_margin_may_come_no_nearer_than_a_third_of_it() -> None:
    assert way([(0.24, 0.0)], Twist(0.3, 0.0), margin=0.06) == pytest.approx(0.02)
    assert way([(0.21, 0.0)], Twist(0.3, 0.0), margin=0.06) == 0.0
    assert way([(0.15, 0.0)], Twist(0.3, 0.0), margin=0.06) == 0.0


def a_scan(ranges: list[float] | Array, **settings: Any) -> Scan:
    array = np.array(ranges, dtype=float)
    facts = {"angle_min": -pi / 2, "angle_increment": pi / (len(array) - 1), **settings}
    return Scan(stamp=10.0, ranges=array, range_min=0.02, range_max=30.0, **facts)


def at_rest(pose: Pose) -> list[Odometry]:
    return [Odometry(9.9, pose, Twist()), Odometry(10.2, pose, Twist())]


def test_near_returns_stand_where_the_beams_point() -> None:
    points = obstacle_points(a_scan([0.5, 0.6, 0.7]), at_rest(Pose()), reach=1.0)
    assert points == pytest.approx(np.array([[0.0, -0.5], [0.6, 0.0], [0.0, 0.7]]), abs=1e-12)


def test_far_returns_and_beams_without_a_range_are_no_obstacles() -> None:
    points = obstacle_points(a_scan([5.0, math.nan, inf, 0.7]), at_rest(Pose()), reach=1.0)
    assert points == pytest.approx(np.array([[0.0, 0.7]]), abs=1e-12)


@pytest.mark.parametrize("step", [math.radians(0.25), math.radians(0.36)])
def test_a_wall_beside_the_robot_is_where_it_is_in_spite_of_the_noise(step: float) -> None:
    """0.21 m abeam, sigma 1 cm: the shortest of its beams is 20 to 25 mm too short."""
    rng = np.random.default_rng(1)
    bearings = np.arange(-1.2, 1.2, step)
    exact = 0.21 / np.cos(bearings)
    raw = exact + rng.normal(0.0, 0.01, (300, len(exact)))
    raw_gaps = (raw * np.cos(bearings)).min(axis=1)
    gaps = np.array([(evened(ranges) * np.cos(bearings)).min() for ranges in raw])
    assert raw_gaps.mean() < 0.21 - 0.018
    assert gaps.mean() > 0.21 - 0.013
    assert evened(exact)[2:-2] == pytest.approx(exact[2:-2], rel=1e-3)


@pytest.mark.parametrize("step", [math.radians(0.25), math.radians(0.36)])
@pytest.mark.parametrize("width", [0.5, 0.6])
def test_a_door_lets_the_robot_through_in_spite_of_a_noisy_laser(step: float, width: float) -> None:
    """Sigma 3 cm, and 5 cm or more to spare on either side of a robot of 0.4 m between jambs."""
    rng = np.random.default_rng(1)
    bearings = np.arange(-2.0, 2.0, step)
    x, y = np.cos(bearings), np.abs(np.sin(bearings))
    jambs = np.where(np.abs(width / 2 / y * x) < 0.15, width / 2 / y, 3.0)  # and a wall far off
    stopped = 0
    for _ in range(200):
        ranges = jambs + rng.normal(0.0, 0.03, len(jambs))
        scan = a_scan(ranges, angle_min=bearings[0], angle_increment=step)
        points = obstacle_points(scan, at_rest(Pose()), reach=1.0)
        way = free_distance((points[:, 0], points[:, 1]), Twist(0.2, 0.0), radius=RADIUS, margin=0)
        stopped += way < 0.1
    assert stopped < 8


@pytest.mark.parametrize("beams", [1, 2])
def test_what_few_beams_show_before_a_wall_stays_where_it_is(beams: int) -> None:
    ranges = np.full(40, 0.30)
    ranges[20 : 20 + beams] = 0.24
    assert evened(ranges) == pytest.approx(ranges)


@given(st.lists(st.floats(0.05, 2.0) | st.sampled_from([math.nan, inf]), min_size=1, max_size=30))
def test_an_evened_range_is_among_those_of_its_neighbours_that_are_near_it(
    values: list[float],
) -> None:
    ranges = np.array(values)
    found = evened(ranges)
    for i, (before, after) in enumerate(zip(values, found.tolist(), strict=True)):
        if not math.isfinite(before):
            assert after == before or (math.isnan(after) and math.isnan(before))
            continue
        near = [other for other in values[max(0, i - 2) : i + 3] if abs(other - before) < 0.3]
        assert min(near) - 1e-9 <= after <= max(near) + 1e-9


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3), st.floats(-0.3, 0.3), st.floats(-3, 3))
def test_points_pass_through_the_mount_and_the_odometry(
    x: float, y: float, theta: float, ahead: float, yaw: float
) -> None:
    odom_base, base_laser = Pose(x, y, theta), Pose(ahead, 0.1, yaw)
    scan = a_scan([0.4, 0.5, 0.6], base_laser=base_laser)
    points = obstacle_points(scan, at_rest(odom_base), reach=1.0)
    polar = scan.ranges[:, None] * np.column_stack([np.cos(scan.bearings), np.sin(scan.bearings)])
    assert points == pytest.approx(odom_base.compose(base_laser).transform(polar), abs=1e-9)
    back = np.column_stack(seen_from(odom_base, points))
    assert back == pytest.approx(base_laser.transform(polar), abs=1e-9)


def test_a_turning_robot_sees_a_still_wall_as_still() -> None:
    """A post at (0.5, 0) seen by beams that sweep while the base turns at 1 rad/s."""
    beams, duration = 200, 0.1
    when = np.arange(beams) / beams * duration
    bearings = -pi / 2 + pi / (beams - 1) * np.arange(beams)
    towards_post = np.abs(bearings + when) < 0.02  # the base's heading is `when`
    ranges = np.where(towards_post, 0.5, inf)
    scan = a_scan(ranges, time_increment=duration / beams)
    track = [Odometry(10.0 + t, Pose(0.0, 0.0, t), Twist(0.0, 1.0)) for t in (0.0, 0.05, 0.1)]
    points = obstacle_points(scan, track, reach=1.0)
    assert len(points) >= 1
    assert points == pytest.approx(np.tile([0.5, 0.0], (len(points), 1)), abs=0.5 * 0.02)


@pytest.mark.parametrize(
    ("stamp", "x"), [(9.0, 1.0), (10.0, 1.0), (10.25, 1.5), (10.5, 2.0), (11.5, 3.0), (99.0, 4.0)]
)
def test_a_pose_between_two_messages_is_between_their_poses(stamp: float, x: float) -> None:
    track = [Odometry(s, Pose(p, 0.0, 0.0), Twist()) for s, p in ((10, 1), (10.5, 2), (12.5, 4))]
    assert pose_at(track, stamp).x == pytest.approx(x)


def test_a_heading_is_interpolated_the_short_way_round() -> None:
    track = [Odometry(0.0, Pose(0, 0, 3.0), Twist()), Odometry(1.0, Pose(0, 0, -3.0), Twist())]
    assert abs(pose_at(track, 0.5).theta) == pytest.approx(pi)


@pytest.mark.parametrize(
    ("ranges", "sees"),
    [
        ([1.0, 1.0, 1.0, 1.0], True),
        ([inf, inf, inf, inf], True),
        ([1.0, math.nan, inf, 1.0], True),
        ([1.0, math.nan, math.nan, math.nan], False),
        ([math.nan] * 4, False),
        ([], False),
    ],
    ids=["all", "open hall", "one dropout", "mostly dropouts", "covered", "no beams"],
)
def test_a_laser_that_trusts_few_beams_sees_nothing(ranges: list[float], sees: bool) -> None:
    assert has_sight(Scan(0.0, np.array(ranges), 0.0, 0.1, 0.02, 30.0)) is sees
