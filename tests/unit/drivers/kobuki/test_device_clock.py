"""The base's counter on the host's clock."""

import numpy as np
import pytest

from gvgbot.drivers.kobuki.device_clock import DeviceClock, advance_clock, start_clock


def test_late_frames_are_stamped_by_when_they_were_made() -> None:
    """Truth: frame k is made at 100 + 0.02 k and arrives up to 30 ms later, sometimes at once."""
    rng = np.random.default_rng(1)
    made = 100.0 + 0.02 * np.arange(5000)
    arrivals = np.maximum.accumulate(made + rng.exponential(0.01, made.size).clip(0.0, 0.03))
    clock = start_clock(65000, arrivals[0])
    errors = []
    for k in range(1, made.size):
        clock = advance_clock(clock, (65000 + 20 * k) % 65536, arrivals[k])
        errors.append(clock.stamp - made[k])
        assert clock.step == pytest.approx(0.02)
    assert np.abs(errors[200:]).max() < 0.002
    assert clock.resets == 0


def test_clocks_of_different_speed_do_not_drift_apart() -> None:
    """Truth: the base's clock loses 100 ppm for an hour."""
    clock = start_clock(0, 0.0)
    for k in range(1, 180_000):
        clock = advance_clock(clock, 20 * k % 65536, 0.02 * k * 1.0001)
    assert clock.stamp == pytest.approx(0.02 * 179_999 * 1.0001, abs=0.001)


def test_a_host_s_clock_that_is_set_right_little_by_little_is_no_reset() -> None:
    """Truth: it gains 0.36 s at 500 ppm, as NTP does it."""
    clock, errors = start_clock(0, 0.0), []
    for k in range(1, 45_000):
        truth = 0.02 * k + 500e-6 * min(0.02 * k, 720.0)
        clock = advance_clock(clock, 20 * k % 65536, truth)
        errors.append(clock.stamp - truth)
    assert clock.resets == 0
    assert np.abs(errors).max() < 0.01
    assert np.abs(errors[-1000:]).max() < 0.001


def test_a_gap_is_measured_by_the_bases_own_counter() -> None:
    clock = advance_clock(start_clock(65500, 5.0), 264, 5.31)
    assert clock.step == pytest.approx(0.3)
    assert clock.stamp == pytest.approx(5.3, abs=1e-3)


def test_a_burst_after_a_stall_keeps_its_spacing_and_is_no_reset() -> None:
    clock = start_clock(0, 0.0)
    for k in range(1, 251):
        clock = advance_clock(clock, 20 * k, max(0.02 * k, 4.0 if k > 50 else 0.0))
        assert clock.stamp == pytest.approx(0.02 * k, abs=2e-3)
    assert clock.resets == 0


def test_a_counter_that_jumps_ahead_of_time_is_a_new_start() -> None:
    clock = advance_clock(start_clock(10_000, 1.0), 0, 1.5)
    assert (clock.resets, clock.step) == (1, 0.0)
    assert clock.stamp == 1.5


def test_stamps_rise_even_when_the_first_frame_came_very_late() -> None:
    clock: DeviceClock = start_clock(0, 1.0)
    stamps = [clock.stamp]
    for k in range(1, 20):
        clock = advance_clock(clock, 20 * k, 1.0 + 0.001 * k)
        stamps.append(clock.stamp)
    assert np.all(np.diff(stamps) > 0.0)


def test_a_repeated_frame_takes_no_time() -> None:
    once = advance_clock(start_clock(0, 0.0), 20, 0.02)
    twice = advance_clock(once, 20, 0.021)
    assert twice.step == 0.0
    assert twice.stamp == pytest.approx(once.stamp)


def test_a_frame_that_comes_again_moves_no_stamp() -> None:
    """Of frames that are read together, all but the last count as made a while before that."""
    clock = advance_clock(start_clock(0, 10.0), 20, 10.02)
    for arrival in (9.98, 10.0, 10.02):
        clock = advance_clock(clock, 20, arrival)
        assert clock.stamp == pytest.approx(10.02, abs=1e-4)
    assert advance_clock(clock, 40, 10.04).stamp == pytest.approx(10.04, abs=1e-4)


@pytest.mark.parametrize("last_ms", [500, 5000, 60_000, 64_600, 65_500])
def test_a_restart_in_a_silence_is_noticed_whatever_the_counter_was(last_ms: int) -> None:
    """Truth: after 1 s without frames the base has been on for 40 ms."""
    clock = advance_clock(start_clock(last_ms - 20, 9.98), last_ms, 10.0)
    for k in range(200):
        clock = advance_clock(clock, 40 + 20 * k, 11.0 + 0.02 * k)
    assert clock.stamp == pytest.approx(11.0 + 0.02 * 199, abs=0.11)
    assert clock.resets <= 1


def test_a_long_silence_without_a_restart_is_none() -> None:
    """The counter turns over within the silence, which is when a restart looks most alike."""
    for raw_ms in range(0, 65536, 997):
        clock = advance_clock(start_clock(raw_ms, 0.0), (raw_ms + 3000) % 65536, 3.01)
        assert (clock.resets, clock.step) == (0, 3.0)


@pytest.mark.parametrize("silence", [65.4, 65.536, 65.54, 65.6, 131.08])
def test_a_stamp_after_any_silence_is_of_the_moment(silence: float) -> None:
    raw_ms = (5000 + round(1000 * silence)) % 65536
    clock = advance_clock(start_clock(5000, 0.0), raw_ms, silence)
    assert clock.stamp == pytest.approx(silence, abs=0.02)
    assert clock.resets == (silence >= 65.536)
