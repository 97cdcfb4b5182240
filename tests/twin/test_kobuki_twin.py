"""The simulated base by itself: bytes in, bytes out."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gvgbot.drivers.kobuki.commands import (
    BaseControl,
    Command,
    GetGain,
    GpOutput,
    RequestExtra,
    SetGain,
    encode_commands,
)
from gvgbot.drivers.kobuki.frames import Frame, FrameParser
from gvgbot.drivers.kobuki.odometry_error import OdometryProfile
from gvgbot.drivers.kobuki.payloads import (
    ControllerInfo,
    CoreSensors,
    FeedbackPart,
    FirmwareVersion,
    HardwareVersion,
    Inertia,
    RawGyro,
    Udid,
    Version,
    decode_feedback,
)
from gvgbot.drivers.kobuki.twin import KobukiTwin, KobukiTwinConfig
from gvgbot.geometry import Twist
from tests.twin.kobuki_body import IdealBody

TICKS_PER_M = 11724.41658
Parts = dict[type, FeedbackPart]


class Rig:
    """A twin, its body, and the frames it sends."""

    def __init__(self, *, seed: int = 1, profile: OdometryProfile = "perfect") -> None:
        self.body = IdealBody()
        self.twin = KobukiTwin(KobukiTwinConfig(odometry=profile), self.body, seed)

    def send(self, *commands: Command) -> None:
        assert self.twin.receive(encode_commands(commands), self.body.now) == b""

    def frame(self) -> list[FeedbackPart]:
        """The next frame, which must be one write and standard in its beginning."""
        (frame,) = FrameParser().feed(self.twin.advance(self.twin.next_due()))
        assert isinstance(frame, Frame)
        return decode_feedback(frame.payload)

    def parts(self) -> Parts:
        return {type(part): part for part in self.frame()}

    def core(self) -> CoreSensors:
        part = self.parts()[CoreSensors]
        assert isinstance(part, CoreSensors)
        return part

    def run(self, seconds: float, each: Callable[[Parts], None] = lambda _: None) -> None:
        for _ in range(round(50 * seconds)):
            each(self.parts())


@given(st.lists(st.binary(max_size=30), min_size=5, max_size=20))
@settings(max_examples=30)
def test_stamps_are_twenty_milliseconds_apart_whatever_is_sent(noise: list[bytes]) -> None:
    rig = Rig(profile="kobuki")
    stamps, dues = [], []
    for data in noise:
        rig.twin.receive(data, rig.body.now)
        dues.append(rig.twin.next_due())
        stamps.append(rig.core().stamp_ms)
    assert set(np.diff(stamps)) == {20}
    assert np.diff(dues) == pytest.approx(0.02, abs=1e-12)


def test_it_streams_fifty_frames_a_second_from_power_on_on_any_clock() -> None:
    twin = KobukiTwin(KobukiTwinConfig(), IdealBody(), 0)
    assert twin.next_due() <= 1234.5
    assert twin.advance(1234.5)
    assert twin.advance(1234.51) == b""
    sent = 0
    while twin.next_due() <= 1244.5:
        assert twin.advance(twin.next_due())
        sent += 1
    assert sent == 500


def test_a_standard_frame_has_its_sub_payloads_in_order_and_length() -> None:
    twin = Rig().twin
    sizes = set()
    for _ in range(50):
        data = twin.advance(twin.next_due())
        sizes.add(len(data))
        assert data[3] == 1
    assert sizes == {81, 87}


def test_gyro_samples_come_in_twos_and_sometimes_threes_numbered_without_gaps() -> None:
    rig, counts, ids = Rig(), [], []

    def look(parts: Parts) -> None:
        gyro = parts[RawGyro]
        assert isinstance(gyro, RawGyro)
        counts.append(len(gyro.samples))
        ids.append(gyro.frame_id)

    rig.run(10.0, look)
    assert set(counts) == {2, 3}
    assert sum(counts) == pytest.approx(1040, abs=2)
    assert [(a + n) % 256 for a, n in zip(ids, counts, strict=True)][:-1] == ids[1:]


def test_requests_are_answered_at_the_end_of_the_next_frame_only() -> None:
    rig = Rig()
    rig.send(RequestExtra(0x0B), GetGain())
    assert rig.frame()[7:9] == [
        HardwareVersion(Version(1, 0, 4)),
        FirmwareVersion(Version(1, 2, 0)),
    ]
    rig.send(RequestExtra(0x0B), GetGain())
    answers = rig.frame()[7:]
    assert [type(a) for a in answers] == [HardwareVersion, FirmwareVersion, Udid, ControllerInfo]
    assert len(rig.frame()) == 7


def test_requests_repeated_within_a_cycle_are_answered_once() -> None:
    rig = Rig()
    for _ in range(10):
        rig.send(*10 * (RequestExtra(0x0B), GetGain()))
    answers = rig.frame()[7:]
    assert [type(a) for a in answers] == [HardwareVersion, FirmwareVersion, Udid, ControllerInfo]


def test_gains_are_kept_and_the_factorys_come_back() -> None:
    rig = Rig()
    rig.send(SetGain(1, 50_000, 200, 1_000), GetGain())
    assert rig.frame()[-1] == ControllerInfo(1, 50_000, 200, 1_000)
    rig.send(SetGain(0, 1, 1, 1))
    rig.send(GetGain())
    assert rig.frame()[-1] == ControllerInfo(0, 100_000, 100, 2_000)


def test_all_commands_of_one_frame_are_obeyed() -> None:
    rig = Rig()
    rig.run(0.1)
    rig.send(GpOutput(0x01F0), BaseControl(100, 0))
    rig.run(0.1)
    assert rig.twin.output == 0x01F0
    assert rig.body.twist == Twist(0.1, 0.0)


def test_a_command_with_a_wrong_checksum_is_ignored() -> None:
    rig = Rig()
    rig.twin.receive(bytes.fromhex("aa 55 06 01 04 64 00 00 00 3d"), 0.0)
    rig.run(0.5)
    assert rig.body.commands == []
    assert rig.twin.received.bad_frames == 1


def test_a_command_takes_effect_after_the_dead_time() -> None:
    rig = Rig()
    rig.run(0.1)
    sent = rig.body.now
    rig.send(BaseControl(100, 0))
    rig.run(0.2)
    ((at, twist),) = rig.body.commands
    assert twist == Twist(0.1, 0.0)
    assert at == pytest.approx(sent + 0.06, abs=0.021)
    assert at > sent + 0.06 - 1e-9


def test_without_commands_it_stops_by_itself() -> None:
    rig = Rig()
    rig.run(0.1)
    sent = rig.body.now
    rig.send(BaseControl(100, 0))
    rig.run(5.0)
    at, twist = rig.body.commands[-1]
    assert twist == Twist()
    assert at == pytest.approx(sent + 1.5, abs=0.03)
    assert len(rig.body.commands) == 2


@pytest.mark.parametrize("control", [BaseControl(2000, 500), BaseControl(-1500, -300)], ids=str)
def test_the_fast_wheel_is_limited_and_the_radius_kept(control: BaseControl) -> None:
    rig = Rig()
    rig.send(control)
    rig.run(0.2)
    v, w = rig.body.twist.linear, rig.body.twist.angular
    assert v / w == pytest.approx(control.radius_mm / 1000)
    assert max(abs(v + 0.115 * w), abs(v - 0.115 * w)) == pytest.approx(0.7)
    assert math.copysign(1, v) == math.copysign(1, control.speed_mmps)


def test_perfect_encoders_and_gyro_report_the_bodys_true_motion() -> None:
    rig = Rig(seed=3)
    first = rig.parts()
    rig.send(BaseControl(257, 400))
    rig.run(1.4)
    last = rig.parts()
    before, after = first[CoreSensors], last[CoreSensors]
    start, end = first[Inertia], last[Inertia]
    assert isinstance(before, CoreSensors)
    assert isinstance(after, CoreSensors)
    assert isinstance(start, Inertia)
    assert isinstance(end, Inertia)
    left = (after.left_encoder - before.left_encoder) % 65536
    right = (after.right_encoder - before.right_encoder) % 65536
    assert left == pytest.approx(rig.body.left_travel * TICKS_PER_M, abs=1.01)
    assert right == pytest.approx(rig.body.right_travel * TICKS_PER_M, abs=1.01)
    turn = (end.angle_cdeg - start.angle_cdeg) % 36000
    assert turn == pytest.approx(100 * math.degrees(rig.body.pose.theta) % 36000, abs=1.01)
    assert end.rate_cdeg_s == pytest.approx(100 * math.degrees(rig.body.twist.angular), abs=1.01)


def test_at_rest_the_processed_rate_is_zero_and_the_raw_one_is_not() -> None:
    rig, angles, encoders = Rig(profile="kobuki"), set(), set()

    def look(parts: Parts) -> None:
        inertia, gyro, core = parts[Inertia], parts[RawGyro], parts[CoreSensors]
        assert isinstance(inertia, Inertia)
        assert isinstance(gyro, RawGyro)
        assert isinstance(core, CoreSensors)
        assert inertia.rate_cdeg_s == 0
        assert all(-90 < z < -40 for _, _, z in gyro.samples)
        angles.add(inertia.angle_cdeg)
        encoders.add((core.left_encoder, core.right_encoder))

    rig.run(5.0, look)
    assert len(angles) == len(encoders) == 1


def test_bumpers_use_the_bases_bits() -> None:
    rig = Rig()
    for bumper, bits in [((1, 0, 0), 4), ((0, 1, 0), 2), ((0, 0, 1), 1), ((1, 1, 1), 7)]:
        rig.body.bumper = (bool(bumper[0]), bool(bumper[1]), bool(bumper[2]))
        assert rig.core().bumper == bits


def test_the_same_seed_gives_the_same_bytes_and_another_seed_another_start() -> None:
    def recording(seed: int) -> bytes:
        rig = Rig(seed=seed, profile="worn")
        rig.send(BaseControl(200, 700))
        return b"".join(rig.twin.advance(rig.twin.next_due()) for _ in range(100))

    assert recording(5) == recording(5)
    a, b = Rig(seed=5).core(), Rig(seed=6).core()
    assert a.left_encoder != b.left_encoder
    assert a.right_encoder != b.right_encoder


@pytest.mark.parametrize(
    ("firmware", "reply"),
    [
        ("1.0.0", "0a02 6800 0b02 7b00"),
        ("1.1.0", "0a02 6800 0b02 6e00"),
        ("1.1.1", "0a02 6800 0b02 6f00"),
        ("1.1.4", "0a04 04000100 0b04 04010100"),
    ],
)
def test_early_firmware_tells_versions_in_two_bytes(firmware: str, reply: str) -> None:
    twin = KobukiTwin(KobukiTwinConfig(firmware_version=firmware), IdealBody(), 0)
    twin.receive(encode_commands([RequestExtra(0x03)]), 0.0)
    assert twin.advance(twin.next_due())[:-1].endswith(bytes.fromhex(reply))


def test_a_base_may_leave_questions_unanswered_for_a_while() -> None:
    rig = Rig()
    rig.twin.inject("no replies", 0.05)
    answered = []
    for _ in range(6):
        rig.send(RequestExtra(0x0B))
        answered.append(len(rig.frame()) - 7)
    assert answered == [0, 0, 0, 3, 3, 3]


def test_buttons_have_the_bases_bits() -> None:
    rig = Rig()
    rig.twin.hold_buttons(0x05)
    assert rig.core().buttons == 0x05
    rig.twin.hold_buttons(0)
    assert rig.core().buttons == 0


@pytest.mark.parametrize("key", ["firmware_version", "hardware_version"])
@pytest.mark.parametrize("version", ["1.2", "1.2.0-rc", "1.300.0", "-1.0.0", ""])
def test_a_version_that_no_reply_can_hold_is_refused(key: str, version: str) -> None:
    with pytest.raises(ValueError, match=f"{key} = "):
        KobukiTwinConfig(**{key: version})  # type: ignore[arg-type]  # keys are parameters
