import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.errors import UsageError
from gvgbot.geometry import wrap_angle
from gvgbot.maps.trajectory import Trajectory, decode_tum, encode_tum

HALF_ROOT = math.sqrt(0.5)


@pytest.mark.parametrize(
    ("theta", "qz", "qw"),
    [
        (0.0, 0.0, 1.0),
        (math.pi / 2, HALF_ROOT, HALF_ROOT),
        (-math.pi / 2, -HALF_ROOT, HALF_ROOT),
        (math.pi / 3, 0.5, math.sqrt(0.75)),
        (math.pi / 3 + 8 * math.pi, 0.5, math.sqrt(0.75)),
        (math.pi / 3 - 2 * math.pi, 0.5, math.sqrt(0.75)),  # not the same rotation, upside down
    ],
)
def test_a_line_is_the_stamp_the_place_and_the_quaternion(
    theta: float, qz: float, qw: float
) -> None:
    line = encode_tum(Trajectory(np.array([12.5]), np.array([[1.0, -2.0, theta]])))
    assert line.endswith("\n")
    assert line.count("\n") == 1
    numbers = [float(word) for word in line.split()]
    assert numbers == pytest.approx([12.5, 1.0, -2.0, 0, 0, 0, qz, qw], abs=1e-8)


rows = st.lists(
    st.tuples(
        st.floats(0, 1e6),
        st.floats(-1e3, 1e3),
        st.floats(-1e3, 1e3),
        st.floats(-50, 50),
    )
)


@given(rows)
def test_a_saved_trajectory_loads_as_it_was(table: list[tuple[float, ...]]) -> None:
    columns = np.array(table, np.float64).reshape(-1, 4)
    saved = Trajectory(columns[:, 0], columns[:, 1:])
    loaded = decode_tum(encode_tum(saved))
    assert loaded.stamps == pytest.approx(saved.stamps, abs=1e-6)
    assert loaded.positions == pytest.approx(saved.positions, abs=1e-6)
    turns = loaded.poses[:, 2] - saved.poses[:, 2]
    assert all(abs(wrap_angle(turn)) < 1e-8 for turn in turns)


def test_any_program_s_quaternions_are_read() -> None:
    text = "# t x y z qx qy qz qw\n\n1 2 3 4 0 0 -2 -2\n2.5 0 0 0 0 0 1 0\n"
    loaded = decode_tum(text)
    assert loaded.stamps.tolist() == [1.0, 2.5]
    assert loaded.poses[0] == pytest.approx([2.0, 3.0, math.pi / 2])
    assert loaded.poses[1] == pytest.approx([0.0, 0.0, math.pi])


def test_a_tilted_rotation_gives_its_heading() -> None:
    roll, yaw = 0.3, 1.1
    # quaternion of Rz(yaw) Rx(roll)
    qw, qx = math.cos(yaw / 2) * math.cos(roll / 2), math.cos(yaw / 2) * math.sin(roll / 2)
    qy, qz = math.sin(yaw / 2) * math.sin(roll / 2), math.sin(yaw / 2) * math.cos(roll / 2)
    loaded = decode_tum(f"0 0 0 0 {qx} {qy} {qz} {qw}")
    assert loaded.poses[0, 2] == pytest.approx(yaw)


@pytest.mark.parametrize(
    "line",
    ["1 2 3", "1 2 3 4 5 6 7 8 9", "1 2 3 4 5 6 7 x", "1 2 nan 0 0 0 0 1", "1 2 3 0 0 0 0 0"],
)
def test_a_damaged_line_is_named_by_its_number(line: str) -> None:
    with pytest.raises(UsageError, match="line 2 "):
        decode_tum(f"0 0 0 0 0 0 0 1\n{line}\n")


def test_stamps_and_poses_must_be_as_many() -> None:
    with pytest.raises(ValueError, match="2 stamps"):
        Trajectory(np.zeros(2), np.zeros((3, 3)))


def test_no_pose_is_an_empty_file() -> None:
    assert encode_tum(Trajectory(np.empty(0), np.empty((0, 3)))) == ""
    assert decode_tum("").poses.shape == (0, 3)


def test_a_stretch_ends_where_nothing_is_told_for_a_while() -> None:
    stamps = np.array([0.0, 0.1, 0.2, 9.0, 9.1])
    x = np.arange(5.0)
    way = Trajectory(stamps, np.column_stack([x, 0.0 * x, 0.0 * x]))
    assert [stretch[:, 0].tolist() for stretch in way.stretches] == [[0.0, 1.0, 2.0], [3.0, 4.0]]
    assert way.holes.tolist() == [False, False, True, False]
