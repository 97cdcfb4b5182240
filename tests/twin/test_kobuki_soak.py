"""All that can go wrong with a base and its link, at once and for a long time."""

import math
from itertools import pairwise

import pytest

from gvgbot.drivers.kobuki.mishaps import MishapConfig
from gvgbot.drivers.kobuki.twin import KobukiTwinConfig
from gvgbot.drivers.link_faults import LinkFaultConfig
from gvgbot.geometry import Twist, wrap_angle
from tests.twin.kobuki_rig import Robot, play

pytestmark = [pytest.mark.twin, pytest.mark.slow]

SPEED, TURN = 0.2, 0.3
SECONDS = 240.0
FAULTS = KobukiTwinConfig(
    odometry="perfect",
    mishaps=MishapConfig(
        bumps_per_h=150.0,
        cliffs_per_h=150.0,
        wheel_drops_per_h=150.0,
        over_currents_per_h=150.0,
        low_batteries_per_h=150.0,
        slips_per_h=75.0,
        reboots_per_h=75.0,
        short_parts_per_h=150.0,
        unknown_parts_per_h=150.0,
    ),
    link=LinkFaultConfig(
        latency_s=0.001,
        jitter_s=0.004,
        chip_timer_s=0.004,
        flipped_bits_per_kb=0.25,
        lost_bytes_per_kb=0.25,
        inserted_bytes_per_kb=0.25,
        cut_messages_per_k=5.0,
        silences_per_h=150.0,
        unplugs_per_h=150.0,
    ),
)
KINDS = 9 + 6  # mishaps, and faults of the link


def soak(seconds: float, seed: int = 1) -> tuple[Robot, float]:
    """The robot after so long, and for how long it was deaf at worst without a reason, s."""
    worst = 0.0

    async def script(robot: Robot) -> None:
        nonlocal worst
        excused = 0.0
        while (now := robot.clock.now()) < seconds:
            is_booting = robot.twin.next_due() > now + 0.03
            if robot.link.is_on("silence") or robot.link.is_on("unplug") or is_booting:
                excused = now
            last = robot.heard[-1][0] if robot.heard else 0.0
            worst = max(worst, now - max(last, excused))
            await robot.clock.sleep_until(now + 0.05)

    return play(script, FAULTS, Twist(SPEED, TURN), seed), worst


def test_every_fault_is_survived_and_none_falsifies_the_odometry() -> None:
    """Truth: the body drives an arc or stands; only slips and restarts may part it from belief."""
    robot, worst = soak(SECONDS)
    seen = robot.link.counts + robot.twin.mishaps.counts
    assert len(seen) == KINDS
    assert min(seen.values()) > 0
    assert worst < 2.0
    for (_, before), (arrival, after) in pairwise(robot.heard):
        dt = after.stamp - before.stamp
        assert dt > 0.0
        assert after.odom_base.distance(before.odom_base) < 0.3 * dt + 0.06
        turn = wrap_angle(after.odom_base.theta - before.odom_base.theta)
        assert abs(turn) < 0.5 * dt + 0.1 or dt > 5.0
        assert -0.002 < arrival - after.stamp < 0.25
        assert math.isfinite(after.twist.linear)
    assert len(robot.heard) > 0.5 * 50 * SECONDS
