"""Dead reckoning against closed forms."""

import math
from collections.abc import Iterator
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.drivers.kobuki.wheel_odometry import (
    KOBUKI,
    Heading,
    WheelOdometry,
    WheelReading,
    advance_odometry,
    start_odometry,
    turned,
    wheel_travels,
)
from gvgbot.geometry import Pose, Twist, wrap_angle

TICKS_PER_M = 11724.41658
HALF_BASE = 0.115  # m
DT = 0.02  # s


def readings(twist: Twist, seconds: float, start: WheelReading) -> Iterator[WheelReading]:
    """What ideal wheels and an ideal gyro read along an arc, from the start reading on."""
    left = (twist.linear - HALF_BASE * twist.angular) * TICKS_PER_M
    right = (twist.linear + HALF_BASE * twist.angular) * TICKS_PER_M
    for k in range(round(seconds / DT) + 1):
        t = k * DT
        yield WheelReading(
            (start.left_encoder + round(left * t)) % 65536,
            (start.right_encoder + round(right * t)) % 65536,
            wrap_angle(start.angle + twist.angular * t),
            twist.angular,
        )


def as_16_bits(angle: float) -> float:
    """An angle (rad) that is told in hundredths of a degree, in two's complement."""
    return math.radians((round(math.degrees(100 * angle)) + 32768) % 65536 - 32768) / 100


def reckon(twist: Twist, seconds: float, start: WheelReading, heading: Heading) -> WheelOdometry:
    first, *rest = readings(twist, seconds, start)
    state = start_odometry(first)
    for reading in rest:
        state = advance_odometry(state, reading, DT, heading, KOBUKI)
    return state


def arc(twist: Twist, seconds: float) -> Pose:
    turn = twist.angular * seconds
    if turn == 0.0:
        return Pose(twist.linear * seconds, 0.0, 0.0)
    radius = twist.linear / twist.angular
    return Pose(radius * math.sin(turn), radius * (1 - math.cos(turn)), wrap_angle(turn))


@pytest.mark.parametrize("heading", ["gyro", "wheels"])
@pytest.mark.parametrize(
    "twist",
    [Twist(0.3, 0.0), Twist(-0.2, 0.0), Twist(0.3, 0.5), Twist(0.5, -2.0), Twist(0.0, 3.0)],
    ids=str,
)
def test_an_arc_is_reckoned_to_where_geometry_says(heading: Heading, twist: Twist) -> None:
    start = WheelReading(65000, 500, math.radians(170), 0.0)
    state = reckon(twist, 10.0, start, heading)
    truth = arc(twist, 10.0)
    assert state.odom_base.distance(truth) < 1e-3
    assert abs(wrap_angle(state.odom_base.theta - truth.theta)) < 2e-3
    assert state.twist.linear == pytest.approx(twist.linear, abs=0.005)
    assert state.twist.angular == pytest.approx(twist.angular, abs=0.05)


def test_stamps_of_a_millisecond_hardly_change_the_speed() -> None:
    """Frames come every 20 ms, and are said to come after 19 and 21: up to 0.737 m/s by each."""
    first, *rest = readings(Twist(0.7, 0.0), 2.0, WheelReading(0, 0, 0.0, 0.0))
    state, speeds = start_odometry(first), []
    for k, reading in enumerate(rest):
        state = advance_odometry(state, reading, DT - 0.001 * (-1) ** k, "gyro", KOBUKI)
        speeds.append(state.twist.linear)
    assert speeds[50:] == pytest.approx([0.7] * len(speeds[50:]), abs=0.007)


def test_who_stands_has_no_speed_at_all() -> None:
    *_, last = readings(Twist(0.7, 0.0), 2.0, WheelReading(0, 0, 0.0, 0.0))
    state = replace(start_odometry(last), twist=Twist(0.7, 0.0), slip_rate=0.3)
    for _ in range(1000):
        state = advance_odometry(state, replace(last, rate=0.0), DT, "gyro", KOBUKI)
    assert state.twist == Twist()
    assert state.slip_rate == 0.0


