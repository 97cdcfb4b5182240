"""How a twin's wheels and gyro err: named profiles, and motion as such sensors feel it."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

OdometryProfile = Literal["perfect", "kobuki", "worn", "wheels"]

_SLIP_SHORTEST = 0.02  # m
_SLIP_LONGEST = 0.10  # m


@dataclass(frozen=True, slots=True)
class OdometryError:
    """Standard deviations of the errors of dead reckoning.

    `wheel_scale` is drawn once per wheel; `along` is m per sqrt(m) driven, the same on both wheels;
    `gyro_walk` is rad per sqrt(s) and `gyro_bias`, drawn once, rad/s, both only while moving;
    `slips_per_m` is how often one wheel spins for some centimetres.
    """

    wheel_scale: float = 0.0
    along: float = 0.0
    gyro_walk: float = 0.0
    gyro_bias: float = 0.0
    slips_per_m: float = 0.0


_KOBUKI = OdometryError(
    wheel_scale=0.01, along=0.02, gyro_walk=math.radians(0.1), gyro_bias=math.radians(0.02)
)

PROFILES: dict[OdometryProfile, OdometryError] = {
    "perfect": OdometryError(),
    "kobuki": _KOBUKI,
    "worn": OdometryError(
        wheel_scale=0.025,
        along=0.06,
        gyro_walk=math.radians(0.3),
        gyro_bias=math.radians(0.02),
        slips_per_m=1 / 20,
    ),
    "wheels": _KOBUKI,
}


class ErringSensors:
    """True motion in, felt motion out: one pair of wheels and one gyro, drawn from a profile."""

    def __init__(self, error: OdometryError, rng: np.random.Generator) -> None:
        self._error = error
        self._rng = rng
        self.left_scale = 1.0 + error.wheel_scale * float(rng.standard_normal())
        self.right_scale = 1.0 + error.wheel_scale * float(rng.standard_normal())
        self.gyro_bias = error.gyro_bias * float(rng.standard_normal())
        self._slip = [0.0, 0.0]  # m that the left and the right wheel have yet to spin

    def feel(self, left: float, right: float, turn: float, dt: float) -> tuple[float, float, float]:
        """Felt travel of both wheels (m) and felt turn (rad), for the true ones in dt seconds."""
        if left == right == turn == 0.0:
            return 0.0, 0.0, 0.0
        noise, walk = self._rng.standard_normal(2).tolist()
        travel = abs(left + right) / 2
        along = self._error.along * math.sqrt(travel) * noise
        self._meet_slips(travel)
        return (
            left * self.left_scale + along + self._spin(0, left),
            right * self.right_scale + along + self._spin(1, right),
            turn + self.gyro_bias * dt + self._error.gyro_walk * math.sqrt(dt) * walk,
        )

    def slip(self, wheel: int, travel: float) -> None:
        """Let a wheel (0 left, 1 right) spin for so much more travel (m) as it goes on rolling."""
        self._slip[wheel] += travel

    def _meet_slips(self, travel: float) -> None:
        """Let one wheel begin to slip, as often as the profile says."""
        if self._error.slips_per_m and self._rng.random() < self._error.slips_per_m * travel:
            wheel = int(self._rng.integers(2))
            self._slip[wheel] += float(self._rng.uniform(_SLIP_SHORTEST, _SLIP_LONGEST))

    def _spin(self, wheel: int, travel: float) -> float:
        """Extra turning of a slipping wheel: as much again as it rolls, until the slip is over."""
        extra = min(self._slip[wheel], abs(travel))
        self._slip[wheel] -= extra
        return math.copysign(extra, travel)
