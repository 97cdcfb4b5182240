"""The simulated laser answers as SCIP 2 says, command by command."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.drivers.hokuyo.models import MODELS, ModelName
from gvgbot.drivers.hokuyo.scip import ScipParser, decode_time
from gvgbot.drivers.hokuyo.scip_messages import Message, Reply, ScanReply
from gvgbot.drivers.hokuyo.twin import HokuyoTwin, HokuyoTwinConfig
from gvgbot.drivers.hokuyo.twin_head import Head
from gvgbot.drivers.hokuyo.twin_readings import clustered, noisy_readings
from gvgbot.drivers.serial_line import SerialLine
from gvgbot.geometry import Array

VECTORS = {
    vector["name"]: vector
    for vector in json.loads(
        (Path(__file__).parents[3] / "data" / "scip_vectors.json").read_text("ascii")
    )["vectors"]
}
RANGES = np.linspace(0.5, 4.0, 1081)


def laser(**config: Any) -> HokuyoTwin:
    quiet = {"range_sigma_m": 0.0, "dropout_fraction": 0.0, "clock_drift_ppm": 0.0}
    return HokuyoTwin(HokuyoTwinConfig(**{**quiet, **config}), lambda *_: RANGES, 0)


def status(twin: HokuyoTwin, command: str, now: float = 0.0) -> str:
    echo, line, *_ = twin.receive(command.encode() + b"\n", now).decode().split("\n")
    assert echo == command
    assert line == VECTORS[f"status {line[:2]}"]["rx"]
    return line[:2]


def frames(twin: HokuyoTwin, until: float) -> list[tuple[float, ScanReply]]:
    """All scans sent until then, each with when it was sent."""
    parser, sent = ScipParser(), []
    while (now := twin.next_due()) <= until:
        for message in parser.feed(twin.advance(now)):
            assert isinstance(message, ScanReply)
            sent.append((now, message))
    return sent


@pytest.mark.parametrize(
    ("model", "name"), [("URG-04LX", "PP URG-04LX"), ("UTM-30LX", "PP UTM-30LX")]
)
def test_pp_answers_with_the_bytes_of_the_real_laser(model: str, name: str) -> None:
    assert laser(model=model).receive(b"PP\n", 0.0) == VECTORS[name]["rx"].encode()


@pytest.mark.parametrize(
    "name",
    ["QT with string", "unknown command", "GD laser off", "TM0", "TM2 already off"],
)
def test_simple_commands_answer_as_in_the_examples(name: str) -> None:
    vector = VECTORS[name]
    assert laser().receive(vector["tx"].encode(), 0.0) == vector["rx"].encode()


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        ("MDx000108001000", "01"),
        ("MD0000x08001000", "02"),
        ("MD00001080x1000", "03"),
        ("MD000010800100x", "07"),
        ("MD0000108001x00", "06"),
        ("MD0000108101000", "04"),
        ("MD0500049901000", "05"),
        ("MD00001080", "0C"),
        ("MD", "0C"),
        ("GS", "0C"),
        ("TM", "0C"),
        ("TM01", "0D"),
        ("MD00001080010000", "0D"),
        ("MD0000108001000;seventeen letters", "0G"),
        ("MD0000108001000;a-b", "0H"),
        ("GD0000108101", "04"),
    ],
)
def test_a_wrong_command_is_refused_with_its_status(command: str, expected: str) -> None:
    twin = laser()
    assert status(twin, command) == expected
    assert twin.next_due() == math.inf


@pytest.mark.parametrize(
    ("commands", "statuses"),
    [
        (["BM", "BM", "QT", "BM"], ["00", "02", "00", "00"]),
        (["TM0", "TM0", "TM2", "TM2"], ["00", "02", "00", "03"]),
        (["MD0000108001000", "TM0", "QT", "TM0"], ["00", "10", "00", "00"]),
        (
            ["TM0", "MD0000108001000", "PP", "TM2", "MD0000108001000"],
            ["00", "10", "10", "00", "00"],
        ),
        (["MD0000108001000", "BM", "RS", "GD0000108001"], ["00", "02", "00", "10"]),
    ],
    ids="-".join,
)
def test_the_answer_depends_on_the_state(commands: list[str], statuses: list[str]) -> None:
    twin = laser()
    assert [status(twin, command) for command in commands] == statuses


@pytest.mark.parametrize("ending", [b"\n", b"\r", b"\r\n", b"\n\n\r"])
def test_every_terminator_ends_a_command(ending: bytes) -> None:
    assert laser().receive(b"\nQT" + ending + b"VV", 0.0) == b"QT\n00P\n\n"


@given(st.lists(st.binary(max_size=60)))
def test_noise_never_raises_and_the_next_command_is_answered(noise: list[bytes]) -> None:
    twin = laser()
    for chunk in noise:
        twin.receive(chunk, 0.0)
    assert twin.receive(b"\nTM2\nQT\n", 0.0).endswith(b"QT\n00P\n\n")


def test_an_endless_command_is_forgotten() -> None:
    twin = laser()
    for _ in range(100):
        assert twin.receive(b"M" * 1000, 0.0) == b""
    assert twin.receive(b"\nQT\n", 0.0) == b"QT\n00P\n\n"


def test_the_clock_counts_milliseconds_in_24_bits_until_reset() -> None:
    twin = laser(clock_start_ms=2**24 - 1000)
    twin.receive(b"TM0\n", 0.0)

    def time_at(now: float) -> int:
        (message,) = ScipParser().feed(twin.receive(b"TM1\n", now))
        assert isinstance(message, Reply)
        return decode_time(message)

    assert [time_at(0.0), time_at(0.999), time_at(1.0)] == [2**24 - 1000, 2**24 - 1, 0]
    twin.receive(b"RS\nTM0\n", 5.0)
    assert time_at(5.25) == 250


def test_a_millisecond_of_the_clock_begins_at_any_time_of_a_turn() -> None:
    """So half a millisecond after a scan has begun the clocks of half of all lasers have ticked."""
    config, begun = HokuyoTwinConfig(clock_drift_ppm=0.0), 4.0
    heads = [Head(config, lambda *_: RANGES, seed, 0.0) for seed in range(200)]
    for head in heads:
        head.reset_clock(2.0)
    ticked = sum(head.device_ms(begun + 0.0005) - head.device_ms(begun) for head in heads)
    assert ticked == pytest.approx(100, abs=35)  # five sigmas


@pytest.mark.parametrize(
    ("model", "period", "last"), [("UTM-30LX", 0.025, 1080), ("URG-04LX", 0.1, 725)]
)
def test_scans_leave_on_the_grid_of_the_motor(model: ModelName, period: float, last: int) -> None:
    ranges = RANGES if model == "UTM-30LX" else RANGES[:682]
    config = HokuyoTwinConfig(model=model, clock_drift_ppm=0.0)
    twin = HokuyoTwin(config, lambda *_: ranges, 0)
    first = MODELS[model].parameters.first_step
    assert status(twin, f"MD{first:04}{last:04}01200", 1.01) == "00"
    sent = frames(twin, 3.0)
    expected = np.arange(math.ceil(1.01 / period), 1000)[::3] * period
    sweep = last * period / MODELS[model].parameters.steps_per_turn
    assert [now for now, _ in sent] == pytest.approx(expected[: len(sent)] + sweep + 0.00475)
    assert [scan.stamp for _, scan in sent] == pytest.approx(expected[: len(sent)] * 1000)
    assert len(sent) > 5


def test_a_counted_stream_counts_down_and_switches_the_laser_off() -> None:
    twin = laser()
    assert status(twin, "MD0000108001003;run 7") == "00"
    sent = [scan for _, scan in frames(twin, 1.0)]
    assert [scan.request.count for scan in sent] == [2, 1, 0]
    assert {scan.request.string for scan in sent} == {"run 7"}
    assert status(twin, "GD0000108001", 1.0) == "10"


@pytest.mark.parametrize("last", [1080, 540])
def test_the_world_is_asked_once_per_scan_sent_when_its_beams_were_seen(last: int) -> None:
    """From step 0 to 1080 of 1440 at most, at 40 Hz."""
    asked: list[float] = []

    def sense(stamp: float, steps: int) -> Array:
        assert steps == last + 1
        asked.append(stamp)
        return RANGES

    twin = HokuyoTwin(HokuyoTwinConfig(), sense, 0)
    status(twin, f"MD0000{last:04}01400")
    while (now := twin.next_due()) < 2.0:
        before = len(asked)
        twin.advance(now)
        assert all(now >= stamp + 0.025 * last / 1440 for stamp in asked[before:])
    assert asked == pytest.approx(np.arange(0.0, 2.0, 0.125))


def test_a_sector_is_cut_out_of_the_full_turn() -> None:
    twin = laser()
    twin.receive(b"BM\n", 0.0)
    (message,) = ScipParser().feed(twin.receive(b"GD0100010701\n", 1.0))
    assert isinstance(message, ScanReply)
    assert message.ranges / 1000.0 == pytest.approx(RANGES[100:108], abs=0.0006)


def test_two_character_ranges_end_at_4095_mm() -> None:
    config = HokuyoTwinConfig(dropout_fraction=0.0)
    twin = HokuyoTwin(config, lambda *_: np.full(1081, 9.0), 0)
    twin.receive(b"BM\n", 0.0)
    (message,) = ScipParser().feed(twin.receive(b"GS0100010701\n", 1.0))
    assert isinstance(message, ScanReply)
    assert message.ranges.tolist() == [4095] * 8


def test_a_cluster_sends_its_smallest_range_that_is_no_error() -> None:
    readings = np.array([701, 5, 700, 702, 650, 800, 3, 900, 1000, 900], np.int32)
    assert clustered(readings, 4, 23).tolist() == [700, 650, 900]
    assert clustered(np.array([2, 1, 900], np.int32), 2, 23).tolist() == [2, 900]


def test_readings_have_the_noise_and_the_codes_of_the_model() -> None:
    model = MODELS["UTM-30LX"]
    rng = np.random.default_rng(5)
    truth = np.full(200_000, 10.0)
    readings = noisy_readings(truth, model, 0.02, 0.01, rng)
    valid = readings[readings >= 23]
    assert np.count_nonzero(readings == model.failure_code) == pytest.approx(2000, abs=150)
    assert len(valid) + np.count_nonzero(readings == model.failure_code) == len(readings)
    assert valid.std() == pytest.approx(20.0, abs=0.2)
    assert valid.mean() == pytest.approx(10_000, abs=0.2)


@pytest.mark.parametrize(("metres", "sigma_mm"), [(0.5, 10.0), (4.0, 40.0), (8.0, 80.0)])
def test_noise_may_grow_with_the_range(metres: float, sigma_mm: float) -> None:
    """A centimetre, and 1 % of the range from a metre on."""
    config = HokuyoTwinConfig(
        range_sigma_m=0.01, range_sigma_share=0.01, dropout_fraction=0.0, clock_drift_ppm=0.0
    )
    twin = HokuyoTwin(config, lambda *_: np.full(1081, metres), 0)
    twin.receive(b"MD0000108001020\n", 0.0)
    read = np.concatenate([message.ranges for _, message in frames(twin, 1.0)])
    assert read.std() == pytest.approx(sigma_mm, rel=0.03)


def test_what_cannot_be_measured_comes_as_a_code() -> None:
    truth = np.array([math.inf, 31.0, 30.0, 0.0, 0.0225, 0.023, math.nan])
    readings = noisy_readings(truth, MODELS["UTM-30LX"], 0.0, 0.0, np.random.default_rng(0))
    assert readings.tolist() == [1, 1, 30000, 2, 2, 23, 1]


def replies(twin: HokuyoTwin, command: bytes, now: float = 0.0) -> list[Message]:
    return ScipParser().feed(twin.receive(command, now))


def test_a_reboot_needs_two_commands_within_a_second() -> None:
    vector = "".join(VECTORS[name]["rx"] for name in ("RB first", "RB second within 1 s")).encode()
    twin = laser(reboot_s=1.5)
    assert twin.receive(b"RB\n", 0.0) + twin.receive(b"RB\n", 0.5) == vector
    assert twin.receive(b"QT\n", 1.4) == b"QT\n00P\n\n"  # it takes a second until it goes
    assert twin.next_due() == pytest.approx(1.5)
    assert twin.advance(1.5) == b""
    assert twin.receive(b"QT\n", 2.9) == b""
    assert twin.receive(b"QT\n", 3.1) == b"QT\n00P\n\n"
    twin.receive(b"TM0\n", 4.0)
    (time,) = replies(twin, b"TM1\n", 4.0)
    assert isinstance(time, Reply)
    assert decode_time(time) == 1000  # since it woke at 3.0 s
    slow = laser()
    assert slow.receive(b"RB\n", 0.0) == slow.receive(b"RB\n", 1.5) == b"RB\n01Q\n\n"


def test_of_two_commands_of_a_type_in_one_go_the_first_is_served() -> None:
    twin = laser()
    sent = b"VV;a\nQT\nVV;b\nTM0\nTM1\nTM2\nQT\n"
    statuses = [answer.split(b"\n")[1] for answer in twin.receive(sent, 0.0).split(b"\n\n")[:-1]]
    assert statuses == [b"00P", b"00P", b"0Bb", b"00P", b"00P", b"00P", b"0Bb"]
    assert status(twin, "QT", 0.1) == "00"


def test_a_reboot_is_told_to_the_link() -> None:
    told: list[bool] = []
    twin = HokuyoTwin(HokuyoTwinConfig(reboot_s=2.0), lambda *_: RANGES, 0, told.append)
    twin.receive(b"RB\nRB\n", 0.0)
    twin.advance(1.0)
    assert told == [False]
    twin.advance(3.0)
    assert told == [False, True]


def test_commands_during_booting_are_answered_together_afterwards() -> None:
    twin = laser(boot_s=2.0)
    assert twin.receive(b"QT\n", 0.5) + twin.receive(b"TM2\n", 1.5) == b""
    assert twin.next_due() == 2.0
    assert twin.advance(2.0) == b"QT\n00P\n\nTM2\n03S\n\n"


def test_a_laser_that_is_switched_on_late_boots_then_and_its_clock_begins_then() -> None:
    """As in real time, where the host has long been up."""
    config = HokuyoTwinConfig(boot_s=2.0, clock_start_ms=5000, clock_drift_ppm=0.0)
    twin = HokuyoTwin(config, lambda *_: RANGES, 0, on_since=1000.0)
    assert twin.receive(b"TM0\n", 1001.9) == b""
    assert twin.advance(1002.0) == b"TM0\n00P\n\n"
    (time,) = replies(twin, b"TM1\n", 1003.0)
    assert isinstance(time, Reply)
    assert decode_time(time) == 8000


def test_scip_1_ends_with_its_command() -> None:
    twin = laser(starts_in_scip_1=True)
    assert twin.receive(b"QT\n", 0.0) == b"QT\nE\n\n"
    assert twin.receive(b"SCIP2.0\n", 0.0) == b"SCIP2.0\n0\n\n"
    assert twin.receive(b"QT\n", 0.0) == b"QT\n00P\n\n"
    assert status(laser(), "SCIP2.0") == "0E"  # nothing to leave: it is spoken already


def test_an_abnormal_laser_says_who_it_is_and_refuses_the_rest() -> None:
    twin = laser(starts_abnormal=True)
    for command in ("QT", "BM", "TM0", "RS", "MD0000108001000"):
        assert status(twin, command) == "0L"
    for command in ("VV", "PP", "II"):
        assert status(twin, command) == "00"
    assert status(twin, "RB") == "01"


@pytest.mark.parametrize(
    ("commands", "state"),
    [
        ([], "000"),
        (["TM0"], "002"),
        (["BM"], "003"),
        (["MD0000108001000"], "004"),
        (["%SL"], "005"),
    ],
    ids=str,
)
def test_newer_lasers_tell_their_state(commands: list[str], state: str) -> None:
    twin = laser(model="UST-10LX")
    for command in commands:
        status(twin, command)
    (reply,) = replies(twin, b"%ST\n")
    assert reply == Reply("%ST", "00", (state,))
    assert status(laser(), "%ST") == "0E"


@pytest.mark.parametrize("command", ["GD", "GS", "GE", "HD", "HE"])
def test_single_scans_come_in_every_form(command: str) -> None:
    twin = laser(model="UTM-30LX-EW", double_echo_fraction=0.2)
    twin.receive(b"BM\n", 0.0)
    (scan,) = replies(twin, f"{command}0000108001\n".encode(), 1.0)
    assert isinstance(scan, ScanReply)
    assert scan.status == "00"
    assert (scan.intensities is None) == (not command.endswith("E"))
    assert (scan.echoes is None) == command.startswith("G")
    if scan.echoes is None:
        assert scan.ranges / 1000.0 == pytest.approx(RANGES, abs=0.0006)
    else:
        last = scan.ranges[np.cumsum(scan.echoes) - 1]
        assert last / 1000.0 == pytest.approx(RANGES, abs=0.0006)
        assert 100 < np.count_nonzero(scan.echoes == 2) < 350
    assert status(laser(model="URG-04LX"), "HD0044072501") == "0E"


def test_a_busy_laser_answers_when_a_turn_is_over() -> None:
    twin = laser(model="URG-04LX", answers_once_per_turn=True)
    twin.receive(b"BM\n", 0.0)
    assert twin.receive(b"II\n", 0.234) == b""
    assert twin.next_due() == pytest.approx(0.3)
    assert twin.advance(twin.next_due()).startswith(b"II\n00P\n")


@given(st.integers(19200, 750000), st.binary(min_size=1, max_size=3000))
def test_a_line_hands_out_every_byte_at_its_rate(baud: int, data: bytes) -> None:
    line = SerialLine(baud)
    line.put(data, 1.0)
    seen, last = b"", 1.0
    while (due := line.next_due()) < math.inf:
        last = due
        seen += line.out(due)
        assert len(seen) * 10 / baud == pytest.approx(due - 1.0)
    assert seen == data
    assert last == pytest.approx(1.0 + len(data) * 10 / baud)
