"""Time: one monotonic clock for everything, and an event loop whose clock can jump."""

import asyncio
import math
import selectors
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any, Protocol, TypeVar

from gvgbot.errors import Deadlock

_T = TypeVar("_T")

# Runs what takes long while the loop goes on: asyncio.to_thread, or at once in virtual time.
OffLoop = Callable[[Callable[[], None]], Awaitable[None]]


class Clock(Protocol):
    """Seconds on a monotonic scale."""

    def now(self) -> float:
        """The present."""

    async def sleep_until(self, stamp: float) -> None:
        """Return at the stamp, or at once if it has passed."""


class LoopClock:
    """The running event loop's clock: real, or virtual under `VirtualTimeLoop`.

    It may be `ahead` of it by some seconds, to go on from where a clock of an earlier life ended.
    """

    def __init__(self, ahead: float = 0.0) -> None:
        self._loop, self._ahead = asyncio.get_running_loop(), ahead

    def now(self) -> float:
        """Seconds of the loop's clock, and what this one is ahead."""
        return self._loop.time() + self._ahead

    async def sleep_until(self, stamp: float) -> None:
        """Return at the stamp, or at once (but after other tasks had a turn) if it has passed."""
        await asyncio.sleep(max(0.0, stamp - self.now()))


def on_loop(clock: Clock, stamp: float) -> float:
    """When it is the stamp by the running event loop's clock, of which the other may be ahead.

    That is later than now in any case: with a timer for a time that has come, virtual time would
    stand still.
    """
    now, on_loop_now = clock.now(), asyncio.get_running_loop().time()
    return max(stamp - (now - on_loop_now), math.nextafter(on_loop_now, math.inf))


class _JumpingSelector(selectors.SelectSelector):
    """Never waits: when the loop would sleep, its clock jumps instead."""

    def __init__(self) -> None:
        super().__init__()
        self.now = 0.0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if timeout is None:
            raise Deadlock("every task waits and no timer is set: the program would hang for ever")
        self.now += max(0.0, timeout)
        return []


class VirtualTimeLoop(asyncio.SelectorEventLoop):
    """An event loop in virtual time: an hour passes at once, in the same order every time.

    It watches no file descriptor: only timers and in-memory streams make progress.
    """

    def __init__(self) -> None:
        self._jumping = _JumpingSelector()
        super().__init__(self._jumping)

    def time(self) -> float:
        """Virtual seconds since the loop was made."""
        now = self._jumping.now
        # A timer that fired early would be set again, and two such tasks would stop time for ever.
        self._clock_resolution = math.ulp(now)
        return now


def run_in_virtual_time(main: Coroutine[Any, Any, _T]) -> _T:
    """Run a coroutine to its end on a `VirtualTimeLoop`. Raises Deadlock if it can never end."""
    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        return runner.run(main)
