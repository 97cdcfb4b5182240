"""The pose graph against exact worlds and a dense least squares solver."""

import math
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.stats import chi2

from gvgbot.autonomy.slam.smoothing import Constraint, PoseGraph, _Blocks
from gvgbot.geometry import Array, Pose, wrap_angle

seeds = st.integers(0, 2**32 - 1)


def relative(x: Array, a: int, b: int) -> Pose:
    return Pose.from_array(x[a]).to(Pose.from_array(x[b]))


def loop(n: int) -> Array:
    """Poses (n, 3) round a circle of 5 m, beginning at the origin."""
    angle = np.arange(n) * math.tau / n
    return np.stack([5 * np.sin(angle), 5 - 5 * np.cos(angle), angle], axis=1)


def difference(x: Array, y: Array) -> Array:
    d = x - y
    d[:, 2] = [wrap_angle(a) for a in d[:, 2]]
    return d


def random_information(rng: np.random.Generator) -> Array:
    root = rng.normal(0.0, 1.0, (3, 3))
    return 100 * (root @ root.T + np.eye(3))


@settings(max_examples=20)
@given(seeds)
def test_exact_constraints_of_a_loop_give_the_exact_poses_back(seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = loop(24)
    pairs = [(i, i + 1) for i in range(23)] + [(23, 0), (4, 17)]
    constraints = [
        Constraint(a, b, relative(truth, a, b), random_information(rng)) for a, b in pairs
    ]
    start = truth + rng.normal(0.0, 0.1, truth.shape)
    start[0] = truth[0]
    assert np.abs(difference(PoseGraph(constraints).solve(start), truth)).max() < 1e-5


@settings(max_examples=10)
@given(seeds)
def test_the_result_is_that_of_a_dense_solver(seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = loop(8)
    pairs = [(i, i + 1) for i in range(7)] + [(7, 0), (1, 5), (6, 2), (1, 5), (5, 1)]
    constraints = []
    for a, b in pairs:
        z = relative(truth, a, b)
        error = rng.normal(0.0, 0.05, 3)
        z = Pose(z.x + error[0], z.y + error[1], z.theta + error[2])
        constraints.append(Constraint(a, b, z, random_information(rng)))
    start = truth + np.concatenate([np.zeros((1, 3)), rng.normal(0.0, 0.05, (7, 3))])

    def residuals(free: Array) -> Array:
        x = np.concatenate([truth[:1], free.reshape(-1, 3)])
        rows = []
        for c in constraints:
            seen = relative(x, c.a, c.b)
            r = np.array([seen.x - c.a_b.x, seen.y - c.a_b.y, wrap_angle(seen.theta - c.a_b.theta)])
            rows.append(np.linalg.cholesky(c.information).T @ r)
        return np.concatenate(rows)

    solved = least_squares(residuals, start[1:].ravel(), xtol=1e-12, ftol=1e-12, gtol=1e-12)
    dense = np.concatenate([truth[:1], np.asarray(solved.x).reshape(-1, 3)])
    assert np.abs(difference(PoseGraph(constraints).solve(start), dense)).max() < 1e-4


@given(seeds)
def test_the_first_pose_stays_where_it_is(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = rng.uniform(-3, 3, (5, 3))
    constraints = [
        Constraint(i, i + 1, Pose(*rng.uniform(-1, 1, 3)), random_information(rng))
        for i in range(4)
    ]
    assert PoseGraph(constraints).solve(x)[0] == pytest.approx(x[0], abs=1e-6)


def test_a_chain_without_a_loop_is_dead_reckoning() -> None:
    steps = [Pose(1.0, 0.1, 0.5), Pose(0.5, 0.0, -1.0), Pose(2.0, -0.3, 3.0)]
    poses = [Pose(1.0, 2.0, 0.3)]
    for step in steps:
        poses.append(poses[-1].compose(step))
    start = np.array([[p.x + 0.3 * (i > 0), p.y, p.theta] for i, p in enumerate(poses)])
    constraints = [Constraint(i, i + 1, step, np.eye(3)) for i, step in enumerate(steps)]
    expected = np.array([[p.x, p.y, p.theta] for p in poses])
    assert np.abs(difference(PoseGraph(constraints).solve(start), expected)).max() < 1e-6


def test_a_position_measurement_leaves_the_heading_to_others() -> None:
    """A vertex seen without its heading: information 0 there, and the heading of another sight."""
    place_only = np.diag([100.0, 100.0, 0.0])
    constraints = [
        Constraint(0, 1, Pose(1.0, 0.0, 0.5), np.diag([100.0, 100.0, 100.0])),
        Constraint(0, 1, Pose(1.2, 0.0, -2.0), place_only),
    ]
    x = PoseGraph(constraints).solve(np.zeros((2, 3)))
    assert x[1] == pytest.approx([1.1, 0.0, 0.5], abs=1e-6)


def test_a_loop_closure_spreads_the_error_evenly_over_equal_steps() -> None:
    """Ten steps of 1.02 m measured on a way of 10 m known exactly: every step is 1 m."""
    constraints = [Constraint(i, i + 1, Pose(1.02, 0.0, 0.0), np.eye(3)) for i in range(10)]
    constraints.append(Constraint(0, 10, Pose(10.0, 0.0, 0.0), 1e8 * np.eye(3)))
    start = np.stack([np.arange(11) * 1.02, np.zeros(11), np.zeros(11)], axis=1)
    assert PoseGraph(constraints).solve(start)[:, 0] == pytest.approx(np.arange(11.0), abs=1e-5)


def test_without_constraints_nothing_moves() -> None:
    x = np.arange(9.0).reshape(3, 3)
    assert np.array_equal(PoseGraph([]).solve(x), x)


def test_the_poses_handed_in_are_left_alone() -> None:
    x = np.zeros((2, 3))
    PoseGraph([Constraint(0, 1, Pose(1.0, 0.0, 0.0), np.eye(3))]).solve(x)
    assert not x.any()


# -- doubtful constraints and covariances ----------------------------------------------------------


def chain(rng: np.random.Generator, truth: Array, information: Array) -> list[Constraint]:
    """Steps along poses, measured with errors of this information (3, 3)."""
    steps = []
    for i in range(len(truth) - 1):
        z, e = (
            relative(truth, i, i + 1),
            rng.multivariate_normal(np.zeros(3), np.linalg.inv(information)),
        )
        noisy = Pose(z.x + e[0], z.y + e[1], z.theta + e[2])
        steps.append(Constraint(i, i + 1, noisy, information))
    return steps


def test_a_doubtful_closure_that_all_others_contradict_hardly_counts() -> None:
    truth, W = loop(24), np.diag([1e4, 1e4, 1e6])
    constraints = chain(np.random.default_rng(3), truth, W)
    right = [Constraint(i, i + 12, relative(truth, i, i + 12), W, doubtful=True) for i in range(12)]
    honest = PoseGraph(constraints + right).solve(truth)
    z = relative(truth, 5, 20)
    wrong = Pose(z.x + 1.0, z.y, z.theta)
    for doubtful, least, most in ((True, 0.0, 0.01), (False, 0.1, 1.0)):
        lie = Constraint(5, 20, wrong, W, doubtful=doubtful)
        moved = PoseGraph([*constraints, *right, lie]).solve(truth) - honest
        assert least <= np.abs(moved[:, :2]).max() < most


def test_covariances_are_those_of_a_dense_linearisation() -> None:
    rng, truth = np.random.default_rng(4), loop(8)
    W = random_information(rng)
    constraints = [*chain(rng, truth, W), Constraint(0, 7, relative(truth, 0, 7), W)]
    graph = PoseGraph(constraints)
    x = graph.solve(truth)

    def residuals(free: Array) -> Array:
        y = np.concatenate([truth[:1], free.reshape(-1, 3)])
        rows = []
        for c in constraints:
            r = np.array(relative_array(y, c.a, c.b)) - (c.a_b.x, c.a_b.y, c.a_b.theta)
            r[2] = wrap_angle(float(r[2]))
            rows.append(np.linalg.cholesky(c.information).T @ r)
        return np.concatenate(rows)

    free, h = x[1:].ravel(), 1e-6
    J = np.stack(
        [(residuals(free + h * e) - residuals(free - h * e)) / (2 * h) for e in np.eye(len(free))],
        axis=1,
    )
    dense = np.linalg.inv(J.T @ J)
    for pose, P in zip((3, 6), graph.covariances(x, [3, 6]), strict=True):
        i = 3 * (pose - 1)
        assert np.allclose(P, dense[i : i + 3, i : i + 3], rtol=1e-4, atol=1e-9)


def laps(n: int) -> tuple[PoseGraph, Array]:
    """Poses (n, 3) round and round a circle, tied to the one before and that of a lap before."""
    x, W = np.tile(loop(20), (n // 20, 1)), np.diag([1e4, 1e4, 1e5])
    pairs = [(i - back, i) for back in (1, 20) for i in range(back, n)]
    return PoseGraph([Constraint(a, b, relative(x, a, b), W) for a, b in pairs]), x


def test_covariances_of_many_poses_are_the_blocks_of_a_dense_inverse() -> None:
    graph, x = laps(60)
    H, _ = graph._normal_equations(x, _Blocks.of(graph._a, graph._b, len(x)), trusting=False)
    dense = np.linalg.inv(H.toarray())
    wanted = np.random.default_rng(6).permutation(60)[:43].tolist()
    blocks = [dense[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] for i in wanted]
    np.testing.assert_allclose(graph.covariances(x, wanted), blocks, rtol=1e-9, atol=1e-14)


def test_covariances_of_all_poses_take_hardly_more_memory_than_those_of_one() -> None:
    graph, x = laps(300)

    def peak(*wanted: int) -> int:
        tracemalloc.start()
        graph.covariances(x, list(wanted))
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    assert peak(*range(300)) < 1.5 * peak(299)


def relative_array(x: Array, a: int, b: int) -> tuple[float, float, float]:
    pose = relative(x, a, b)
    return pose.x, pose.y, pose.theta


def test_errors_are_as_large_as_the_covariances_say() -> None:
    rng, truth, W = np.random.default_rng(5), loop(16), np.diag([1e4, 1e4, 1e5])
    total, runs = 0.0, 100
    for _ in range(runs):
        constraints = chain(rng, truth, W)
        e = rng.multivariate_normal(np.zeros(3), np.linalg.inv(W))
        z = relative(truth, 0, 15)
        constraints.append(Constraint(0, 15, Pose(z.x + e[0], z.y + e[1], z.theta + e[2]), W))
        graph = PoseGraph(constraints)
        x = graph.solve(truth)
        error = difference(x, truth)[8]
        total += float(error @ np.linalg.solve(graph.covariances(x, [8])[0], error))
    assert chi2.ppf(0.005, 3 * runs) < total < chi2.ppf(0.995, 3 * runs)


def test_no_pose_wanted_is_no_covariance() -> None:
    assert PoseGraph([]).covariances(np.zeros((1, 3)), []).shape == (0, 3, 3)
