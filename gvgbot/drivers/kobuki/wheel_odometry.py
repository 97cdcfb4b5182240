"""Dead reckoning: encoder counts and the gyro's heading to a pose, as a function state to state."""

import math
from dataclasses import dataclass, replace
from typing import Literal

from gvgbot.geometry import Pose, Twist, wrap_angle

Heading = Literal["gyro", "wheels"]

TICK = 0.0000852920904977  # m of travel per encoder count
WHEEL_BASE = 0.230  # m between the wheels
TICK_ANGLE = 0.002436916871363930  # rad of a wheel's turn per encoder count
_WRAP = 65536  # encoder counts
_ANGLE_SPAN = math.radians(655.36)  # of what 16 bits of a hundredth of a degree can tell
_SLIP_MEMORY_S = 0.5  # time constant of the reported slip rate
_SPEED_MEMORY_S = 0.1  # and of the speed: stamps of 1 ms alone make it jitter by a twentieth
_NOTHING = 1e-6  # m/s and rad/s: slower than any wheel turns is standing still
_IDLE_RAD = 0.001  # that the encoders of a base at rest may seem to turn it between two frames


@dataclass(frozen=True, slots=True)
class DriveGeometry:
    """Distance of the wheels (m), and travel of a wheel per encoder count (m)."""

    wheel_base: float = WHEEL_BASE
    tick: float = TICK


KOBUKI = DriveGeometry()


@dataclass(frozen=True, slots=True)
class WheelReading:
    """What a frame says about motion: 16-bit encoders, gyro heading (rad) and turn rate (rad/s)."""

    left_encoder: int
    right_encoder: int
    angle: float
    rate: float


@dataclass(frozen=True, slots=True)
class WheelOdometry:
    """Where the base is, `odom_base`, how it moves, and the reading that this is based on.

    Its speed is smoothed, as is `slip_rate` (rad/s), the turn rate of the gyro minus that of the
    wheels; `implausible` counts readings in a row that jumped too far to be believed; `unfelt` is
    how far the wheels have turned the base, to and fro (rad), since the gyro's heading last
    changed.
    """

    odom_base: Pose
    twist: Twist
    reading: WheelReading
    slip_rate: float = 0.0
    implausible: int = 0
    unfelt: float = 0.0


def start_odometry(reading: WheelReading, odom_base: Pose | None = None) -> WheelOdometry:
    """Standing at `odom_base` (the origin by default), whatever encoders and gyro count from."""
    return WheelOdometry(odom_base or Pose(), Twist(), reading)


def advance_odometry(
    state: WheelOdometry,
    reading: WheelReading,
    dt: float,
    heading: Heading,
    geometry: DriveGeometry,
) -> WheelOdometry:
    """The state after `dt` seconds (> 0) at whose end the wheels and the gyro read this.

    The heading's change is the gyro's or the wheels', and the way goes along the mean heading.
    """
    left, right = wheel_travels(state.reading, reading, geometry.tick)
    by_wheels = turned(state.reading, reading, "wheels", geometry)
    by_gyro = turned(state.reading, reading, "gyro", geometry)
    turn = by_gyro if heading == "gyro" else by_wheels
    travel = (left + right) / 2
    rate = reading.rate if heading == "gyro" else by_wheels / dt
    slip_rate = _smoothed(state.slip_rate, (by_gyro - by_wheels) / dt, dt, _SLIP_MEMORY_S)
    speed = _smoothed(state.twist.linear, travel / dt, dt, _SPEED_MEMORY_S)
    pose = _moved(state.odom_base, travel, turn)
    unfelt = state.unfelt + max(0.0, abs(by_wheels) - _IDLE_RAD)
    if reading.angle != state.reading.angle:
        unfelt = 0.0
    return WheelOdometry(pose, Twist(speed, rate), reading, slip_rate, unfelt=unfelt)


def wheel_travels(before: WheelReading, after: WheelReading, tick: float) -> tuple[float, float]:
    """Metres that the left and the right wheel went, each less than half an encoder turn-over."""
    return (
        tick * _signed(after.left_encoder - before.left_encoder),
        tick * _signed(after.right_encoder - before.right_encoder),
    )


def turned(
    before: WheelReading, after: WheelReading, heading: Heading, geometry: DriveGeometry
) -> float:
    """How far the base has turned, rad: by the gyro, in (-π, π], or by the wheels."""
    if heading == "gyro":
        # the angle may be told in one turn, or count on for as long as its bits last
        change = after.angle - before.angle
        return min(wrap_angle(change), change - math.copysign(_ANGLE_SPAN, change), key=abs)
    left, right = wheel_travels(before, after, geometry.tick)
    return (right - left) / geometry.wheel_base


def doubt(state: WheelOdometry) -> WheelOdometry:
    """The state with one more unbelievable reading, which changes nothing else."""
    return replace(state, implausible=state.implausible + 1)


def _smoothed(before: float, now: float, dt: float, memory: float) -> float:
    """A value that follows what is measured now, after dt s, with a time constant (s)."""
    value = before - math.expm1(-dt / memory) * (now - before)
    return value if abs(value) > _NOTHING else 0.0


def _moved(odom_base: Pose, travel: float, turn: float) -> Pose:
    middle = odom_base.theta + turn / 2
    return Pose(
        odom_base.x + travel * math.cos(middle),
        odom_base.y + travel * math.sin(middle),
        wrap_angle(odom_base.theta + turn),
    )


def _signed(counts: int) -> int:
    return (counts + _WRAP // 2) % _WRAP - _WRAP // 2
