"""Wire frames of the Kobuki base: AA 55, length, payload, checksum; the same in both directions."""

from dataclasses import dataclass

HEADER = b"\xaa\x55"
MIN_PAYLOAD = 3  # bytes: a sub-payload's id and length, and one byte of data
MAX_PAYLOAD = 255  # bytes
_OVERHEAD = 4  # bytes: header, length, checksum
_FOLDS = (1024, 512, 256, 128, 64, 32, 16, 8)  # bits


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame whose checksum is right; `payload` is what lies between length and checksum."""

    payload: bytes


@dataclass(frozen=True, slots=True)
class BadFrame:
    """Bytes, header to checksum, that look like a frame but whose checksum is wrong."""

    data: bytes


def checksum(data: bytes) -> int:
    """XOR of up to 256 bytes, by folding one long integer in halves."""
    folded = int.from_bytes(data, "little")
    for bits in _FOLDS:
        folded ^= folded >> bits
    return folded & 0xFF


def encode_frame(payload: bytes) -> bytes:
    """The frame that carries the payload. Raises ValueError if its length cannot be sent."""
    if not MIN_PAYLOAD <= len(payload) <= MAX_PAYLOAD:
        raise ValueError(f"a payload of {len(payload)} bytes does not fit into a frame")
    body = bytes((len(payload),)) + payload
    return HEADER + body + bytes((checksum(body),))


class FrameParser:
    """Finds frames in a byte stream cut anywhere, and finds the next good one after noise.

    Counts what it has seen: `frames` good, `bad_frames` with a wrong checksum, `skipped_bytes`
    that belong to no good frame; of these `leading_bytes` came before the first one, as for
    everybody who begins to listen in the middle of a frame. It holds back less than one frame
    between calls.
    """

    def __init__(self) -> None:
        self.frames = 0
        self.bad_frames = 0
        self.skipped_bytes = 0
        self.leading_bytes = 0
        self._buffer = b""

    def feed(self, data: bytes) -> list[Frame | BadFrame]:
        """The frames that these bytes complete, in order of arrival."""
        buffer = self._buffer + data
        found: list[Frame | BadFrame] = []
        start = self._seek(buffer, 0)
        while (end := _frame_end(buffer, start)) is not None:
            if end == start:  # no frame has such a length: a false header
                start = self._seek(buffer, start, skip=1)
            elif checksum(buffer[start + 2 : end - 1]) != buffer[end - 1]:
                self.bad_frames += 1
                found.append(BadFrame(buffer[start:end]))
                start = self._seek(buffer, start, skip=1)
            else:
                if not self.frames:
                    self.leading_bytes = self.skipped_bytes
                self.frames += 1
                found.append(Frame(buffer[start + 3 : end - 1]))
                start = self._seek(buffer, end)
        self._buffer = buffer[start:]
        return found

    def _seek(self, buffer: bytes, start: int, *, skip: int = 0) -> int:
        """Where the next header starts, or may start once more bytes have come."""
        found = buffer.find(HEADER, start + skip)
        if found < 0:
            found = len(buffer) - (1 if buffer[start + skip :].endswith(HEADER[:1]) else 0)
        self.skipped_bytes += found - start
        return found


def _frame_end(buffer: bytes, start: int) -> int | None:
    """The index after the frame at `start`; `start` if there is none; None if bytes are missing."""
    if len(buffer) < start + 3:
        return None
    length = buffer[start + 2]
    if length < MIN_PAYLOAD:
        return start
    end = start + length + _OVERHEAD
    return end if len(buffer) >= end else None
