"""The map from the laser's clock to the host's, against clocks whose truth is known."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gvgbot.drivers.hokuyo.clock_sync import WRAP_MS, ClockMap, follow

Array = NDArray[np.floating[Any]]

PERIOD = 0.1


def follow_all(device_ms: Array, arrivals: Array) -> list[ClockMap]:
    maps: list[ClockMap] = []
    for stamp, arrival in zip(device_ms, arrivals, strict=True):
        maps.append(follow(maps[-1] if maps else None, int(stamp) % WRAP_MS, float(arrival)))
    return maps


def host_stamps(maps: list[ClockMap]) -> Array:
    return np.array([clock_map.host_stamp for clock_map in maps])


@given(
    st.integers(0, WRAP_MS - 1),
    st.floats(-80.0, 80.0),
    st.integers(0, 2**32),
)
def test_stamps_hold_through_jitter_drift_and_wrap(
    start_ms: int, drift_ppm: float, seed: int
) -> None:
    truth = 1000.0 + PERIOD * np.arange(600)
    device_ms = np.floor(start_ms + (truth - 1000.0) * 1000.0 * (1.0 + drift_ppm * 1e-6))
    # Most frames come at once, some late: the first one is taken as prompt.
    delays = np.random.default_rng(seed).exponential(0.004, 600)
    delays[0] = 0.0
    maps = follow_all(device_ms, truth + delays)
    assert maps[-1].resets == 0
    errors = host_stamps(maps) - truth
    assert errors.max() < 0.003
    assert errors.min() > -0.0015


def test_a_backlog_read_at_once_keeps_its_stamps() -> None:
    truth = PERIOD * np.arange(100)
    arrivals = np.maximum(truth, np.where((truth > 3.0) & (truth < 8.0), 8.0, 0.0))
    errors = host_stamps(follow_all(np.round(truth * 1000.0), arrivals)) - truth
    assert np.abs(errors).max() < 0.0015


@pytest.mark.parametrize("before_ms", [5_000, 9_000_000, WRAP_MS - 60_000])
def test_a_clock_that_starts_again_from_zero_starts_a_new_map(before_ms: int) -> None:
    truth = PERIOD * np.arange(20)
    device_ms = np.round(truth * 1000.0) + np.where(truth < 0.95, before_ms, -1000)
    maps = follow_all(device_ms, truth)
    assert [clock_map.resets for clock_map in maps] == [0] * 10 + [1] * 10
    assert np.abs(host_stamps(maps) - truth).max() < 0.001
