"""The odometry of a base that is read late, since the computer has too much to do."""

import math

import numpy as np
import pytest

from gvgbot.drivers.kobuki.feedback import FeedbackReader
from gvgbot.drivers.kobuki.payloads import Inertia
from gvgbot.drivers.kobuki.wheel_odometry import KOBUKI
from gvgbot.geometry import wrap_angle
from gvgbot.hal.messages import Odometry
from tests.unit.drivers.kobuki.test_driver import core, frame

HALF_BASE_TICKS = 0.115 * 11724.41658
RATE = 1.0  # rad/s
PERIOD = 0.02  # s


def turning(k: int) -> bytes:
    """Frame k of a base that turns on the spot; its counters and its gyro wrap on the way."""
    angle = RATE * PERIOD * k
    wheel = round(HALF_BASE_TICKS * angle)
    cdeg = (round(math.degrees(100 * angle)) + 18000) % 36000 - 18000
    motion = Inertia(cdeg, round(math.degrees(100 * RATE)))
    return frame(core(k + 3000, left=65000 - wheel, right=100 + wheel), motion)


def read_late(
    seed: int, longest: float, lag: float
) -> tuple[FeedbackReader, list[tuple[int, Odometry]]]:
    """A minute of frames, read in time for a second, then each pass of a loop that takes long.

    What one pass took from the port is looked at `lag` s later.
    """
    rng = np.random.default_rng(seed)
    reader = FeedbackReader("gyro", 0.0, KOBUKI)
    heard: list[tuple[int, Odometry]] = []
    sent, now = 0, 0.0
    while now < 60.0:
        made = [k for k in range(sent, sent + 400) if k * PERIOD <= now]
        if made:
            sent = made[-1] + 1
            late = lag if now > 1.0 else 0.0
            odometry = reader.take(b"".join(map(turning, made)), now + late)
            if odometry is not None:
                heard.append((made[-1], odometry))
        now += PERIOD if now <= 1.0 else float(rng.uniform(lag, longest))
    return reader, heard


@pytest.mark.parametrize(("longest", "lag"), [(0.15, 0.11), (0.4, 0.15), (1.0, 0.3), (3.0, 0.9)])
@pytest.mark.parametrize("seed", range(3))
def test_a_base_that_is_read_late_has_not_started_anew(
    seed: int, longest: float, lag: float
) -> None:
    reader, heard = read_late(seed, longest, lag)
    assert reader.statistics.resets == 0
    assert heard[-1][0] * PERIOD > 55.0
    for k, odometry in heard:
        truth = RATE * PERIOD * k
        assert abs(wrap_angle(odometry.odom_base.theta - truth)) < 0.002
        assert odometry.stamp == pytest.approx(PERIOD * k, abs=0.02)
        assert odometry.breaks == 0
