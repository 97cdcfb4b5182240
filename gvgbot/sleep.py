"""Whether the program was suspended, or hung: what came meanwhile is not wanted any more."""

import asyncio
import math
import time

_ASLEEP_S = 2.0  # without a word: who asked meanwhile may have been told that nobody is there
_WAKING_S = 1.0  # that what came meanwhile may take
_LOOK_S = 0.5


class Sleep:
    """Tells whether the loop has not run for so long that what it finds may have come long ago."""

    def __init__(self) -> None:
        self._ran, self._woke = _now(), -math.inf

    async def watch(self) -> None:
        """Watch the loop until cancelled."""
        while True:
            if self._has_paused:
                self._woke = _now()
            self._ran = _now()
            await asyncio.sleep(_LOOK_S)

    @property
    def is_or_was(self) -> bool:
        """Whether that is so, or has been just now."""
        return self._has_paused or _now() < self._woke + _WAKING_S

    @property
    def _has_paused(self) -> bool:
        return _now() > self._ran + _ASLEEP_S


def _now() -> float:
    """Seconds that go on while the computer sleeps, where the system counts these."""
    return time.clock_gettime(getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC))
