"""The simulated base's mishaps and its bad link, and what the driver makes of them."""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gvgbot.drivers.kobuki.commands import BaseControl, encode_commands
from gvgbot.drivers.kobuki.feedback import FRAME_PERIOD
from gvgbot.drivers.kobuki.frames import Frame, FrameParser
from gvgbot.drivers.kobuki.mishaps import Mishap, MishapConfig
from gvgbot.drivers.kobuki.payloads import CoreSensors, decode_feedback
from gvgbot.drivers.kobuki.twin import KobukiTwin
from gvgbot.drivers.link_faults import LinkFault, LinkFaultConfig
from gvgbot.geometry import Pose, Twist
from gvgbot.hal.messages import Contact, Odometry
from tests.twin.kobuki_body import IdealBody
from tests.twin.kobuki_rig import FORWARD, PERFECT, Robot, for_seconds, play

pytestmark = pytest.mark.twin

HELD_S = 0.1  # longer than it lasts a touch is told of
FELT: dict[Mishap, Callable[[Contact], bool]] = {
    "bump": lambda contact: contact.bumper,
    "cliff": lambda contact: contact.cliff,
    "wheel drop": lambda contact: contact.wheel_drop,
    "over-current": lambda contact: contact.over_current,
}


@pytest.mark.parametrize("mishap", FELT)
def test_a_mishap_is_felt_as_itself_alone_and_for_as_long_as_it_lasts(mishap: Mishap) -> None:
    async def script(robot: Robot) -> None:
        await robot.clock.sleep_until(1.005)
        robot.twin.inject(mishap, 0.4)
        await robot.clock.sleep_until(2.0)

    contacts = play(script).contacts
    felt = [contact.stamp for contact in contacts if FELT[mishap](contact)]
    assert felt[0] == pytest.approx(1.02, abs=1e-6)
    assert felt[-1] == pytest.approx(1.4 + HELD_S, abs=FRAME_PERIOD)
    assert len(felt) == round((felt[-1] - felt[0]) / FRAME_PERIOD) + 1
    others = [feel for name, feel in FELT.items() if name != mishap]
    assert not any(feel(contact) for contact in contacts for feel in others)


def test_over_current_cuts_the_motors_until_it_is_over() -> None:
    async def script(robot: Robot) -> None:
        await robot.clock.sleep_until(1.005)
        robot.twin.inject("over-current", 0.5)
        await robot.clock.sleep_until(1.1)
        assert robot.body.twist == Twist()
        await robot.clock.sleep_until(1.5)
        assert robot.body.twist == Twist()
        await robot.clock.sleep_until(1.7)
        assert robot.body.twist == FORWARD

    play(script)


def test_low_battery_is_reported() -> None:
    """5 % at 13.2 V and 100 % at 16.5 V lie on a line, which gives 2.1 % at 13.1 V."""

    async def script(robot: Robot) -> None:
        await robot.clock.sleep_until(0.1)
        robot.twin.inject("low battery", 1.0)
        await robot.clock.sleep_until(0.2)
        assert robot.base.battery is not None
        assert robot.base.battery.fraction == pytest.approx(0.021, abs=5e-4)

    play(script)


def test_a_slip_turns_one_wheel_further_than_the_body_went() -> None:
    async def script(robot: Robot) -> None:
        await robot.clock.sleep_until(1.0)
        robot.twin.inject("slip", 0.0)
        await robot.clock.sleep_until(3.0)

    robot = play(script)
    believed = robot.heard[-1][1].odom_base
    assert believed.x - robot.body.pose.x == pytest.approx(0.05 / 2, abs=0.005)
    assert believed.theta == 0.0


