"""What odometry does wrong all the time is found, as well as the calibration says."""

import numpy as np
import pytest
from scipy.stats import chi2

from gvgbot.autonomy.slam.calibration import Calibration, _seen_after, per_unit
from gvgbot.autonomy.slam.ekf import OdometryNoise
from gvgbot.geometry import Array, Pose, rotated_covariance

ERRORS = np.array([-0.015, 0.008, 0.0004])  # scale of distances, of turns, rad/s
Q = np.diag([0.015**2, 0.003**2, 0.003**2])
PARTS = np.array([*(np.diag(row) for row in np.diag(np.diag(Q))), np.zeros((3, 3))])
WALLS = np.diag([1.0 / 0.01**2, 1.0 / 0.004**2, 1.0 / 0.001**2])  # information
STEPS = ((Pose(0.25, 0.02, 0.1), 0.5), (Pose(0.25, 0.0, 0.0), 0.5), (Pose(0.2, -0.05, -0.2), 0.5))


def matched(walls: Array) -> Array:
    """Covariance (3, 3) after a match with walls of this information."""
    return np.asarray(np.linalg.inv(np.linalg.inv(Q) + walls), np.float64)


def driven(errors: Array, walls: Array, seed: int, steps: int = 120) -> Calibration:
    """The calibration after steps whose odometry has these errors beside its noise."""
    rng, calibration = np.random.default_rng(seed), Calibration()
    for i in range(steps):
        felt, duration = STEPS[i % len(STEPS)]
        true = Pose(
            felt.x * (1 + errors[0]),
            felt.y * (1 + errors[0]),
            felt.theta * (1 + errors[1]) + errors[2] * duration,
        )
        slip = Pose.from_array(rng.multivariate_normal(np.zeros(3), Q))
        corrected = calibration.corrected(felt, duration)
        off = corrected.to(true).compose(slip)  # from the prior to the truth
        z = np.array([off.x, off.y, off.theta])
        if walls.any():
            scatter = np.diag(np.where(np.diag(walls) > 0, 1 / np.maximum(np.diag(walls), 1), 0))
            z = z + rng.multivariate_normal(np.zeros(3), scatter)
        C = matched(walls)
        change = Pose.from_array(C @ walls @ z)
        calibration.learn(corrected, duration, change, PARTS, C, 1.0)
    return calibration


def test_constant_errors_are_found_as_well_as_it_says() -> None:
    runs, total = 40, 0.0
    for seed in range(runs):
        found = driven(ERRORS, WALLS, seed)
        error = found.x - ERRORS
        total += float(error @ np.linalg.solve(found.P, error))
    low, high = chi2.ppf(0.005, 3 * runs), chi2.ppf(0.995, 3 * runs)
    assert 0.5 * low < total < high  # the prior is wider than these errors


def test_the_scale_of_distances_is_soon_known() -> None:
    found = driven(ERRORS, WALLS, 1)
    assert np.sqrt(found.P[0, 0]) < 0.01
    assert abs(found.x[0] - ERRORS[0]) < 3 * np.sqrt(found.P[0, 0])


@pytest.mark.parametrize("rough", [0.0, 0.02])
def test_walls_along_which_one_drives_say_nothing_about_distances(rough: float) -> None:
    """Straight steps and side walls only: what is known of the scale is what was known before.

    Rough ones seem to make good a small share of an error along the way, but hold back as well.
    """
    side_walls = [rough / (1.0 - rough) / Q[0, 0], 1.0 / 0.004**2, 1.0 / 0.001**2]
    calibration, C = Calibration(), matched(np.diag(side_walls))
    before, held_back = calibration.P[0, 0], Pose(-0.2 * rough * 0.25, 0.001, 0.0001)
    for _ in range(50):
        calibration.learn(Pose(0.25, 0.0, 0.0), 0.5, held_back, PARTS, C, 0.01)
    assert calibration.x[0] == 0.0
    assert calibration.noise[0] == 1.0
    assert calibration.P[0, 0] >= before


def test_a_slip_teaches_nothing() -> None:
    calibration = Calibration()
    C = matched(WALLS)
    calibration.learn(Pose(0.25, 0.0, 0.0), 0.5, Pose(-0.25, 0.0, 0.0), PARTS, C, 1.0)
    assert not calibration.x.any()


def test_a_correction_to_the_known_errors_undoes_them() -> None:
    calibration = Calibration()
    calibration.x = np.array([0.01, -0.02, 0.001])
    motion = calibration.corrected(Pose(1.0, 0.5, 0.4), 2.0)
    assert np.allclose((motion.x, motion.y, motion.theta), (1.01, 0.505, 0.392 + 0.002))


