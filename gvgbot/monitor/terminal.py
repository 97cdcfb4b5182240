"""The terminal that a person sits at: whether there is one, its keys, and how it was before."""

import asyncio
import os
import sys
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console

from gvgbot.errors import UsageError

_NO_TERMINAL = (
    "the monitor draws on a terminal, and this is none; programs watch a robot with gvgbot.client"
)


def open_console() -> Console:
    """The console on stdout. Raises UsageError if nothing can be drawn there."""
    console = Console(highlight=False)
    if not sys.stdout.isatty() or console.is_dumb_terminal:
        raise UsageError(_NO_TERMINAL)
    if "utf" not in console.encoding.lower():
        raise UsageError(
            f"the monitor draws with characters that {console.encoding} lacks: use a UTF-8 locale, "
            "such as LC_ALL=C.UTF-8"
        )
    return console


@contextmanager
def keys(on_key: Callable[[str], None]) -> Iterator[None]:
    """Give each key that is pressed to a function of the running loop; without a keyboard, none.

    Keys are not echoed, and need no Enter. Ctrl-Z does nothing, since it would leave the shell with
    a picture; Ctrl-C remains a signal, and takes away no key: a read that waits for a key which was
    there a moment ago would hold up the loop.
    """
    if not sys.stdin.isatty():
        yield
        return
    keyboard, loop = sys.stdin.fileno(), asyncio.get_running_loop()
    before = termios.tcgetattr(keyboard)

    def read() -> None:
        pressed = os.read(keyboard, 64)
        if not pressed:
            loop.remove_reader(keyboard)
        for key in pressed.decode(errors="ignore"):
            on_key(key)

    tty.setcbreak(keyboard)
    mode = termios.tcgetattr(keyboard)
    mode[3] |= termios.NOFLSH
    mode[6][termios.VSUSP] = b"\0"
    termios.tcsetattr(keyboard, termios.TCSADRAIN, mode)
    loop.add_reader(keyboard, read)
    try:
        yield
    finally:
        loop.remove_reader(keyboard)
        termios.tcsetattr(keyboard, termios.TCSAFLUSH, before)
