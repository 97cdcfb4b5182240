"""The errors a user or the daemon can do something about."""

import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager


class GvgbotError(Exception):
    """A failure with one clear line that says what to do; the command line exits with 1."""


class ExtraMissing(GvgbotError):
    """A part of the program needs packages that only an extra installs."""

    def __init__(self, what: str, extra: str) -> None:
        """Say how to install it where this program is, whichever environment the shell is in."""
        command = [sys.executable, "-m", "pip", "install", f"gvgbot[{extra}]"]
        super().__init__(f"{what}: {shlex.join(command)}")


class UsageError(GvgbotError):
    """The command or a file it names is wrong; the command line exits 2."""


class ConfigError(UsageError):
    """A configuration file or override is wrong: file, key path, value and what is allowed."""


class WorldError(UsageError):
    """A world file is missing, unreadable or unfit, or the start pose does not fit into it."""


class DeviceLost(GvgbotError):
    """The device fell silent or its link is gone: stop, and reopen with back-off."""


class DeviceRefused(GvgbotError):
    """The device answered that it cannot do what was asked."""


class Deadlock(GvgbotError):
    """In virtual time every task waits for something that nothing will ever do."""


@contextmanager
def extra_for(what: str, extra: str, *packages: str) -> Iterator[None]:
    """Turn the lack of one of the packages into an ExtraMissing that says what needs it."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] not in packages:
            raise
        raise ExtraMissing(what, extra) from error


def underlying(error: BaseException) -> BaseException:
    """What went wrong first, where a group of tasks only says that something did."""
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return error


def reason_of(error: BaseException) -> str:
    """One line that says what went wrong, whether or not the error itself says anything."""
    cause = underlying(error)
    return str(cause) or type(cause).__name__
