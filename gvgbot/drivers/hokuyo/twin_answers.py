"""What a simulated laser answers to each command, and the state that this leaves it in."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from gvgbot.drivers.hokuyo.scip import encode_reply
from gvgbot.drivers.hokuyo.scip_codec import encode_number
from gvgbot.drivers.hokuyo.scip_messages import ACCEPTED, Reply, ScanRequest, parse_request
from gvgbot.drivers.hokuyo.twin_commands import scan_fault, string_fault
from gvgbot.drivers.hokuyo.twin_config import HokuyoTwinConfig
from gvgbot.drivers.hokuyo.twin_head import Head
from gvgbot.drivers.hokuyo.twin_settings import BROKEN, LENGTHS, Settings

DENIED = "10"
UNDEFINED = "0E"
TOO_SHORT, TOO_LONG = "0C", "0D"
ABNORMAL = "0L"
NOT_CONTROLLED = "01"  # the laser does not light up
NO_SUCH_CODE = "01"  # of TM
ONCE_MORE = "01"  # of RB: only the second one counts
ALREADY_ON = "02"
ALREADY_OFF = "03"
SCIP_1_ANSWER = "E"
TWICE_WITHIN = 1.0  # s between two RB
SCAN_COMMANDS = frozenset(a + b for a in "MGNH" for b in "DSE") - {"NS", "HS"}


@dataclass(frozen=True, slots=True)
class Standby:
    """Laser off."""


@dataclass(frozen=True, slots=True)
class LaserOn:
    """Measuring, but sending only on demand."""


@dataclass(frozen=True, slots=True)
class TimeMode:
    """Laser off, answering with the time."""


@dataclass(frozen=True, slots=True)
class Asleep:
    """Laser and motor off until it is asked for scans."""


@dataclass(slots=True)
class Streaming:
    """Sending scans, of which `scan_number` is the next one."""

    request: ScanRequest
    scan_number: int


Phase = Standby | LaserOn | TimeMode | Asleep | Streaming
STATES = {Standby: "000", TimeMode: "002", LaserOn: "003", Streaming: "004", Asleep: "005"}
FAILED, UNSTABLE_DIGIT = "900", "1"


class Answers:
    """The laser's side of the dialogue. `phase` is what it is doing.

    `restarts_at` is when it will go down because it was told to (s); None if it was not.
    """

    def __init__(self, config: HokuyoTwinConfig, head: Head) -> None:
        self.phase: Phase = Standby()
        self.settings = Settings(config, head)
        self.is_abnormal = config.starts_abnormal
        self.is_unstable = False
        self.speaks_scip_1 = config.starts_in_scip_1
        self.restarts_at: float | None = None
        self._config = config
        self._head = head
        self._asked_to_restart: float | None = None

    def power_up(self, now: float) -> None:
        """Begin again, as after a reboot: what ailed the laser is gone."""
        self.phase = Standby()
        self.settings.reset(now, wholly=True)
        self.speaks_scip_1 = self._config.starts_in_scip_1
        self.is_abnormal = False
        self.restarts_at = self._asked_to_restart = None

    def answer(self, text: str, now: float) -> bytes:
        """The reply to one command, without its terminator."""
        if self.speaks_scip_1:
            self.speaks_scip_1 = text != "SCIP2.0"
            return status_reply(text, "0" if text == "SCIP2.0" else SCIP_1_ANSWER)
        command, _, string = text.partition(";")
        fault = string_fault(string)
        if fault is not None:
            return status_reply(text, fault)
        lines = self._information(command, now)
        if lines is not None:
            return _key_lines(text, lines)
        if self.is_abnormal and command not in {"RB", "%ST"}:
            return status_reply(text, ABNORMAL)
        if command[:2] in SCAN_COMMANDS:
            return self._answer_scan(text, command, now)
        return self._answer_state(text, command, now)

    def _information(self, command: str, now: float) -> Mapping[str, str] | None:
        model = self._head.model
        match command:
            case "VV":
                return replace(model.identity, serial=self._config.serial_number).lines()
            case "PP" if not isinstance(self.phase, TimeMode):
                return model.parameters.lines()
            case "II":
                return self._condition(now)
        return None

    def _condition(self, now: float) -> Mapping[str, str]:
        model, baud = self._head.model, self.settings.baud
        is_on = isinstance(self.phase, LaserOn | Streaming)
        ms = self._head.device_ms(now)
        return {
            "MODL": model.parameters.model,
            "LASR": "ON" if is_on else "OFF",
            "SCSP": f"Initial({model.parameters.rpm}[rpm])",
            "MESM": ("Measuring" if model.is_newer else "CLASSIC") if is_on else "IDLE",
            "SBPS": f"{baud}[bps]" if baud else model.link,
            "TIME": encode_number(ms, 4).decode("ascii") if model.is_newer else f"{ms:06X}",
            "STAT": self._health(),
        }

    def _state(self) -> str:
        """Three digits, as %ST tells it."""
        if self.is_abnormal:
            return FAILED
        state = STATES[type(self.phase)]
        return UNSTABLE_DIGIT + state[1:] if self.is_unstable else state

    def _health(self) -> str:
        if self.is_abnormal or self.settings.is_broken:
            return "Sensor is in abnormal state."
        return "Stable 000 no error." if self._head.model.is_newer else "Sensor works well."

    def _answer_state(self, text: str, command: str, now: float) -> bytes:
        """The reply to what is no question and no scan."""
        if command[:2] in LENGTHS:
            return status_reply(text, self._set(command, now))
        if command[:2] == "TM":
            return self._answer_time(text, command, now)
        if command == "%ST" and self._head.model.is_newer:
            return encode_reply(Reply(text, ACCEPTED, (self._state(),)))
        if command == "RB":
            return status_reply(text, self._restart(now))
        return status_reply(text, self._switch(command, now))

    def _switch(self, command: str, now: float) -> str:
        """Change the phase; the status."""
        match command, self.phase:
            case "BM" | "QT" | "PP" | "II" | "VV", TimeMode():
                return DENIED
            case "BM", LaserOn() | Streaming():
                return ALREADY_ON
            case "BM", _ if self.settings.is_broken:
                return NOT_CONTROLLED
            case "BM", _:
                self.phase = LaserOn()
            case "QT", Streaming() if self._head.is_lucky(self._config.lost_stop_fraction):
                return ACCEPTED
            case "QT", _:
                self.phase = Standby()
            case "RS" | "RT", _:
                self.phase = Standby()
                self._head.reset_clock(now)
                self.settings.reset(now, wholly=command == "RS")
            case "%SL", _ if self._head.model.is_newer:
                self.phase = Asleep()
            case _:
                return UNDEFINED
        return ACCEPTED

    def _set(self, command: str, now: float) -> str:
        """The status of a command that sets something."""
        if isinstance(self.phase, TimeMode):
            return DENIED
        status = self.settings.answer(command, now)
        if self.settings.is_broken:
            self.phase = Standby()
        return status

    def _restart(self, now: float) -> str:
        asked, self._asked_to_restart = self._asked_to_restart, now
        if asked is None or now - asked > TWICE_WITHIN:
            return ONCE_MORE
        self.restarts_at = now + 1.0
        return ACCEPTED

    def _answer_time(self, text: str, command: str, now: float) -> bytes:
        if len(command) != len("TM0"):
            return status_reply(text, TOO_SHORT if command == "TM" else TOO_LONG)
        match command, self.phase:
            case "TM0", TimeMode():
                return status_reply(text, ALREADY_ON)
            case "TM0", Streaming():
                return status_reply(text, DENIED)
            case "TM0", _:
                self.phase = TimeMode()
            case "TM2", TimeMode():
                self.phase = Standby()
            case "TM2", _:
                return status_reply(text, ALREADY_OFF)
            case "TM1", _:
                time = encode_number(self._head.device_ms(now), 4).decode("ascii")
                return encode_reply(Reply(text, ACCEPTED, (time,)))
            case _:
                return status_reply(text, NO_SUCH_CODE)
        return status_reply(text, ACCEPTED)

    def _answer_scan(self, text: str, command: str, now: float) -> bytes:
        fault = self._scan_fault(command)
        if fault is not None:
            return status_reply(text, fault)
        if self.settings.is_broken:
            return status_reply(text, BROKEN)
        request = parse_request(text.encode("ascii"))
        if request is None:
            return status_reply(text, UNDEFINED)
        if request.is_single_shot:
            if not isinstance(self.phase, LaserOn | Streaming):
                return status_reply(text, DENIED)
            return self._head.frame(request, ACCEPTED, self._head.latest_scan(request, now))
        if isinstance(self.phase, TimeMode):
            return status_reply(text, DENIED)
        self.phase = Streaming(request, self._head.next_scan(now))
        return status_reply(text, ACCEPTED)

    def _scan_fault(self, command: str) -> str | None:
        if command[0] in "NH" and not self._head.model.is_multi_echo:
            return UNDEFINED
        return scan_fault(command, self._head.model.parameters)


def status_reply(echo: str, status: str) -> bytes:
    """A reply that is nothing but a status."""
    return encode_reply(Reply(echo, status))


def _key_lines(echo: str, lines: Mapping[str, str]) -> bytes:
    return encode_reply(
        Reply(echo, ACCEPTED, tuple(f"{key}:{value}" for key, value in lines.items()))
    )
