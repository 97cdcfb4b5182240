"""Twists made slower and gentler."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.drivers.kobuki.limits import Accelerations, ramped, slowed
from gvgbot.geometry import STANDSTILL, Twist

twists = st.builds(Twist, st.floats(-2.0, 2.0), st.floats(-6.0, 6.0))
LIMITS = Accelerations(rise=0.5, fall=0.6, turn=3.5)


@given(twists, st.floats(0.1, 1.0), st.floats(0.1, 3.0), st.floats(0.1, 1.0))
def test_slowed_twists_stay_on_their_arc_within_the_limits(
    twist: Twist, speed: float, rate: float, base: float
) -> None:
    slow = slowed(twist, speed, rate, base)
    assert slow.linear * twist.angular == pytest.approx(slow.angular * twist.linear, abs=1e-9)
    assert max(abs(slow.linear + s * slow.angular * base / 2) for s in (-1, 1)) <= speed + 1e-9
    assert abs(slow.angular) <= rate + 1e-9


def seconds_to(target: Twist, start: Twist, limits: Accelerations = LIMITS) -> float:
    twist, steps = start, 0
    while twist != target:
        twist, steps = ramped(target, twist, 0.02, limits), steps + 1
        assert steps < 1000
    return steps * 0.02


@pytest.mark.parametrize(
    ("start", "target", "seconds"),
    [
        (Twist(), Twist(0.5, 0.0), 1.0),
        (Twist(0.5, 0.0), Twist(0.2, 0.0), 0.5),
        (Twist(), Twist(0.0, 1.75), 0.5),
        (Twist(0.3, 0.0), Twist(0.3, -3.5), 1.0),
        (Twist(), Twist(-0.25, 0.0), 0.5),
    ],
    ids=str,
)
def test_a_change_takes_as_long_as_its_limit_says(
    start: Twist, target: Twist, seconds: float
) -> None:
    assert seconds_to(target, start) == pytest.approx(seconds, abs=0.021)


@given(twists)
def test_a_standstill_is_never_put_off(last: Twist) -> None:
    assert ramped(STANDSTILL, last, 0.0, LIMITS) == STANDSTILL


@given(twists, st.floats(-6.0, 6.0), st.floats(-2.0, 0.0), st.floats(0.0, 1.0))
def test_going_no_further_is_never_put_off(
    last: Twist, turn: float, back: float, elapsed: float
) -> None:
    ahead = Twist(abs(last.linear), last.angular)
    assert ramped(Twist(0.0, turn), ahead, elapsed, LIMITS).linear == 0.0
    assert ramped(Twist(back, turn), ahead, elapsed, LIMITS).linear <= 0.0
    astern = Twist(-ahead.linear, last.angular)
    assert ramped(Twist(-back, turn), astern, elapsed, LIMITS).linear >= 0.0


@given(twists, twists, st.floats(0.001, 10.0))
def test_without_limits_every_twist_is_reached_at_once(
    twist: Twist, last: Twist, elapsed: float
) -> None:
    assert ramped(twist, last, elapsed, Accelerations()) == twist


@given(twists, twists, st.floats(0.0, math.inf))
def test_a_ramp_never_overshoots_nor_jumps_after_a_pause(
    twist: Twist, last: Twist, elapsed: float
) -> None:
    got = ramped(twist, last, elapsed, LIMITS)
    if twist.linear * last.linear > 0.0:
        assert abs(got.linear - last.linear) <= 0.06 + 1e-12
    if twist != STANDSTILL:
        assert min(last.linear, twist.linear) <= got.linear <= max(last.linear, twist.linear)
