"""The lasers: what their PP reply says, and what it does not say."""

import math
from collections.abc import Mapping
from dataclasses import astuple, dataclass
from typing import Self

import numpy as np

from gvgbot.geometry import Array

_NUMBER_KEYS = ("DMIN", "DMAX", "ARES", "AMIN", "AMAX", "AFRT", "SCAN")
_IDENTITY_KEYS = ("VEND", "PROD", "FIRM", "PROT", "SERI")


@dataclass(frozen=True, slots=True)
class Identity:
    """What the laser says it is."""

    vendor: str
    product: str
    firmware: str
    protocol: str
    serial: str

    @classmethod
    def from_lines(cls, lines: Mapping[str, str]) -> Self:
        """Read the lines of a VV reply; those that are missing come out empty."""
        return cls(*(lines.get(key, "") for key in _IDENTITY_KEYS))

    def lines(self) -> dict[str, str]:
        """The lines of the VV reply; the inverse of `from_lines`."""
        return dict(zip(_IDENTITY_KEYS, astuple(self), strict=True))


@dataclass(frozen=True, slots=True)
class Parameters:
    """A laser's geometry and timing, as its PP reply gives them; steps are angular indices."""

    model: str
    range_min_mm: int
    range_max_mm: int
    steps_per_turn: int
    first_step: int
    last_step: int
    front_step: int
    rpm: int

    @property
    def period(self) -> float:
        """Time from one scan to the next, s."""
        return 60.0 / self.rpm

    @property
    def step_time(self) -> float:
        """Time from one step to the next, s."""
        return self.period / self.steps_per_turn

    @property
    def step_angle(self) -> float:
        """Angle from one step to the next, rad."""
        return math.tau / self.steps_per_turn

    def bearing(self, step: float) -> float:
        """Direction of a step in the laser frame, rad."""
        return (step - self.front_step) * self.step_angle

    @property
    def bearings(self) -> Array:
        """Directions (N,) of all steps from the first to the last in the laser frame, rad."""
        steps = np.arange(self.first_step, self.last_step + 1, dtype=np.float64)
        return (steps - self.front_step) * self.step_angle

    @classmethod
    def from_lines(cls, lines: Mapping[str, str]) -> Self:
        """Read the lines of a PP reply. Raises ValueError when they make no sense."""
        try:
            numbers = [int(lines[key]) for key in _NUMBER_KEYS]
        except KeyError as error:
            raise ValueError(f"no {error.args[0]} line") from error
        parameters = cls(lines.get("MODL", ""), *numbers)
        if not parameters._is_plausible():
            raise ValueError(f"implausible parameters: {parameters}")
        return parameters

    def _is_plausible(self) -> bool:
        steps_rise = 0 <= self.first_step < self.last_step <= 2 * self.steps_per_turn
        ranges_rise = 0 <= self.range_min_mm < self.range_max_mm
        return steps_rise and ranges_rise and self.steps_per_turn > 0 and self.rpm > 0

    def lines(self) -> dict[str, str]:
        """The lines of the PP reply; the inverse of `from_lines`."""
        model, *numbers = astuple(self)
        return {"MODL": model, **dict(zip(_NUMBER_KEYS, map(str, numbers), strict=True))}


@dataclass(frozen=True, slots=True)
class Model:
    """A laser of the catalogue: its parameters, and the readings it sends in place of a range.

    `usable_mm` is the range the maker guarantees, which can be less than the largest reading.
    """

    parameters: Parameters
    product: str
    usable_mm: int
    nothing_code: int
    near_code: int
    failure_code: int


MODELS: dict[str, Model] = {
    "URG-04LX": Model(
        Parameters("URG-04LX(Hokuyo Automatic Co.,Ltd.)", 20, 5600, 1024, 44, 725, 384, 600),
        product="SOKUIKI Sensor URG-04LX",
        usable_mm=5600,
        nothing_code=0,
        near_code=6,
        failure_code=7,
    ),
    "UTM-30LX": Model(
        Parameters("UTM-30LX(Hokuyo Automatic Co.,Ltd.)", 23, 60000, 1440, 0, 1080, 540, 2400),
        product="SOKUIKI Sensor TOP-URG UTM-30LX",
        usable_mm=30000,
        nothing_code=1,
        near_code=2,
        failure_code=5,
    ),
}


def find_model(name: str) -> Model | None:
    """The catalogue's model for the MODL line of a PP reply; None if it is not listed."""
    return MODELS.get(name.partition("(")[0].strip())
