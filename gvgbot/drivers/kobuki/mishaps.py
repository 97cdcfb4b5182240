"""What befalls a simulated base: bumps, cliffs, a jammed wheel, a restart, odd bytes."""

from collections import Counter
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np

from gvgbot.drivers.fault_schedule import FaultSchedule, PerHour, Rate
from gvgbot.drivers.kobuki.payloads import CliffAdc, CoreSensors, FeedbackPart, encode_feedback
from gvgbot.drivers.kobuki.sub_payloads import Unknown
from gvgbot.ranges import Range

Mishap = Literal[
    "bump",
    "cliff",
    "wheel drop",
    "over-current",
    "low battery",
    "slip",
    "reboot",
    "short part",
    "unknown part",
    "no replies",
]

_NO_FLOOR = 150  # reading of a cliff sensor that sees none
_LOW_BATTERY = 131  # dV
_CORE_ID = 1
_UNKNOWN_PART = Unknown(99, bytes(3))
_SIDES = (4, 2, 1)  # bits of bumper and cliff: left, centre, right


@dataclass(frozen=True, slots=True, kw_only=True)
class MishapConfig:
    """How often a simulated base has each mishap, and how long one lasts."""

    bumps_per_h: PerHour = 0.0  # a bumper is pressed, though nothing is there
    cliffs_per_h: PerHour = 0.0  # a cliff sensor sees no floor
    wheel_drops_per_h: PerHour = 0.0  # a wheel hangs in the air
    over_currents_per_h: PerHour = 0.0  # a motor is overloaded
    low_batteries_per_h: PerHour = 0.0  # the voltage reads low
    slips_per_h: PerHour = 0.0  # a wheel slips some centimetres
    reboots_per_h: PerHour = 0.0  # it restarts, and its stamps with it
    short_parts_per_h: PerHour = 0.0  # a part of a frame is cut short
    unknown_parts_per_h: PerHour = 0.0  # a frame has a part that nobody knows
    no_replies_per_h: PerHour = 0.0  # to what it is asked
    duration_s: Annotated[float, Range(0.0, 60.0)] = 0.5  # of each that lasts
    boot_s: Annotated[float, Range(0.0, 60.0)] = 1.0  # from a reboot to the first frame

    @property
    def rates(self) -> dict[str, Rate]:
        """By name of the mishap."""
        lasting: dict[Mishap, float] = {
            "bump": self.bumps_per_h,
            "cliff": self.cliffs_per_h,
            "wheel drop": self.wheel_drops_per_h,
            "over-current": self.over_currents_per_h,
            "low battery": self.low_batteries_per_h,
            "short part": self.short_parts_per_h,
            "unknown part": self.unknown_parts_per_h,
            "no replies": self.no_replies_per_h,
        }
        sudden: dict[Mishap, float] = {"slip": self.slips_per_h, "reboot": self.reboots_per_h}
        rates = {str(name): Rate(per_h, self.duration_s) for name, per_h in lasting.items()}
        return rates | {str(name): Rate(per_h, 0.0) for name, per_h in sudden.items()}


class Mishaps:
    """What is amiss with a base just now."""

    def __init__(self, config: MishapConfig, seed: int) -> None:
        self._rng = np.random.default_rng((seed, 4))
        self._schedule = FaultSchedule(config.rates, np.random.default_rng((seed, 5)))
        self._side = _SIDES[0]

    @property
    def counts(self) -> Counter[str]:
        """How often each mishap has happened."""
        return self._schedule.counts

    def inject(self, mishap: Mishap, duration: float) -> None:
        """Let it happen in the next frame, for so long (s)."""
        self._schedule.inject(mishap, duration)

    def advance(self, now: float) -> list[str]:
        """The mishaps that begin with the frame of this time."""
        began = self._schedule.advance(now)
        if began:
            self._side = _SIDES[int(self._rng.integers(len(_SIDES)))]
        return began

    def is_on(self, mishap: Mishap) -> bool:
        """Whether the base suffers from it."""
        return self._schedule.is_on(mishap)

    def spoil(self, parts: list[FeedbackPart]) -> list[FeedbackPart]:
        """The parts of a frame as the base sends them in its present state."""
        if not self._schedule.any_is_on:
            return parts
        parts = [self._felt(part) for part in parts]
        if self.is_on("unknown part"):
            parts.append(_UNKNOWN_PART)
        if self.is_on("short part"):
            parts = [_shortened(part) if isinstance(part, CoreSensors) else part for part in parts]
        return parts

    def _felt(self, part: FeedbackPart) -> FeedbackPart:
        match part:
            case CoreSensors():
                return self._core(part)
            case CliffAdc() if self.is_on("cliff"):
                names = dict(zip(_SIDES, ("left", "centre", "right"), strict=True))
                return replace(part, **{names[self._side]: _NO_FLOOR})
        return part

    def _core(self, core: CoreSensors) -> CoreSensors:
        is_left = self._side == _SIDES[0]
        return replace(
            core,
            bumper=core.bumper | (self._side if self.is_on("bump") else 0),
            cliff=self._side if self.is_on("cliff") else 0,
            wheel_drop=(2 if is_left else 1) if self.is_on("wheel drop") else 0,
            over_current=(1 if is_left else 2) if self.is_on("over-current") else 0,
            battery_dv=_LOW_BATTERY if self.is_on("low battery") else core.battery_dv,
        )


def _shortened(part: FeedbackPart) -> Unknown:
    """A part with its last bytes missing, and a length that says so."""
    return Unknown(_CORE_ID, encode_feedback([part])[2:-4])
