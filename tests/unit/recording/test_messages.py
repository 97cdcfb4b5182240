"""What a recording holds comes back bit by bit, and reads as Foxglove's own types."""

import math
import struct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.autonomy.control.reflexes import Felt
from gvgbot.autonomy.loop import Cycle
from gvgbot.geometry import Pose, Twist
from gvgbot.hal.messages import Battery, Contact, Odometry, Scan
from gvgbot.recording import messages
from gvgbot.recording.schemas import DESCRIPTORS, TYPES

number = st.floats(allow_nan=False, allow_infinity=False)
stamps = st.floats(0.0, 1e9)
poses = st.builds(Pose, number, number, number)
twists = st.builds(Twist, number, number)
flag = st.booleans()
contacts = st.builds(Contact, stamps, *[flag] * 9)
cycles = st.builds(
    Cycle,
    st.builds(Odometry, stamps, poses, twists),
    st.builds(Felt, st.none() | contacts, st.sampled_from([None, "obstacle", "bumper"])),
    twists,
    twists,
)
unseen = st.sampled_from([math.nan, math.inf])
scans = st.builds(
    Scan,
    stamps,
    st.lists(st.floats(max_value=1e3) | unseen, min_size=2, max_size=8).map(
        lambda r: np.array(r, np.float64)
    ),
    number,
    number.filter(bool),
    number,
    st.floats(0.0, 1e3),
    number,
    poses,
)


def bits(value: Any) -> bytes:
    return struct.pack("<d", value)


@given(scans)
def test_a_scan_comes_back_bit_by_bit(scan: Scan) -> None:
    again = messages.decode_scan(messages.encode_scan(scan))
    assert again.ranges.tobytes() == scan.ranges.tobytes()
    for name in ("stamp", "angle_min", "angle_increment", "range_min", "range_max"):
        assert bits(getattr(again, name)) == bits(getattr(scan, name))
    assert bits(again.time_increment) == bits(scan.time_increment)
    assert again.base_laser == scan.base_laser


IMPOSSIBLE = {
    "no beams": {"ranges": np.empty(0)},
    "all beams in one direction": {"angle_increment": 0.0},
    "no direction": {"angle_min": math.nan},
    "a place that is none": {"base_laser": Pose(math.nan)},
    "walls beyond the horizon": {"ranges": np.array([1.0, 1e300])},
}


@pytest.mark.parametrize("wrong", IMPOSSIBLE.values(), ids=IMPOSSIBLE)
def test_a_scan_that_no_laser_sends_is_refused(wrong: dict[str, Any]) -> None:
    scan = replace(Scan(1.0, np.array([1.0, 2.0]), -0.1, 0.2, 0.0, 5.0), **wrong)
    with pytest.raises(ValueError, match=r"no scan|a number that is none"):
        messages.decode_scan(messages.encode_scan(scan))


@pytest.mark.parametrize("wrong", [math.nan, math.inf])
def test_a_cycle_of_numbers_that_are_none_is_refused(wrong: float) -> None:
    for odometry, wish in [
        (Odometry(1.0, Pose(wrong), Twist(0.0, 0.0)), Twist(0.0, 0.0)),
        (Odometry(1.0, Pose(), Twist(0.0, 0.0)), Twist(0.0, wrong)),
    ]:
        cycle = Cycle(odometry, Felt(), wish, wish)
        with pytest.raises(ValueError, match="a number that is none"):
            messages.decode_cycle(messages.encode_cycle(cycle))


@given(cycles)
def test_a_cycle_comes_back_as_it_was(cycle: Cycle) -> None:
    again = messages.decode_cycle(messages.encode_cycle(cycle))
    assert again == cycle
    assert bits(again.odometry.odom_base.theta) == bits(cycle.odometry.odom_base.theta)


@given(st.builds(Battery, stamps, number, number, flag))
def test_a_battery_comes_back_as_it_was(battery: Battery) -> None:
    assert messages.decode_battery(messages.encode_battery(battery)) == battery


def test_foxglove_reads_a_scan() -> None:
    ranges = np.array([1.0, math.nan, math.inf, 2.5])
    scan = Scan(12.25, ranges, -1.5, 0.5, 0.1, 30.0, 1e-4, Pose(0.1, -0.2, math.pi / 2))
    seen = LaserScan.FromString(messages.encode_scan(scan))
    assert (seen.timestamp.seconds, seen.timestamp.nanos) == (12, 250_000_000)
    assert (seen.frame_id, seen.start_angle, seen.end_angle) == ("base", -1.5, 0.0)
    np.testing.assert_array_equal(seen.ranges, ranges)
    assert (seen.pose.position.x, seen.pose.position.y) == (0.1, -0.2)
    half = math.sqrt(0.5)  # a quarter turn about z
    assert abs(seen.pose.orientation.z - half) < 1e-12
    assert abs(seen.pose.orientation.w - half) < 1e-12


def test_foxglove_reads_where_the_base_is() -> None:
    seen = FrameTransform.FromString(messages.encode_transform(3.5, Pose(1.0, 2.0, math.pi)))
    assert (seen.parent_frame_id, seen.child_frame_id) == ("map", "base")
    assert (seen.timestamp.seconds, seen.timestamp.nanos) == (3, 500_000_000)
    assert (seen.translation.x, seen.translation.y) == (1.0, 2.0)
    assert abs(seen.rotation.z - 1.0) < 1e-12


def test_the_fields_of_foxglove_have_its_names_numbers_and_types() -> None:
    pool = DescriptorPool()
    for file in FileDescriptorSet.FromString(DESCRIPTORS).file:
        pool.Add(file)
    for theirs in (LaserScan.DESCRIPTOR, FrameTransform.DESCRIPTOR):
        ours = pool.FindMessageTypeByName(theirs.full_name)
        for field in theirs.fields:
            same = ours.fields_by_name[field.name]
            assert (same.number, same.type) == (field.number, field.type)
            assert same.is_repeated == field.is_repeated


def test_all_types_of_the_table_are_described() -> None:
    described = {
        f"{file.package}.{kind.name}"
        for file in FileDescriptorSet.FromString(DESCRIPTORS).file
        for kind in file.message_type
    }
    assert described == {*TYPES, "google.protobuf.Timestamp"}
