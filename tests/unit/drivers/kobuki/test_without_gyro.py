"""A base whose frames have no sub-payload of a gyro."""

import math

import pytest

from gvgbot.drivers.kobuki.driver import KobukiConfig
from gvgbot.drivers.kobuki.feedback import FeedbackReader
from gvgbot.drivers.kobuki.wheel_odometry import KOBUKI
from gvgbot.errors import DeviceLost
from gvgbot.geometry import wrap_angle
from gvgbot.hal.messages import Odometry
from tests.unit.drivers.kobuki.test_driver import TICKS_PER_M, Bench, core, frame, play

LEFT, RIGHT = 20, 80  # ticks a frame
FRAMES = 1000
TURN = (RIGHT - LEFT) / TICKS_PER_M / 0.230  # rad a frame
RADIUS = (RIGHT + LEFT) / (RIGHT - LEFT) * 0.115  # m


def test_its_wheels_tell_the_heading_where_they_are_to() -> None:
    reader, odometry = FeedbackReader("wheels", 0.0, KOBUKI), None
    for k in range(FRAMES):
        odometry = reader.take(frame(core(k, LEFT * k, RIGHT * k)), 0.02 * k)
    assert isinstance(odometry, Odometry)
    pose, turned = odometry.odom_base, (FRAMES - 1) * TURN
    assert wrap_angle(pose.theta - turned) == pytest.approx(0.0, abs=1e-3)
    assert pose.x == pytest.approx(RADIUS * math.sin(turned), abs=1e-3)
    assert pose.y == pytest.approx(RADIUS * (1 - math.cos(turned)), abs=1e-3)
    assert reader.statistics.slips == 0
    assert reader.statistics.doubted == 0


def test_whoever_wants_a_gyro_is_told_that_there_is_none() -> None:
    async def script(bench: Bench) -> None:
        for k in range(100):
            await bench.say(core(k))

    with pytest.raises(ExceptionGroup) as failure:
        play(script, KobukiConfig(heading="gyro"))
    lost = failure.value.exceptions[0]
    assert isinstance(lost, DeviceLost)
    assert "set base.heading=wheels" in str(lost)
