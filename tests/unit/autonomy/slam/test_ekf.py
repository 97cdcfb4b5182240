"""The filter against finite differences, Monte Carlo, the information form and chi-squared."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.stats import chi2

from gvgbot.autonomy.slam.ekf import (
    Belief,
    OdometryNoise,
    add_vertex,
    apart,
    distances,
    expected,
    innovation,
    mahalanobis,
    part,
    place_robot,
    predict,
    predict_in_place,
    remove_vertex,
    unite,
    update_in_place,
    update_vertex_in_place,
)
from gvgbot.geometry import Array, Pose, wrap_angle
from tests.unit.autonomy.slam.beliefs import updated

seeds = st.integers(0, 2**32 - 1)


def random_covariance(rng: np.random.Generator, n: int, sigma: float = 0.3) -> Array:
    root = rng.normal(0.0, sigma, (n, n))
    return root @ root.T / n + 1e-4 * np.eye(n)


def random_pose(rng: np.random.Generator) -> Pose:
    return Pose.from_array(rng.uniform((-9.0, -9.0, -3.0), (9.0, 9.0, 3.0)))


def random_belief(rng: np.random.Generator, vertices: int) -> Belief:
    x = np.concatenate([as_array(random_pose(rng)) for _ in range(vertices + 1)])
    return Belief(x, random_covariance(rng, len(x)), tuple(range(10, 10 + vertices)))


def as_array(pose: Pose) -> Array:
    return np.array([pose.x, pose.y, pose.theta])


def numerical_jacobian(function: Callable[[Array], Array], x: Array, step: float = 1e-6) -> Array:
    columns = []
    for i in range(len(x)):
        d = np.zeros(len(x))
        d[i] = step
        change = function(x + d) - function(x - d)
        change[2::3] = [wrap_angle(a) for a in change[2::3]]
        columns.append(change / (2 * step))
    return np.stack(columns, axis=1)


def moved(x: Array, motion: Array) -> Array:
    return as_array(Pose.from_array(x).compose(Pose.from_array(motion)))


def composed(a: Array, b: Array) -> Array:
    """Poses (N, 3) a composed with b, written out with complex numbers."""
    turn = np.exp(1j * a[:, 2])
    place = a[:, 0] + 1j * a[:, 1] + turn * (b[:, 0] + 1j * b[:, 1])
    return np.stack([place.real, place.imag, a[:, 2] + b[:, 2]], axis=1)


# -- Jacobians ---------------------------------------------------------------------------------


@given(seeds)
def test_prediction_has_the_jacobians_of_the_motion(seed: int) -> None:
    rng = np.random.default_rng(seed)
    belief, motion, Q = random_belief(rng, 2), random_pose(rng), random_covariance(rng, 3)
    F = numerical_jacobian(lambda x: moved(x, as_array(motion)), belief.x[:3])
    G = numerical_jacobian(lambda m: moved(belief.x[:3], m), as_array(motion))
    after = predict(belief, motion, Q)
    assert np.allclose(after.P[:3, :3], F @ belief.P[:3, :3] @ F.T + G @ Q @ G.T, atol=1e-6)
    assert np.allclose(after.P[:3, 3:], F @ belief.P[:3, 3:], atol=1e-6)
    assert np.array_equal(after.P[3:, 3:], belief.P[3:, 3:])


@given(seeds)
def test_predicting_in_place_gives_the_same(seed: int) -> None:
    rng = np.random.default_rng(seed)
    belief, motion, Q = random_belief(rng, 2), random_pose(rng), random_covariance(rng, 3)
    wanted, here = predict(belief, motion, Q), belief.P
    after = predict_in_place(belief, motion, Q)
    assert after.P is here
    assert np.array_equal(after.P, wanted.P)
    assert np.array_equal(after.x, wanted.x)


@given(seeds)
def test_a_new_vertex_has_the_jacobians_of_its_placement(seed: int) -> None:
    rng = np.random.default_rng(seed)
    belief, seen, R = random_belief(rng, 1), random_pose(rng), random_covariance(rng, 3)
    J_r = numerical_jacobian(lambda x: moved(x, as_array(seen)), belief.x[:3])
    J_z = numerical_jacobian(lambda z: moved(belief.x[:3], z), as_array(seen))
    after = add_vertex(belief, 77, seen, R)
    assert np.allclose(after.P[6:, 6:], J_r @ belief.P[:3, :3] @ J_r.T + J_z @ R @ J_z.T, atol=1e-6)
    assert np.allclose(after.P[6:, :6], J_r @ belief.P[:3, :6], atol=1e-6)
    assert np.array_equal(after.P[:6, :6], belief.P)


@given(seeds)
def test_a_robot_that_is_placed_by_a_vertex_has_the_jacobians_of_its_placement(seed: int) -> None:
    rng = np.random.default_rng(seed)
    belief, seen, R = random_belief(rng, 3), random_pose(rng), random_covariance(rng, 3)
    at = slice(6, 9)  # of the second vertex
    J_v = numerical_jacobian(lambda x: moved(x, as_array(seen)), belief.x[at])
    J_z = numerical_jacobian(lambda z: moved(belief.x[at], z), as_array(seen))
    after = place_robot(belief, belief.ids[1], seen, R)
    assert np.array_equal(after.x[:3], moved(belief.x[at], as_array(seen)))
    assert np.allclose(after.P[:3, 3:], J_v @ belief.P[at, 3:], atol=1e-6)
    assert np.allclose(after.P[:3, :3], J_v @ belief.P[at, at] @ J_v.T + J_z @ R @ J_z.T, atol=1e-6)
    assert np.allclose(after.P, after.P.T)
    assert np.array_equal(after.P[3:, 3:], belief.P[3:, 3:])


@given(seeds, st.integers(0, 2))
def test_the_measurement_has_the_jacobian_of_the_pose_in_the_base_frame(seed: int, i: int) -> None:
    belief = random_belief(np.random.default_rng(seed), 3)

    def measured(x: Array) -> Array:
        return as_array(expected(Belief(x, belief.P, belief.ids), belief.ids[i])[0])

    assert np.allclose(
        expected(belief, belief.ids[i])[1], numerical_jacobian(measured, belief.x), atol=1e-6
    )


# -- Monte Carlo -------------------------------------------------------------------------------


def test_prediction_agrees_with_the_spread_of_moved_samples() -> None:
    rng = np.random.default_rng(1)
    x, motion = np.array([1.0, -2.0, 0.7]), np.array([0.5, 0.1, 0.4])
    P, Q = random_covariance(rng, 3, 0.02), random_covariance(rng, 3, 0.02)
    starts = rng.multivariate_normal(x, P, 200_000)
    motions = rng.multivariate_normal(motion, Q, 200_000)
    spread = np.cov(composed(starts, motions).T)
    after = predict(Belief(x, P), Pose.from_array(motion), Q)
    assert np.abs(after.P - spread).max() < 0.02 * np.abs(spread).max()


def test_odometry_noise_agrees_with_a_drive_of_many_small_noisy_steps() -> None:
    """White noise on way and heading along a straight metre that takes two seconds."""
    rng = np.random.default_rng(2)
    noise, steps, runs = OdometryNoise(), 100, 20_000
    d, dt = 1.0 / steps, 2.0 / steps
    way = d + rng.normal(0.0, noise.along_m_per_sqrt_m * math.sqrt(d), (runs, steps))
    sigma = math.hypot(
        noise.turn_rad_per_sqrt_m * math.sqrt(d), noise.turn_rad_per_sqrt_s * math.sqrt(dt)
    )
    heading = np.cumsum(rng.normal(0.0, sigma, (runs, steps)), axis=1)
    ends = np.stack(
        [(way * np.cos(heading)).sum(1), (way * np.sin(heading)).sum(1), heading[:, -1]], axis=1
    )
    P = noise.covariance(Pose(1.0, 0.0, 0.0), 2.0)
    scale = np.sqrt(np.diag(P))
    assert np.abs((P - np.cov(ends.T)) / np.outer(scale, scale)).max() < 0.04


@pytest.mark.parametrize("steps", [2, 4, 10])
@pytest.mark.parametrize(
    "whole", [Pose(1.0, 0.0, 0.0), Pose(0.0, 0.0, 1.2)], ids=["straight", "turn"]
)
def test_noise_does_not_depend_on_the_rate_of_prediction(whole: Pose, steps: int) -> None:
    noise = OdometryNoise()
    part = Pose(whole.x / steps, 0.0, whole.theta / steps)
    belief = Belief()
    for _ in range(steps):
        belief = predict(belief, part, noise.covariance(part, 2.0 / steps))
    once = predict(Belief(), whole, noise.covariance(whole, 2.0))
    c, s = math.cos(whole.theta / 2), math.sin(whole.theta / 2)
    assert np.allclose(belief.x, once.x, atol=1e-9)
    assert math.isclose(belief.P[2, 2], once.P[2, 2], rel_tol=1e-3)
    if whole.theta == 0.0:
        assert np.allclose(belief.P, once.P, rtol=1e-2, atol=1e-6)
    else:  # a turn spreads its shift evenly, whichever way its frame points
        direction = np.array([c, s])
        variance = [float(direction @ b.P[:2, :2] @ direction) for b in (belief, once)]
        assert math.isclose(*variance, rel_tol=1e-2)


# -- update --------------------------------------------------------------------------------------


@given(seeds, st.sampled_from([2, 3]))
def test_an_update_adds_the_information_of_the_measurement(seed: int, size: int) -> None:
    """The information form is another way to the same covariance and mean."""
    rng = np.random.default_rng(seed)
    belief = random_belief(rng, 2)
    R = random_covariance(rng, size)
    foreseen, H = expected(belief, 11)
    seen = Pose.from_array(as_array(foreseen) + rng.normal(0.0, 0.03, 3))
    r = (as_array(seen) - as_array(foreseen))[:size]
    information = np.linalg.inv(belief.P) + H[:size].T @ np.linalg.inv(R) @ H[:size]
    x = belief.x + np.linalg.solve(information, H[:size].T @ np.linalg.solve(R, r))
    after = updated(belief, 11, seen, R)
    assert np.allclose(after.P, np.linalg.inv(information), atol=1e-7)
    assert np.allclose(np.exp(1j * after.x), np.exp(1j * x), atol=1e-7)


@given(seeds)
def test_a_large_innovation_leads_to_the_most_probable_state(seed: int) -> None:
    """As least squares finds it from the belief and the measurement, turned wherever that is."""
    rng = np.random.default_rng(seed)
    x = np.array([0.0, 0.0, 0.4, 6.0, 2.0, 0.1, -3.0, 4.0, 0.0])
    belief = Belief(x, np.diag([0.2, 0.2, 0.15, 0.05, 0.05, 0.02, 0.1, 0.1, 0.1]) ** 2, (1, 2))
    foreseen, R = expected(belief, 1)[0], np.diag([0.05, 0.05, 0.05]) ** 2
    aside = rng.uniform(0.4, 1.0) * np.exp(1j * rng.uniform(-math.pi, math.pi))
    seen = Pose(foreseen.x + aside.real, foreseen.y + aside.imag, foreseen.theta + 0.1)
    whiten = np.linalg.inv(np.linalg.cholesky(belief.P))

    def misfit(x: Array) -> Array:
        off = as_array(seen) - as_array(expected(Belief(x, belief.P, belief.ids), 1)[0])
        return np.concatenate([whiten @ (x - belief.x), off / 0.05])

    best = least_squares(misfit, belief.x).x
    assert np.allclose(updated(belief, 1, seen, R).x, best, atol=2e-3)


def test_a_map_of_many_blocks_is_corrected_as_the_textbook_says() -> None:
    """Joseph's form with dense matrices; and not one bit of symmetry is lost."""
    rng = np.random.default_rng(1)
    belief, R = random_belief(rng, 90), random_covariance(rng, 3)
    P = belief.P
    foreseen, H = expected(belief, 50)
    S = H @ P @ H.T + R
    assert np.allclose(innovation(belief, 50, foreseen, R)[1], S, rtol=0.0, atol=1e-13)
    K = P @ H.T @ np.linalg.inv(S)
    rest = np.eye(len(P)) - K @ H
    joseph = rest @ P @ rest.T + K @ R @ K.T
    after = update_in_place(belief, 50, Pose(foreseen.x + 0.01, foreseen.y, foreseen.theta), R)
    assert after.P is P
    assert np.allclose(after.P, joseph, rtol=0.0, atol=1e-13)
    assert np.allclose(after.P, after.P.T)