def test_the_frame_of_the_step_does_not_matter() -> None:
    """The noise and C, handed over as seen from the end of a step that turns, tell the same."""
    turned = Calibration()
    straight = Calibration()
    C = matched(WALLS)
    straight.learn(Pose(0.25, 0.0, 0.0), 0.0, Pose(0.004, 0.0, 0.0), PARTS, C, 1.0)
    angle = 0.6
    around = [rotated_covariance(m, -angle) for m in (PARTS, C)]
    change = Pose(0.004 * np.cos(angle), -0.004 * np.sin(angle), 0.0)
    turned.learn(Pose(0.25, 0.0, angle), 0.0, change, around[0], around[1], 1.0)
    assert np.isclose(turned.x[0], straight.x[0])


def noise_found(
    actual: float, walls: Array, *, seed: int, steps: int = 400, scatter: float = 1.0
) -> Array:
    """What is learnt of wheels and gyro whose variance is so many times what Q says.

    That of the walls is `scatter` times what matching expects.
    """
    rng, calibration = np.random.default_rng(seed), Calibration()
    sigmas = np.where(np.diag(walls) > 0, 1 / np.sqrt(np.maximum(np.diag(walls), 1)), 0.0)
    for _ in range(steps):
        expected = calibration.scattered(PARTS)
        C = np.asarray(np.linalg.inv(np.linalg.inv(expected) + walls), np.float64)
        off = rng.multivariate_normal(np.zeros(3), actual * Q) + rng.normal(
            0.0, np.sqrt(scatter) * sigmas
        )
        change = Pose.from_array(C @ walls @ off)
        calibration.learn(Pose(0.25, 0.0, 0.0), 0.5, change, PARTS, C, scatter)
    return calibration.noise[:3]


def test_how_noisy_odometry_is_is_found() -> None:
    found = np.array([noise_found(4.0, WALLS, seed=seed) for seed in range(10)])
    assert np.allclose(found.mean(axis=0), 4.0, rtol=0.25)


def test_noise_as_expected_stays() -> None:
    found = np.array([noise_found(1.0, WALLS, seed=seed) for seed in range(10)])
    assert np.allclose(found.mean(axis=0), 1.0, rtol=0.15)


def test_walls_along_which_one_drives_say_nothing_about_the_noise_of_distances() -> None:
    side_walls = np.diag([0.0, 1.0 / 0.004**2, 1.0 / 0.001**2])
    along, sideways, heading = noise_found(4.0, side_walls, seed=1)
    assert along == 1.0
    assert min(sideways, heading) > 2.0


def test_a_good_base_errs_less_than_it_is_doubted() -> None:
    found = np.array([noise_found(0.1, 25 * WALLS, seed=seed, steps=1000) for seed in range(5)])
    assert np.allclose(found.mean(axis=0), 0.1, rtol=0.5)
    calibration = Calibration()
    calibration.noise[:3] = found.mean(axis=0)
    assert np.allclose(calibration.scattered(PARTS), 0.5 * Q)
    felt = calibration.as_felt(PARTS).sum(axis=0)
    assert np.allclose(np.diag(felt), calibration.noise[:3] * np.diag(Q))


def test_walls_that_are_better_than_they_are_taken_for_hide_no_noise() -> None:
    found = [noise_found(1.0, WALLS, seed=seed, scatter=1 / 9) for seed in range(10)]
    assert np.allclose(np.mean(found, axis=0), 1.0, rtol=0.2)


def test_one_slip_makes_no_noise() -> None:
    """Even if it is the very first step."""
    rng, calibration, slip = np.random.default_rng(4), Calibration(), Pose(-0.25, 0.0, 0.0)
    for step in range(201):
        C = np.linalg.inv(np.linalg.inv(calibration.scattered(PARTS)) + WALLS)
        off = rng.multivariate_normal(np.zeros(3), Q + np.linalg.inv(WALLS))
        change = slip if step in (0, 200) else Pose.from_array(C @ WALLS @ off)
        calibration.learn(Pose(0.25, 0.0, 0.0), 0.5, change, PARTS, C, 1.0)
        if step in (40, 200):
            assert calibration.noise[0] < 1.5