@pytest.mark.parametrize("mishap", ["short part", "unknown part"])
def test_odd_parts_are_counted_and_cost_no_way(mishap: Mishap) -> None:
    async def script(robot: Robot) -> None:
        await robot.clock.sleep_until(1.005)
        robot.twin.inject(mishap, 0.2)
        await robot.clock.sleep_until(2.0)

    robot = play(script)
    assert robot.feedback.statistics.unknown_parts == 10
    assert robot.feedback.statistics.malformed == 0
    assert robot.heard[-1][1].odom_base.x == pytest.approx(robot.body.pose.x, abs=0.005)


def test_a_rebooted_base_counts_from_nothing() -> None:
    twin = KobukiTwin(PERFECT, IdealBody(), 7)
    for _ in range(100):
        twin.advance(twin.next_due())
    twin.inject("reboot", 0.0)
    assert twin.advance(twin.next_due()) == b""
    assert twin.next_due() == pytest.approx(100 * 0.02 + 1.0)
    (frame,) = FrameParser().feed(twin.advance(twin.next_due()))
    assert isinstance(frame, Frame)
    core = decode_feedback(frame.payload)[0]
    assert isinstance(core, CoreSensors)
    assert (core.stamp_ms, core.left_encoder, core.right_encoder) == (0, 0, 0)


@pytest.mark.parametrize("age", [1.0, 3.3, 20.0, 64.7, 65.2])
def test_after_a_reboot_the_pose_goes_on_and_stamps_are_right(age: float) -> None:
    """The base stands for the boot, so that what its wheels did not count is at most its run-out.

    The counter wraps at 65.536 s: a reboot just before looks like a small step.
    """

    async def script(robot: Robot) -> None:
        await robot.clock.sleep_until(age)
        robot.twin.inject("reboot", 0.0)
        await robot.clock.sleep_until(age + 6.0)

    robot = play(script)
    believed = robot.heard[-1][1]
    assert believed.odom_base.x == pytest.approx(robot.body.pose.x, abs=0.06)
    assert believed.odom_base.theta == 0.0
    assert all(abs(at - odometry.stamp) < 0.05 for at, odometry in robot.heard[-50:])
    assert robot.feedback.statistics.resets >= 1
    steps = [b.odom_base.distance(a.odom_base) for (_, a), (_, b) in pairwise(robot.heard)]
    assert max(steps) < 0.2 * 0.2


def test_firmware_without_a_time_out_of_its_own_drives_on() -> None:
    def moving_after_a_minute(*, has_command_timeout: bool) -> bool:
        body = IdealBody()
        config = replace(PERFECT, has_command_timeout=has_command_timeout)
        twin = KobukiTwin(config, body, 1)
        twin.receive(encode_commands([BaseControl(100, 0)]), 0.0)
        for _ in range(3000):
            twin.advance(twin.next_due())
        return body.twist != Twist()

    assert moving_after_a_minute(has_command_timeout=False)
    assert not moving_after_a_minute(has_command_timeout=True)


def test_motors_that_stand_get_their_power_late() -> None:
    def first_motion(delay: float) -> float:
        config = replace(PERFECT, motor_power_delay_s=delay)
        return next(
            at for at, twist in play(for_seconds(1.0), config).body.commands if twist.linear
        )

    assert first_motion(0.1) - first_motion(0.0) == pytest.approx(0.1, abs=0.021)


@pytest.mark.parametrize("fault", ["silence", "unplug"])
def test_a_lost_base_stands_and_is_back_within_two_seconds(fault: LinkFault) -> None:
    async def script(robot: Robot) -> None:
        await robot.clock.sleep_until(2.0)
        robot.link.inject(fault, 3.0)
        await robot.clock.sleep_until(4.9)
        assert robot.base.away is not None
        assert robot.body.twist == Twist()
        await robot.clock.sleep_until(9.0)
        assert robot.base.away is None

    robot = play(script)
    assert robot.heard_between(2.05, 4.95) == 0
    assert robot.heard_between(5.0, 7.0) > 10
    assert robot.heard_between(8.0, 9.0) >= 49
    assert robot.heard[-1][1].odom_base.x == pytest.approx(robot.body.pose.x, abs=0.01)


