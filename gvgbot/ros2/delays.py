"""Whether a message was held up on its way: who sent it may have stopped since."""

import math

_HELD_UP_S = 0.5  # more than those before it
_STAYS_S = 2.0  # so late for so long: a clock was set, or the way has become longer
_DRIFT_S = 0.001  # from one message to the next, by which clocks may go apart
_SENDERS = 32


class Delays:
    """Tells what has come much later than what the same sender sent before.

    Clocks need not agree, as only differences count.
    """

    def __init__(self) -> None:
        self._least: dict[bytes, float] = {}
        self._late_since: dict[bytes, float] = {}

    def held_up(self, sender: bytes, *, sent: float, stamp: float) -> bool:
        """Whether a message was, that was sent by the sender's clock and came by one's own."""
        if sender not in self._least and len(self._least) == _SENDERS:
            self._least.clear()
            self._late_since.clear()
        delay, least = stamp - sent, self._least.get(sender, math.inf)
        if delay > least + _HELD_UP_S:
            if stamp < self._late_since.setdefault(sender, stamp) + _STAYS_S:
                return True
            least = delay
        self._late_since.pop(sender, None)
        self._least[sender] = min(delay, least + _DRIFT_S)
        return False
