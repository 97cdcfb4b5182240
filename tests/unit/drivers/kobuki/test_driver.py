"""The driver against a scripted base at the other end of a pipe, in virtual time."""

import asyncio
import math
from collections.abc import Awaitable, Callable
from itertools import pairwise

import pytest

from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.drivers.kobuki.commands import (
    BaseControl,
    Command,
    GpOutput,
    Melody,
    Output,
    RequestExtra,
    SoundSequence,
    decode_commands,
)
from gvgbot.drivers.kobuki.driver import KobukiBase, KobukiConfig
from gvgbot.drivers.kobuki.feedback import FeedbackReader
from gvgbot.drivers.kobuki.frames import Frame, FrameParser, encode_frame
from gvgbot.drivers.kobuki.payloads import (
    CoreSensors,
    FeedbackPart,
    FirmwareVersion,
    HardwareVersion,
    Inertia,
    Udid,
    Version,
    encode_feedback,
)
from gvgbot.drivers.kobuki.sub_payloads import Truncated, Unknown
from gvgbot.drivers.kobuki.wheel_odometry import KOBUKI, Heading
from gvgbot.drivers.transport import pipe
from gvgbot.errors import DeviceLost, DeviceRefused
from gvgbot.geometry import STANDSTILL, Twist
from gvgbot.hal.messages import Contact, Odometry

TICKS_PER_M = 11724.41658
STOP = BaseControl(0, 0)
MOVE = BaseControl(200, 0)
SILENCE_LOST_S = KobukiConfig().silence_lost_s


def core(k: int = 0, left: int = 0, right: int = 0, **fields: int) -> CoreSensors:
    values = {"bumper": 0, "wheel_drop": 0, "cliff": 0, "charger": 0, "battery_dv": 165}
    values |= {"over_current": 0, "left_pwm": 0, "right_pwm": 0, "buttons": 0} | fields
    return CoreSensors(
        stamp_ms=20 * k % 65536, left_encoder=left % 65536, right_encoder=right % 65536, **values
    )


def frame(*parts: FeedbackPart) -> bytes:
    return encode_frame(encode_feedback(parts))


class Bench:
    """A driver whose base is played by the test."""

    def __init__(self, config: KobukiConfig | None = None, ahead: float = 0.0) -> None:
        self.clock = LoopClock(ahead)
        stream, self.wire = pipe()
        self.base = KobukiBase(stream, config or KobukiConfig(), self.clock)
        self.sent: list[tuple[float, Command]] = []
        self.cycle = 0

    def controls(self, since: float = 0.0) -> list[tuple[float, Command]]:
        return [(t, c) for t, c in self.sent if isinstance(c, BaseControl) and t >= since]

    async def listen(self) -> None:
        parser = FrameParser()
        while True:
            for got in parser.feed(await self.wire.read()):
                assert isinstance(got, Frame)
                self.sent += [(self.clock.now(), c) for c in decode_commands(got.payload)]

    async def say(self, *parts: FeedbackPart) -> None:
        self.wire.write(frame(*parts))
        await asyncio.sleep(0.02)

    async def stream(self, seconds: float, twist: Twist | None = None) -> None:
        for _ in range(round(seconds / 0.02)):
            if twist is not None:
                self.base.drive(twist)
            await self.say(core(self.cycle), Inertia(0, 0))
            self.cycle += 1


def play(
    script: Callable[[Bench], Awaitable[None]],
    config: KobukiConfig | None = None,
    ahead: float = 0.0,
) -> Bench:
    """Run the driver while the script plays the base, then cancel the driver.

    Its clock is `ahead` of the loop's, s.
    """

    async def main() -> Bench:
        bench = Bench(config, ahead)
        async with asyncio.TaskGroup() as tasks:
            listening = tasks.create_task(bench.listen())
            running = tasks.create_task(bench.base.run())
            await script(bench)
            running.cancel()
            await asyncio.sleep(0.001)
            listening.cancel()
        return bench

    result = run_in_virtual_time(main())
    assert isinstance(result, Bench)
    return result


