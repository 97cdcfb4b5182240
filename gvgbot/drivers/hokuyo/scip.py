"""SCIP 2 on the wire: replies and scans from bytes in any chunks, and the bytes of each; no I/O."""

import re

import numpy as np

from gvgbot.drivers.hokuyo.scip_codec import (
    Characters,
    DamagedError,
    Values,
    block,
    checked,
    checked_key_line,
    decode_number,
    encode_key_line,
    encode_number,
    join_echoes,
    split_echoes,
    to_characters,
    to_values,
    unblock,
    with_checksum,
)
from gvgbot.drivers.hokuyo.scip_messages import (
    ACCEPTED,
    SCAN_DATA,
    USER_STRING,
    BadReply,
    Message,
    Reply,
    ScanReply,
    ScanRequest,
    parse_request,
)

END = b"\n\n"
MESSAGE_LIMIT = 65536  # bytes; the largest multi-echo frame takes a third of it

_END = re.compile(re.escape(END))  # a regular expression finds it sooner than `find` does
_KEY_COMMANDS = frozenset({"VV", "PP", "II"})
_STATUS = re.compile(rb"[0-9A-Z]{1,2}")
_STAMP_CHARACTERS = frozenset({4, 11})
_ECHO = re.compile(rf"(?:[%$]?[A-Z]{{2}}|SCIP)[0-9.]*(?:;{USER_STRING})?".encode())
# A message that begins inside a damaged one: a scan anywhere, a short reply on a line of its own.
_LATER_START = re.compile(
    rf"(?:%?[GHMN][DSE]\d{{10}}(?:\d{{3}})?|(?<=\n)[A-Z]{{2}}[A-Z0-9.]{{0,8}})"
    rf"(?:;{USER_STRING})?\n[0-9A-Z]{{2}}[0-o]\n".encode()
)


class ScipParser:
    """Cuts a byte stream into messages; whatever is damaged comes out as a BadReply."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._searched = 0  # bytes in which no message ends

    @property
    def pending(self) -> int:
        """Bytes of the message that has begun."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[Message]:
        """The messages that these bytes complete, in order."""
        self._buffer += data
        messages: list[Message] = []
        while (message := self._next_message()) is not None:
            messages += _parse_or_recover(message)
        return messages

    def _next_message(self) -> bytes | None:
        """The next message with its first line feed of two, or what fills the buffer."""
        self._drop_empty_lines()
        end = _END.search(self._buffer, self._searched, MESSAGE_LIMIT)
        if end is not None:
            message = self._take(end.start() + 1)
            del self._buffer[:1]
            return message
        if len(self._buffer) >= MESSAGE_LIMIT:
            return self._take(MESSAGE_LIMIT)
        self._searched = max(0, len(self._buffer) - 1)
        return None

    def _drop_empty_lines(self) -> None:
        while self._buffer.startswith(b"\n"):
            del self._buffer[:1]

    def _take(self, length: int) -> bytes:
        taken = bytes(self._buffer[:length])
        del self._buffer[:length]
        self._searched = 0
        return taken


def parse_message(message: bytes) -> Message:
    """The meaning of one message, given with the first line feed of its closing two."""
    echo, _, rest = message.partition(b"\n")
    status_line, _, payload = rest.partition(b"\n")
    try:
        status = _status(status_line)
        request = parse_request(echo)
        if request is not None and _carries_scan(request, status, payload):
            return _scan(request, status, payload)
        return _reply(echo, status, payload)
    except DamagedError as error:
        return BadReply(str(error), message)


def _carries_scan(request: ScanRequest, status: str, payload: bytes) -> bool:
    single = request.is_single_shot and status == ACCEPTED and payload != b""
    return single or status == SCAN_DATA


def _parse_or_recover(message: bytes) -> list[Message]:
    parsed = parse_message(message)
    if not isinstance(parsed, BadReply):
        return [parsed]
    starts = [match.start() for match in _LATER_START.finditer(message, 1)]
    later = parse_message(message[starts[-1] :]) if starts else parsed
    if isinstance(later, BadReply):
        return [parsed]
    return [BadReply(parsed.reason, message[: starts[-1]]), later]


def _status(line: bytes) -> str:
    # Before SCIP 2 a status is one character without checksum.
    status = line if len(line) == 1 else checked(line)
    if not _STATUS.fullmatch(status):
        raise DamagedError("status")
    return status.decode("ascii")


def _reply(echo: bytes, status: str, payload: bytes) -> Reply:
    if status == SCAN_DATA or not _ECHO.fullmatch(echo):
        raise DamagedError("echo")
    command = echo.partition(b";")[0].decode("ascii")
    content = checked_key_line if command in _KEY_COMMANDS else checked
    lines = payload.removesuffix(b"\n").split(b"\n") if payload else []
    return Reply(
        echo.decode("ascii"), status, tuple(content(line).decode("latin-1") for line in lines)
    )


def _scan(request: ScanRequest, status: str, payload: bytes) -> ScanReply:
    stamp_line, _, data = payload.partition(b"\n")
    stamp = checked(stamp_line)
    if len(stamp) not in _STAMP_CHARACTERS:
        raise DamagedError("stamp")
    ranges, intensities, echoes = _readings(request, unblock(data))
    return ScanReply(request, status, decode_number(stamp), ranges, intensities, echoes, len(stamp))


def _readings(
    request: ScanRequest, characters: Characters
) -> tuple[Values, Values | None, Values | None]:
    """Ranges, intensities and echoes per step of a scan's characters. Raises DamagedError."""
    echoes = None
    steps = len(characters) // (request.width * request.numbers)
    if request.is_multi_echo:
        characters, echoes = split_echoes(characters, request.width * request.numbers)
        steps = len(echoes)
    if steps != request.values:
        raise DamagedError("value count")
    values = to_values(characters, request.width)
    if request.numbers == 1:
        return values, None, echoes
    return values[0::2], values[1::2], echoes


def encode_command(text: str) -> bytes:
    """The bytes that ask for it, to go out in one write."""
    return text.encode("ascii") + b"\n"


def decode_time(reply: Reply) -> int:
    """Device milliseconds of a TM1 reply. Raises DamagedError."""
    if len(reply.lines) != 1:
        raise DamagedError("no time")
    return decode_number(reply.lines[0].encode("latin-1"))


def encode_reply(reply: Reply) -> bytes:
    """The bytes of a reply; one-character statuses have no checksum."""
    seal = encode_key_line if reply.command in _KEY_COMMANDS else with_checksum
    status = reply.status.encode("latin-1")
    lines = [reply.echo.encode("latin-1"), status if len(status) == 1 else with_checksum(status)]
    lines += [seal(line.encode("latin-1")) for line in reply.lines]
    return b"\n".join(lines) + END


def encode_scan(scan: ScanReply) -> bytes:
    """The bytes of a scan."""
    request, numbers = scan.request, scan.ranges
    if scan.intensities is not None:
        numbers = np.column_stack((numbers, scan.intensities)).ravel()
    characters = to_characters(numbers, request.width)
    if scan.echoes is not None:
        characters = join_echoes(characters, scan.echoes, request.width * request.numbers)
    head = (
        request.text().encode("ascii"),
        with_checksum(scan.status.encode("ascii")),
        with_checksum(encode_number(scan.stamp, scan.stamp_characters)),
        block(characters),
    )
    return b"\n".join(head) + b"\n"
