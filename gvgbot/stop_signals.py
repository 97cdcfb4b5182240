"""The signals that end a program which tidies up by itself."""

import asyncio
import signal
from collections.abc import Callable
from functools import partial
from typing import Any, Self

_STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class StopSignals:
    """Remembers that the process was asked to end; as a context manager it takes those signals.

    Being asked again changes nothing: shells, supervisors and impatient people send signals twice.
    """

    def __init__(self) -> None:
        self._asked: str | None = None
        self._tell: Callable[[], object] | None = None
        self._before: dict[signal.Signals, Any] = {}
        self._blocked: set[signal.Signals | int] = set()

    async def wait(self) -> str:
        """The name of the first signal; waits for one."""
        loop, asked = asyncio.get_running_loop(), asyncio.Event()
        self._tell = partial(loop.call_soon_threadsafe, asked.set)
        try:
            if self._asked is None:
                await asked.wait()
        finally:
            self._tell = None
        assert self._asked is not None
        return self._asked

    def _take(self, number: int, frame: object) -> None:
        self._asked = self._asked or signal.Signals(number).name
        if self._tell is not None:
            self._tell()

    def __enter__(self) -> Self:
        for number in _STOP_SIGNALS:
            before = signal.getsignal(number)
            if number is signal.SIGHUP and before is signal.SIG_IGN:
                continue  # started by nohup: to outlive its terminal
            self._before[number] = signal.signal(number, self._take)
        self._blocked = signal.pthread_sigmask(signal.SIG_UNBLOCK, self._before)
        return self

    def __exit__(self, *_: object) -> None:
        signal.pthread_sigmask(signal.SIG_SETMASK, self._blocked)
        for number, handler in self._before.items():
            signal.signal(number, handler)
