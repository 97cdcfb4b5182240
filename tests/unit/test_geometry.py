"""Poses and angles obey the laws of the plane."""

import cmath
import copy
import math
import tracemalloc

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gvgbot.geometry import (
    STANDSTILL,
    Pose,
    Poses,
    Twist,
    anchored,
    composed,
    direction_of,
    length_of,
    resampled,
    rows_of,
    seen_from,
    stations_of,
    thinned,
    without_spikes,
    wrap_angle,
    wrap_angles,
)

angles = st.floats(-50.0, 50.0)
lengths = st.floats(-100.0, 100.0)
poses = st.builds(Pose, lengths, lengths, angles)


def homogeneous(pose: Pose) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    return np.array([[c, -s, pose.x], [s, c, pose.y], [0.0, 0.0, 1.0]])


def is_same(one: Pose, other: Pose) -> bool:
    return bool(np.allclose(homogeneous(one), homogeneous(other), atol=1e-9))


@given(angles)
def test_a_wrapped_angle_is_the_same_direction_in_the_half_open_turn(angle: float) -> None:
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert cmath.rect(1.0, wrapped) == pytest.approx(cmath.rect(1.0, angle), abs=1e-9)


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [(0.0, 0.0), (math.pi, math.pi), (-math.pi, math.pi), (3 * math.pi, math.pi), (-0.5, -0.5)],
)
def test_the_ends_of_the_turn_wrap_to_plus_pi(angle: float, wrapped: float) -> None:
    assert wrap_angle(angle) == pytest.approx(wrapped)


@given(st.lists(angles))
def test_wrapped_arrays_are_what_the_remainder_of_a_whole_turn_says(turned: list[float]) -> None:
    wrapped = wrap_angles(np.array(turned))
    assert wrapped.shape == (len(turned),)
    assert np.all((-math.pi < wrapped) & (wrapped <= math.pi))
    for angle, here in zip(turned, wrapped.tolist(), strict=True):
        away = abs(here - math.remainder(angle, math.tau))
        assert min(away, math.tau - away) < 1e-13
        if abs(angle) < math.pi:
            assert here == angle


def test_the_ends_of_the_turn_wrap_to_plus_pi_in_arrays_too() -> None:
    ends = [math.pi * turn for turn in range(-99, 100, 2)]
    wrapped = wrap_angles(np.array([*ends, *(math.nextafter(end, 0.0) for end in ends)]))
    assert np.all((-math.pi < wrapped) & (wrapped <= math.pi))
    assert np.abs(wrapped) == pytest.approx(math.pi, abs=1e-12)
    assert wrap_angles(np.array([[math.pi, -math.pi]])).tolist() == [[math.pi, math.pi]]


@given(poses, poses)
def test_composition_is_the_product_of_homogeneous_matrices(a: Pose, b: Pose) -> None:
    assert np.allclose(homogeneous(a.compose(b)), homogeneous(a) @ homogeneous(b), atol=1e-9)


@given(poses)
def test_a_pose_composed_with_its_inverse_is_the_identity(pose: Pose) -> None:
    assert is_same(pose.compose(pose.inverse()), Pose())
    assert is_same(pose.inverse().compose(pose), Pose())


@given(poses, poses, poses)
def test_composition_is_associative(a: Pose, b: Pose, c: Pose) -> None:
    assert is_same(a.compose(b).compose(c), a.compose(b.compose(c)))


@given(poses, poses)
def test_the_motion_to_a_pose_leads_there(a: Pose, b: Pose) -> None:
    assert is_same(a.compose(a.to(b)), b)


@given(poses, poses, poses)
def test_a_motion_does_not_depend_on_the_frame_it_is_seen_from(a: Pose, b: Pose, c: Pose) -> None:
    assert is_same(a.to(b), c.compose(a).to(c.compose(b)))


@given(poses, poses, st.floats(0.0, 1.0))
def test_between_two_poses_the_way_is_straight_and_the_turn_even_and_short(
    a: Pose, b: Pose, share: float
) -> None:
    between = a.towards(b, share)
    straight = [np.interp(share, [0.0, 1.0], ends) for ends in ((a.x, b.x), (a.y, b.y))]
    assert between.position == pytest.approx(straight, abs=1e-9)
    rotations = cmath.rect(1.0, a.theta), cmath.rect(1.0, b.theta)
    turn = cmath.phase(rotations[1] / rotations[0])
    assume(abs(turn) < math.pi - 1e-6)  # half a turn is as short either way round
    turned = rotations[0] * cmath.rect(1.0, share * turn)
    assert cmath.rect(1.0, between.theta) == pytest.approx(turned, abs=1e-9)


