"""What the host asks of the base: command sub-payloads to values and back, and twists to arcs."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from struct import Struct
from typing import Self

from gvgbot.drivers.kobuki.frames import encode_frame
from gvgbot.drivers.kobuki.sub_payloads import (
    Truncated,
    Unknown,
    decode_parts,
    encode_parts,
    fixed_decoder,
    fixed_encoder,
)
from gvgbot.geometry import Twist

_EPSILON = 1e-4  # m/s and rad/s: less counts as zero
_S16_MAX = 32767


@dataclass(frozen=True, slots=True)
class BaseControl:
    """Drive along an arc: signed speed of the outer wheel, and radius, positive to the left.

    Radius 0 means straight ahead, radius 1 turning on the spot anticlockwise at `speed_mmps`.
    """

    speed_mmps: int
    radius_mm: int

    @classmethod
    def from_twist(cls, twist: Twist, wheel_base_mm: float) -> Self:
        """The command nearest to the twist; numbers are cut towards zero, so it is never faster.

        An arc too wide for the field is sent as straight ahead: the widest arc that fits would
        turn many times faster than asked.
        """
        v, w = 1000 * twist.linear, twist.angular
        half_base = wheel_base_mm / 2
        if abs(w) < _EPSILON:
            return cls(_s16(v), 0)
        radius = v / w
        if abs(twist.linear) < _EPSILON or abs(radius) <= 1:
            return cls(_s16(half_base * w), 1)
        if abs(radius) > _S16_MAX:
            return cls(_s16(v), 0)
        return cls(_s16((radius + math.copysign(half_base, radius)) * w), int(radius))

    def twist_on(self, wheel_base_mm: float) -> Twist:
        """What a base with its wheels so far apart does on this command, m/s and rad/s."""
        speed, radius, half_base = self.speed_mmps, self.radius_mm, wheel_base_mm / 2
        if radius == 0:
            return Twist(speed / 1000, 0.0)
        if radius == 1:
            return Twist(0.0, speed / half_base)
        angular = speed / (radius + math.copysign(half_base, radius))
        return Twist(radius * angular / 1000, angular)


@dataclass(frozen=True, slots=True)
class Sound:
    """One note: its period in units of 2.75 us, and how long to play it."""

    note: int
    duration_ms: int


class Melody(IntEnum):
    """The tunes that the base knows."""

    ON = 0
    OFF = 1
    RECHARGE = 2
    BUTTON = 3
    ERROR = 4
    CLEANING_START = 5
    CLEANING_END = 6


@dataclass(frozen=True, slots=True)
class SoundSequence:
    """Play a tune of the base; the numbers are those of `Melody`."""

    sequence: int


class Extra(IntFlag):
    """What can be asked for with `RequestExtra`."""

    HARDWARE = 0x01
    FIRMWARE = 0x02
    UDID = 0x08


@dataclass(frozen=True, slots=True)
class RequestExtra:
    """Ask for versions and the unique number; flags of `Extra`."""

    flags: int


class Output(IntFlag):
    """Bits of the general-purpose output word. Every write must carry all of them."""

    DIGITAL_0 = 0x0001
    DIGITAL_1 = 0x0002
    DIGITAL_2 = 0x0004
    DIGITAL_3 = 0x0008
    POWER_3V3 = 0x0010
    POWER_5V = 0x0020
    POWER_12V_5A = 0x0040
    POWER_12V_1A5 = 0x0080
    LED1_RED = 0x0100
    LED1_GREEN = 0x0200
    LED2_RED = 0x0400
    LED2_GREEN = 0x0800


NO_OUTPUT = Output(0)
ALL_POWER = Output.POWER_3V3 | Output.POWER_5V | Output.POWER_12V_5A | Output.POWER_12V_1A5


@dataclass(frozen=True, slots=True)
class GpOutput:
    """Set outputs, power and LEDs at once; flags of `Output`."""

    flags: int


@dataclass(frozen=True, slots=True)
class SetGain:
    """Gains of the wheel controller in thousandths; kind 0 goes back to the factory's."""

    kind: int
    p_milli: int
    i_milli: int
    d_milli: int


@dataclass(frozen=True, slots=True)
class GetGain:
    """Ask for the gains of the wheel controller."""

    unused: int = 0


Command = (
    BaseControl
    | Sound
    | SoundSequence
    | RequestExtra
    | GpOutput
    | SetGain
    | GetGain
    | Unknown
    | Truncated
)

_LAYOUTS: dict[int, tuple[type, Struct]] = {
    1: (BaseControl, Struct("<hh")),
    3: (Sound, Struct("<HB")),
    4: (SoundSequence, Struct("<B")),
    9: (RequestExtra, Struct("<H")),
    12: (GpOutput, Struct("<H")),
    13: (SetGain, Struct("<B3I")),
    14: (GetGain, Struct("<B")),
}


_DECODERS = {number: fixed_decoder(*entry) for number, entry in _LAYOUTS.items()}
_ENCODERS = {entry[0]: (number, fixed_encoder(*entry)) for number, entry in _LAYOUTS.items()}


def decode_commands(payload: bytes) -> list[Command]:
    """The commands in one frame's payload, in the order sent. Never raises."""
    return decode_parts(payload, _DECODERS)


def encode_commands(commands: Iterable[Command]) -> bytes:
    """One whole frame with the commands. Raises struct.error or ValueError if they do not fit."""
    return encode_frame(encode_parts(commands, _ENCODERS))


def _s16(value: float) -> int:
    return int(max(-_S16_MAX - 1, min(_S16_MAX, value)))
