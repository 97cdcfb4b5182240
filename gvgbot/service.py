"""Life as a service: what systemd is told, the collector of garbage, memory, and the log."""

import contextlib
import ctypes
import gc
import os
import re
import select
import socket
from collections.abc import Iterator, Mapping
from typing import Any, Literal, TextIO, cast

import structlog
from structlog.typing import EventDict, Processor, WrappedLogger

_READER_S = 0.05  # that who reads the log may take to catch up
_LARGE = 4 << 20  # bytes; no array of a single scan is as large
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # as malloc.h has them
_SEVERITY = {"debug": 7, "info": 6, "warning": 4, "error": 3, "critical": 2}  # as syslog counts


class Notifier:
    """Tells the service manager how things are; does nothing if there is none."""

    def __init__(self, address: str | None) -> None:
        """`address` is a socket's path, or `@` and an abstract name; None: nobody listens."""
        self._address = re.sub("^@", "\0", address) if address else None
        self._status = ""

    @classmethod
    def from_environment(cls) -> "Notifier":
        """For the service manager that started this process, if one did."""
        return cls(os.environ.get("NOTIFY_SOCKET"))

    def ready(self) -> None:
        """The robot works."""
        self._send("READY=1")

    def stopping(self) -> None:
        """The robot is about to end."""
        self._send("STOPPING=1")

    def alive(self) -> None:
        """The control loop is not stuck."""
        self._send("WATCHDOG=1")

    def status(self, text: str) -> None:
        """What the robot does, for people; sent only when it has changed."""
        if text != self._status:
            self._status = text
            self._send(f"STATUS={text}")

    def _send(self, message: str) -> None:
        if self._address is None:
            return
        with (
            contextlib.suppress(OSError),  # a manager that does not listen is its own affair
            socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as link,
        ):
            link.sendto(message.encode(), self._address)


class _Unbreakable:
    """A text stream that may go away, as a terminal does, without taking the robot with it.

    Nor does it hold the robot up while nobody reads it, as after Ctrl-S: what is written then is
    left out, and the next line says how many are `missing`.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream, self._line = stream, ""
        self._missing = 0

    def write(self, text: str) -> int:
        self._line += text
        return len(text)

    def flush(self) -> None:
        line, self._line = self._line, ""
        if not _takes_more(self._stream, 0.0 if self._missing else _READER_S):
            self._missing += 1
            return
        self._missing = 0
        with contextlib.suppress(OSError):
            self._stream.write(line)
            self._stream.flush()

    def own_up(self, logger: WrappedLogger, method: str, event: EventDict) -> EventDict:
        """The event with the number of lines that are missing before it."""
        return {**event, "missing": self._missing} if self._missing else event


def _takes_more(stream: TextIO, patience_s: float) -> bool:
    """Whether a line can be written now or soon, as far as the system tells."""
    try:
        return bool(select.select([], [stream], [], patience_s)[1])
    except (OSError, ValueError):  # it is no file, or has a number that is too high
        return True


@contextlib.contextmanager
def start_left_out_of_collections() -> Iterator[None]:
    """Let the garbage collector pass over all that is there by now, most of which stays.

    To go through it takes longer than a control cycle.
    """
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def give_back_large_arrays() -> None:
    """Let the C library get each large array from the system, and give it back when it is freed.

    By itself glibc learns to keep their memory, where smaller things that stay are put in between:
    whoever has drawn a large building once would need the memory of that for good.
    """
    with contextlib.suppress(AttributeError):  # another C library
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_M_MMAP_THRESHOLD, _LARGE)
        mallopt(_M_TRIM_THRESHOLD, 4 * _LARGE)


def set_up_logging(
    stream: TextIO, environment: Mapping[str, str], least: Literal["info", "warning"] = "info"
) -> None:
    """Log to the stream: for people, or as JSON with a severity where a journal reads along."""
    unbreakable = _Unbreakable(stream)
    form = (
        _for_journal()
        if _is_journal(stream, environment)
        else _for_people(colors=stream.isatty() and not environment.get("NO_COLOR"))
    )
    structlog.configure(
        processors=[unbreakable.own_up, *form],
        wrapper_class=structlog.make_filtering_bound_logger(least),
        logger_factory=structlog.PrintLoggerFactory(cast(TextIO, unbreakable)),
        cache_logger_on_first_use=False,
    )


def _is_journal(stream: TextIO, environment: Mapping[str, str]) -> bool:
    """Whether a journal reads the stream: terminals, too, inherit the variable of a service."""
    try:
        status = os.fstat(stream.fileno())
    except OSError:
        return False
    return environment.get("JOURNAL_STREAM") == f"{status.st_dev}:{status.st_ino}"


def _for_people(*, colors: bool) -> list[Processor]:
    return [
        structlog.processors.add_log_level,
        _without_none,
        structlog.processors.TimeStamper(fmt="%H:%M:%S", utc=False),
        structlog.dev.ConsoleRenderer(colors=colors, sort_keys=False),
    ]


def _for_journal() -> list[Processor]:
    return [
        structlog.processors.add_log_level,
        _without_none,
        structlog.processors.JSONRenderer(ensure_ascii=False),
        _with_severity,
    ]


def _without_none(logger: WrappedLogger, method: str, event: EventDict) -> EventDict:
    return {key: value for key, value in event.items() if value is not None}


def _with_severity(logger: WrappedLogger, method: str, line: Any) -> str:
    """The line with the prefix by which the journal knows its severity."""
    return f"<{_SEVERITY.get(method, 6)}>{line}"