@given(seeds, st.integers(2, 3))
def test_a_vertex_alone_is_corrected_as_with_a_gain_that_is_zero_elsewhere(
    seed: int, k: int
) -> None:
    rng = np.random.default_rng(seed)
    belief = random_belief(rng, 5)
    vertex = int(rng.choice(belief.ids))
    R, own = random_covariance(rng, k), 3 + 3 * belief.ids.index(vertex) + np.arange(3)
    foreseen, H = expected(belief, vertex)
    seen, H = foreseen.compose(Pose(0.1, -0.2, 0.05)), H[:k]
    r = np.array([seen.x - foreseen.x, seen.y - foreseen.y, 0.05])[:k]
    K = np.zeros((len(belief.x), k))
    K[own] = (belief.P @ H.T @ np.linalg.inv(H @ belief.P @ H.T + R))[own]
    rest = np.eye(len(belief.x)) - K @ H
    joseph, x = rest @ belief.P @ rest.T + K @ R @ K.T, belief.x + K @ r
    after = update_vertex_in_place(belief, vertex, seen, R)
    off = after.x - x
    assert np.allclose(after.P, joseph, rtol=0.0, atol=1e-12)
    assert np.allclose(after.P, after.P.T, rtol=0.0, atol=1e-15)
    assert np.allclose([*np.delete(off, np.s_[2::3]), *np.sin(off[2::3])], 0.0, atol=1e-12)


