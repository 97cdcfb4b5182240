"""The lasers: what their PP reply says, and what it does not say."""

import math
from collections.abc import Mapping
from dataclasses import astuple, dataclass
from typing import Literal, Self

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
        parameters = cls(lines.get("MODL", ""), *(_number(lines, key) for key in _NUMBER_KEYS))
        nonsense = parameters._nonsense()
        if nonsense is not None:
            raise ValueError(nonsense)
        return parameters

    def _nonsense(self) -> str | None:
        """The lines that cannot be true together."""
        first, last, turn = self.first_step, self.last_step, self.steps_per_turn
        near, far = self.range_min_mm, self.range_max_mm
        if not 0 <= first < last <= 2 * turn:
            return f"steps from AMIN:{first} to AMAX:{last}, with ARES:{turn} in a turn"
        if not 0 <= near < far:
            return f"ranges from DMIN:{near} to DMAX:{far}"
        return f"SCAN:{self.rpm} turns a minute" if self.rpm <= 0 else None

    def lines(self) -> dict[str, str]:
        """The lines of the PP reply; the inverse of `from_lines`."""
        model, *numbers = astuple(self)
        return {"MODL": model, **dict(zip(_NUMBER_KEYS, map(str, numbers), strict=True))}


def _number(lines: Mapping[str, str], key: str) -> int:
    """What a line says. Raises ValueError without such a line, or if it says no number."""
    if key not in lines:
        raise ValueError(f"no {key} line")
    try:
        return int(lines[key])
    except ValueError:
        raise ValueError(f"{key}:{lines[key]} is no number") from None


@dataclass(frozen=True, slots=True)
class Model:
    """A laser of the catalogue: its parameters, and the readings it sends in place of a range.

    `usable_mm` is the range the maker guarantees, which can be less than the largest reading.
    `link` is what it says of a link that has no bit rate.
    """

    parameters: Parameters
    identity: Identity  # of one with no serial number yet
    usable_mm: int
    nothing_code: int
    near_code: int
    failure_code: int
    link: str
    is_multi_echo: bool
    is_adjustable: bool  # knows CR, HS and DB
    is_newer: bool  # knows %ST and %SL


_URG_CODES = (0, 6, 7)
_UTM_CODES = (1, 2, 5)
_UST_CODES = (65533, 0, 0)
_USB, _ETHERNET = "USB Full Speed", "Ethernet 100 [Mbps]"
_URG_FIRMWARE = "3.3.00(16/Apr./2008)"
_UTM_FIRMWARE = "1.1.0 (2011-09-30)"
_UST_FIRMWARE = "2.23.0000"


def _model(
    name: str,
    numbers: tuple[int, int, int, int, int, int, int],
    usable_mm: int,
    codes: tuple[int, int, int],
    *,
    product: str = "",
    modl: str = "",
    link: str = _USB,
    is_multi_echo: bool = False,
) -> Model:
    """A row of the catalogue: the numbers in the order of the PP reply."""
    is_urg, is_newer = codes == _URG_CODES, name.startswith("UST")
    firmware = _UST_FIRMWARE if is_newer else _URG_FIRMWARE if is_urg else _UTM_FIRMWARE
    return Model(
        Parameters(f"{modl or name}(Hokuyo Automatic Co.,Ltd.)", *numbers),
        Identity(
            "Hokuyo Automatic Co., Ltd." if is_newer else "Hokuyo Automatic Co.,Ltd.",
            product or f"SOKUIKI Sensor {name}",
            firmware,
            "SCIP 2.2" if is_newer else "SCIP 2.0",
            "",
        ),
        usable_mm,
        *codes,
        link=link,
        is_multi_echo=is_multi_echo,
        is_adjustable=is_urg,
        is_newer=is_newer,
    )


MODELS: dict[str, Model] = {
    "URG-04LX": _model("URG-04LX", (20, 5600, 1024, 44, 725, 384, 600), 5600, _URG_CODES),
    "URG-04LX-UG01": _model(  # in its PP reply it calls itself by the name of the other
        "URG-04LX-UG01",
        (20, 5600, 1024, 44, 725, 384, 600),
        5600,
        _URG_CODES,
        product="SOKUIKI Sensor URG-04LX-UG01(Simple-URG)",
        modl="URG-04LX",
    ),
    "UBG-04LX-F01": _model("UBG-04LX-F01", (20, 5600, 1024, 44, 725, 384, 2140), 5600, _URG_CODES),
    "UBG-05LX-F01": _model("UBG-05LX-F01", (20, 5600, 1024, 44, 725, 384, 2140), 5600, _URG_CODES),
    "UHG-08LX": _model("UHG-08LX", (30, 11000, 1024, 0, 768, 384, 900), 8000, _URG_CODES),
    "UTM-30LX": _model(
        "UTM-30LX",
        (23, 60000, 1440, 0, 1080, 540, 2400),
        30000,
        _UTM_CODES,
        product="SOKUIKI Sensor TOP-URG UTM-30LX",
    ),
    "UTM-30LX-EW": _model(
        "UTM-30LX-EW",
        (23, 60000, 1440, 0, 1080, 540, 2400),
        30000,
        _UST_CODES,
        link=_ETHERNET,
        is_multi_echo=True,
    ),
    "UXM-30LX-E": _model(
        "UXM-30LX-E",
        (100, 100000, 1440, 0, 760, 380, 1200),
        30000,
        _UTM_CODES,
        product="SOKUIKI Sensor Tough-URG UXM-30LX-E",
        is_multi_echo=True,
    ),
    "UST-10LX": _model(
        "UST-10LX",
        (20, 30000, 1440, 0, 1080, 540, 2400),
        10000,
        _UST_CODES,
        product="UST-10LX",
        link=_ETHERNET,
    ),
    "UST-20LX": _model(
        "UST-20LX",
        (20, 60000, 1440, 0, 1080, 540, 2400),
        20000,
        _UST_CODES,
        product="UST-20LX",
        link=_ETHERNET,
    ),
}
ModelName = Literal[
    "URG-04LX",
    "URG-04LX-UG01",
    "UBG-04LX-F01",
    "UBG-05LX-F01",
    "UHG-08LX",
    "UTM-30LX",
    "UTM-30LX-EW",
    "UXM-30LX-E",
    "UST-10LX",
    "UST-20LX",
]


_NOTHING_OF_FAMILY = {1024: _URG_CODES[0], 1440: _UTM_CODES[0]}  # by steps per turn


def find_model(name: str) -> Model | None:
    """The catalogue's model that the MODL line of a PP reply names; None if it is not listed."""
    named = [model for model in MODELS if model in name]
    return MODELS[max(named, key=len)] if named else None


def nothing_code(parameters: Parameters) -> int | None:
    """What a laser sends where nothing is within range; one that is not listed, as its family."""
    model = find_model(parameters.model)
    if model is None:
        return _NOTHING_OF_FAMILY.get(parameters.steps_per_turn)
    return model.nothing_code
