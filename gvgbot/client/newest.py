"""The newest sample of a topic, between zenoh's threads and whoever reads: a loop or a thread."""

import asyncio
import contextlib
import threading
import time
from collections.abc import AsyncIterator, Callable, Iterator
from functools import partial
from typing import Generic, TypeVar

import msgspec

from gvgbot.errors import GvgbotError
from gvgbot.topics import Topic

T = TypeVar("T")

# What msgspec raises for bytes that are no message: also for letters that are none, and for depth.
UNREADABLE = (msgspec.MsgspecError, UnicodeDecodeError, RecursionError)


class Newest(Generic[T]):
    """Holds one value; whoever is slow misses some, and memory never grows.

    Iterate over it, with `for` or with `async for`: first comes the newest value, if there is one,
    then each newer one as soon as it is there. The iteration ends when the robot is closed.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._wakes: set[Callable[[], None]] = set()
        self._read: Callable[[], T] | None = None
        self._count = 0
        self._arrived = 0.0
        self._closed = False

    def put(self, read: Callable[[], T]) -> None:
        """Replace what was there by what `read` will return to each reader; from any thread."""
        with self._changed:
            self._read, self._count = read, self._count + 1
            self._arrived = time.perf_counter()
            self._wake()

    def swap(self, read: Callable[[], T] | None) -> Callable[[], T] | None:
        """Replace what was there, perhaps by nothing, and return it; from any thread."""
        with self._changed:
            before, self._read = self._read, read
            self._count += 1
            self._wake()
        return before

    def close(self) -> None:
        """End all iterations; from any thread."""
        with self._changed:
            self._closed = True
            self._wake()

    def _wake(self) -> None:
        self._changed.notify_all()
        for wake in self._wakes:
            wake()

    def _has_news(self, seen: int) -> bool:
        return self._closed or (self._read is not None and self._count > seen)

    @property
    def latest(self) -> T | None:
        """The newest value, None before the first. Raises GvgbotError if it cannot be read."""
        read = self._read
        return None if read is None else read()

    @property
    def age(self) -> float | None:
        """Seconds since the newest value arrived here, None before the first."""
        return None if self._read is None else time.perf_counter() - self._arrived

    def __iter__(self) -> Iterator[T]:
        """Wait for values in this thread. Raises GvgbotError for one that cannot be read."""
        seen = 0
        while True:
            with self._changed:
                self._changed.wait_for(partial(self._has_news, seen))
                if self._closed:
                    return
                seen, read = self._count, self._read
            assert read is not None
            yield read()

    async def __aiter__(self) -> AsyncIterator[T]:
        """Wait for values in the running loop. Raises GvgbotError for one that cannot be read."""
        loop, fresh = asyncio.get_running_loop(), asyncio.Event()
        seen = 0

        def wake() -> None:
            with contextlib.suppress(RuntimeError):  # a loop that was closed while we waited
                loop.call_soon_threadsafe(fresh.set)

        with self._changed:
            self._wakes.add(wake)
        try:
            while not self._closed:
                with self._changed:
                    count, read = self._count, self._read
                if read is None or count == seen:
                    await fresh.wait()
                    fresh.clear()
                    continue
                seen = count
                yield read()
        finally:
            with self._changed:
                self._wakes.discard(wake)


def decoded(topic: Topic, payload: type[T], encoding: str, data: bytes) -> T:
    """The value in a sample. Raises GvgbotError if it is of another version, or damaged."""
    if encoding != topic.encoding:
        raise GvgbotError(
            f"the robot sends {_schema(encoding)}, this program reads {_schema(topic.encoding)}: "
            "install the same gvgbot on both"
        )
    try:
        return msgspec.msgpack.decode(data, type=payload)
    except UNREADABLE as error:
        raise GvgbotError(f"a damaged sample of {topic.name}: {error}") from error


def _schema(encoding: str) -> str:
    """Type and version, as an encoding has them after the format."""
    return encoding.rpartition(";gvgbot.")[2]