@given(st.integers(0, 65535), st.integers(0, 65535), st.floats(-math.pi, math.pi))
def test_where_encoders_and_gyro_begin_does_not_matter(left: int, right: int, at: float) -> None:
    twist = Twist(0.4, 0.8)
    here = reckon(twist, 1.0, WheelReading(left, right, at, 0.0), "gyro").odom_base
    origin = reckon(twist, 1.0, WheelReading(0, 0, 0.0, 0.0), "gyro").odom_base
    assert here.distance(origin) < 1e-9
    assert abs(wrap_angle(here.theta - origin.theta)) < 1e-9


@pytest.mark.parametrize("rate", [2.0, -2.0])
@pytest.mark.parametrize("begins_deg", [0.0, 179.0, -327.0])
def test_a_gyro_that_counts_on_past_half_a_turn_tells_the_same_as_one_that_does_not(
    rate: float, begins_deg: float
) -> None:
    """For five turns either way; at 327.67 degrees it goes on at -327.68."""
    turned_deg = math.degrees(rate * DT)
    ticks = round(rate * DT * HALF_BASE * TICKS_PER_M)
    state = start_odometry(WheelReading(0, 0, as_16_bits(math.radians(begins_deg)), rate))
    for k in range(1, 1 + round(5 * math.tau / abs(rate * DT))):
        angle = as_16_bits(math.radians(begins_deg + k * turned_deg))
        reading = WheelReading(-k * ticks % 65536, k * ticks % 65536, angle, rate)
        assert abs(turned(state.reading, reading, "gyro", KOBUKI)) < 0.05
        state = advance_odometry(state, reading, DT, "gyro", KOBUKI)
    truth = wrap_angle(k * rate * DT)
    assert abs(wrap_angle(state.odom_base.theta - truth)) < 1e-3
    assert abs(state.slip_rate) < 0.02


@given(st.integers(0, 65535), st.integers(-32767, 32767))
def test_encoders_wrap_in_both_directions(start: int, counts: int) -> None:
    before = WheelReading(start, start, 0.0, 0.0)
    after = WheelReading((start + counts) % 65536, (start - counts) % 65536, 0.0, 0.0)
    left, right = wheel_travels(before, after, KOBUKI.tick)
    assert left == pytest.approx(counts / TICKS_PER_M)
    assert right == pytest.approx(-counts / TICKS_PER_M)


def test_only_the_gyro_notices_a_wheel_that_spins_in_place() -> None:
    """One wheel spins 5 cm while the base stands: no turn, and a slip rate that shows it."""
    before = WheelReading(0, 0, 0.0, 0.0)
    after = WheelReading(0, round(0.05 * TICKS_PER_M), 0.0, 0.0)
    by_gyro = advance_odometry(start_odometry(before), after, DT, "gyro", KOBUKI)
    by_wheels = advance_odometry(start_odometry(before), after, DT, "wheels", KOBUKI)
    assert by_gyro.odom_base.theta == 0.0
    assert by_wheels.odom_base.theta == pytest.approx(0.05 / 0.23, rel=1e-3)
    assert by_gyro.slip_rate < 0.0


def test_two_steps_and_one_long_step_agree_on_a_straight_line() -> None:
    a, b, c = (WheelReading(k * 100, k * 100, 0.3, 0.0) for k in range(3))
    twice = advance_odometry(
        advance_odometry(start_odometry(a), b, DT, "gyro", KOBUKI), c, DT, "gyro", KOBUKI
    )
    once = advance_odometry(start_odometry(a), c, 2 * DT, "gyro", KOBUKI)
    assert twice.odom_base.distance(once.odom_base) < 1e-12
    assert twice.twist.linear == pytest.approx(once.twist.linear, rel=1e-12)
    assert twice.twist.angular == once.twist.angular


def test_a_restart_keeps_the_pose() -> None:
    pose = Pose(1.0, 2.0, 0.5)
    state = start_odometry(WheelReading(7, 9, 1.0, 0.2), pose)
    assert state.odom_base == pose
    assert state.twist == Twist()


def test_encoders_that_flicker_at_rest_do_not_cast_doubt_on_a_gyro_that_stands() -> None:
    """Either wheel to and fro between two counts, for ten minutes."""
    flicker = [WheelReading(k % 2, (k // 2) % 2, 0.5, 0.0) for k in range(4)]
    state = start_odometry(flicker[0])
    for k in range(round(600.0 / DT)):
        state = advance_odometry(state, flicker[k % 4], DT, "gyro", KOBUKI)
    assert state.unfelt < math.tau
