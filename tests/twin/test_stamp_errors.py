"""Stamps tell when a value was true, however late it arrives and however fast a clock runs."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.rigs.stamp_errors import odometry_stamp_errors, rms, scan_stamp_errors
from gvgbot.config import load_config
from gvgbot.drivers.hokuyo.driver import HokuyoConfig
from gvgbot.drivers.link_faults import LinkFaultConfig

pytestmark = pytest.mark.twin
SCANS, FRAMES = 200, 1000  # those of the time that is measured


@pytest.mark.parametrize("drift_ppm", [-50.0, 50.0])
@pytest.mark.parametrize(
    ("sync", "latency", "limit"),
    [
        pytest.param(True, 0.0, 0.0015, id="synchronised"),
        pytest.param(False, 0.0, 0.0015, id="arrivals only"),
        pytest.param(True, 0.004, 0.0035, id="half of a one-sided latency is found out"),
    ],
)
def test_scans_are_stamped_right_in_spite_of_jitter_and_drift(
    drift_ppm: float, latency: float, limit: float, *, sync: bool
) -> None:
    link = LinkFaultConfig(latency_s=latency, jitter_s=0.005)
    errors = scan_stamp_errors(link, drift_ppm, HokuyoConfig(synchronise=sync))
    assert len(errors) > 0.95 * SCANS
    assert rms(errors) < limit


@pytest.mark.parametrize("drift_ppm", [-50.0, 50.0])
def test_odometry_is_stamped_right_in_spite_of_jitter_and_drift(drift_ppm: float) -> None:
    errors = odometry_stamp_errors(LinkFaultConfig(jitter_s=0.005), drift_ppm)
    assert len(errors) > 0.95 * FRAMES
    assert rms(errors) < 0.0005
    assert np.abs(errors).max() < 0.001


def test_a_constant_latency_is_the_error_of_stamps_that_know_none() -> None:
    errors = odometry_stamp_errors(LinkFaultConfig(latency_s=0.003), drift_ppm=0.0)
    assert errors == pytest.approx(0.003, abs=1e-6)


def test_the_turtlebot_allows_for_the_time_that_a_frame_is_on_its_line() -> None:
    """So it does, on average, for the timer of its converter, which hands out a frame's end."""
    line = LinkFaultConfig(baud=115200, chip_timer_s=0.001)
    errors = odometry_stamp_errors(line, 50.0, load_config(Path("turtlebot2.yaml")).base)
    assert np.abs(errors).max() < 0.001
