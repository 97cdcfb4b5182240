"""The map from the laser's clock to the host's, against clocks whose truth is known."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gvgbot.drivers.hokuyo.clock_sync import (
    WRAP_MS,
    ClockMap,
    Synchronisation,
    TimeSample,
    follow,
    start,
    synchronise,
)

Array = NDArray[np.floating[Any]]

PERIOD = 0.1


def follow_all(
    device_ms: Array,
    arrivals: Array,
    delay: float = 0.0,
    sync: Synchronisation | None = None,
) -> list[ClockMap]:
    maps: list[ClockMap] = []
    for stamp, arrival in zip(device_ms, arrivals, strict=True):
        stamp_ms = int(stamp) % WRAP_MS
        maps.append(
            follow(maps[-1], stamp_ms, float(arrival))
            if maps
            else start(stamp_ms, float(arrival), delay=delay, sync=sync)
        )
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


def asked(offset: float, delays: Array) -> list[TimeSample]:
    """Time samples of a laser whose clock is `offset` behind, on a link with delays (N, 2), s."""
    samples, now = [], 50.0
    for there, back in delays:
        stamp = int(np.floor((now + there - offset) * 1000.0)) % WRAP_MS
        samples.append(TimeSample(now, stamp, now + there + back))
        now += there + back + 0.0003
    return samples


@given(st.floats(-1e4, 49.0), st.integers(0, 2**32))
def test_samples_of_time_bound_the_truth(offset: float, seed: int) -> None:
    delays = np.random.default_rng(seed).exponential(0.005, (12, 2))
    samples = asked(offset, delays)
    sync = synchronise(samples)
    assert sync is not None
    since = (sync.host - offset) * 1000.0 - sync.stamp_ms
    wrong = (since + WRAP_MS / 2) % WRAP_MS - WRAP_MS / 2
    assert abs(wrong) / 1000.0 <= sync.error + 1e-6
    assert sync.error <= delays.sum(axis=1).min() / 2 + 0.0005 + 1e-6


def test_samples_of_a_clock_that_jumps_say_nothing() -> None:
    samples = [TimeSample(0.0, 1000, 0.001), TimeSample(0.01, 5000, 0.011)]
    assert synchronise(samples) is None
    assert synchronise([]) is None


@pytest.mark.parametrize("law", ["uniform", "normal", "exponential"])
@pytest.mark.parametrize("drift_ppm", [-50.0, 50.0])
def test_stamps_stay_right_for_minutes_of_jitter_and_drift(law: str, drift_ppm: float) -> None:
    rng = np.random.default_rng(7)
    jitter = {
        "uniform": rng.uniform(0.0, 0.01, 3000),
        "normal": np.abs(rng.normal(0.0, 0.005, 3000)),
        "exponential": rng.exponential(0.005, 3000),
    }[law]
    offset, latency = 42.0, 0.023  # the driver is told 3 ms less
    truth = 51.0 + 0.1 * np.arange(3000) + 0.0004
    device_ms = np.floor(((truth - 51.0) * (1.0 + drift_ppm * 1e-6) + 51.0 - offset) * 1000.0)
    sync = synchronise(asked(offset, rng.exponential(0.005, (12, 2))))
    errors = host_stamps(follow_all(device_ms, truth + latency + jitter, 0.020, sync)) - truth
    assert np.sqrt(np.mean(errors[600:] ** 2)) < 0.0015
    assert np.abs(errors).max() < 0.004


def test_stamps_keep_up_with_a_host_s_clock_that_is_set_right_little_by_little() -> None:
    """By 0.36 s, at 500 ppm, as NTP does it."""
    made = PERIOD * np.arange(9000)
    truth = made + 500e-6 * np.minimum(made, 720.0)
    jitter = np.random.default_rng(1).exponential(0.002, len(made))
    maps = follow_all(np.floor(made * 1000.0), truth + jitter)
    errors = host_stamps(maps) - truth
    assert maps[-1].resets == 0
    assert np.abs(errors).max() < 0.015
    assert np.abs(errors[8000:]).max() < 0.002


def test_a_clock_reset_keeps_what_was_learnt_about_the_link() -> None:
    truth = 51.0 + 0.1 * np.arange(200)
    device_ms = np.round((truth - 42.0) * 1000.0) - np.where(np.arange(200) < 100, 0, 12_000)
    sync = synchronise(asked(42.0, np.full((4, 2), 0.001)))
    maps = follow_all(device_ms, truth + 0.030, 0.010, sync)
    assert maps[-1].resets == 1
    assert np.abs(host_stamps(maps) - truth).max() < 0.0015


def test_a_scan_that_comes_before_it_was_measured_refutes_the_synchronisation() -> None:
    # The laser reads its clock at once and answers a second later; its first scan is late, too.
    sync = synchronise(asked(42.0, np.array([[0.0, 1.0]] * 4)))
    assert sync is not None
    truth = 55.0 + PERIOD * np.arange(100)
    delays = np.full(100, 0.1)
    delays[0] = 0.8
    device_ms = np.floor((truth - 42.0) * 1000.0)
    stamps = host_stamps(follow_all(device_ms, truth + delays, 0.1, sync))
    assert np.abs(stamps - truth)[1:].max() < 0.0015
