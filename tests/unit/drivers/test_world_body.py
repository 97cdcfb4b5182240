"""The simulated robot's body, against closed forms and against every wall square."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.drivers.body import BodyConfig, RobotBody
from gvgbot.drivers.world import World
from gvgbot.geometry import Pose

RADIUS = BodyConfig().radius_m
BASE = BodyConfig().wheel_base_m
OPEN = World(np.zeros((10, 10), dtype=np.bool_), 0.05)


def walled(at: float, thickness: int = 1) -> World:
    """A wall that begins at x = `at` m and runs along y; all else is free."""
    occupied = np.zeros((200, 200), dtype=np.bool_)
    first = round(at / 0.05)
    occupied[:, first : first + thickness] = True
    return World(occupied, 0.05)


def brute_gap(world: World, pose: Pose) -> float:
    """Distance from the pose to the nearest occupied square, looking at each of them."""
    rows, columns = np.nonzero(world.occupied)
    low = np.column_stack((columns, rows)) * world.resolution_m + world.origin
    nearest = np.clip(pose.position, low, low + world.resolution_m)
    return float(np.linalg.norm(nearest - pose.position, axis=1).min())


def test_a_straight_run_into_a_wall_ends_in_touch_with_it() -> None:
    body = RobotBody(walled(5.0), Pose(3.0, 5.0, 0.0))
    body.command(0.3, 0.0)
    for k in range(600):
        body.advance(0.02 * k)
    assert body.pose.x == pytest.approx(5.0 - RADIUS, abs=1e-3)
    assert body.distance_m == pytest.approx(2.0 - RADIUS, abs=1e-3)
    assert (body.contacts, body.bumper) == (1, (False, True, False))


@pytest.mark.parametrize(("gap", "speed"), [(1.0, 3.0), (7.0, 3.0), (1.0, 30.0)])
def test_no_wall_is_jumped_over_however_long_the_step(gap: float, speed: float) -> None:
    config = BodyConfig(max_acceleration_mps2=1000.0)
    body = RobotBody(walled(5.0), Pose(3.0, 5.0, 0.2), config)
    body.command(speed, 0.0)
    for k in range(1, 3):
        body.advance(gap * k)
        assert body.pose.x <= 5.0 - RADIUS + 1e-5


@given(seed=st.integers(0, 10**6))
def test_no_drive_ever_enters_a_wall(seed: int) -> None:
    rng = np.random.default_rng(seed)
    world = World(rng.random((60, 60)) < 0.01, 0.05)
    start = Pose(*rng.uniform((0.5, 0.5, -3.0), (2.5, 2.5, 3.0)))
    body, now = RobotBody(world, start), 0.0
    if brute_gap(world, start) < RADIUS:
        return
    for _ in range(6):
        body.command(rng.uniform(-0.7, 0.7), rng.uniform(-2.0, 2.0))
        now += rng.uniform(0.01, 1.5)
        body.advance(now)
        assert brute_gap(world, body.pose) >= RADIUS - 1e-5


def test_a_circle_closes() -> None:
    body = RobotBody(OPEN, Pose(1.0, 2.0, 0.5))
    body.command(0.3, 0.6)
    body.advance(2.0)
    begin, period = body.pose, math.tau / 0.6
    body.advance(2.0 + period / 2)
    assert body.pose.distance(begin) == pytest.approx(2 * 0.3 / 0.6)
    body.advance(2.0 + period)
    assert body.pose.distance(begin) == pytest.approx(0.0, abs=1e-9)
    assert math.cos(body.pose.theta - begin.theta) == pytest.approx(1.0)


@pytest.mark.parametrize("steps", [1, 7, 300])
def test_wheel_travel_follows_the_speed_ramps(steps: int) -> None:
    body = RobotBody(OPEN, Pose())
    body.command(0.4, 1.2)
    for k in range(1, steps + 1):
        body.advance(3.0 * k / steps)
    way, turn = 0.4 * 3.0 - 0.4**2 / (2 * 1.0), 1.2 * 3.0 - 1.2**2 / (2 * 6.0)
    assert body.left_travel + body.right_travel == pytest.approx(2 * way)
    assert body.right_travel - body.left_travel == pytest.approx(turn * BASE)
    assert body.distance_m == pytest.approx(way)


def test_a_curve_driven_while_accelerating_is_the_integral_of_its_ramps() -> None:
    body = RobotBody(OPEN, Pose())
    body.command(0.7, 2.0)
    body.advance(1.5)
    time = (np.arange(150_000) + 0.5) * 1e-5
    speed, rate = np.minimum(1.0 * time, 0.7), np.minimum(6.0 * time, 2.0)
    theta = np.cumsum(rate) * 1e-5
    x, y = (float(np.sum(speed * f(theta)) * 1e-5) for f in (np.cos, np.sin))
    assert (body.pose.x, body.pose.y) == pytest.approx((x, y), abs=1e-3)
    assert body.pose.theta == pytest.approx(theta[-1], abs=1e-3)


def test_braking_takes_the_way_of_the_acceleration_limit() -> None:
    body = RobotBody(OPEN, Pose())
    body.command(0.5, 0.0)
    body.advance(2.0)
    before = body.pose.x
    body.command(0.0, 0.0)
    body.advance(10.0)
    assert body.pose.x - before == pytest.approx(0.5**2 / 2)
    assert (body.linear, body.angular) == (0.0, 0.0)


def test_the_wheels_slip_while_a_wall_blocks_the_robot() -> None:
    body = RobotBody(walled(5.0), Pose(4.7, 5.0, 0.0))
    body.command(0.2, 0.0)
    body.advance(5.0)
    assert body.left_travel == pytest.approx(0.2 * 5.0 - 0.2**2 / 2)
    assert body.distance_m == pytest.approx(0.3 - RADIUS, abs=1e-3)


def test_time_never_runs_backwards() -> None:
    body = RobotBody(OPEN, Pose())
    body.command(0.4, 0.3)
    body.advance(2.0)
    state = body.pose, body.left_travel
    body.advance(1.0)
    body.advance(2.0)
    assert (body.pose, body.left_travel) == state


def test_a_body_made_late_does_not_catch_up() -> None:
    body = RobotBody(OPEN, Pose(), stamp=1e6)
    body.command(0.4, 0.0)
    body.advance(1e6 + 1.0)
    assert body.pose.x == pytest.approx(0.4 - 0.4**2 / 2)


@pytest.mark.parametrize(
    ("heading_deg", "speed", "pressed"),
    [
        (0, 0.2, (False, True, False)),
        (20, 0.2, (False, True, False)),
        (60, 0.2, (False, False, True)),
        (-60, 0.2, (True, False, False)),
        (180, -0.2, (False, False, False)),
        (120, -0.2, (False, False, False)),
    ],
)
def test_the_bumper_tells_which_third_of_the_front_touches(
    heading_deg: float, speed: float, pressed: tuple[bool, bool, bool]
) -> None:
    body = RobotBody(walled(5.0), Pose(4.6, 5.0, math.radians(heading_deg)))
    body.command(speed, 0.0)
    body.advance(5.0)
    assert body.contacts == 1
    assert body.bumper == pressed


def test_a_corner_presses_both_sides() -> None:
    occupied = np.zeros((100, 100), dtype=np.bool_)
    occupied[:, :4] = occupied[:4, :] = True
    body = RobotBody(World(occupied, 0.05), Pose(1.0, 1.0, -3 * math.pi / 4))
    body.command(0.3, 0.0)
    body.advance(6.0)
    assert body.bumper == (True, False, True)


def test_a_long_push_is_one_contact_and_a_second_hit_another() -> None:
    body = RobotBody(walled(5.0), Pose(4.6, 5.0, 0.0))
    for k, speed in enumerate((0.2, 0.2, -0.2, 0.2, 0.2)):
        body.command(speed, 0.0)
        body.advance(3.0 * (k + 1))
    assert body.contacts == 2


def test_a_robot_in_touch_can_back_off_and_releases_its_bumper() -> None:
    body = RobotBody(walled(5.0), Pose(4.6, 5.0, 0.0))
    body.command(0.2, 0.0)
    body.advance(3.0)
    body.command(-0.2, 0.0)
    body.advance(4.5)
    assert body.bumper == (False, False, False)
    assert body.pose.x < 5.0 - RADIUS - 0.1


def test_a_robot_put_too_near_a_wall_can_leave_but_not_approach_it() -> None:
    for speed, x in ((0.2, 4.9), (-0.2, 4.9 - 0.2 * 3.0 + 0.2**2 / 2)):
        body = RobotBody(walled(5.0), Pose(4.9, 5.0, 0.0))
        body.command(speed, 0.0)
        body.advance(3.0)
        assert body.pose.x == pytest.approx(x)


def test_a_robot_in_touch_can_turn_and_roll_along_the_wall() -> None:
    body = RobotBody(walled(5.0), Pose(5.0 - RADIUS, 3.0, math.pi / 2))
    body.command(0.3, 0.0)
    body.advance(5.0)
    assert body.pose.y == pytest.approx(3.0 + 0.3 * 5.0 - 0.3**2 / 2)
    assert body.contacts == 0
