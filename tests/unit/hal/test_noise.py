"""Noise of a known sigma, on the exact ranges of a room."""

import math

import numpy as np
import pytest

from gvgbot.geometry import Array
from gvgbot.hal.noise import excess_noise, range_noise


def seen(sigma: float) -> Array:
    """A room of 8 by 4 m with a box in it; some beams get lost, others leave by a door."""
    bearings, rng = np.arange(-2.0, 2.0, math.tau / 1440), np.random.default_rng(4)
    x, y = np.abs(np.cos(bearings)), np.abs(np.sin(bearings))
    ranges = np.minimum(4.0 / x, 2.0 / np.maximum(y, 1e-9))
    ranges = np.where(np.abs(bearings - 0.4) < 0.06, 2.35 / x, ranges)
    ranges[rng.random(len(ranges)) < 0.02] = math.nan
    ranges[:30] = math.inf
    return np.asarray(ranges + sigma * rng.standard_normal(len(ranges)))


@pytest.mark.parametrize("sigma", [0.0, 0.01, 0.02, 0.03])
def test_the_noise_is_measured_whatever_stands_in_the_room(sigma: float) -> None:
    assert range_noise(seen(sigma)) == pytest.approx(sigma, rel=0.1, abs=1e-3)


def test_a_blind_laser_has_no_noise_to_measure() -> None:
    assert range_noise(np.full(100, np.nan)) == 0.0


@pytest.mark.parametrize(
    ("sigma", "excess"), [(0.0, 0.0), (0.01, 0.0), (0.02, 0.0075), (0.03, 0.0175)]
)
def test_what_is_more_than_a_usual_sigma_counts(sigma: float, excess: float) -> None:
    """Which is up to 12.5 mm."""
    assert excess_noise(seen(sigma)) == pytest.approx(excess, abs=0.003)


@pytest.mark.parametrize(
    "ranges", [[], [1.0], [1.0, 2.0], [math.nan, math.inf, 1.0], [math.inf] * 9 + [1.0, 2.0, 1.0]]
)
def test_too_few_ranges_tell_of_no_noise(ranges: list[float]) -> None:
    assert excess_noise(np.array(ranges)) == 0.0
