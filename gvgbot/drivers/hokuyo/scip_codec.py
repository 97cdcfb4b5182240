"""SCIP numbers, checksums and 64-character data blocks: bytes to arrays and back."""

import numpy as np
from numpy.typing import NDArray

Characters = NDArray[np.uint8]
"""Six-bit characters (N,) with the offset taken off: 0..63, or ECHO_SEPARATOR."""
Values = NDArray[np.int32]

OFFSET = 0x30
LARGEST_DIGIT = 0x3F
LINE_FEED = 0x0A
BLOCK = 64  # characters
ROW = BLOCK + 2  # characters, checksum, line feed
ECHO_SEPARATOR = (ord("&") - OFFSET) % 256

# Exact in float32, whose products go through the fast matrix code.
_WEIGHTS = {
    2: np.array([64.0, 1.0], np.float32),
    3: np.array([4096.0, 64.0, 1.0], np.float32),
}
# By the sum modulo 256, which leaves the six bits that count as they are.
_CHECKSUMS = bytes((total & LARGEST_DIGIT) + OFFSET for total in range(256))


class DamagedError(ValueError):
    """The bytes break a rule of the protocol; the text says which."""


def checksum(data: bytes) -> int:
    """The byte that closes a line with this content."""
    return (sum(data) & LARGEST_DIGIT) + OFFSET


def with_checksum(data: bytes) -> bytes:
    """The content followed by its checksum."""
    return data + bytes((checksum(data),))


def checked(line: bytes) -> bytes:
    """The content of a line without its checksum. Raises DamagedError."""
    if len(line) < 2 or checksum(line[:-1]) != line[-1]:
        raise DamagedError("line checksum")
    return line[:-1]


def encode_key_line(text: bytes) -> bytes:
    """A `KEY:value` line with its closing `;`, which the sum leaves out, and checksum."""
    return text + b";" + bytes((checksum(text),))


def checked_key_line(line: bytes) -> bytes:
    """`KEY:value` of a `KEY:value;c` line, whose sum may include the `;`. Raises DamagedError."""
    content, separator, found = line[:-2], line[-2:-1], line[-1:]
    # Some firmware stops summing where its own remark begins.
    candidates = (content, line[:-1], content.partition(b"<-")[0])
    if separator != b";" or found not in {bytes((checksum(each),)) for each in candidates}:
        raise DamagedError("line checksum")
    return content


def encode_number(value: int, characters: int) -> bytes:
    """A number of 6 bits per character, most significant first. Raises ValueError if too large."""
    if not 0 <= value < 1 << 6 * characters:
        raise ValueError(f"{value} does not fit into {characters} characters")
    shifts = range(6 * (characters - 1), -1, -6)
    return bytes((value >> shift & LARGEST_DIGIT) + OFFSET for shift in shifts)


def decode_number(data: bytes) -> int:
    """The number that the characters stand for. Raises DamagedError."""
    value = 0
    for byte in data:
        if not OFFSET <= byte <= OFFSET + LARGEST_DIGIT:
            raise DamagedError("character out of range")
        value = value << 6 | byte - OFFSET
    return value


def unblock(data: bytes) -> Characters:
    """The characters of data blocks, each checked for length, checksum and line feed.

    `data` ends with the line feed of its last block. Raises DamagedError.
    """
    full = len(data) // ROW
    tail = data[full * ROW :]
    if tail and tail[-1] != LINE_FEED:
        raise DamagedError("block length")
    rows = np.frombuffer(data, np.uint8, full * ROW).reshape(full, ROW)[:, :BLOCK]
    if data[BLOCK + 1 : full * ROW : ROW] != b"\n" * full:
        raise DamagedError("block length")
    if data[BLOCK : full * ROW : ROW] != _row_checksums(rows):
        raise DamagedError("line checksum")
    last = checked(tail[:-1]) if tail else b""
    return np.frombuffer(rows.tobytes() + last, np.uint8) - np.uint8(OFFSET)


def _row_checksums(rows: Characters) -> bytes:
    """The checksum of each row of bytes."""
    sums: Characters = np.add.reduce(rows, axis=1, dtype=np.uint8)
    return sums.tobytes().translate(_CHECKSUMS)


def block(characters: Characters) -> bytes:
    """Data blocks with checksums and line feeds; the inverse of `unblock`."""
    text = characters + np.uint8(OFFSET)
    full = len(text) // BLOCK
    rows = np.empty((full, ROW), np.uint8)
    rows[:, :BLOCK] = text[: full * BLOCK].reshape(full, BLOCK)
    rows[:, BLOCK] = np.frombuffer(_row_checksums(rows[:, :BLOCK]), np.uint8)
    rows[:, BLOCK + 1] = LINE_FEED
    tail = text[full * BLOCK :].tobytes()
    return rows.tobytes() + (with_checksum(tail) + b"\n" if tail else b"")


def to_values(characters: Characters, width: int) -> Values:
    """Numbers (N,) of `width` (2 or 3) characters each. Raises DamagedError."""
    if len(characters) % width:
        raise DamagedError("value count")
    if characters.size and characters.max() > LARGEST_DIGIT:
        raise DamagedError("character out of range")
    digits = characters.reshape(-1, width).astype(np.float32)
    return (digits @ _WEIGHTS[width]).astype(np.int32)


def to_characters(values: Values, width: int) -> Characters:
    """Characters of numbers (N,) that fit into `width` each; the inverse of `to_values`."""
    out = np.empty((len(values), width), np.uint8)
    for column in range(width):
        out[:, column] = values >> 6 * (width - 1 - column) & LARGEST_DIGIT
    return out.ravel()


def split_echoes(characters: Characters, width: int) -> tuple[Characters, Values]:
    """Multi-echo characters without their separators, and the number of echoes of each step.

    A reading takes `width` characters. Raises DamagedError.
    """
    separators = np.flatnonzero(characters == ECHO_SEPARATOR)
    offsets = separators - np.arange(len(separators))
    kept = np.delete(characters, separators)
    if len(kept) % width:
        raise DamagedError("value count")
    inside = (offsets > 0) & (offsets < len(kept)) & (offsets % width == 0)
    if not inside.all() or not np.diff(offsets).all():
        raise DamagedError("echo separator")
    first = np.ones(len(kept) // width, np.bool_)
    first[offsets // width] = False
    return kept, np.bincount(np.cumsum(first) - 1).astype(np.int32)


def join_echoes(characters: Characters, echoes: Values, width: int) -> Characters:
    """Characters with a separator before each further echo; the inverse of `split_echoes`."""
    first = np.zeros(int(echoes.sum()), np.bool_)
    first[np.cumsum(echoes) - echoes] = True
    return np.insert(characters, np.flatnonzero(~first) * width, ECHO_SEPARATOR)