@given(seeds)
def test_many_updates_keep_the_covariance_symmetric_and_positive(seed: int) -> None:
    rng = np.random.default_rng(seed)
    belief = random_belief(rng, 3)
    for _ in range(30):
        vertex = int(rng.choice(belief.ids))
        seen = expected(belief, vertex)[0]
        R = np.diag(10.0 ** rng.uniform(-10, 0, 3))
        belief = updated(belief, vertex, seen, R[: (k := int(rng.integers(2, 4))), :k])
        belief = predict(belief, Pose(0.1, 0.0, 0.1), 1e-6 * np.eye(3))
    assert np.allclose(belief.P, belief.P.T, rtol=0.0, atol=1e-15)
    assert np.linalg.eigvalsh(belief.P).min() > -1e-10


@given(st.floats(-3.1, 3.1), st.floats(-3.1, 3.1))
def test_an_innovation_of_the_heading_is_the_short_way_round(psi: float, seen: float) -> None:
    belief = Belief(np.array([0.0, 0.0, 0.0, 1.0, 0.0, psi]), np.eye(6), (1,))
    r, _, _ = innovation(belief, 1, Pose(1.0, 0.0, seen), np.eye(3))
    assert abs(r[2]) <= math.pi
    assert math.cos(r[2]) == pytest.approx(math.cos(seen - psi))


