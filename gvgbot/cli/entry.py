"""The command line: arguments in, exit status out, one clear line for every failure."""

import contextlib
import errno
import io
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import FrameType

from gvgbot import __version__
from gvgbot.atomic_files import is_disk_full
from gvgbot.cli.arguments import BAD_USAGE, Parser
from gvgbot.cli.devices import add_check, add_twin
from gvgbot.cli.explore import add_explore
from gvgbot.cli.maps import add_map
from gvgbot.cli.remote import add_ctl, add_monitor, add_web
from gvgbot.cli.replay import add_replay
from gvgbot.cli.run import add_install_service, add_run
from gvgbot.errors import GvgbotError, UsageError, underlying

FAILURE, INTERRUPTED = 1, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status; wrong arguments raise SystemExit(2)."""
    _fill_streams()
    with _ctrl_c_shut_out_if_ignored(), _any_stop_as_by_ctrl_c():
        status = status_of(lambda: _done(arguments))
    if status == INTERRUPTED:  # once more would break into what Python does at its end
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    return status


def _done(arguments: Sequence[str] | None) -> int:
    options = parser().parse_args(arguments)
    status: int = options.command(options)
    return status


def _fill_streams() -> None:
    """Let nothing take the place of a closed stream: what is printed would go into a port.

    What a terminal cannot show, such as the name of a file in another encoding, is spelt out.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open(mode, encoding="utf-8"))  # noqa: SIM115
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


@contextlib.contextmanager
def _ctrl_c_shut_out_if_ignored() -> Iterator[None]:
    """Let tasks be ended in order though Ctrl-C is ignored, as `&` in a script has it.

    asyncio takes no signal that is ignored, and whatever else ends the program would break into a
    task. One that is blocked does not come either: threads that begin later have it blocked, too.
    """
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _any_stop_as_by_ctrl_c() -> Iterator[None]:
    """Let a command that is told to end, or loses its terminal, tidy up as after Ctrl-C."""
    taken = [
        number
        for number in (signal.SIGTERM, signal.SIGHUP)
        if signal.getsignal(number) is signal.SIG_DFL  # `nohup` has it ignored
    ]
    for number in taken:
        signal.signal(number, _interrupt)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)


def status_of(command: Callable[[], int]) -> int:
    """The command's own exit status, or 1 if it failed, 2 if it was asked wrongly, 130 if stopped.

    The reason goes to stderr; only a mistake of the program leaves a traceback.
    """
    try:
        return _ungrouped(command)
    except KeyboardInterrupt:
        return _fail("interrupted", INTERRUPTED)
    except UsageError as error:
        return _fail(str(error), BAD_USAGE)
    except GvgbotError as error:
        return _fail(str(error), FAILURE)
    except MemoryError as error:  # NumPy says how much it wanted, Python nothing
        wanted = f" ({error})" if str(error) else ""
        return _fail(f"out of memory{wanted}: take a smaller or coarser map", FAILURE)
    except BrokenPipeError:  # whoever read our output has gone, as `head` does
        _drop_output()
        return FAILURE
    except PermissionError as error:
        if error.filename is None:
            raise
        return _fail(f"{error.filename}: permission denied: choose another, or sudo", FAILURE)
    except OSError as error:
        if is_disk_full(error):
            return _fail(f"{error.filename or 'output'}: no space left: make room", FAILURE)
        if error.errno != errno.ENAMETOOLONG:
            raise
        return _fail(f"{error.filename}: {error.strerror}: choose a shorter one", BAD_USAGE)


def _drop_output() -> None:
    """Let nobody hear of what is still to be written, which Python tries once more at its end."""
    with contextlib.suppress(OSError), Path(os.devnull).open("wb") as nobody:
        os.dup2(nobody.fileno(), sys.stdout.fileno())


def _ungrouped(command: Callable[[], int]) -> int:
    """Let what one of several tasks met with be told as if the command had met with it itself."""
    try:
        return command()
    except BaseExceptionGroup as errors:
        raise underlying(errors) from None


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Do what Ctrl-C does now: a running loop has it end its tasks."""
    handler = signal.getsignal(signal.SIGINT)
    (handler if callable(handler) else signal.default_int_handler)(number, frame)


def _fail(message: str, status: int) -> int:
    """Say why on stderr, a line each; the status."""
    for line in message.splitlines():
        print(f"gvgbot: {line}", file=sys.stderr)
    return status


def parser() -> Parser:
    """Of all commands and their options."""
    root = Parser(
        prog="gvgbot",
        description="A robot that maps a building by itself, along its generalized Voronoi graph.",
    )
    root.add_argument("--version", action="version", version=f"gvgbot {__version__}")
    commands = root.add_subparsers(title="commands", metavar="COMMAND", required=True)
    add_explore(commands)
    add_run(commands)
    add_twin(commands)
    add_check(commands)
    add_install_service(commands)
    add_monitor(commands)
    add_web(commands)
    add_ctl(commands)
    add_map(commands)
    add_replay(commands)
    return root
