"""Stops a base while the event loop hangs, and with it every task that could."""

import asyncio
import contextlib
import os
import threading

_LOOKS = 5  # in the time that is waited


class Deadman:
    """Writes its last words to a port as long as the event loop has not run for some time.

    It is the one thread that no task waits for. What holds the interpreter itself, or stops the
    whole process, holds it as well: that is for the service manager.
    """

    def __init__(self, fd: int, last_words: bytes, patience_s: float) -> None:
        self._fd, self._last_words, self._patience = fd, last_words, patience_s
        self._loop = asyncio.get_running_loop()
        self._closed = threading.Event()
        self._beat()
        self._thread = threading.Thread(  # noqa: TID251  # a task of a hung loop does not run
            target=self._watch, name="deadman", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Watch no more; the port may be closed then."""
        self._closed.set()
        self._next.cancel()
        self._thread.join()

    def _beat(self) -> None:
        self._alive = self._loop.time()
        self._next = self._loop.call_later(self._patience / _LOOKS, self._beat)

    def _watch(self) -> None:
        while not self._closed.wait(self._patience / _LOOKS):
            if self._loop.time() - self._alive > self._patience:
                with contextlib.suppress(OSError):
                    os.write(self._fd, self._last_words)
