"""Old poses in the state against drives by chance, and against the means that they stand for."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from gvgbot.autonomy.revocable import Revocable
from gvgbot.autonomy.slam import trail
from gvgbot.autonomy.slam.calibration import per_unit
from gvgbot.autonomy.slam.ekf import (
    Belief,
    add_vertex,
    expected,
    part,
    place_robot,
    predict,
    remove_vertex,
    without_trail,
)
from gvgbot.autonomy.slam.graph import GvgGraph
from gvgbot.autonomy.slam.trail import MOST, Laid, move
from gvgbot.geometry import Array, Pose, rotated_covariance, wrap_angle
from tests.unit.autonomy.slam.beliefs import updated
from tests.unit.autonomy.slam.test_ekf import (
    as_array,
    moved,
    numerical_jacobian,
    random_belief,
    random_covariance,
    random_pose,
)

seeds = st.integers(0, 2**32 - 1)
NOTHING = np.zeros((3, 3))
NOISE = np.diag([0.01, 0.004, 0.003]) ** 2
ERRORS = np.diag([0.02, 0.01, 0.001]) ** 2  # of odometry: scales of distances and turns, rad/s
STEP, SECONDS = Pose(0.3, 0.0, 0.05), 0.5
OUT = 7  # steps, and as many back: no old pose is merged yet


def laid_at(local_base: Pose, look: int, looks: Sequence[int], gains: Array, noise: Array) -> Laid:
    """A match that errors of odometry have nothing to do with."""
    numbers = np.array(looks, np.int64)[:, None] + (0, 1)
    return Laid(local_base, look, numbers, gains, NOTHING, noise, NOTHING, np.eye(3), NOTHING)


def driven(rng: np.random.Generator, steps: int, vertices: int = 2) -> tuple[Belief, Pose]:
    """A belief after some steps onto walls seen before, and where the local frame has the base."""
    belief, local = random_belief(rng, vertices), random_pose(rng)
    for look in range(2, steps + 2):
        motion = Pose.from_array(rng.uniform((-0.3, -0.1, -0.5), (0.3, 0.1, 0.5)))
        local = local.compose(motion)
        looks = sorted({int(k) for k in rng.integers(1, look, 5)})
        gains = np.array([random_covariance(rng, 3, 0.4) for _ in looks]) / len(looks)
        left = rng.uniform(0.7, 1.0) * np.eye(3)  # less than is left of their covariance
        laid = laid_at(local, look, looks, gains, random_covariance(rng, 3, 0.02))
        laid = laid._replace(by_odometry=per_unit(motion, 1.0), left=left, P=ERRORS)
        laid = laid._replace(scan_noise=random_covariance(rng, 3, 0.01))
        belief = move(belief, motion, np.eye(3), laid)
    return belief, local


def clone_rows(belief: Belief, i: int) -> slice:
    """The part of the state that is one of the trail, oldest first."""
    start = belief.end + 3 + 3 * belief.trail[i].slot
    return slice(start, start + 3)


@given(seeds)
def test_a_step_that_no_walls_tell_of_is_a_prediction(seed: int) -> None:
    rng = np.random.default_rng(seed)
    belief, motion = random_belief(rng, 3), random_pose(rng)
    noise = random_covariance(rng, 3)
    wanted = predict(belief, motion, rotated_covariance(noise, motion.theta))
    laid = laid_at(random_pose(rng), 5, [], np.empty((0, 3, 3)), noise)
    own = replace(belief, P=belief.P.copy())
    found = without_trail(move(own, motion, NOTHING, laid))
    np.testing.assert_array_equal(found.x, wanted.x)
    np.testing.assert_allclose(found.P, wanted.P, rtol=1e-9, atol=1e-9)


@given(seeds)
def test_what_many_looks_drew_errs_as_their_mean(seed: int) -> None:
    """Two spans of looks, or each look with its share; the first pose stands for all before it."""
    rng = np.random.default_rng(seed)
    belief, local = driven(rng, 30)
    own, G = replace(belief, P=belief.P.copy()), 0.3 * random_covariance(rng, 3)
    one = laid_at(local, 32, [-3, 20], np.array([G, 2.0 * G]), NOISE)
    one.looks[:, 1] = 3, 31
    each = laid_at(
        local, 32, range(-3, 31), np.array([G / 6] * 6 + [0 * G] * 17 + [2.0 * G / 11] * 11), NOISE
    )
    np.testing.assert_allclose(
        move(belief, STEP, NOISE, one).P, move(own, STEP, NOISE, each).P, rtol=1e-9, atol=1e-12
    )


@given(seeds)
def test_walls_are_off_by_as_much_as_the_base_that_old_poses_have_before_them(seed: int) -> None:
    rng = np.random.default_rng(seed)
    belief, _ = driven(rng, 6)
    local_base, turn = random_pose(rng), rng.uniform(-3.0, 3.0)
    c, s = math.cos(turn), math.sin(turn)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    gains = np.array([random_covariance(rng, 3) for _ in belief.trail])
    looks = [clone.first for clone in belief.trail]
    by_clones = trail._by_clones(belief, laid_at(local_base, 8, looks, gains, NOISE), R)
    for i, (clone, G) in enumerate(zip(belief.trail, gains, strict=True)):
        seen = as_array(clone.local_base.to(local_base))
        A = numerical_jacobian(partial(moved, motion=seen), belief.x[clone_rows(belief, i)])
        slot = slice(3 * clone.slot, 3 * clone.slot + 3)
        np.testing.assert_allclose(by_clones[:, slot], R @ G @ R.T @ A, rtol=1e-5, atol=1e-7)


@given(seeds)
def test_without_a_match_the_trail_ends(seed: int) -> None:
    rng = np.random.default_rng(seed)
    belief, _ = driven(rng, 4)
    motion, Q = random_pose(rng), random_covariance(rng, 3)
    wanted = predict(without_trail(belief), motion, Q)
    found = move(belief, motion, Q, None)
    assert found.trail == ()
    np.testing.assert_array_equal(found.x, wanted.x)
    np.testing.assert_array_equal(found.P, wanted.P)


def test_all_that_errs_with_odometry_errs_less_with_what_is_left_of_that() -> None:
    rng = np.random.default_rng(8)
    belief, local = driven(rng, 6)
    odometry = slice(belief.end, belief.end + 3)
    share, left = belief.P[: belief.end, odometry].copy(), random_covariance(rng, 3)
    laid = laid_at(local, 8, [], np.empty((0, 3, 3)), NOISE)._replace(left=left, P=2.0 * ERRORS)
    learnt = move(belief, Pose(), NOISE, laid)
    assert np.abs(share).max() > 1e-6
    np.testing.assert_allclose(learnt.P[: belief.end, odometry], share @ left.T, atol=1e-15)
    np.testing.assert_array_equal(learnt.P[odometry, odometry], 2.0 * ERRORS)


def test_who_is_put_down_elsewhere_has_no_trail() -> None:
    rng = np.random.default_rng(4)
    belief, _ = driven(rng, 4)
    seen, R = random_pose(rng), random_covariance(rng, 3)
    wanted = place_robot(without_trail(belief), 11, seen, R)
    found = place_robot(belief, 11, seen, R)
    assert found.trail == part(belief, [10]).trail == ()
    np.testing.assert_array_equal(found.x, wanted.x)
    np.testing.assert_array_equal(found.P, wanted.P)


def test_there_and_back_it_errs_as_it_says() -> None:
    """Walls seen on the way there hold the robot on the way back; all errors are by chance.

    A scan is drawn where it lies on the walls: by its own noise off where the robot is thought.
    """
    rng, runs, total = np.random.default_rng(5), 300, np.zeros(2)
    share = np.diag([0.5, 0.8, 0.7])
    gains = {i: {i - 1: share} for i in range(1, OUT + 1)}  # of steps, by looks: the newest, or
    for i in range(OUT):  # on the way back those of the places that it comes to
        gains[2 * OUT - i] = {i: 0.7 * share, i + 1: 0.3 * share}
    claimed = np.zeros((2, 3, 3))
    for _ in range(runs):
        errors = rng.multivariate_normal(np.zeros(3), ERRORS)
        truth, local, belief = [Pose()], [Pose()], Belief()
        drawn = [Pose()]
        for i in range(1, 2 * OUT + 1):
            step = STEP if i <= OUT else STEP.inverse()
            truth.append(truth[-1].compose(step))
            slip = Pose.from_array(
                per_unit(step, SECONDS) @ errors + rng.multivariate_normal(np.zeros(3), NOISE)
            )
            prior = local[-1].compose(step).compose(slip)
            own = change = rng.multivariate_normal(np.zeros(3), share @ NOISE @ share.T)
            for k, G in gains[i].items():  # where the walls of an old look have the base
                change = change + G @ as_array(prior.to(drawn[k].compose(truth[k].to(truth[i]))))
            local.append(prior.compose(Pose.from_array(change)))
            drawn.append(local[-1].compose(Pose.from_array(-own)))
            rest = np.eye(3) - share
            laid = laid_at(
                local[-1],
                i + 1,
                [k + 1 for k in gains[i]],
                np.array(list(gains[i].values())),
                rest @ NOISE @ rest.T,
            )
            laid = laid._replace(by_odometry=rest @ per_unit(step, SECONDS), P=ERRORS)
            laid = laid._replace(scan_noise=share @ NOISE @ share.T)
            belief = move(belief, local[-2].to(local[-1]), np.eye(3), laid)
            if i % OUT == 0:
                at = i // OUT - 1
                error = as_array(truth[-1]) - as_array(belief.map_base)
                total[at] += error @ np.linalg.solve(belief.P[:3, :3], error)
                claimed[at] += belief.P[:3, :3] / runs
    low, high = (chi2.ppf(p, 3 * runs) for p in (0.001, 0.999))
    assert (low < total).all()
    assert (total < high).all()
    assert np.trace(claimed[1][:2, :2]) < 0.5 * np.trace(claimed[0][:2, :2])


@given(seeds)
def test_two_old_poses_become_their_mean(seed: int) -> None:
    rng = np.random.default_rng(seed)
    belief, _ = driven(rng, 6)
    older, newer = (belief.trail[i]._replace(looks=n) for i, n in ((1, 3), (2, 5)))
    q, r = clone_rows(belief, 1), clone_rows(belief, 2)

    def mean(x: Array) -> Array:
        a = Pose.from_array(x[q])
        b = Pose.from_array(x[r]).compose(newer.local_base.to(older.local_base))
        off = np.array([b.x - a.x, b.y - a.y, wrap_angle(b.theta - a.theta)])
        y = x.copy()
        y[q] += 5 / 8 * off
        return y

    A = numerical_jacobian(mean, belief.x)
    x, P = mean(belief.x), A @ belief.P @ A.T
    merged = trail._merged(belief, older, newer)
    assert merged == older._replace(looks=8)
    np.testing.assert_allclose(belief.x, x, atol=1e-12)
    np.testing.assert_allclose(belief.P, P, rtol=1e-6, atol=1e-7)


def test_a_long_trail_keeps_all_its_looks_the_newest_one_by_one() -> None:
    belief, _ = driven(np.random.default_rng(3), 1000)
    poses = belief.trail
    assert len(poses) == MOST
    assert sorted(clone.slot for clone in poses) == list(range(MOST))
    assert sum(clone.looks for clone in poses) == 1001
    for older, newer in pairwise(poses):
        assert older.first + older.looks == newer.first
    assert [clone.looks for clone in poses[-3:]] == [1, 1, 1]
    assert all(clone.looks < 0.6 * (1002 - clone.first) for clone in poses[:-2])


@given(seeds)
def test_what_it_says_stays_possible(seed: int) -> None:
    """P is symmetric and has no negative variance, whatever is learnt, closed and merged."""
    rng = np.random.default_rng(seed)
    belief, _ = driven(rng, 40)
    belief = updated(belief, 10, random_pose(rng), random_covariance(rng, 3))
    np.testing.assert_array_equal(belief.P, belief.P.T)
    scale = np.sqrt(np.diag(belief.P))
    assert np.linalg.eigvalsh(belief.P / np.outer(scale, scale)).min() > -1e-9


@pytest.mark.parametrize("rows", [2, 3])
def test_a_closure_corrects_old_poses_as_well(rows: int) -> None:
    """As Kalman has it for the whole state."""
    rng = np.random.default_rng(6)
    belief, _ = driven(rng, 5)
    foreseen, H = expected(belief, 11)
    seen, R = foreseen.compose(Pose(0.1, -0.05, 0.02)), random_covariance(rng, rows, 0.1)
    r, H = (as_array(seen) - as_array(foreseen))[:rows], H[:rows]
    K = belief.P @ H.T @ np.linalg.inv(H @ belief.P @ H.T + R)
    closed = updated(belief, 11, seen, R)
    for i in range(6):
        own = clone_rows(belief, i)
        np.testing.assert_allclose(
            wrap_angle(closed.x[own][2] - (belief.x + K @ r)[own][2]), 0.0, atol=1e-9
        )
        np.testing.assert_allclose(closed.x[own][:2], (belief.x + K @ r)[own][:2], atol=1e-9)
        np.testing.assert_allclose(closed.P[own], (belief.P - K @ H @ belief.P)[own], atol=1e-9)


@given(seeds)
def test_vertices_come_and_go_beside_the_trail(seed: int) -> None:
    rng = np.random.default_rng(seed)
    belief, _ = driven(rng, 5)
    seen, R = random_pose(rng), random_covariance(rng, 3)
    grown = add_vertex(belief, 99, seen, R)
    wanted = add_vertex(without_trail(belief), 99, seen, R)
    np.testing.assert_array_equal(without_trail(grown).x, wanted.x)
    np.testing.assert_array_equal(without_trail(grown).P, wanted.P)
    newest, own = clone_rows(grown, -1), slice(grown.end - 3, grown.end)
    by_robot = numerical_jacobian(
        lambda x: as_array(Pose.from_array(x).compose(seen)), belief.x[:3]
    )
    across = belief.P[clone_rows(belief, -1), :3] @ by_robot.T
    np.testing.assert_allclose(grown.P[newest, own], across, rtol=1e-6, atol=1e-8)
    back = remove_vertex(grown, 99)
    assert back.trail == belief.trail
    np.testing.assert_array_equal(back.x, belief.x)
    np.testing.assert_array_equal(back.P, belief.P)


def test_after_a_closure_that_was_revoked_it_is_as_if_there_had_been_none() -> None:
    rng = np.random.default_rng(2)
    belief, local = driven(rng, 20)
    never = replace(belief, P=belief.P.copy())
    was = Revocable.before(10, belief, GvgGraph(), [], [], {})
    belief = updated(belief, 10, random_pose(rng), 0.01 * np.eye(3))
    for look in range(22, 30):
        local, looks = local.compose(STEP), [look - 15, look - 1]
        laid = laid_at(local, look, looks, np.array([0.3, 0.4])[:, None, None] * np.eye(3), NOISE)
        was.move(STEP, NOISE, laid)
        never, belief = (move(one, STEP, NOISE, laid) for one in (never, belief))
    relived = was.belief
    assert relived.trail == never.trail == belief.trail
    np.testing.assert_array_equal(relived.x, never.x)
    np.testing.assert_array_equal(relived.P, never.P)
    assert not math.isclose(belief.x[0], never.x[0])
