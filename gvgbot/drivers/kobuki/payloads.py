"""What the base reports: sub-payloads (id, length, data) of a frame to values and back.

Fields are the wire's integers in the wire's order; a suffix gives the unit (`_ms`, `_cdeg` for
0.01 deg, `_dv` for 0.1 V, `_10ma`). What a number means in SI units is a property.
"""

import math
from collections.abc import Callable, Container, Iterable
from dataclasses import dataclass
from struct import Struct
from typing import Any

from gvgbot.drivers.kobuki.sub_payloads import (
    Truncated,
    Unknown,
    decode_parts,
    encode_parts,
    fixed_decoder,
    fixed_encoder,
)

_CDEG = math.radians(0.01)  # rad
GYRO_DIGIT = math.radians(0.00875)  # rad/s per digit of a raw gyro sample


@dataclass(frozen=True, slots=True)
class CoreSensors:
    """State of the base. Of bumper and cliff, bit 0 is right, 1 centre, 2 left."""

    stamp_ms: int
    bumper: int
    wheel_drop: int  # bit 0 right, 1 left
    cliff: int
    left_encoder: int
    right_encoder: int
    left_pwm: int
    right_pwm: int
    buttons: int
    charger: int
    battery_dv: int
    over_current: int  # bit 0 left, 1 right: the other way round than all others

    @property
    def voltage(self) -> float:
        """Battery voltage, V."""
        return self.battery_dv / 10

    @property
    def charging(self) -> bool:
        """Whether the dock or the adapter is charging the battery."""
        return self.charger & 0x0F == 6

    @property
    def has_adapter(self) -> bool:
        """Whether the charger's cable is plugged in, whether or not it is charging."""
        return bool(self.charger & 0x10)

    @property
    def feels(self) -> bool:
        """Whether the base touches or overhangs something, hangs in the air or is overloaded."""
        return bool(self.bumper or self.cliff or self.wheel_drop or self.over_current)


@dataclass(frozen=True, slots=True)
class DockIr:
    """Which of the dock's beams each receiver sees, one bit per beam."""

    right: int
    centre: int
    left: int


@dataclass(frozen=True, slots=True)
class Inertia:
    """Heading and turn rate by the gyro, bias removed by the base, anticlockwise positive."""

    angle_cdeg: int
    rate_cdeg_s: int

    @property
    def angle(self) -> float:
        """Heading since an arbitrary direction, rad."""
        return self.angle_cdeg * _CDEG

    @property
    def rate(self) -> float:
        """Turn rate, rad/s."""
        return self.rate_cdeg_s * _CDEG


@dataclass(frozen=True, slots=True)
class CliffAdc:
    """Raw readings of the cliff sensors, 12 bits; larger is nearer to the floor."""

    right: int
    centre: int
    left: int


@dataclass(frozen=True, slots=True)
class MotorCurrent:
    """Current of each motor."""

    left_10ma: int
    right_10ma: int


@dataclass(frozen=True, slots=True)
class Version:
    """A version number, major.minor.patch."""

    major: int
    minor: int
    patch: int

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}.{self.patch}"


@dataclass(frozen=True, slots=True)
class HardwareVersion:
    """Version of the base's electronics."""

    version: Version


@dataclass(frozen=True, slots=True)
class FirmwareVersion:
    """Version of the base's program."""

    version: Version


@dataclass(frozen=True, slots=True)
class RawGyro:
    """Gyro samples (x, y, z) in digits, bias included, in the sensor's own axes."""

    frame_id: int  # number of the first sample, modulo 256
    samples: tuple[tuple[int, int, int], ...]


@dataclass(frozen=True, slots=True)
class GpInput:
    """Inputs of the expansion port: 4 digital bits, 4 analog readings of 12 bits."""

    digital: int
    analog: tuple[int, int, int, int]
    unused: tuple[int, int, int] = (0, 0, 0)


@dataclass(frozen=True, slots=True)
class Udid:
    """The base's unique number: three words of 32 bits."""

    words: tuple[int, int, int]

    def __str__(self) -> str:
        return "-".join(map(str, self.words))


@dataclass(frozen=True, slots=True)
class ControllerInfo:
    """Gains of the wheel controller in thousandths; kind 0 factory, 1 user."""

    kind: int
    p_milli: int
    i_milli: int
    d_milli: int


FeedbackPart = (
    CoreSensors
    | DockIr
    | Inertia
    | CliffAdc
    | MotorCurrent
    | HardwareVersion
    | FirmwareVersion
    | RawGyro
    | GpInput
    | Udid
    | ControllerInfo
    | Unknown
    | Truncated
)

