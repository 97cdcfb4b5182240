"""SCIP 2 messages as values: scan requests, replies, scans, and what could not be read."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from gvgbot.drivers.hokuyo.scip_codec import Values

ACCEPTED = "00"
SCAN_DATA = "99"
USER_STRING = r"[A-Za-z0-9 ._+@]{1,16}"

_SINGLE_SHOT = frozenset("GH")
_REQUEST = re.compile(
    rf"(%?[GHMN][DSE])(\d{{4}})(\d{{4}})(\d\d)(?:(\d)(\d\d))?(?:;({USER_STRING}))?".encode()
)


@dataclass(frozen=True, slots=True)
class ScanRequest:
    """Steps start..end in clusters: `count` scans (0 = until QT), `skip` left out between two.

    Single-shot commands (GD, HD and the like) have neither skip nor count.
    """

    command: str
    start: int
    end: int
    cluster: int = 1
    skip: int = 0
    count: int = 0
    string: str = ""

    @property
    def is_single_shot(self) -> bool:
        """Whether one scan comes back in the reply itself."""
        return self.command[0] in _SINGLE_SHOT

    @property
    def group(self) -> int:
        """Steps per value; 0 and 1 both ask for no grouping."""
        return max(1, self.cluster)

    @property
    def values(self) -> int:
        """Values in a scan; the last group may be short."""
        return -((self.start - self.end - 1) // self.group)

    @property
    def width(self) -> int:
        """Characters per number."""
        return 2 if self.command.endswith("S") else 3

    @property
    def numbers(self) -> int:
        """Numbers per reading: the range, and the intensity where it was asked for."""
        return 2 if self.command.endswith("E") else 1

    @property
    def is_multi_echo(self) -> bool:
        """Whether a step can have several readings."""
        return self.command[-2] in "HN"

    def text(self) -> str:
        """The command as sent and as echoed, without line feed."""
        text = f"{self.command}{self.start:04}{self.end:04}{self.cluster:02}"
        if not self.is_single_shot:
            text += f"{self.skip}{self.count:02}"
        return f"{text};{self.string}" if self.string else text


@lru_cache(maxsize=256)
def parse_request(echo: bytes) -> ScanRequest | None:
    """The scan request that a command or an echo states; None if it is none."""
    match = _REQUEST.fullmatch(echo)
    if match is None:
        return None
    command, start, end, cluster, skip, count, string = match.groups()
    request = ScanRequest(
        command.decode(),
        int(start),
        int(end),
        int(cluster),
        int(skip or 0),
        int(count or 0),
        (string or b"").decode(),
    )
    is_complete = request.is_single_shot == (skip is None)
    return request if is_complete and request.end >= request.start else None


@dataclass(frozen=True, slots=True)
class Reply:
    """The answer to a command: its echo, the status and the payload without checksums."""

    echo: str
    status: str
    lines: tuple[str, ...] = ()

    @property
    def command(self) -> str:
        """The echo without the user string."""
        return self.echo.partition(";")[0]

    @property
    def fields(self) -> Mapping[str, str]:
        """The payload of VV, PP and II by key."""
        return {key: value for key, _, value in (line.partition(":") for line in self.lines)}


@dataclass(frozen=True, slots=True, eq=False)
class ScanReply:
    """One scan as sent: ranges (N,) in mm or error codes, stamp of step 0 in device milliseconds.

    `request.count` counts the scans still to come. Intensities have no unit. In multi-echo scans
    `echoes` (steps,) says how many of the ranges belong to each step. A stamp of 11 characters
    is in microseconds.
    """

    request: ScanRequest
    status: str
    stamp: int
    ranges: Values
    intensities: Values | None = None
    echoes: Values | None = None
    stamp_characters: int = 4


@dataclass(frozen=True, slots=True)
class BadReply:
    """Bytes that are no message, and why."""

    reason: str
    data: bytes


Message = Reply | ScanReply | BadReply