def test_a_started_driver_first_of_all_stops_the_base() -> None:
    async def script(bench: Bench) -> None:
        await bench.stream(0.1)

    assert play(script).sent[0] == (0.0, STOP)


def test_without_drive_for_half_a_second_zeros_are_sent() -> None:
    async def script(bench: Bench) -> None:
        await bench.stream(1.0, Twist(0.2, 0.0))
        await bench.stream(1.0)

    controls = play(script).controls(since=0.02)
    moves = [t for t, control in controls if control == MOVE]
    stops = [t for t, control in controls if control == STOP]
    assert moves[-1] == pytest.approx(0.98)
    assert stops[0] == pytest.approx(moves[-1] + 0.5, abs=0.021)
    assert len(stops) > 2


def test_after_such_a_stop_the_ramp_begins_from_rest() -> None:
    """A tenth of a second of it, at most, for the first command."""
    drove: list[Twist] = []

    async def script(bench: Bench) -> None:
        await bench.stream(3.0, Twist(0.4, 0.0))
        await bench.stream(1.0)
        drove.append(bench.base.drive(Twist(0.4, 0.0)))

    play(script, KobukiConfig(max_acceleration_mps2=0.5))
    assert drove == [Twist(0.05, 0.0)]


def test_driving_goes_on_as_long_as_it_is_asked_for() -> None:
    async def script(bench: Bench) -> None:
        for _ in range(10):
            bench.base.drive(Twist(0.2, 0.0))
            await bench.stream(0.4)

    controls = [control for _, control in play(script).controls(since=0.02)]
    assert controls[:-1] == [MOVE] * (len(controls) - 1)
    assert len(controls) >= 10


def test_a_cancelled_driver_leaves_zeros_as_its_last_command() -> None:
    async def script(bench: Bench) -> None:
        await bench.stream(0.5, Twist(0.2, 0.0))

    controls = play(script).controls()
    assert [control for _, control in controls[-2:]] == [MOVE, STOP]


