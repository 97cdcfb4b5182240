"""What commands have in common: kinds of arguments, shared options, and printing a line."""

import argparse
import contextlib
import re
import sys
from collections.abc import Callable, Sequence
from math import inf, isfinite
from pathlib import Path
from typing import Any, NoReturn, TypeAlias, TypeVar

from gvgbot.spelling import nearest

Number = TypeVar("Number", int, float)

BAD_USAGE = 2
MOST_FRAMES = 200
LAST_PORT = 65535
KEYS = {  # of the configuration, which have options of their own with some commands
    "--world": "twin.world",
    "--start": "twin.start",
    "--seed": "twin.seed",
}
NEGATIVE_NUMBER = re.compile(r"-\.?\d")


class Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, and takes -1e-3 for a number, not for an option."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self._negative_number_matcher = NEGATIVE_NUMBER

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Refuse what is not known here, so that the help that is named is that of the command.

        Words may go on behind an option: `ctl turtlebot2 --connect ADDRESS goto 7`.
        """
        parsed, unknown = super().parse_known_args(args, namespace)
        if "words" in parsed and all(_is_word(one) for one in unknown):
            parsed.words, unknown = [*parsed.words, *unknown], []
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}{self._hint(unknown)}")
        return parsed, unknown

    def _hint(self, unknown: Sequence[str]) -> str:
        """What to type instead of an option that is a key of the configuration here."""
        keys = [KEYS[name] for one in unknown if (name := one.partition("=")[0]) in KEYS]
        is_key = keys and "--set" in self._option_string_actions
        return f": here it is --set {keys[0]}=..." if is_key else ""

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse what is no choice, with the one that may have been meant."""
        if isinstance(value, str) and action.choices is not None and value not in action.choices:
            near = nearest(value, map(str, action.choices))
            if near is not None:
                said = f"there is no {value!r}: did you mean {near}?"
                raise argparse.ArgumentError(action, said)
        super()._check_value(action, value)

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print help at once; argparse would hide that there is no room for it."""
        print(message, end="", file=file or sys.stderr, flush=True)

    def error(self, message: str) -> NoReturn:
        """End with the message and the status of wrong usage."""
        self.exit(BAD_USAGE, f"{self.prog}: {message} (see {self.prog} --help)\n")


def _is_word(argument: str) -> bool:
    return not argument.startswith("-") or NEGATIVE_NUMBER.match(argument) is not None


Commands: TypeAlias = "argparse._SubParsersAction[Parser]"  # noqa: SLF001 the only name it has


def add_config(parser: argparse.ArgumentParser) -> None:
    """Let the command take a configuration, and overrides of its keys."""
    parser.add_argument(
        "config", nargs="?", type=path, metavar="CONFIG", help="default: sim.yaml, no hardware"
    )
    add_overrides(parser)


def add_overrides(parser: argparse.ArgumentParser) -> None:
    """Let the command take overrides of configuration keys."""
    parser.add_argument(
        "--set",
        dest="overrides",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="override a configuration key, such as twin.base.odometry=worn; repeatable",
    )


def same_robot(options: argparse.Namespace) -> list[str]:
    """The configuration that a command was given, in words for `gvgbot run` and its like."""
    config = [] if options.config is None else [str(options.config)]
    return [*config, *(word for override in options.overrides for word in ("--set", override))]


def add_connection(parser: argparse.ArgumentParser) -> None:
    """Let the command say how to reach robots on the network."""
    parser.add_argument(
        "--connect",
        default="tcp/127.0.0.1:7447",
        metavar="ADDRESS",
        help="of the robot or of a zenoh router (default: %(default)s)",
    )
    parser.add_argument(
        "--zenoh-file",
        type=path,
        metavar="FILE",
        help="keys and passwords, and perhaps an address: a configuration of zenoh in JSON5",
    )


def say(text: str) -> None:
    """Print a line to a person, at once, even into a pipe."""
    print(text, flush=True)


def path(text: str) -> Path:
    """A path. Raises ArgumentTypeError if there is no text: that would be the working directory."""
    if not text:
        raise argparse.ArgumentTypeError("it is empty: give a path")
    return Path(text)


def number(text: str) -> float:
    """A finite number. Raises ArgumentTypeError."""
    return _value(float, text, "a number", isfinite)


def positive(text: str) -> float:
    """A finite number above 0. Raises ArgumentTypeError."""
    return _value(float, text, "a number above 0", lambda value: 0.0 < value < inf)


def seed(text: str) -> int:
    """A whole number, not negative. Raises ArgumentTypeError."""
    return _value(int, text, "a whole number from 0 on", lambda value: value >= 0)


def host(text: str) -> str:
    """A name or an address. Raises ArgumentTypeError if there is no text: that would be all."""
    if not text:
        raise argparse.ArgumentTypeError("it is empty: 127.0.0.1 is this machine, 0.0.0.0 all")
    return text


def tcp_port(text: str) -> int:
    """A number of a TCP port. Raises ArgumentTypeError that says what there is."""
    if not text.isdecimal() or int(text) > LAST_PORT:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no port: there are 0 to {LAST_PORT}, and 0 takes any that is free"
        )
    return int(text)


def frames(text: str) -> int:
    """A number of pictures that still makes a film. Raises ArgumentTypeError."""
    allowed = f"a whole number from 2 to {MOST_FRAMES}"
    return _value(int, text, allowed, lambda value: 2 <= value <= MOST_FRAMES)


def _value(
    kind: Callable[[str], Number], text: str, allowed: str, fits: Callable[[Number], bool]
) -> Number:
    with contextlib.suppress(ValueError):
        if fits(value := kind(text)):
            return value
    raise argparse.ArgumentTypeError(f"{text!r} must be {allowed}")
