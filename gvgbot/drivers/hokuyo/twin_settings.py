"""What SS, CR, HS and DB set in a simulated laser: bit rate, motor, sensitivity, malfunction."""

from gvgbot.drivers.hokuyo.scip_messages import ACCEPTED
from gvgbot.drivers.hokuyo.twin_commands import BIT_RATES
from gvgbot.drivers.hokuyo.twin_config import HokuyoTwinConfig
from gvgbot.drivers.hokuyo.twin_head import Head

LENGTHS = {"SS": 6, "CR": 2, "HS": 1, "DB": 2}  # digits of each command's parameter
NOT_BY_URG = "038400"  # the one bit rate that it lacks

SLOWER_PER_LEVEL = 0.01  # of the motor's speed
LEVELS = 10
TO_DEFAULT = 99

BREAK_NOW = frozenset({1, 2})  # parameters of DB
HALT_AND_GO_ON, HALT_AND_BREAK, BREAK = 3, 4, 5  # in the midst of a stream
END = 10

SCANS_BEFORE = 20  # that are sent until the malfunction begins
SCANS_CHECKED = 10  # that are not made while the laser looks into it
CHECKING, RESUMED, BROKEN, SILENCE = "21", "98", "50", ""


class Settings:
    """What the host has set. A malfunction that it asked for makes the laser `is_broken`."""

    def __init__(self, config: HokuyoTwinConfig, head: Head) -> None:
        self.baud = config.serial_baud
        self.is_broken = False
        self._shipped_baud = config.serial_baud
        self._head = head
        self._level = 0
        self._drill: int | None = None
        self._drilled = 0  # scans since it was asked for

    def reset(self, now: float, *, wholly: bool) -> None:
        """As shipped; unless `wholly`, motor and bit rate stay as they are."""
        self._head.is_sensitive = False
        self._drill, self.is_broken = None, False
        if wholly:
            self.baud = self._shipped_baud
            self._turn(0, now)

    def answer(self, command: str, now: float) -> str:
        """Obey a command of `LENGTHS`; its status."""
        name, digits = command[:2], command[2:]
        if len(digits) != LENGTHS[name]:
            return "0C" if len(digits) < LENGTHS[name] else "0D"
        if name == "SS":
            return self._set_baud(digits)
        if not self._head.model.is_adjustable:
            return "03" if name == "HS" else "04"
        if not digits.isdecimal():
            return "01"
        match name:
            case "CR":
                return self._set_speed(int(digits), now)
            case "HS":
                return self._set_sensitivity(int(digits))
        return self._set_drill(int(digits))

    def instead_of_scan(self) -> str | None:
        """The status that takes the place of the next scan of a stream; None: the scan itself."""
        late, self._drilled = self._drilled - SCANS_BEFORE, self._drilled + 1
        if self._drill is None or late < 0:
            return None
        if self._drill == BREAK:
            return BROKEN
        if late < SCANS_CHECKED:
            return SILENCE if late else CHECKING
        if self._drill == HALT_AND_BREAK:
            return BROKEN
        return RESUMED if late == SCANS_CHECKED else None

    def _set_baud(self, digits: str) -> str:
        if not digits.isdecimal():
            return "01"
        if digits not in BIT_RATES:
            return "02"
        if not self.baud:
            return ACCEPTED  # without effect: there is no serial line
        if int(digits) == self.baud:
            return "03"
        if digits == NOT_BY_URG and self._head.model.is_adjustable:
            return "04"
        self.baud = int(digits)
        return ACCEPTED

    def _set_speed(self, level: int, now: float) -> str:
        if LEVELS < level < TO_DEFAULT:
            return "02"
        level = 0 if level == TO_DEFAULT else level
        if level == self._level:
            return "03"
        self._turn(level, now)
        return ACCEPTED

    def _turn(self, level: int, now: float) -> None:
        if level != self._level:
            self._level = level
            self._head.set_speed(1.0 - SLOWER_PER_LEVEL * level, now)

    def _set_sensitivity(self, wanted: int) -> str:
        if wanted > 1:
            return "01"
        if self._head.is_sensitive == bool(wanted):
            return "02"
        self._head.is_sensitive = bool(wanted)
        return ACCEPTED

    def _set_drill(self, wanted: int) -> str:
        if wanted == END:
            status = "03" if self._drill is None else ACCEPTED
            self._drill, self.is_broken = None, False
            return status
        if wanted not in BREAK_NOW | {HALT_AND_GO_ON, HALT_AND_BREAK, BREAK}:
            return "01"
        if wanted == self._drill:
            return "02"
        if self.is_broken:
            return "05"
        self._drill, self._drilled = wanted, 0
        self.is_broken = wanted in BREAK_NOW
        return ACCEPTED