@pytest.mark.parametrize(
    ("heading", "gyro", "is_refused"),
    [("gyro", 0, True), ("gyro", 1, False), ("wheels", 0, False)],
    ids=["dead gyro", "one that moves, by a hundredth of a degree", "no gyro wanted"],
)
def test_a_gyro_that_stands_while_the_wheels_turn_the_base_round_is_of_no_use(
    heading: Heading, gyro: int, *, is_refused: bool
) -> None:
    """For a turn, here half of it to either side, each wheel goes tau times 0.115 m."""
    ticks = 1.2 * math.tau * 0.115 * TICKS_PER_M / 100

    async def main() -> None:
        bench = Bench(KobukiConfig(heading=heading))
        async with asyncio.TaskGroup() as tasks:
            running = tasks.create_task(until_refused(bench.base))
            for k in range(100):
                way = round(ticks * min(k, 100 - k))
                await bench.say(core(k, -way, way), Inertia(gyro * (k // 50), 0))
            assert running.done() == is_refused
            running.cancel()

    async def until_refused(base: KobukiBase) -> None:
        with pytest.raises(DeviceRefused, match="heading=wheels"):
            await base.run()

    run_in_virtual_time(main())


def test_silence_stops_the_base_and_then_loses_it() -> None:
    async def script(bench: Bench) -> None:
        async def insist() -> None:
            while True:
                bench.base.drive(Twist(0.2, 0.0))
                await asyncio.sleep(0.02)

        async with asyncio.TaskGroup() as tasks:
            insisting = tasks.create_task(insist())
            await bench.stream(0.5)
            with pytest.raises(DeviceLost, match="cable"):
                await bench.base.run()
            assert bench.clock.now() == pytest.approx(1.5, abs=0.05)
            insisting.cancel()

    async def main() -> Bench:
        bench = Bench()
        async with asyncio.TaskGroup() as tasks:
            listening = tasks.create_task(bench.listen())
            await script(bench)
            listening.cancel()
        return bench

    bench = run_in_virtual_time(main())
    quiet = [control for t, control in bench.controls(since=1.01)]
    assert quiet
    assert set(quiet) == {STOP}
    assert (MOVE in [control for t, control in bench.controls() if t < 0.99]) is True


def test_a_quarter_of_a_second_of_silence_stops_the_base_long_before_the_deadman() -> None:
    async def script(bench: Bench) -> None:
        await bench.stream(0.5, Twist(0.2, 0.0))
        await asyncio.sleep(0.9)

    bench = play(script, KobukiConfig(deadman_s=2.0))
    stops = [t for t, control in bench.controls(since=0.02) if control == STOP]
    assert stops[0] == pytest.approx(0.48 + 0.25)


@pytest.mark.parametrize("ahead", [5000.0, -5000.0])
@pytest.mark.parametrize(("streams", "allowed"), [(True, 0.5), (False, 0.25)])
def test_a_stop_is_due_though_the_clock_goes_on_from_an_earlier_life(
    ahead: float, allowed: float, *, streams: bool
) -> None:
    """After a restart of the computer its clock, and so the loop's, is not the robot's."""

    async def script(bench: Bench) -> None:
        await bench.stream(0.5, Twist(0.2, 0.0))
        await (bench.stream(0.9) if streams else asyncio.sleep(0.9))

    bench = play(script, ahead=ahead)
    stops = [t - ahead for t, control in bench.controls(since=ahead + 0.02) if control == STOP]
    assert stops[0] == pytest.approx(0.48 + allowed, abs=0.021)


@pytest.mark.parametrize("ahead", [5000.0, -5000.0])
def test_a_silent_base_is_lost_though_the_clock_goes_on_from_an_earlier_life(ahead: float) -> None:
    async def main() -> float:
        bench = Bench(ahead=ahead)
        with pytest.raises(DeviceLost, match="cable"):
            await bench.base.run()
        return bench.clock.now() - ahead

    assert run_in_virtual_time(main()) == pytest.approx(SILENCE_LOST_S)


def test_a_link_that_is_cut_is_reported_by_run_alone() -> None:
    async def main() -> None:
        bench = Bench()
        async with asyncio.TaskGroup() as tasks:
            running = tasks.create_task(expect_lost(bench.base))
            await bench.stream(0.1)
            bench.wire.close()
            await running
        assert bench.base.drive(Twist(0.2, 0.0)) == STANDSTILL

    async def expect_lost(base: KobukiBase) -> None:
        with pytest.raises(DeviceLost):
            await base.run()

    run_in_virtual_time(main())


def test_noise_alone_counts_as_silence() -> None:
    async def main() -> None:
        bench = Bench()

        async def chatter() -> None:
            while True:
                bench.wire.write(b"\xaa\x55\x00" * 7)
                await asyncio.sleep(0.02)

        async with asyncio.TaskGroup() as tasks:
            chattering = tasks.create_task(chatter())
            with pytest.raises(DeviceLost):
                await bench.base.run()
            chattering.cancel()

    run_in_virtual_time(main())


@pytest.mark.parametrize(
    ("asked", "sent"),
    [
        (Twist(0.3, 0.0), Twist(0.3, 0.0)),
        (Twist(2.0, 0.0), Twist(0.7, 0.0)),
        (Twist(0.0, 5.0), Twist(0.0, math.pi)),
        (Twist(0.0, -9.0), Twist(0.0, -math.pi)),
        (Twist(0.7, 1.0), Twist(0.7 / 1.164285, 1.0 / 1.164285)),
        (Twist(math.nan, 1.0), STANDSTILL),
        (Twist(0.1, math.inf), STANDSTILL),
    ],
    ids=str,
)
def test_drive_slows_down_on_the_same_arc_and_says_what_it_sent(asked: Twist, sent: Twist) -> None:
    async def script(bench: Bench) -> None:
        await bench.stream(0.04)
        told.append(bench.base.drive(asked))
        await bench.stream(0.04)

    told: list[Twist] = []
    controls = play(script).controls(since=0.04)
    (_, control) = controls[0]
    assert isinstance(control, BaseControl)
    assert told == [control.twist_on(230.0)]
    assert told[0].linear == pytest.approx(sent.linear, abs=0.002)
    assert told[0].angular == pytest.approx(sent.angular, abs=0.01)


def test_drive_writes_at_once_without_run() -> None:
    async def main() -> None:
        bench = Bench()
        bench.base.drive(Twist(0.2, 0.0))
        (got,) = FrameParser().feed(await bench.wire.read())
        assert isinstance(got, Frame)
        assert decode_commands(got.payload) == [MOVE]

    run_in_virtual_time(main())


def test_odometry_is_stamped_twenty_milliseconds_apart_however_the_bytes_come() -> None:
    async def script(bench: Bench) -> None:
        stream = b"".join(frame(core(k, 100 * k, 100 * k), Inertia(0, 0)) for k in range(200))
        assert len(stream) == 200 * 30
        for start in range(0, len(stream), 28):
            bench.wire.write(stream[start : start + 28])
            await asyncio.sleep(0.02 * 28 / 30)
            if bench.base.statistics.frames > len(stamps) + 1:
                stamps.append((await bench.base.next_odometry()).stamp)

    stamps: list[float] = []
    play(script)
    assert len(stamps) > 150
    steps = [b - a for a, b in pairwise(stamps[20:])]
    assert all(step == pytest.approx(0.02, abs=2e-3) for step in steps)


def odometry_after(*cores: CoreSensors) -> tuple[Odometry, Bench]:
    async def script(bench: Bench) -> None:
        for each in cores:
            await bench.say(each, Inertia(0, 0))
        found.append(await bench.base.next_odometry())

    found: list[Odometry] = []
    bench = play(script)
    return found[0], bench


def test_a_single_absurd_reading_moves_nothing() -> None:
    steps = [core(k, 60 * k, 60 * k) for k in range(10)]
    steps[5] = core(5, 40_000, 300)
    odometry, bench = odometry_after(*steps)
    assert odometry.odom_base.x == pytest.approx(9 * 60 / TICKS_PER_M)
    assert odometry.odom_base.theta == 0.0
    assert bench.base.statistics.doubted == 1


def test_a_base_that_goes_by_its_wheels_may_have_any_gyro() -> None:
    async def script(bench: Bench) -> None:
        for k in range(10):
            await bench.say(core(k, -60 * k, 60 * k), Inertia(9000 * (k % 4) - 18_000, 0))
        found.append(await bench.base.next_odometry())

    found: list[Odometry] = []
    bench = play(script, KobukiConfig(heading="wheels"))
    assert found[0].odom_base.theta == pytest.approx(9 * 120 / TICKS_PER_M / 0.23)
    assert (found[0].breaks, bench.base.statistics.doubted) == (0, 0)


def test_a_wheel_that_jumps_is_not_believed_to_turn_the_base() -> None:
    async def script(bench: Bench) -> None:
        for k in range(10):
            jump = 1500 if k == 5 else 0  # 0.13 m, by which no base turns within a frame
            await bench.say(core(k, 60 * k, 60 * k + jump), Inertia(0, 0))
        found.append(await bench.base.next_odometry())

    found: list[Odometry] = []
    bench = play(script, KobukiConfig(heading="wheels"))
    assert found[0].odom_base.theta == pytest.approx(0.0, abs=1e-9)
    assert bench.base.statistics.doubted == 1


def test_encoders_that_start_anew_do_not_move_the_robot_but_count_from_there() -> None:
    """Of the 9 steps after the jump, as many as it takes to believe it may be lost."""
    steps = [core(k, 60 * k, 60 * k) for k in range(10)]
    steps += [core(k, 30_000 + 60 * k, 30_000 + 60 * k) for k in range(10, 20)]
    odometry, _ = odometry_after(*steps)
    assert 14 * 60 / TICKS_PER_M < odometry.odom_base.x <= 18 * 60 / TICKS_PER_M


@pytest.mark.parametrize("late", [0, 1, 20])
def test_a_base_that_starts_anew_may_tell_of_its_gyro_a_few_frames_later(late: int) -> None:
    reader, back, odometry = FeedbackReader("gyro", 0.0, KOBUKI), 12.0, None
    for k in range(500):
        reader.take(frame(core(k, 60 * k, 60 * k), Inertia(0, 0)), 0.02 * k)
    for k in range(100):
        gyro = [Inertia(0, 0)] if k >= late else []
        odometry = reader.take(frame(core(k, 60 * k, 60 * k), *gyro), back + 0.02 * k)
    assert odometry is not None
    assert odometry.odom_base.x == pytest.approx((499 + 99 - late) * 60 / TICKS_PER_M)
    assert (odometry.breaks, reader.statistics.resets) == (1, 1)


def test_lost_frames_lose_no_way_and_are_counted() -> None:
    steps = [core(k, 60 * k, 60 * k) for k in (0, 1, 2, 7, 8)]
    odometry, bench = odometry_after(*steps)
    assert odometry.odom_base.x == pytest.approx(8 * 60 / TICKS_PER_M)
    assert bench.base.statistics.missed_frames == 4


def test_speed_over_lost_frames_is_the_mean_speed() -> None:
    odometry, _ = odometry_after(*[core(k, 60 * k, 60 * k) for k in (*range(100), 105)])
    assert odometry.twist.linear == pytest.approx(60 / TICKS_PER_M / 0.02)


def test_contact_and_battery_are_those_of_the_newest_frame() -> None:
    async def script(bench: Bench) -> None:
        await bench.say(core(0))
        await bench.say(
            core(1, bumper=5, wheel_drop=2, cliff=2, over_current=2, charger=22, battery_dv=139)
        )
        contact, battery = bench.base.contact, bench.base.battery
        assert contact is not None
        assert battery is not None
        assert (contact.bumper_left, contact.bumper_centre, contact.bumper_right) == (1, 0, 1)
        assert (contact.cliff_left, contact.cliff_centre, contact.cliff_right) == (0, 1, 0)
        assert (contact.wheel_drop_left, contact.wheel_drop_right) == (1, 0)
        assert contact.over_current
        assert (battery.voltage, battery.charging) == (13.9, True)
        assert battery.fraction == pytest.approx(0.2515, abs=1e-4)

    play(script)


def test_what_one_of_several_frames_felt_that_come_together_is_told() -> None:
    """A tap of 20 ms, and all that the base sent for 0.2 s arrives at once; later all is well."""

    async def script(bench: Bench) -> None:
        tap = core(1, bumper=2, cliff=4, wheel_drop=1, over_current=1)
        bench.wire.write(b"".join(frame(part) for part in (tap, *map(core, range(2, 11)))))
        await asyncio.sleep(0.02)
        contact = bench.base.contact
        assert contact == Contact(
            contact.stamp if contact else 0.0,
            bumper_centre=True,
            cliff_left=True,
            wheel_drop_right=True,
            over_current=True,
        )
        for k in range(11, 18):
            await bench.say(core(k))
        contact = bench.base.contact
        assert contact == Contact(contact.stamp if contact else 0.0)

    play(script)


@pytest.mark.parametrize(
    ("charger", "is_tied"), [(0, False), (2, False), (6, False), (18, True), (22, True)]
)
def test_the_cable_of_the_charger_is_felt_and_the_dock_is_not(charger: int, is_tied: bool) -> None:
    """By the states of the charger in the base's protocol: 16 is the adapter."""

    async def script(bench: Bench) -> None:
        await bench.say(core(0, charger=charger))
        assert bench.base.contact is not None
        assert bench.base.contact.charger_cable == is_tied

    play(script)


@pytest.mark.parametrize("silence", ["frozen", "no gyro", "no core", "a long core", "cut"])
def test_a_base_that_talks_but_tells_of_no_motion_is_lost(silence: str) -> None:
    """It says the same frame for ever, or leaves out its gyro, or what all else depends on."""
    tail: dict[str, list[FeedbackPart]] = {
        "frozen": [core(25), Inertia(0, 0)],
        "no core": [Inertia(0, 0)],
        "a long core": [Unknown(1, bytes(17)), Inertia(0, 0)],
        "cut": [Inertia(0, 0), Truncated(b"\x63\x50")],
    }

    async def main() -> None:
        bench = Bench()

        async def chatter() -> None:
            await bench.stream(0.5)
            while True:
                bench.cycle += 1
                await bench.say(*tail.get(silence, [core(bench.cycle)]))

        async with asyncio.TaskGroup() as tasks:
            chattering = tasks.create_task(chatter())
            with pytest.raises(DeviceLost, match="nothing new of its wheels"):
                await bench.base.run()
            assert bench.clock.now() == pytest.approx(0.5 + SILENCE_LOST_S, abs=0.1)
            chattering.cancel()

    run_in_virtual_time(main())


def test_before_the_first_frame_contact_and_battery_are_unknown() -> None:
    async def main() -> None:
        base = Bench().base
        assert (base.contact, base.battery) == (None, None)

    run_in_virtual_time(main())


@pytest.mark.parametrize(
    ("decivolts", "percent"), [(131, 2.1), (132, 5.0), (157, 77.0), (161, 88.5), (165, 100.0)]
)
def test_charge_follows_the_voltage(decivolts: int, percent: float) -> None:
    async def script(bench: Bench) -> None:
        await bench.say(core(battery_dv=decivolts))
        assert bench.base.battery is not None
        assert bench.base.battery.fraction == pytest.approx(percent / 100, abs=5e-4)

    play(script)


def test_versions_are_asked_for_until_answered_in_any_order() -> None:
    async def script(bench: Bench) -> None:
        await bench.stream(1.2)
        await bench.say(core(60), Inertia(0, 0), Udid((7, 8, 9)), HardwareVersion(Version(1, 0, 4)))
        await bench.say(core(61), Inertia(0, 0), FirmwareVersion(Version(1, 2, 0)))
        bench.cycle = 62
        await bench.stream(5.0)

    bench = play(script)
    identity = bench.base.identity
    assert (identity.hardware, identity.firmware, identity.udid) == ("1.0.4", "1.2.0", "7-8-9")
    requests = [t for t, command in bench.sent if isinstance(command, RequestExtra)]
    assert len(requests) == 3


def test_a_base_that_never_answers_is_not_asked_for_ever() -> None:
    async def script(bench: Bench) -> None:
        await bench.stream(10.0)

    bench = play(script, KobukiConfig(identity_attempts=4))
    assert sum(isinstance(command, RequestExtra) for _, command in bench.sent) == 4


def test_nothing_is_asked_before_the_base_speaks() -> None:
    async def script(bench: Bench) -> None:
        await asyncio.sleep(0.4)

    assert {command for _, command in play(script).sent} == {STOP}


def test_each_output_word_carries_the_whole_state() -> None:
    async def script(bench: Bench) -> None:
        bench.base.switch(on=Output.LED1_GREEN)
        bench.base.switch(on=Output.LED2_RED)
        bench.base.switch(off=Output.LED1_GREEN | Output.POWER_12V_5A)
        bench.base.play(Melody.CLEANING_START)
        await bench.stream(0.1)

    sent = [command for _, command in play(script).sent]
    outputs = [command.flags for command in sent if isinstance(command, GpOutput)]
    assert outputs == [0x02F0, 0x06F0, 0x04B0]
    assert SoundSequence(5) in sent


def test_damage_is_counted_and_does_not_stop_the_stream() -> None:
    async def script(bench: Bench) -> None:
        await bench.stream(0.1)
        bench.wire.write(bytes.fromhex("aa 55 06 01 04 64 00 00 00 3d"))
        bench.wire.write(encode_frame(bytes((1, 15, 0, 0))))
        bench.wire.write(encode_frame(bytes((99, 1, 0))))
        bench.cycle += 1
        await bench.stream(0.1)

    statistics = play(script).base.statistics
    assert (statistics.bad_frames, statistics.malformed, statistics.unknown_parts) == (1, 1, 1)
    assert (statistics.frames, statistics.skipped_bytes, statistics.missed_frames) == (12, 10, 1)
