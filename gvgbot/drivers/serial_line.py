"""A simulated serial line: one byte after the other, at its bit rate."""

import math
from collections import deque

BITS_PER_BYTE = 10
PIECE = 256  # bytes handed over at once, after the first one


class SerialLine:
    """Bytes in the order they were sent, each when its last bit is out."""

    def __init__(self, baud: int) -> None:
        """`baud` in bit/s; 0 is so fast that it does not matter."""
        self.baud = baud
        self.free_at = -math.inf
        self._pieces: deque[tuple[float, bytes]] = deque()

    def put(self, data: bytes, when: float) -> None:
        """Send the bytes from `when` (s) on, or as soon as the line is free."""
        start = max(when, self.free_at)
        if not self.baud:
            self._pieces.append((start, data))
        else:
            for piece in _pieces(data):
                start += len(piece) * BITS_PER_BYTE / self.baud
                self._pieces.append((start, piece))
        self.free_at = start

    def next_due(self) -> float:
        """When the next bytes are out (s); inf if there are none."""
        return self._pieces[0][0] if self._pieces else math.inf

    def out(self, now: float) -> bytes:
        """The bytes that are out by now."""
        sent = []
        while self._pieces and self._pieces[0][0] <= now:
            sent.append(self._pieces.popleft()[1])
        return b"".join(sent)

    def clear(self) -> None:
        """Forget what is not out yet."""
        self._pieces.clear()
        self.free_at = -math.inf


def _pieces(data: bytes) -> list[bytes]:
    rest = [data[i : i + PIECE] for i in range(1, len(data), PIECE)]
    return [data[:1], *rest]