def test_headings_stay_wrapped_through_an_update() -> None:
    x = np.array([0.0, 0.0, 3.1, -1.0, 0.0, -3.1])
    belief = Belief(x, np.diag([0.1, 0.1, 0.5, 0.1, 0.1, 0.5]), (1,))
    seen = expected(belief, 1)[0]
    after = updated(belief, 1, Pose(seen.x, seen.y, seen.theta - 0.4), 1e-4 * np.eye(3))
    assert (np.abs(after.x[2::3]) <= math.pi).all()
    assert wrap_angle(after.x[5] - after.x[2] - (-6.2 - 0.4)) == pytest.approx(0.0, abs=1e-3)


@given(seeds)
def test_the_distance_of_an_innovation_is_that_in_whitened_space(seed: int) -> None:
    rng = np.random.default_rng(seed)
    S, r = random_covariance(rng, 3), rng.normal(size=3)
    white = np.linalg.solve(np.linalg.cholesky(S), r)
    assert mahalanobis(r, S) == pytest.approx(float(white @ white))


# -- the map -------------------------------------------------------------------------------------


def test_the_first_vertex_gets_only_the_uncertainty_of_sensing() -> None:
    R = np.diag([0.04, 0.01, 0.001])
    belief = add_vertex(Belief(np.array([3.0, 1.0, math.pi / 2])), 1, Pose(2.0, 0.0, 0.0), R)
    assert np.allclose(belief.x[3:], [3.0, 3.0, math.pi / 2])
    assert np.allclose(belief.vertex_covariance(1), np.diag([0.01, 0.04]))  # turned by 90 degrees
    assert not belief.P[:3].any()
    assert belief.map_vertex(1) == Pose.from_array(belief.x[3:])