@given(poses, st.lists(st.tuples(lengths, lengths), min_size=1, max_size=5))
def test_points_transform_as_poses_do(pose: Pose, points: list[tuple[float, float]]) -> None:
    moved = pose.transform(np.array(points))
    for point, (x, y) in zip(moved, points, strict=True):
        assert point == pytest.approx(pose.compose(Pose(x, y)).position, abs=1e-9)


@given(poses, st.tuples(lengths, lengths), st.tuples(lengths, lengths))
def test_a_transform_keeps_distances(
    pose: Pose, one: tuple[float, float], other: tuple[float, float]
) -> None:
    moved = pose.transform(np.array([one, other]))
    assert math.dist(*moved) == pytest.approx(math.dist(one, other), abs=1e-9)


def test_a_single_point_transforms_without_a_batch() -> None:
    assert Pose(1.0, 2.0, math.pi / 2).transform(np.array([3.0, 0.0])) == pytest.approx([1.0, 5.0])


def test_a_quarter_turn_points_to_the_left() -> None:
    there = Pose(1.0, 0.0, math.pi / 2).compose(Pose(2.0, 0.0))
    assert (there.x, there.y) == pytest.approx((1.0, 2.0))


def test_distance_is_between_origins_whatever_the_headings() -> None:
    assert Pose(1.0, 1.0, 3.0).distance(Pose(4.0, 5.0, -1.0)) == pytest.approx(5.0)


def test_a_pose_is_near_another_only_if_place_and_heading_are() -> None:
    here, there = Pose(1.0, 1.0, 3.1), Pose(4.0, 5.0, -3.1)  # 5 m off, 0.083 rad over the seam
    for one, other in ((here, there), (there, here)):
        assert one.is_near(other, 5.01, 0.09)
        assert not one.is_near(other, 4.99, 0.09)
        assert not one.is_near(other, 5.01, 0.08)


def test_a_pose_is_read_from_an_array() -> None:
    assert Pose.from_array(np.array([1.0, 2.0, 0.5])) == Pose(1.0, 2.0, 0.5)


def test_a_standstill_does_not_move() -> None:
    assert Twist(0.0, 0.0) == STANDSTILL


@given(st.lists(poses, max_size=5))
def test_rows_of_poses_are_read_back_as_these(listed: list[Pose]) -> None:
    rows = rows_of(listed)
    assert rows.shape == (len(listed), 3)
    assert [Pose.from_array(row) for row in rows] == listed


@given(st.lists(poses, max_size=4), st.lists(poses, max_size=4), st.integers(0, 8))
def test_kept_poses_are_given_back_as_they_came(a: list[Pose], b: list[Pose], first: int) -> None:
    kept = Poses(a)
    before = copy.deepcopy(kept)
    kept.extend(rows_of(b))
    listed = a + b
    assert before.rows().tolist() == rows_of(a).tolist()
    assert [kept[i] for i in range(-len(listed), len(kept))] == listed + listed
    assert kept.rows(first, 5).tolist() == rows_of(listed[first:5]).tolist()
    kept.cut(first)
    assert kept.rows().tolist() == rows_of(listed[:first]).tolist()


def test_a_kept_pose_takes_the_room_of_three_numbers() -> None:
    tracemalloc.start()
    kept = Poses(Pose(0.1 * i, 0.2 * i, 0.3) for i in range(1000))
    size, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert 24 * len(kept) < size < 30 * len(kept)


@given(st.lists(st.tuples(poses, poses), min_size=1, max_size=5))
def test_rows_of_poses_are_composed_and_seen_from_each_other_as_matrices_say(
    pairs: list[tuple[Pose, Pose]],
) -> None:
    a_b, other = (rows_of(row) for row in zip(*pairs, strict=True))
    together, apart = composed(a_b, other), seen_from(a_b, other)
    assert together.shape == apart.shape == (len(pairs), 3)
    for (one, two), a_c, b_c in zip(pairs, together, apart, strict=True):
        product = homogeneous(one) @ homogeneous(two)
        assert np.allclose(homogeneous(Pose.from_array(a_c)), product, atol=1e-9)
        quotient = np.linalg.inv(homogeneous(one)) @ homogeneous(two)
        assert np.allclose(homogeneous(Pose.from_array(b_c)), quotient, atol=1e-9)


