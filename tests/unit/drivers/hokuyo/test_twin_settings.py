"""What a host can set in the simulated laser, with the statuses of SCIP 2, and what comes of it."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gvgbot.drivers.hokuyo.models import MODELS, ModelName
from gvgbot.drivers.hokuyo.scip import ScipParser
from gvgbot.drivers.hokuyo.scip_codec import decode_number
from gvgbot.drivers.hokuyo.scip_messages import Reply, ScanReply
from gvgbot.drivers.hokuyo.twin import HokuyoTwin, HokuyoTwinConfig

VECTORS = {
    vector["name"]: vector["rx"]
    for vector in json.loads(
        (Path(__file__).parents[3] / "data" / "scip_vectors.json").read_text("ascii")
    )["vectors"]
}
STREAM = "MD0044072501000"


def laser(model: ModelName = "URG-04LX", **config: Any) -> HokuyoTwin:
    quiet = {"range_sigma_m": 0.0, "dropout_fraction": 0.0, "clock_drift_ppm": 0.0}
    settings = HokuyoTwinConfig(model=model, **{**quiet, **config})
    return HokuyoTwin(settings, lambda *_: np.full(len(MODELS[model].parameters.bearings), 2.0), 0)


def ask(twin: HokuyoTwin, command: str, now: float = 0.0) -> Reply:
    (reply,) = ScipParser().feed(twin.receive(command.encode() + b"\n", now))
    assert isinstance(reply, Reply)
    assert reply.echo == command
    return reply


def status(twin: HokuyoTwin, command: str) -> str:
    echo, line, *_ = twin.receive(command.encode() + b"\n", 0.0).decode().split("\n")
    assert echo == command
    assert line == VECTORS[f"status {line[:2]}"]
    return line[:2]


def told(twin: HokuyoTwin, *commands: str) -> list[str]:
    return [status(twin, command) for command in commands]


def sent(twin: HokuyoTwin, until: float) -> list[Reply | ScanReply]:
    """All that the laser sends by itself until then."""
    parser, messages = ScipParser(), []
    while (now := twin.next_due()) <= until:
        for message in parser.feed(twin.advance(now)):
            assert isinstance(message, Reply | ScanReply)
            messages.append(message)
    return messages


def stamps(twin: HokuyoTwin, until: float) -> list[int]:
    return [message.stamp for message in sent(twin, until) if isinstance(message, ScanReply)]


@pytest.mark.parametrize(
    ("model", "serial", "name"),
    [
        ("URG-04LX", "H0805048", "VV synthetic"),
        ("UST-10LX", "H1614934", "VV sum is a semicolon"),
    ],
)
def test_vv_has_the_form_of_the_model(model: ModelName, serial: str, name: str) -> None:
    assert laser(model, serial_number=serial).receive(b"VV\n", 0.0) == VECTORS[name].encode()


def test_ii_tells_the_time_in_the_form_of_the_model() -> None:
    assert ask(laser("UTM-30LX", clock_start_ms=0x4991D0), "II").fields["TIME"] == "4991D0"
    newer = ask(laser("UST-10LX", clock_start_ms=3292603), "II").fields["TIME"]
    assert newer == "<Sfk"  # as TM1 says it
    assert decode_number(newer.encode()) == 3292603


def test_ii_tells_link_and_laser() -> None:
    twin = laser("UTM-30LX")
    assert ask(twin, "II").fields["SBPS"] == "USB Full Speed"
    assert (ask(twin, "II").fields["LASR"], ask(twin, "II").fields["MESM"]) == ("OFF", "IDLE")
    assert told(twin, "BM") == ["00"]
    assert (ask(twin, "II").fields["LASR"], ask(twin, "II").fields["MESM"]) == ("ON", "CLASSIC")
    serial = laser("URG-04LX", serial_baud=19200)
    parser = ScipParser()
    serial.receive(b"II\n", 0.0)
    (reply,) = parser.feed(b"".join(iter(lambda: serial.advance(serial.next_due()), b"")))
    assert isinstance(reply, Reply)
    assert reply.fields["SBPS"] == "19200[bps]"


@pytest.mark.parametrize(
    ("commands", "statuses"),
    [
        (["TM0", "VV", "II", "PP"], ["00", "00", "00", "10"]),
        (["TM0", "BM", "QT", "CR05", "SS115200", "HS1"], ["00"] + 5 * ["10"]),
        (["TM3", "TMx"], ["01", "01"]),
        (["TM0", "RS", "TM2"], ["00", "00", "03"]),
    ],
    ids=str,
)
def test_in_time_mode_little_else_is_answered(commands: list[str], statuses: list[str]) -> None:
    assert told(laser(), *commands) == statuses


@pytest.mark.parametrize(
    ("command", "model", "expected"),
    [
        ("CR00", "URG-04LX", "03"),  # as a real one: it runs at that speed already
        ("CR00", "UTM-30LX", "04"),  # as real ones
        ("CR00", "UXM-30LX-E", "04"),
        ("CRx1", "URG-04LX", "01"),
        ("CR11", "URG-04LX", "02"),
        ("CR98", "URG-04LX", "02"),
        ("CR99", "URG-04LX", "03"),
        ("CR1", "URG-04LX", "0C"),
        ("CR100", "URG-04LX", "0D"),
        ("HS0", "URG-04LX", "02"),
        ("HS2", "URG-04LX", "01"),
        ("HS1", "UTM-30LX", "03"),
        ("SS115200", "URG-04LX", "00"),
        ("SS11520x", "URG-04LX", "01"),
        ("SS115201", "URG-04LX", "02"),
        ("SS1152", "URG-04LX", "0C"),
        ("DB10", "URG-04LX", "03"),
        ("DB09", "URG-04LX", "01"),
        ("DB02", "UTM-30LX", "04"),
        ("%SL", "URG-04LX", "0E"),
    ],
)
def test_each_setting_has_its_statuses(command: str, model: ModelName, expected: str) -> None:
    assert status(laser(model), command) == expected


def test_a_slower_motor_makes_fewer_scans_on_a_new_grid() -> None:
    twin = laser()
    assert told(twin, "CR10", "CR10", STREAM) == ["00", "03", "00"]
    steps = np.diff(stamps(twin, 3.0))
    assert set(steps) == {111, 112}  # 540 rpm
    assert steps.mean() == pytest.approx(60_000 / 540, abs=0.05)
    assert ask(twin, "CR99", 3.0).status == "00"
    assert set(np.diff(stamps(twin, 5.0))[1:]) == {100}


def test_a_change_of_speed_costs_no_scan_and_turns_no_time_back() -> None:
    twin = laser()
    assert told(twin, STREAM) == ["00"]
    before = stamps(twin, 1.05)
    assert ask(twin, "CR05", 1.05).status == "00"
    times = np.array([*before, *stamps(twin, 3.0)])
    steps = np.diff(times)
    assert set(steps[times[1:] <= 1100]) == {100}  # the turn under way is made to its end
    assert set(steps[times[1:] > 1100]) == {105, 106}  # 570 rpm


@pytest.mark.parametrize(("reset", "period"), [("RS", 100), ("RT", 111)])
def test_only_a_full_reset_turns_the_motor_back_to_its_speed(reset: str, period: int) -> None:
    twin = laser()
    assert told(twin, "CR10", "HS1", reset, "HS0", STREAM) == ["00", "00", "00", "02", "00"]
    assert np.diff(stamps(twin, 2.0)).min() == period


@pytest.mark.parametrize(("reset", "baud"), [("RS", 19200), ("RT", 115200)])
def test_only_a_full_reset_takes_the_bit_rate_back(reset: str, baud: int) -> None:
    twin = laser(serial_baud=19200)
    assert twin.baud == 19200
    for now, command in enumerate(["SS019200", "SS115200", reset]):
        twin.receive(command.encode() + b"\n", float(now))
        while twin.next_due() < math.inf:
            twin.advance(twin.next_due())
    assert twin.baud == baud


def test_high_sensitivity_loses_a_fifth_fewer_beams() -> None:
    lost = {}
    for sensitivity in ("QT", "HS1"):
        twin = laser(dropout_fraction=0.2)
        assert told(twin, sensitivity, STREAM) == ["00", "00"]
        scans = [message for message in sent(twin, 10.0) if isinstance(message, ScanReply)]
        lost[sensitivity] = np.mean([scan.ranges < 20 for scan in scans])
    assert lost["QT"] == pytest.approx(0.20, abs=0.005)
    assert lost["HS1"] == pytest.approx(0.16, abs=0.005)


def test_a_malfunction_at_once_ends_when_it_is_told_to() -> None:
    twin = laser()
    assert told(twin, STREAM, "DB02", "DB02", "BM", "DB03") == ["00", "00", "02", "01", "05"]
    assert sent(twin, 2.0) == []
    assert 50 <= int(ask(twin, STREAM, 2.0).status) <= 97
    assert ask(twin, "II", 2.0).fields["STAT"] != "Sensor works well."
    assert [ask(twin, command, 2.0).status for command in ("DB10", "BM")] == ["00", "00"]


@pytest.mark.parametrize(
    ("drill", "statuses"),
    [("DB03", ["21", "98"]), ("DB04", ["21", "50"]), ("DB05", ["50"])],
)
def test_a_malfunction_in_mid_stream_says_so(drill: str, statuses: list[str]) -> None:
    twin = laser()
    assert told(twin, drill, STREAM) == ["00", "00"]
    messages = sent(twin, 10.0)
    assert all(isinstance(message, ScanReply) for message in messages[:20])
    assert [m.status for m in messages if isinstance(m, Reply)] == statuses
    goes_on = isinstance(messages[-1], ScanReply)
    assert goes_on == (drill == "DB03")
    assert (ask(twin, "BM", 10.0).status == "01") == (not goes_on)


@pytest.mark.parametrize(
    ("commands", "state"),
    [([], "100"), (["TM0"], "102"), (["BM"], "103"), (["MD0000108001000"], "104")],
    ids=str,
)
def test_newer_lasers_tell_that_they_become_unstable(commands: list[str], state: str) -> None:
    twin = laser("UST-10LX")
    told(twin, *commands)
    twin.inject("unstable", 1.0)
    assert ask(twin, "%ST").lines == (state,)
    assert ask(laser("UST-10LX", starts_abnormal=True), "%ST").lines == ("900",)


@pytest.mark.parametrize("number", ["ЖH1", "a\nb", "H1;H2"])
def test_a_serial_number_that_no_reply_can_hold_is_refused(number: str) -> None:
    with pytest.raises(ValueError, match="serial_number = "):
        HokuyoTwinConfig(serial_number=number)