@given(seeds)
def test_removing_a_vertex_that_told_nothing_leaves_what_would_be_without_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start = Belief(np.zeros(3), random_covariance(rng, 3, 0.05))
    R = 0.01 * np.eye(3)
    one, other = random_pose(rng), random_pose(rng)
    without = add_vertex(start, 1, one, R)
    with_it = add_vertex(add_vertex(start, 2, other, R), 1, one, R)
    step = Pose(0.3, 0.0, 0.1)
    seen = Pose.from_array(as_array(step.to(one)) + 0.05)
    beliefs = [
        updated(predict(belief, step, 0.01 * np.eye(3)), 1, seen, R)
        for belief in (with_it, without)
    ]
    left = remove_vertex(beliefs[0], 2)
    assert left.ids == beliefs[1].ids
    assert np.allclose(left.x, beliefs[1].x)
    assert np.allclose(left.P, beliefs[1].P)


@given(seeds)
def test_the_order_of_the_vertices_does_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start = Belief(np.zeros(3), random_covariance(rng, 3, 0.05))
    seen = {vertex: random_pose(rng) for vertex in (1, 2, 3)}
    again = {v: Pose.from_array(as_array(p) + rng.normal(0, 0.05, 3)) for v, p in seen.items()}
    beliefs = []
    for order in ((1, 2, 3), (3, 1, 2)):
        belief = start
        for vertex in order:
            belief = add_vertex(belief, vertex, seen[vertex], 0.01 * np.eye(3))
        for vertex in (2, 3):
            belief = updated(belief, vertex, again[vertex], 0.02 * np.eye(3))
        beliefs.append(belief)
    one, other = beliefs
    assert np.allclose(one.P[:3, :3], other.P[:3, :3])
    for vertex in (1, 2, 3):
        assert np.allclose(as_array(one.map_vertex(vertex)), as_array(other.map_vertex(vertex)))
        assert np.allclose(one.vertex_covariance(vertex), other.vertex_covariance(vertex))


# -- the whole filter ------------------------------------------------------------------------------

SIDE, RUNS = 8.0, 60
CORNERS = tuple(Pose(SIDE * x, SIDE * y, 0.3) for x, y in ((1, 0), (1, 1), (0, 1), (0, 0)))
SENSING = np.diag([0.05**2, 0.05**2, 0.02**2])


def drive_square(seed: int) -> tuple[Belief, Pose]:
    """Twice round a square, seeing each corner on arrival: belief and true pose at the end."""
    rng = np.random.default_rng(seed)
    noise, truth, belief = OdometryNoise(), Pose(), Belief()
    for lap in range(2):
        for vertex, corner in enumerate(CORNERS):
            for step in [Pose(0.5, 0.0, 0.0)] * int(SIDE / 0.5) + [Pose(0.0, 0.0, math.pi / 2)]:
                Q = noise.covariance(step, 1.0)
                belief = predict(belief, step, Q)
                error = Pose.from_array(rng.multivariate_normal(np.zeros(3), Q))
                truth = truth.compose(Pose(step.x + error.x, error.y, step.theta + error.theta))
            seen = as_array(truth.to(corner)) + rng.multivariate_normal(np.zeros(3), SENSING)
            known = updated if lap else add_vertex
            belief = known(belief, vertex, Pose.from_array(seen), SENSING)
    return belief, truth


def test_errors_after_two_laps_are_as_large_as_the_filter_says() -> None:
    total, robot, places = 0.0, 3 * RUNS, 0.0
    for seed in range(RUNS):
        belief, truth = drive_square(seed)
        error = as_array(belief.map_base) - as_array(truth)
        error[2] = wrap_angle(error[2])
        total += mahalanobis(error, belief.P[:3, :3])
        for vertex, corner in enumerate(CORNERS):
            off = belief.map_vertex(vertex).position - corner.position
            places += mahalanobis(off, belief.vertex_covariance(vertex)) / len(CORNERS)
    low, high = float(chi2.ppf(0.005, robot)), float(chi2.ppf(0.995, robot))
    assert low < total < high  # three degrees of freedom a run
    assert 1.3 < places / RUNS < 2.8  # two degrees of freedom; corners of one run are correlated


