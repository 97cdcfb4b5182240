"""Programs in processes of their own, none of which outlives its test, and waiting for them."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Event

PATIENCE = 15.0  # s, for a busy machine


@contextmanager
def gvgbot(
    *arguments: str, cwd: Path | None = None, python: Sequence[str] = (sys.executable,)
) -> Iterator["subprocess.Popen[str]"]:
    """A gvgbot process with its log on a pipe, and no service manager."""
    command = [*python, "-m", "gvgbot", *arguments]
    environment = {k: v for k, v in os.environ.items() if k != "NOTIFY_SOCKET"}
    with subprocess.Popen(
        command,
        cwd=cwd,
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    ) as process:
        try:
            yield process
        finally:
            process.kill()


@contextmanager
def program(source: str, *arguments: str) -> Iterator["subprocess.Popen[str]"]:
    """A Python program, as soon as it says that it is there."""
    command = [sys.executable, "-c", source, *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "there\n"
            yield process
        finally:
            process.kill()


def until(is_so: Callable[[], bool], *, patience_s: float = PATIENCE) -> float:
    """Wait until something is so; the seconds that took."""
    start, pause = time.perf_counter(), Event()
    while not is_so():
        assert time.perf_counter() - start < patience_s, "it did not become so"
        pause.wait(0.02)
    return time.perf_counter() - start