def test_noise_by_turning_is_told_from_noise_by_driving_and_by_time() -> None:
    """A gyro that wanders with time, and never errs by a turn: what a turn costs is found."""
    expected, found = OdometryNoise(), []
    for seed in range(5):
        rng, calibration = np.random.default_rng(seed), Calibration()
        for step in range(600):
            felt = Pose(0.05, 0.0, 0.5) if step % 3 == 0 else Pose(0.25, 0.0, 0.0)
            parts = expected.parts(felt, 0.5)
            C = np.linalg.inv(np.linalg.inv(calibration.scattered(parts)) + 25 * WALLS)
            actual = np.tensordot([0.4, 0.1, 0.0, 0.3], parts, axes=1)
            off = rng.multivariate_normal(np.zeros(3), actual + np.linalg.inv(25 * WALLS))
            change = Pose.from_array(C @ (25 * WALLS) @ off)
            calibration.learn(felt, 0.5, change, parts, C, 1.0)
        found.append(calibration.noise)
    along, _, by_turning, by_driving = np.mean(found, axis=0)
    assert along == pytest.approx(0.4, rel=0.3)
    assert by_driving == pytest.approx(0.3, rel=0.3)
    assert by_turning < 0.03


OWN = np.diag([0.004**2, 0.002**2, 0.0005**2])  # of a step by itself


def test_what_every_step_errs_adds_up_as_in_drives_by_chance() -> None:
    """Along two corridors and round a corner between, where walls tell the heading in part."""
    rng, calibration = np.random.default_rng(7), Calibration()
    left = np.diag([1.0, 1.0, 0.05])  # what walls leave of an error of a step
    steps = [Pose(0.2, 0.0, 0.0)] * 150 + [Pose(0.1, 0.0, 0.05)] * 20 + [Pose(0.2, 0.0, 0.0)] * 100
    errors = rng.multivariate_normal(np.zeros(3), calibration.P, 4000)
    true, felt = np.zeros((len(errors), 3)), Pose()
    covariance = np.zeros((3, 3))
    for step in steps:
        felt = felt.compose(step)
        scale, turn, rate = errors.T
        off = np.stack([step.x * scale, 0.0 * scale, step.theta * turn + rate * 0.4], axis=1)
        motion = np.array([step.x, step.y, step.theta]) + off @ left
        c, s = np.cos(true[:, 2]), np.sin(true[:, 2])
        true += np.stack(
            [
                c * motion[:, 0] - s * motion[:, 1],
                s * motion[:, 0] + c * motion[:, 1],
                motion[:, 2],
            ],
            axis=1,
        )
        c1, s1 = np.cos(step.theta), np.sin(step.theta)
        carried = np.array(  # an error before the step, seen from the pose after it
            [
                [c1, s1, s1 * step.x - c1 * step.y],
                [-s1, c1, c1 * step.x + s1 * step.y],
                [0.0, 0.0, 1.0],
            ]
        )
        added = calibration.adds_up(step, 0.4, left, OWN) - OWN
        covariance = carried @ covariance @ carried.T + added
    wrong = true - (felt.x, felt.y, felt.theta)
    claimed = rotated_covariance(covariance, felt.theta)
    drawn = np.cov(wrong.T)
    share = np.sqrt(np.diag(claimed) / np.diag(drawn))
    assert share[0] == pytest.approx(1.0, abs=0.05)  # 2 % of more than thirty metres
    assert (share > 0.95).all()
    assert (share < 1.5).all()  # what goes away again is left out


def test_on_the_way_back_nothing_more_adds_up() -> None:
    calibration, there_and_back = Calibration(), [Pose(0.2)] * 50 + [Pose(-0.2)] * 50
    whole = [calibration.adds_up(step, 0.0, np.eye(3), OWN) for step in there_and_back]
    added = [(covariance - OWN)[0, 0] for covariance in whole]
    assert sum(added[:50]) == pytest.approx((0.02 * 10.0) ** 2)
    assert sum(added[50:]) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("motion", [Pose(0.3, -0.2, 0.7), Pose(-0.1, 0.4, -2.0), Pose(0.25)])
def test_errors_before_a_motion_and_in_it_move_the_base_after_it_as_their_jacobians_say(
    motion: Pose,
) -> None:
    """By finite differences, in the frame of the base after the motion."""
    duration, h = 0.5, 1e-6

    def off(after: Pose) -> Array:
        seen = motion.to(after)
        return np.array([seen.x, seen.y, seen.theta]) / h

    for i, axis in enumerate(np.eye(3)):
        before = Pose.from_array(h * axis).compose(motion)
        assert off(before) == pytest.approx(_seen_after(motion)[:, i], abs=1e-5)
        distance, turn, rate = h * axis
        moved = Pose(motion.x * (1.0 + distance), motion.y * (1.0 + distance), motion.theta)
        turned = Pose(moved.x, moved.y, motion.theta * (1.0 + turn) + rate * duration)
        assert off(turned) == pytest.approx(per_unit(motion, duration)[:, i], abs=1e-5)
