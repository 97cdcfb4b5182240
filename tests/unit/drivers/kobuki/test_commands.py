"""Commands: inverses, and what an arc means."""

import math
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gvgbot.drivers.kobuki.commands import (
    ALL_POWER,
    NO_OUTPUT,
    BaseControl,
    Command,
    GetGain,
    GpOutput,
    Melody,
    Output,
    RequestExtra,
    SetGain,
    Sound,
    SoundSequence,
    decode_commands,
    encode_commands,
)
from gvgbot.drivers.kobuki.frames import MIN_PAYLOAD
from gvgbot.geometry import Twist

HALF_BASE = 0.115  # m
WHEEL_BASE_MM = 230.0
u8, u16, u32 = (st.integers(0, 2**bits - 1) for bits in (8, 16, 32))
s16 = st.integers(-32768, 32767)

commands: st.SearchStrategy[Any] = st.one_of(
    st.builds(BaseControl, s16, s16),
    st.builds(Sound, u16, u8),
    st.builds(SoundSequence, u8),
    st.builds(RequestExtra, u16),
    st.builds(GpOutput, u16),
    st.builds(SetGain, u8, u32, u32, u32),
    st.builds(GetGain),
)


@given(st.lists(commands, min_size=1, max_size=8))
def test_commands_of_one_frame_read_back_as_they_were_sent(sent: list[Command]) -> None:
    assert decode_commands(encode_commands(sent)[3:-1]) == sent


@given(st.binary(min_size=1, max_size=255))
def test_no_payload_raises_and_what_was_read_is_sent_as_the_same_bytes(payload: bytes) -> None:
    commands = decode_commands(payload)
    if len(payload) >= MIN_PAYLOAD:
        assert encode_commands(commands)[3:-1] == payload


def wheels(twist: Twist) -> tuple[float, float]:
    return twist.linear - HALF_BASE * twist.angular, twist.linear + HALF_BASE * twist.angular


@given(st.floats(-0.7, 0.7), st.floats(-math.pi, math.pi))
@example(0.3, 0.0001)
@example(0.0015, 1.0)
@example(-0.0015, 1.0)
@example(0.0, 0.0)
def test_a_twist_survives_within_what_cutting_costs(linear: float, angular: float) -> None:
    """Geometry: 1 mm/s of a wheel, 1 mm of radius, and 1 mm/s for small terms left out."""
    got = BaseControl.from_twist(Twist(linear, angular), WHEEL_BASE_MM).twist_on(WHEEL_BASE_MM)
    radius = abs(linear / angular) if angular else math.inf
    by_radius = 0.001 / (radius + HALF_BASE) * (abs(linear) + HALF_BASE * abs(angular))
    for ours, theirs in zip(wheels(got), wheels(Twist(linear, angular)), strict=True):
        assert abs(ours - theirs) < 0.0025 + by_radius


@given(st.floats(-1.0, 1.0), st.floats(-4.0, 4.0))
def test_what_is_sent_is_never_faster_than_asked(linear: float, angular: float) -> None:
    got = BaseControl.from_twist(Twist(linear, angular), WHEEL_BASE_MM).twist_on(WHEEL_BASE_MM)
    asked = abs(linear) + HALF_BASE * abs(angular)
    assert abs(got.linear) + HALF_BASE * abs(got.angular) <= asked + 1e-4 + 0.0015


@pytest.mark.parametrize("radius", [2, -2, 115, -115, 1000, -30000])
@pytest.mark.parametrize("speed", [100, -250])
def test_the_arcs_radius_and_outer_wheel_are_as_commanded(speed: int, radius: int) -> None:
    twist = BaseControl(speed, radius).twist_on(WHEEL_BASE_MM)
    assert twist.linear / twist.angular == pytest.approx(radius / 1000)
    left, right = wheels(twist)
    assert (right if radius > 0 else left) == pytest.approx(speed / 1000)


@pytest.mark.parametrize(
    ("control", "twist"),
    [
        (BaseControl(300, 0), Twist(0.3, 0.0)),
        (BaseControl(115, 1), Twist(0.0, 1.0)),
        (BaseControl(-115, 1), Twist(0.0, -1.0)),
        (BaseControl(-116, -1), Twist(-0.001, 1.0)),
    ],
)
def test_special_radii_mean_straight_and_on_the_spot(control: BaseControl, twist: Twist) -> None:
    got = control.twist_on(WHEEL_BASE_MM)
    assert got.linear == pytest.approx(twist.linear)
    assert got.angular == pytest.approx(twist.angular)


@pytest.mark.parametrize("speed", [0.01, -0.3, 0.7])
def test_an_arc_too_wide_to_send_becomes_straight(speed: float) -> None:
    control = BaseControl.from_twist(Twist(speed, speed / 40.0), WHEEL_BASE_MM)
    assert control == BaseControl(round(1000 * speed), 0)


def test_speeds_beyond_the_field_saturate() -> None:
    assert BaseControl.from_twist(Twist(40.0, 0.0), WHEEL_BASE_MM) == BaseControl(32767, 0)
    assert BaseControl.from_twist(Twist(-40.0, 0.0), WHEEL_BASE_MM) == BaseControl(-32768, 0)


def test_a_radius_that_means_a_turn_on_the_spot_is_sent_as_one() -> None:
    assert BaseControl.from_twist(Twist(0.001, 1.0), WHEEL_BASE_MM) == BaseControl(115, 1)


def test_the_bits_of_the_outputs_are_those_of_the_protocol() -> None:
    """Digital outputs 0 to 3, power, then two lamps of two colours: one bit after the other."""
    assert [output.name for output in Output] == [
        "DIGITAL_0", "DIGITAL_1", "DIGITAL_2", "DIGITAL_3",
        "POWER_3V3", "POWER_5V", "POWER_12V_5A", "POWER_12V_1A5",
        "LED1_RED", "LED1_GREEN", "LED2_RED", "LED2_GREEN",
    ]  # fmt: skip
    assert [int(output) for output in Output] == [1 << bit for bit in range(12)]
    assert (int(NO_OUTPUT), int(ALL_POWER)) == (0, 0x00F0)


def test_the_tunes_have_the_numbers_of_the_protocol() -> None:
    assert [tune.name for tune in sorted(Melody)] == [
        "ON", "OFF", "RECHARGE", "BUTTON", "ERROR", "CLEANING_START", "CLEANING_END",
    ]  # fmt: skip
    assert [int(tune) for tune in sorted(Melody)] == list(range(7))
