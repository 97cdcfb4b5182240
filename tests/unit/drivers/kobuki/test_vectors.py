"""Byte vectors of the protocol, in both directions."""

import json
from pathlib import Path
from typing import Any

import pytest

from gvgbot.drivers.kobuki.commands import (
    BaseControl,
    Command,
    GetGain,
    GpOutput,
    RequestExtra,
    SetGain,
    Sound,
    SoundSequence,
    decode_commands,
    encode_commands,
)
from gvgbot.drivers.kobuki.frames import BadFrame, Frame, FrameParser, encode_frame
from gvgbot.drivers.kobuki.payloads import (
    CliffAdc,
    ControllerInfo,
    CoreSensors,
    DockIr,
    FeedbackPart,
    FirmwareVersion,
    GpInput,
    HardwareVersion,
    Inertia,
    MotorCurrent,
    RawGyro,
    Udid,
    Version,
    decode_feedback,
    encode_feedback,
)
from gvgbot.geometry import Twist

Fields = dict[str, Any]
DATA = Path(__file__).parents[3] / "data" / "kobuki_vectors.json"
VECTORS: list[Fields] = json.loads(DATA.read_text())["vectors"]
FEEDBACK = [v for v in VECTORS if v["direction"] == "feedback"]
COMMANDS = [v for v in VECTORS if v["direction"] == "command" and v["valid"]]
TWISTS = [v for v in COMMANDS if "twist" in v]


def name(vector: Fields) -> str:
    return str(vector["name"])


def only_frame(data: bytes) -> bytes:
    (frame,) = FrameParser().feed(data)
    assert isinstance(frame, Frame)
    return frame.payload


def expected_commands(fields: Fields) -> list[Command]:
    if "ids" in fields:
        return [GpOutput(0x00F0), BaseControl(100, 0)]
    values = [value for key, value in fields.items() if key != "id"]
    kinds = {1: BaseControl, 3: Sound, 4: SoundSequence, 9: RequestExtra, 12: GpOutput}
    match fields["id"]:
        case 13:
            return [SetGain(*values)]
        case 14:
            return [GetGain()]
        case number:
            return [kinds[number](*values)]


def version(text: str) -> Version:
    return Version(*map(int, text.split(".")))


def expected_core(fields: Fields) -> CoreSensors:
    return CoreSensors(
        stamp_ms=fields["stamp_ms"],
        bumper=fields["bumper"],
        wheel_drop=fields["wheel_drop"],
        cliff=fields["cliff"],
        left_encoder=fields["left_encoder"],
        right_encoder=fields["right_encoder"],
        left_pwm=fields["left_pwm"],
        right_pwm=fields["right_pwm"],
        buttons=fields["buttons"],
        charger=fields["charger"],
        battery_dv=fields["battery_dV"],
        over_current=fields["over_current"],
    )


def expected_feedback(fields: Fields) -> list[FeedbackPart]:
    dock = fields["dock"]
    parts: list[FeedbackPart] = [DockIr(dock["right"], dock["center"], dock["left"])]
    if "stamp_ms" not in fields:
        return parts
    cliff, current, gyro = fields["cliff_adc"], fields["current_10mA"], fields["gyro"]
    samples = tuple((x, y, z) for x, y, z in gyro["samples"])
    parts = [
        expected_core(fields),
        *parts,
        Inertia(fields["angle_cdeg"], fields["rate_cdeg_s"]),
        CliffAdc(cliff["right"], cliff["center"], cliff["left"]),
        MotorCurrent(current["left"], current["right"]),
        RawGyro(gyro["frame_id"], samples),
        GpInput(fields["gp_digital"], tuple(fields["gp_analog"]), tuple(fields["gp_unused"])),
    ]
    if "udid" in fields:
        first, second, third = map(int, fields["udid"].split("-"))
        parts += [
            HardwareVersion(version(fields["hardware"])),
            FirmwareVersion(version(fields["firmware"])),
            Udid((first, second, third)),
        ]
    if "gains" in fields:
        gains = fields["gains"]
        parts.append(ControllerInfo(gains["type"], gains["p"], gains["i"], gains["d"]))
    return parts


@pytest.mark.parametrize("vector", COMMANDS, ids=name)
def test_a_command_is_sent_as_these_bytes_and_read_back(vector: Fields) -> None:
    data, commands = bytes.fromhex(vector["hex"]), expected_commands(vector["fields"])
    assert encode_commands(commands) == data
    assert decode_commands(only_frame(data)) == commands


@pytest.mark.parametrize("vector", FEEDBACK, ids=name)
def test_feedback_is_read_as_these_values_and_sent_back(vector: Fields) -> None:
    data, parts = bytes.fromhex(vector["hex"]), expected_feedback(vector["fields"])
    assert decode_feedback(only_frame(data)) == parts
    assert encode_frame(encode_feedback(parts)) == data


@pytest.mark.parametrize("vector", TWISTS, ids=name)
def test_a_twist_becomes_this_speed_and_radius(vector: Fields) -> None:
    twist = Twist(vector["twist"]["vx_m_s"], vector["twist"]["wz_rad_s"])
    fields = vector["fields"]
    straight_instead = abs(fields["radius"]) == 32767  # too wide an arc is not sent as a narrower
    expected = BaseControl(fields["speed"], 0 if straight_instead else fields["radius"])
    assert BaseControl.from_twist(twist, 230.0) == expected


def test_a_wrong_checksum_makes_a_bad_frame() -> None:
    (vector,) = [v for v in VECTORS if not v["valid"]]
    (bad,) = FrameParser().feed(bytes.fromhex(vector["hex"]))
    assert bad == BadFrame(bytes.fromhex(vector["hex"]))


def test_the_vectors_are_all_there() -> None:
    assert (len(COMMANDS), len(FEEDBACK), len(TWISTS)) == (26, 5, 12)
