"""The laser's side of commands: cutting them out of the bytes, and what is wrong with them."""

import re

from gvgbot.drivers.hokuyo.models import Parameters

COMMAND_LIMIT = 128  # bytes without a terminator before they are forgotten
STRING_LIMIT = 16
BIT_RATES = frozenset({"019200", "038400", "057600", "115200", "250000", "500000", "750000"})

_STRING = re.compile(r"[A-Za-z0-9 ._+@]*")
_FIELDS = (  # characters of a scan command, and the status when they are no number
    (slice(2, 6), "01"),
    (slice(6, 10), "02"),
    (slice(10, 12), "03"),
    (slice(12, 13), "06"),
    (slice(13, 15), "07"),
)


class CommandReader:
    """Cuts bytes into commands, which end with LF, CR or both; empty ones are ignored."""

    def __init__(self) -> None:
        self._buffer = b""

    def feed(self, data: bytes) -> list[str]:
        """The commands that these bytes complete."""
        *lines, rest = re.split(rb"[\r\n]", self._buffer + data)
        self._buffer = rest if len(rest) <= COMMAND_LIMIT else b""
        return [line.decode("latin-1") for line in lines if line]


def repeated(texts: list[str]) -> list[bool]:
    """Which of the commands that came in one go are refused: of each type the first is served.

    Whoever wants a reboot has to say so twice.
    """
    types = [text[: 3 if text[:1] in "%$T" else 2] for text in texts]
    return [kind != "RB" and kind in types[:place] for place, kind in enumerate(types)]


def string_fault(string: str) -> str | None:
    """The status that refuses this user string; None if it is good."""
    if len(string) > STRING_LIMIT:
        return "0G"
    return None if _STRING.fullmatch(string) else "0H"


def scan_fault(command: str, parameters: Parameters) -> str | None:
    """The status that refuses this Mx or Gx command (without user string); None if it is good."""
    length = 12 if command[0] in "GH" else 15
    if len(command) != length:
        return "0C" if len(command) < length else "0D"
    for field, status in _FIELDS:
        if command[field] and not command[field].isdecimal():
            return status
    start, end = int(command[2:6]), int(command[6:10])
    if start < parameters.first_step or end > parameters.last_step:
        return "04"
    return "05" if end < start else None
