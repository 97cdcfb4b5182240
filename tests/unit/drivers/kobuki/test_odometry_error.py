"""The error profiles against their published figures, by Monte Carlo."""

import math

import numpy as np
import pytest

from gvgbot.drivers.kobuki.odometry_error import PROFILES, ErringSensors, OdometryProfile
from gvgbot.geometry import Array

DT = 0.02  # s
STEP = 0.006  # m per cycle: 0.3 m/s


def drawn(profile: OdometryProfile, seeds: int) -> list[ErringSensors]:
    return [ErringSensors(PROFILES[profile], np.random.default_rng(k)) for k in range(seeds)]


def drive(sensors: ErringSensors, cycles: int, step: float = STEP) -> Array:
    """Felt left travel, right travel and turn of each cycle (cycles, 3), straight ahead."""
    return np.array([sensors.feel(step, step, 0.0, DT) for _ in range(cycles)])


@pytest.mark.parametrize(
    ("profile", "sigma"), [("kobuki", 0.01), ("worn", 0.025), ("wheels", 0.01)]
)
def test_each_wheels_scale_has_its_sigma(profile: OdometryProfile, sigma: float) -> None:
    sensors = drawn(profile, 2000)
    left = np.array([s.left_scale for s in sensors])
    right = np.array([s.right_scale for s in sensors])
    for scale in (left, right):
        assert abs(scale.mean() - 1.0) < 4 * sigma / math.sqrt(2000)
        assert scale.std() == pytest.approx(sigma, rel=0.07)
    assert abs(np.corrcoef(left, right)[0, 1]) < 0.09


@pytest.mark.parametrize(("profile", "sigma"), [("kobuki", 0.02), ("wheels", 0.02), ("worn", 0.06)])
def test_noise_along_grows_with_the_root_of_the_way(profile: OdometryProfile, sigma: float) -> None:
    """100 cycles are 0.6 m: sigma * sqrt(0.6), the same on both wheels; slips add to one only."""
    errors, differences = [], []
    for sensors in drawn(profile, 400):
        felt = drive(sensors, 100)
        left = felt[:, 0].sum() - 0.6 * sensors.left_scale
        right = felt[:, 1].sum() - 0.6 * sensors.right_scale
        errors.append(min(left, right))
        differences.append(abs(left - right))
    assert np.std(errors) == pytest.approx(sigma * math.sqrt(0.6), rel=0.15)
    assert np.median(differences) < 1e-12


@pytest.mark.parametrize(("profile", "walk_deg"), [("kobuki", 0.1), ("worn", 0.3)])
def test_the_gyro_walks_with_the_root_of_time(profile: OdometryProfile, walk_deg: float) -> None:
    """100 cycles are 2 s."""
    errors = [
        math.degrees(drive(sensors, 100)[:, 2].sum() - 2.0 * sensors.gyro_bias)
        for sensors in drawn(profile, 400)
    ]
    assert np.std(errors) == pytest.approx(walk_deg * math.sqrt(2.0), rel=0.15)


@pytest.mark.parametrize("profile", ["kobuki", "worn", "wheels"])
def test_the_gyros_bias_has_its_sigma(profile: OdometryProfile) -> None:
    biases = [math.degrees(sensors.gyro_bias) for sensors in drawn(profile, 2000)]
    assert np.std(biases) == pytest.approx(0.02, rel=0.07)


@pytest.mark.parametrize("profile", list(PROFILES))
def test_at_rest_nothing_is_felt(profile: OdometryProfile) -> None:
    (sensors,) = drawn(profile, 1)
    assert {sensors.feel(0.0, 0.0, 0.0, DT) for _ in range(100)} == {(0.0, 0.0, 0.0)}


def test_perfect_sensors_feel_the_truth() -> None:
    (sensors,) = drawn("perfect", 1)
    assert sensors.feel(0.01, -0.02, 0.3, DT) == (0.01, -0.02, 0.3)


def test_worn_wheels_slip_once_in_twenty_metres_by_two_to_ten_centimetres() -> None:
    """600 runs of 6 m; the difference of the wheels, scales removed, is slip alone."""
    slips, step = [], 4 * STEP
    for sensors in drawn("worn", 600):
        felt = drive(sensors, 250, step)
        scale = np.array([sensors.left_scale, sensors.right_scale])
        extra = (felt[:, :2] - step * scale).sum(axis=0)
        slips.append(extra[0] - extra[1])
    size = np.abs(slips)
    slipped = size > 0.005
    assert np.mean(slipped) == pytest.approx(1 - math.exp(-6 / 20), abs=0.05)
    assert np.median(size[slipped]) == pytest.approx(0.06, abs=0.015)
    assert abs(np.mean(np.sign(np.array(slips)[slipped]))) < 0.3


def test_a_kobukis_wheels_do_not_slip() -> None:
    (sensors,) = drawn("kobuki", 1)
    felt = drive(sensors, 5000)
    difference = felt[:, 0] - felt[:, 1]
    assert difference == pytest.approx(STEP * (sensors.left_scale - sensors.right_scale))
