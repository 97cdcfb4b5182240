"""The instruments of a simulated base: felt motion becomes encoder counts, angles and samples."""

import math

import numpy as np

from gvgbot.drivers.kobuki.payloads import (
    GYRO_DIGIT,
    CliffAdc,
    CoreSensors,
    DockIr,
    FeedbackPart,
    GpInput,
    Inertia,
    MotorCurrent,
    RawGyro,
)
from gvgbot.drivers.kobuki.power import Power
from gvgbot.drivers.kobuki.wheel_odometry import TICK

_WORD = 65536
_GYRO_SAMPLES = 2.08  # per frame on average: the sensor runs by its own clock
_RAW_BIAS = math.radians(-0.45)  # rad/s: only the processed rate has it removed
_FULL_PWM_SPEED = 0.7  # m/s
_CLIFF_FLOOR = CliffAdc(1700, 1900, 1650)  # readings over a flat floor
_OPEN_INPUTS = GpInput(0, (4095, 4095, 4095, 4095), (0xFF0, 0, 0))


class Instruments:
    """Encoders and gyro that count from anywhere, as a base does that has run before."""

    def __init__(self, rng: np.random.Generator, tick: float = TICK) -> None:
        """`tick` is the travel of a wheel per encoder count, m."""
        encoders = rng.integers(0, _WORD, 2).tolist()
        self._tick = tick
        self._left, self._right = encoders[0] * tick, encoders[1] * tick  # m
        self._angle = float(rng.uniform(-math.pi, math.pi))  # rad
        self._left_speed = self._right_speed = self._rate = 0.0
        self._gyro_id = 0
        self._gyro_due = 0.0
        self.buttons = 0  # that are held, one bit each

    def restart(self) -> None:
        """Count from nothing, as after switching on."""
        self._left = self._right = self._angle = 0.0
        self._left_speed = self._right_speed = self._rate = 0.0
        self._gyro_id, self._gyro_due = 0, 0.0

    def turn(self, left: float, right: float, turn: float, dt: float) -> None:
        """Add what was felt within dt seconds: travel of both wheels (m) and turn (rad)."""
        self._left += left
        self._right += right
        self._angle += turn
        self._left_speed, self._right_speed, self._rate = left / dt, right / dt, turn / dt

    def read(
        self,
        stamp_ms: int,
        bumper: tuple[bool, bool, bool],
        power: Power,
        dock_ir: DockIr,
    ) -> list[FeedbackPart]:
        """The standard part of one frame; bumper is left, centre, right."""
        return [
            self._core(stamp_ms, bumper, power),
            dock_ir,
            Inertia(_wrapped_cdeg(self._angle), _s16(math.degrees(100 * self._rate))),
            _CLIFF_FLOOR,
            MotorCurrent(_current(self._left_speed), _current(self._right_speed)),
            self._gyro(),
            _OPEN_INPUTS,
        ]

    def _core(self, stamp_ms: int, bumper: tuple[bool, bool, bool], power: Power) -> CoreSensors:
        left, centre, right = bumper
        return CoreSensors(
            stamp_ms=stamp_ms % _WORD,
            bumper=4 * left + 2 * centre + right,
            wheel_drop=0,
            cliff=0,
            left_encoder=math.floor(self._left / self._tick + 0.5) % _WORD,
            right_encoder=math.floor(self._right / self._tick + 0.5) % _WORD,
            left_pwm=_pwm(self._left_speed),
            right_pwm=_pwm(self._right_speed),
            buttons=self.buttons,
            charger=power.charger,
            battery_dv=max(0, round(10 * power.volts)),
            over_current=0,
        )

    def _gyro(self) -> RawGyro:
        """Two samples, sometimes three; z carries the bias that the processed rate has not."""
        self._gyro_due += _GYRO_SAMPLES
        count = int(self._gyro_due)
        self._gyro_due -= count
        first = self._gyro_id
        self._gyro_id = (first + count) % 256
        z = _s16((self._rate + _RAW_BIAS) / GYRO_DIGIT)
        return RawGyro(first, ((0, 0, z),) * count)


def _wrapped_cdeg(angle: float) -> int:
    return (round(math.degrees(100 * angle)) + 18000) % 36000 - 18000


def _s16(value: float) -> int:
    return max(-32768, min(32767, round(value)))


def _pwm(speed: float) -> int:
    return max(-127, min(127, round(127 * speed / _FULL_PWM_SPEED)))


def _current(speed: float) -> int:
    """Motor current in 10 mA: some to turn at all, more when faster."""
    return 0 if speed == 0.0 else min(255, round(1 + 40 * abs(speed)))