def test_a_loop_closure_shrinks_what_odometry_alone_lets_grow() -> None:
    belief, _ = drive_square(5)
    noise, blind = OdometryNoise(), Belief()
    for _ in range(8):
        for step in [Pose(0.5, 0.0, 0.0)] * int(SIDE / 0.5) + [Pose(0.0, 0.0, math.pi / 2)]:
            blind = predict(blind, step, noise.covariance(step, 1.0))
    assert np.trace(belief.P[:2, :2]) < 0.5 * np.trace(blind.P[:2, :2])


@given(seeds, st.integers(0, 5))
def test_distances_of_all_vertices_are_those_of_each_innovation(seed: int, vertices: int) -> None:
    rng = np.random.default_rng(seed)
    belief, point = random_belief(rng, vertices), rng.uniform(-9.0, 9.0, 2)
    R = random_covariance(rng, 2)
    d2, metres = distances(belief, point, R)
    assert d2.shape == metres.shape == (vertices,)
    for i, vertex in enumerate(belief.ids):
        r, S, _ = innovation(belief, vertex, Pose(*point.tolist()), R)
        assert d2[i] == pytest.approx(mahalanobis(r, S))
        assert metres[i] == pytest.approx(math.hypot(*r))


@given(seeds)
def test_vertices_apart_are_those_that_many_draws_show(seed: int) -> None:
    belief = random_belief(np.random.default_rng(seed), 3)
    r, S = apart(belief, 11, [10, 12])
    for offset, covariance, i in zip(r, S, (3, 9), strict=True):
        A = np.zeros((2, len(belief.x)))
        A[:, 6:8], A[:, i : i + 2] = np.eye(2), -np.eye(2)
        np.testing.assert_allclose(offset, A @ belief.x)
        np.testing.assert_allclose(covariance, A @ belief.P @ A.T, atol=1e-12)


@given(seeds)
def test_uniting_two_vertices_is_the_information_form_with_one_more_row(seed: int) -> None:
    """Their difference is measured as nought; the rest follows by the normal equations."""
    rng = np.random.default_rng(seed)
    belief, R = random_belief(rng, 3), random_covariance(rng, 2)
    belief.x[2::3] = 0.1 * belief.x[2::3]  # far from where angles wrap
    united = unite(belief, 10, 12, R)
    A = np.zeros((2, len(belief.x)))
    A[:, 3:5], A[:, 9:11] = np.eye(2), -np.eye(2)
    information = np.linalg.inv(belief.P) + A.T @ np.linalg.inv(R) @ A
    x = np.linalg.solve(information, np.linalg.solve(belief.P, belief.x))
    assert united.ids == (10, 11)
    off = united.x - x[:9]
    off[2::3] = [wrap_angle(angle) for angle in off[2::3]]
    np.testing.assert_allclose(off, 0.0, atol=1e-5)
    np.testing.assert_allclose(united.P, np.linalg.inv(information)[:9, :9], atol=1e-5)


def test_a_part_of_a_belief_is_the_marginal_of_some_vertices() -> None:
    belief = random_belief(np.random.default_rng(1), 3)
    rows = [0, 1, 2, 9, 10, 11, 3, 4, 5]
    some = part(belief, [12, 10])
    assert some.ids == (12, 10)
    np.testing.assert_array_equal(some.x, belief.x[rows])
    np.testing.assert_array_equal(some.P, belief.P[np.ix_(rows, rows)])


@pytest.mark.parametrize("vertices", [0, 1, 4])
def test_positions_of_all_vertices_are_those_of_each(vertices: int) -> None:
    belief = random_belief(np.random.default_rng(vertices), vertices)
    each = [belief.map_vertex(vertex).position for vertex in belief.ids]
    np.testing.assert_array_equal(belief.positions, np.array(each).reshape(-1, 2))
