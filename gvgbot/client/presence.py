"""Whether a robot is there: what can be told from its token on the network and its silence."""

from dataclasses import dataclass
from typing import Literal

QUIET_AFTER = 2.0  # s without a state, though the robot is on the network

Word = Literal["alive", "doubled", "quiet", "gone", "absent", "cut off"]


@dataclass(frozen=True, slots=True)
class Presence:
    """How things are with the robot, and for how long, s.

    alive: it is on the network and says so; doubled: it does, and so does another one by its name;
    quiet: it is on the network but says nothing, so its program hangs; gone: it was there, and left
    or died; absent: it was not there since this program connected; cut off: nothing answers at the
    address any more, so that nobody knows.
    """

    word: Word
    for_s: float


@dataclass(slots=True)
class Signs:
    """What was noticed last; stamps in s of one clock, None for never."""

    connected_at: float
    token_at: float | None = None  # when the robot joined or left the network
    has_token: bool = False
    heard_at: float | None = None  # the last state
    doubled_at: float | None = None  # when one and another of this name took turns to speak
    via_router: bool = False  # otherwise the other end of the connection is the robot itself

    def presence(self, now: float, *, linked: bool) -> Presence:
        """What the signs say at a stamp; `linked`: whether anything is at the other end."""
        if self.token_at is None:
            return Presence("absent" if linked else "cut off", now - self.connected_at)
        if not self.has_token:
            is_known = linked or not self.via_router
            return Presence("gone" if is_known else "cut off", now - self.token_at)
        heard_at = self.token_at if self.heard_at is None else max(self.heard_at, self.token_at)
        silence = now - heard_at
        if silence > QUIET_AFTER:
            return Presence("quiet", silence)
        is_doubled = self.doubled_at is not None and now - self.doubled_at <= QUIET_AFTER
        return Presence("doubled" if is_doubled else "alive", now - self.token_at)