def test_unplugging_is_noticed_at_once() -> None:
    async def script(robot: Robot) -> None:
        await robot.clock.sleep_until(2.0)
        robot.link.inject("unplug", 3.0)
        await robot.clock.sleep_until(2.05)
        assert robot.base.away is not None

    play(script)


def test_a_converter_with_a_slow_timer_costs_no_frame_and_no_accuracy() -> None:
    """Frame k is made at 0.02 k s; by when the bytes come, it cannot be told better than once."""
    config = replace(PERFECT, link=LinkFaultConfig(chip_timer_s=0.016, latency_s=0.001))
    robot = play(for_seconds(20.0), config)
    statistics = robot.feedback.statistics
    assert (statistics.bad_frames, statistics.missed_frames) == (0, 0)
    assert statistics.frames == pytest.approx(1000, abs=3)
    late = [odometry.stamp % 0.02 for _, odometry in robot.heard[500:]]
    assert np.ptp(late) < 1e-3


def test_a_damaged_link_loses_only_the_damaged_frames() -> None:
    """A frame of 81 to 87 bytes comes through unhurt with the chance of all its bytes together."""
    rates = LinkFaultConfig(
        flipped_bits_per_kb=1.0, lost_bytes_per_kb=1.0, inserted_bytes_per_kb=1.0
    )
    robot = play(for_seconds(60.0), replace(PERFECT, link=rates))
    unhurt = (1 - 0.001) ** (3 * 81.5)
    expected, spread = 3000 * unhurt, math.sqrt(3000 * unhurt * (1 - unhurt))
    # an inserted byte between two frames hurts neither, and a hurt header can take the next along
    assert expected - 6 * spread < robot.feedback.statistics.frames < expected + 6 * spread
    assert robot.feedback.statistics.bad_frames > 300
    assert {name for name, count in robot.link.counts.items() if count > 100} == {
        "flipped bit",
        "lost byte",
        "inserted byte",
    }


def test_the_same_seed_gives_the_same_faults() -> None:
    faults = LinkFaultConfig(jitter_s=0.01, flipped_bits_per_kb=2.0, cut_messages_per_k=50.0)
    config = replace(PERFECT, link=faults, mishaps=MishapConfig(bumps_per_h=3600.0))

    def recording(seed: int) -> list[tuple[float, Odometry]]:
        return play(for_seconds(5.0), config, seed=seed).heard

    assert recording(3) == recording(3)
    assert recording(3) != recording(4)


def test_a_cut_frame_costs_no_more_than_itself_and_the_next() -> None:
    config = replace(PERFECT, link=LinkFaultConfig(cut_messages_per_k=100.0))
    robot = play(for_seconds(60.0), config)
    cuts = robot.link.counts["cut message"]
    assert 200 < cuts < 400
    assert 3000 - 2 * cuts <= robot.feedback.statistics.frames <= 3001 - cuts


def test_a_standing_start_is_at_the_origin_again_after_driving_a_full_circle_through_faults() -> (
    None
):
    """Geometry: the believed pose follows the true one, whatever single frames were lost."""
    faults = LinkFaultConfig(
        jitter_s=0.005, flipped_bits_per_kb=0.5, lost_bytes_per_kb=0.5, cut_messages_per_k=20.0
    )
    robot = play(for_seconds(30.0), replace(PERFECT, link=faults), Twist(0.2, 0.5))
    believed = robot.heard[-1][1]
    robot.body.advance(30.0)
    assert believed.odom_base.distance(robot.body.pose) < 0.03
    assert robot.body.pose != Pose()


def test_a_slip_is_counted_and_a_turn_is_none() -> None:
    async def script(robot: Robot) -> None:
        await robot.clock.sleep_until(3.0)
        assert robot.feedback.statistics.slips == 0
        robot.twin.inject("slip", 0.0)
        await robot.clock.sleep_until(6.0)
        assert robot.feedback.statistics.slips == 1

    play(script, twist=Twist(0.2, 1.0))
