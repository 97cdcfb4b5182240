"""The signals that end a program which tidies up by itself, and the one that suspends it."""

import asyncio
import contextlib
import signal
from collections.abc import Callable, Coroutine, Iterator
from functools import partial
from typing import Any, Self

_STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class StopSignals:
    """Remembers that the process was asked to end; as a context manager it takes those signals.

    Being asked again changes nothing: shells, supervisors and impatient people send signals twice.
    A signal that is blocked comes only if it `unblocks` them.
    """

    def __init__(self, *, unblocks: bool = True) -> None:
        self._unblocks = unblocks
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

    def run(
        self,
        work: Coroutine[Any, Any, None],
        loop_factory: Callable[[], asyncio.AbstractEventLoop] | None = None,
    ) -> None:
        """Do some work. Raises KeyboardInterrupt if a signal ended it: the first one cancels it."""
        try:
            with asyncio.Runner(loop_factory=loop_factory) as runner:
                runner.run(self._cancelled_by_signal(work))
        except asyncio.CancelledError:
            raise KeyboardInterrupt from None

    async def _cancelled_by_signal(self, work: Coroutine[Any, Any, None]) -> None:
        loop, task = asyncio.get_running_loop(), asyncio.current_task()
        assert task is not None
        self._tell = partial(loop.call_soon_threadsafe, task.cancel)
        try:
            if self._asked is not None:
                task.cancel()
            await work
        finally:
            self._tell = None

    def _take(self, number: int, frame: object) -> None:
        if self._asked is None:
            self._asked = signal.Signals(number).name
            if self._tell is not None:
                self._tell()

    def __enter__(self) -> Self:
        for number in _STOP_SIGNALS:
            before = signal.getsignal(number)
            if number is signal.SIGHUP and before is signal.SIG_IGN:
                continue  # started by nohup: to outlive its terminal
            self._before[number] = signal.signal(number, self._take)
        heard = self._before if self._unblocks else ()
        self._blocked = signal.pthread_sigmask(signal.SIG_UNBLOCK, heard)
        return self

    def __exit__(self, *_: object) -> None:
        signal.pthread_sigmask(signal.SIG_SETMASK, self._blocked)
        for number, handler in self._before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def standing_while_suspended(stand: Callable[[], object]) -> Iterator[None]:
    """Let the robot stand before Ctrl-Z suspends the program; on the running loop.

    A base that is no longer heard or driven would roll on until it stops itself.
    """
    loop = asyncio.get_running_loop()
    if signal.getsignal(signal.SIGTSTP) is signal.SIG_IGN:
        yield
        return

    def suspend() -> None:
        stand()
        loop.remove_signal_handler(signal.SIGTSTP)
        signal.raise_signal(signal.SIGTSTP)  # it goes on from here once somebody wants that
        loop.add_signal_handler(signal.SIGTSTP, suspend)

    loop.add_signal_handler(signal.SIGTSTP, suspend)
    try:
        yield
    finally:
        loop.remove_signal_handler(signal.SIGTSTP)