_CORE = Struct("<HBBBHHbbBBBB")
_BYTES3 = Struct("<3B")
_INERTIA = Struct("<hh3x")
_ADC3 = Struct("<3H")
_CURRENT = Struct("<2B")
_VERSION = Struct("<3Bx")
_OLD_VERSION = Struct("<H")
_SAMPLE = Struct("<3h")
_GP_INPUT = Struct("<8H")
_UDID = Struct("<3I")
_CONTROLLER = Struct("<B3I")

_OLD_FIRMWARE_1_0_0 = 123  # the one old number whose digits are not the version


def _version(data: bytes) -> Version | None:
    """Four bytes, or the two-byte decimal number of early bases."""
    if len(data) == _VERSION.size:
        patch, minor, major = _VERSION.unpack(data)
        return Version(major, minor, patch)
    if len(data) != _OLD_VERSION.size:
        return None
    (number,) = _OLD_VERSION.unpack(data)
    if number == _OLD_FIRMWARE_1_0_0:
        return Version(1, 0, 0)
    base = 10 if number < 1000 else 100
    return Version(number // base**2, number // base % base, number % base)


def _hardware(data: bytes) -> HardwareVersion | None:
    version = _version(data)
    return None if version is None else HardwareVersion(version)


def _firmware(data: bytes) -> FirmwareVersion | None:
    version = _version(data)
    return None if version is None else FirmwareVersion(version)


def _gyro(data: bytes) -> RawGyro | None:
    if len(data) < 2 or data[1] * 2 != len(data) - 2 or data[1] % 3:
        return None
    return RawGyro(data[0], tuple(_SAMPLE.iter_unpack(data[2:])))


def _gp_input(data: bytes) -> GpInput | None:
    if len(data) != _GP_INPUT.size:
        return None
    words = _GP_INPUT.unpack(data)
    return GpInput(words[0], words[1:5], words[5:])


def _udid(data: bytes) -> Udid | None:
    return Udid(_UDID.unpack(data)) if len(data) == _UDID.size else None


def _pack_version(part: HardwareVersion | FirmwareVersion) -> bytes:
    version = part.version
    return _VERSION.pack(version.patch, version.minor, version.major)


def _pack_gyro(part: RawGyro) -> bytes:
    head = bytes((part.frame_id, 3 * len(part.samples)))
    return head + b"".join(_SAMPLE.pack(*sample) for sample in part.samples)


_DECODERS: dict[int, Callable[[bytes], Any]] = {
    1: fixed_decoder(CoreSensors, _CORE),
    3: fixed_decoder(DockIr, _BYTES3),
    4: fixed_decoder(Inertia, _INERTIA),
    5: fixed_decoder(CliffAdc, _ADC3),
    6: fixed_decoder(MotorCurrent, _CURRENT),
    10: _hardware,
    11: _firmware,
    13: _gyro,
    16: _gp_input,
    19: _udid,
    21: fixed_decoder(ControllerInfo, _CONTROLLER),
}

_ENCODERS: dict[type, tuple[int, Callable[[Any], bytes]]] = {
    CoreSensors: (1, fixed_encoder(CoreSensors, _CORE)),
    DockIr: (3, fixed_encoder(DockIr, _BYTES3)),
    Inertia: (4, fixed_encoder(Inertia, _INERTIA)),
    CliffAdc: (5, fixed_encoder(CliffAdc, _ADC3)),
    MotorCurrent: (6, fixed_encoder(MotorCurrent, _CURRENT)),
    HardwareVersion: (10, _pack_version),
    FirmwareVersion: (11, _pack_version),
    RawGyro: (13, _pack_gyro),
    GpInput: (16, lambda part: _GP_INPUT.pack(part.digital, *part.analog, *part.unused)),
    Udid: (19, lambda part: _UDID.pack(*part.words)),
    ControllerInfo: (21, fixed_encoder(ControllerInfo, _CONTROLLER)),
}


# What every frame has and nobody drives by: cliff distances, motor currents, raw gyro, inputs.
DIAGNOSTICS: frozenset[int] = frozenset({5, 6, 13, 16})


def decode_feedback(payload: bytes, unread: Container[int] = ()) -> list[FeedbackPart]:
    """The values that the base reports in one frame, in the order sent, but for `unread` ids.

    Never raises.
    """
    return decode_parts(payload, _DECODERS, unread)


def encode_feedback(parts: Iterable[FeedbackPart]) -> bytes:
    """The payload of a frame with these values. Raises struct.error if a field is out of range."""
    return encode_parts(parts, _ENCODERS)