def test_no_poses_composed_are_none() -> None:
    nothing = np.zeros((0, 3))
    assert composed(nothing, nothing).shape == seen_from(nothing, nothing).shape == (0, 3)


@pytest.mark.parametrize("spacing", [0.05, 0.3, 10.0])
def test_a_line_keeps_its_ends_and_its_corner_when_it_is_resampled(spacing: float) -> None:
    """An L of 3 m and 4 m: every point is on one of its legs, and none far from the next."""
    points = resampled(np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]]), spacing)
    assert points[[0, -1]].tolist() == [[0.0, 0.0], [3.0, 4.0]]
    on_first = (points[:, 1] == 0.0) & (points[:, 0] <= 3.0)
    on_second = np.isclose(points[:, 0], 3.0) & (points[:, 1] <= 4.0)
    assert (on_first | on_second).all()
    steps = np.hypot(*np.diff(points, axis=0).T)
    assert steps.max() <= spacing


def test_the_length_of_a_line_is_that_of_its_steps() -> None:
    assert length_of(np.array([(0.0, 0.0), (3.0, 4.0), (3.0, 6.0)])) == 7.0
    assert length_of(np.array([(3.0, 4.0)])) == length_of(np.empty((0, 2))) == 0.0


def test_stations_along_a_line_are_the_sums_of_its_steps() -> None:
    line = np.array([(0.0, 0.0), (3.0, 4.0), (3.0, 6.0)])
    assert stations_of(line).tolist() == [0.0, 5.0, 7.0]
    assert stations_of(line[:1]).tolist() == [0.0]


@pytest.mark.parametrize(("over", "expected"), [(0.5, 0.0), (2.0, math.pi / 4), (9.0, math.pi / 2)])
def test_a_line_sets_out_towards_where_it_is_so_far_from_its_start(
    over: float, expected: float
) -> None:
    line = np.array([(1.0, 1.0), (2.0, 1.0), (3.0, 3.0), (1.0, 5.0)])
    assert direction_of(line, over) == pytest.approx(expected)


@given(st.lists(st.tuples(lengths, lengths), min_size=2, max_size=6), poses)
def test_a_line_whose_ends_are_moved_alike_is_moved_as_a_whole(
    points: list[tuple[float, float]], by: Pose
) -> None:
    line = np.array(points)
    moved = anchored(line, line[0] + by.position, line[-1] + by.position)
    assert moved == pytest.approx(line + by.position, abs=1e-9)
    assert anchored(line, line[0], line[-1]) == pytest.approx(line, abs=1e-9)


def test_a_line_is_bent_the_more_the_nearer_to_the_end_that_is_off() -> None:
    line = np.array([(0.0, 0.0), (1.0, 0.0), (4.0, 0.0)])
    there = anchored(line, np.array([0.0, 0.4]), np.array([4.0, -0.8]))
    assert there == pytest.approx(np.array([(0.0, 0.4), (1.0, 0.1), (4.0, -0.8)]))


@given(poses)
def test_a_line_keeps_its_right_angles_and_loses_where_it_turns_back(by: Pose) -> None:
    """Behind its start, in the middle, there in two steps and back, and before its end."""
    way = [(0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (1.0, 0.5), (1.0, 1.0), (0.0, 1.0)]
    spiky = [*way]
    spiky[5:5] = [(0.3, 1.0), (0.0, 0.9)]
    spiky[3:3] = [(1.0, -0.2), (1.01, -0.4), (1.0, -0.2)]
    spiky[1:1] = [(-0.1, 0.02)]
    left = without_spikes(by.transform(np.array(spiky)))
    assert left == pytest.approx(by.transform(np.array([*way[:5], (0.3, 1.0), way[5]])), abs=1e-9)
    assert without_spikes(left) == pytest.approx(left)


@given(st.integers(0, 60), st.floats(0.1, 3.0), poses)
def test_of_points_in_a_cell_their_mean_is_left(count: int, cell: float, at: Pose) -> None:
    points = at.position + np.random.default_rng(count).uniform(-4.0, 4.0, (count, 2))
    cells: dict[tuple[int, int], list[tuple[float, float]]] = {}
    for x, y in points.tolist():
        cells.setdefault((math.floor(x / cell), math.floor(y / cell)), []).append((x, y))
    means = [
        [sum(values) / len(values) for values in zip(*cells[k], strict=True)] for k in sorted(cells)
    ]
    assert thinned(points, cell) == pytest.approx(np.array(means).reshape(-1, 2), abs=1e-9)
