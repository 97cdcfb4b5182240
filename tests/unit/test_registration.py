"""Pairs against all that could be, and poses against a solver that knows no closed form."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares

from gvgbot.geometry import Array, Pose, wrap_angle
from gvgbot.registration import assigned, rigid_fit

WITHIN = 1.0

seeds = st.integers(0, 2**32 - 1)
sizes = st.integers(0, 5)


def least_sum(distances: Array) -> float:
    """The least sum of distances, not above `WITHIN` each, of all ways to pair off."""
    near = np.minimum(distances, WITHIN)
    near = near if near.shape[0] <= near.shape[1] else near.T
    rows = np.arange(near.shape[0])
    ways = permutations(range(near.shape[1]), near.shape[0])
    return min(float(near[rows, list(columns)].sum()) for columns in ways)


@given(seeds, sizes, sizes)
def test_no_other_pairs_are_nearer_to_each_other_together(seed: int, rows: int, cols: int) -> None:
    distances = np.random.default_rng(seed).uniform(0.0, 2.0 * WITHIN, (rows, cols))
    pairs = assigned(distances, WITHIN)
    assert pairs == sorted(pairs)
    assert len({i for i, _ in pairs}) == len({j for _, j in pairs}) == len(pairs)
    assert all(distances[pair] < WITHIN for pair in pairs)
    alone = min(rows, cols) - len(pairs)
    found = sum(float(distances[pair]) for pair in pairs) + alone * WITHIN
    assert found == pytest.approx(least_sum(distances))


def test_what_is_out_of_reach_stays_alone_though_infinitely_far() -> None:
    distances = np.array([[0.2, np.inf], [0.1, np.inf]])
    assert assigned(distances, WITHIN) == [(1, 0)]
    assert assigned(np.array([[WITHIN]]), WITHIN) == []


@given(seeds, st.integers(2, 8), st.floats(-3.0, 3.0))
def test_a_fit_and_its_covariance_are_those_of_a_solver_of_least_squares(
    seed: int, count: int, turn: float
) -> None:
    rng = np.random.default_rng(seed)
    along = 2.0 * np.arange(count)[:, None] - (10.0, 3.0)
    b = along + rng.uniform(-1.0, 1.0, (count, 2))
    a = Pose(4.0, -7.0, turn).transform(b) + rng.normal(0.0, 0.2, (count, 2))

    def off(x: Array) -> Array:
        return (Pose.from_array(x).transform(b) - a).ravel()

    best = least_squares(off, [4.0, -7.0, turn], xtol=1e-14, ftol=1e-14, gtol=1e-14)
    pose, covariance = rigid_fit(a, b)
    assert 0.5 * float((off(np.array([pose.x, pose.y, pose.theta])) ** 2).sum()) <= best.cost + 1e-9
    assert (pose.x, pose.y) == pytest.approx(best.x[:2], abs=1e-3)
    assert wrap_angle(pose.theta - best.x[2]) == pytest.approx(0.0, abs=1e-4)
    variance = max(2.0 * best.cost / max(1, 2 * count - 3), 1e-4)  # of one coordinate of a point
    jacobian = np.asarray(best.jac)
    expected = count * variance * np.linalg.inv(jacobian.T @ jacobian)
    assert covariance == pytest.approx(expected, rel=1e-2, abs=1e-6)


@pytest.mark.parametrize(
    "points", [[[1.0, 1.0]], [[1.0, 1.0], [1.0, 1.0]], [[1.0, 1.0], [2.0, 5.0]]]
)
def test_points_that_were_only_moved_lie_on_each_other_also_a_single_one(
    points: list[list[float]],
) -> None:
    there, moved = np.array(points), np.add(points, (2.0, 3.0))
    pose, _ = rigid_fit(moved, there)
    assert pose.transform(there) == pytest.approx(moved)
    assert pose.theta == pytest.approx(0.0)
