"""Sub-payloads: inverses, and tolerance of what is not as it should be."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.drivers.kobuki.payloads import (
    CliffAdc,
    ControllerInfo,
    CoreSensors,
    DockIr,
    FeedbackPart,
    FirmwareVersion,
    GpInput,
    HardwareVersion,
    Inertia,
    MotorCurrent,
    RawGyro,
    Udid,
    Version,
    decode_feedback,
    encode_feedback,
)
from gvgbot.drivers.kobuki.sub_payloads import Truncated, Unknown, split_payload

u8, u16, u32 = (st.integers(0, 2**bits - 1) for bits in (8, 16, 32))
s8, s16 = st.integers(-128, 127), st.integers(-32768, 32767)
versions = st.builds(Version, u8, u8, u8)

feedback_parts: st.SearchStrategy[Any] = st.one_of(
    st.builds(CoreSensors, u16, u8, u8, u8, u16, u16, s8, s8, u8, u8, u8, u8),
    st.builds(DockIr, u8, u8, u8),
    st.builds(Inertia, s16, s16),
    st.builds(CliffAdc, u16, u16, u16),
    st.builds(MotorCurrent, u8, u8),
    st.builds(HardwareVersion, versions),
    st.builds(FirmwareVersion, versions),
    st.builds(RawGyro, u8, st.lists(st.tuples(s16, s16, s16), max_size=9).map(tuple)),
    st.builds(GpInput, u16, st.tuples(u16, u16, u16, u16), st.tuples(u16, u16, u16)),
    st.builds(Udid, st.tuples(u32, u32, u32)),
    st.builds(ControllerInfo, u8, u32, u32, u32),
    st.builds(Unknown, st.sampled_from([0, 2, 7, 15, 200]), st.binary(max_size=20)),
)


@given(st.lists(feedback_parts, max_size=8))
def test_values_read_back_as_they_were_sent(parts: list[FeedbackPart]) -> None:
    assert decode_feedback(encode_feedback(parts)) == parts


@given(st.binary(max_size=255))
def test_no_payload_raises_and_all_sub_payloads_account_for_all_bytes(payload: bytes) -> None:
    items = list(split_payload(payload))
    sizes = [len(i.data) if isinstance(i, Truncated) else 2 + len(i[1]) for i in items]
    assert sum(sizes) == len(payload)
    parts = decode_feedback(payload)
    assert len(parts) == len(items)
    assert all(not isinstance(part, Truncated) for part in parts[:-1])


@pytest.mark.parametrize(
    ("number", "size"), [(1, 14), (1, 16), (4, 6), (13, 9), (13, 0), (16, 17), (19, 11), (21, 5)]
)
def test_a_wrong_length_is_skipped_by_the_length_it_states(number: int, size: int) -> None:
    odd = bytes((number, size)) + bytes(size)
    dock = DockIr(1, 2, 4)
    parts = decode_feedback(odd + encode_feedback([dock]))
    assert parts == [Unknown(number, bytes(size)), dock]


def test_gyro_samples_must_match_their_count() -> None:
    assert isinstance(decode_feedback(bytes((13, 8, 0, 5)) + bytes(6))[0], Unknown)


@given(st.lists(feedback_parts, max_size=8), st.sets(st.sampled_from([1, 3, 5, 13, 16])))
def test_parts_that_are_not_read_are_left_out_and_no_others(
    parts: list[FeedbackPart], unread: set[int]
) -> None:
    by_number = {1: CoreSensors, 3: DockIr, 5: CliffAdc, 13: RawGyro, 16: GpInput}
    left_out = tuple(by_number[number] for number in unread)
    kept = [part for part in parts if not isinstance(part, left_out)]
    assert decode_feedback(encode_feedback(parts), unread=unread) == kept


@pytest.mark.parametrize("kept", [1, 2, 8])
def test_a_short_end_is_told_apart_and_what_came_before_is_read(kept: int) -> None:
    dock, inertia = DockIr(1, 2, 4), Inertia(5, 6)
    tail = encode_feedback([inertia])[:kept]
    assert decode_feedback(encode_feedback([dock]) + tail) == [dock, Truncated(tail)]


@pytest.mark.parametrize(
    ("number", "old", "text"),
    [
        (10, 104, "1.0.4"),
        (11, 123, "1.0.0"),
        (11, 110, "1.1.0"),
        (11, 10100, "1.1.0"),
        (11, 111, "1.1.1"),
        (11, 10101, "1.1.1"),
    ],
)
def test_the_two_byte_versions_of_early_bases_are_read(number: int, old: int, text: str) -> None:
    (part,) = decode_feedback(bytes((number, 2)) + old.to_bytes(2, "little"))
    assert isinstance(part, HardwareVersion if number == 10 else FirmwareVersion)
    assert str(part.version) == text


@pytest.mark.parametrize(
    ("charger", "charging"), [(0, False), (2, False), (6, True), (18, False), (22, True)]
)
def test_dock_and_adapter_both_count_as_charging(charger: int, charging: bool) -> None:
    core = CoreSensors(0, 0, 0, 0, 0, 0, 0, 0, 0, charger, 161, 0)
    assert core.charging is charging
    assert core.voltage == 16.1


def test_heading_and_rate_are_hundredths_of_a_degree() -> None:
    inertia = Inertia(-9000, 18000)
    assert inertia.angle == pytest.approx(-math.pi / 2)
    assert inertia.rate == pytest.approx(math.pi)
