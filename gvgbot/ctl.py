"""One request to a robot from the command line: what it says, or why it will not."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

import msgspec

from gvgbot import client
from gvgbot.client import Asking, Refused, Robot
from gvgbot.errors import GvgbotError, UsageError
from gvgbot.requests import REQUESTS
from gvgbot.spelling import nearest

Number = TypeVar("Number", int, float)


def ctl(
    words: Sequence[str], endpoint: str, zenoh_file: Path | None, say: Callable[[str], None]
) -> int:
    """Ask for what the words say, and say the answer; 0.

    Raises UsageError for words that are no request, GvgbotError if the robot refuses or is away.
    """
    name, request, arguments = _split(words)
    ask = _asker(request, arguments)
    name = name or client.only_robot(endpoint, zenoh_file=zenoh_file)
    with client.connect(name, endpoint, zenoh_file=zenoh_file) as robot:
        say(_answer(robot, ask))
    return 0


def _answer(robot: Robot, ask: Callable[[Robot], Asking]) -> str:
    """What the robot answers. Raises GvgbotError, which names who is there instead of it."""
    try:
        return ask(robot).result()
    except Refused:
        raise
    except GvgbotError as error:
        if robot.presence.word == "absent" and (others := robot.others()):
            there = f"there is {', '.join(others)}"
            raise GvgbotError(f"no robot named {robot.name} here; {there}") from error
        raise


def _split(words: Sequence[str]) -> tuple[str | None, str, Sequence[str]]:
    """The robot's name, None if it is left out, the request and its arguments."""
    is_named = words[0] not in REQUESTS or (len(words) > 1 and words[1] in REQUESTS)
    name, rest = (words[0], words[1:]) if is_named else (None, words)
    if not rest or rest[0] not in REQUESTS:
        raise UsageError(_no_request(words))
    return name, rest[0], rest[1:]


def _no_request(words: Sequence[str]) -> str:
    """What is wrong with words of which neither the first nor the second is a request."""
    for word in reversed(words[:2]):  # the first one may be a robot
        if (near := nearest(word.lower(), REQUESTS)) is not None:
            return f"{word!r} is no request: did you mean {near}?"
    is_robot_first = len(words) > 1 and words[1].isidentifier()  # and no number
    odd = words[1] if is_robot_first else words[0]
    return f"{odd!r} is no request: there are {', '.join(REQUESTS)}"


def _asker(request: str, arguments: Sequence[str]) -> Callable[[Robot], Asking]:
    """How to ask for it. Raises UsageError if the arguments do not fit."""
    match request, arguments:
        case "goto", [vertex]:
            number = _number(int, vertex, "the id of a vertex")
            return lambda robot: robot.goto(number)
        case "goto", [x, y]:
            point = _number(_metres, x, "a number"), _number(_metres, y, "a number")
            return lambda robot: robot.goto(*point)
        case "patrol", words:
            vertices = [_number(int, word, "the id of a vertex") for word in words]
            return lambda robot: robot.patrol(*vertices)
        case "set", [key, value]:
            return lambda robot: robot.set(key, _value(value))
        case "goto", _:
            raise UsageError("goto needs a vertex, or x and y: goto 7, goto 1.5 -2")
        case "set", _:
            raise UsageError("set needs a key and a value: set robot.limits.max_speed_mps 0.3")
        case _, []:
            return _plain(request)
        case _:
            raise UsageError(f"{request} takes no arguments")


def _plain(request: str) -> Callable[[Robot], Asking]:
    return lambda robot: getattr(robot, request)()


def _number(kind: Callable[[str], Number], text: str, allowed: str) -> Number:
    try:
        return kind(text)
    except ValueError as error:
        raise UsageError(f"{text!r} must be {allowed}") from error


def _metres(text: str) -> float:
    """Raises ValueError for what is no number; nan is that by its name."""
    if math.isnan(metres := float(text)):
        raise ValueError(text)
    return metres


def _value(text: str) -> bool | float | str:
    """A number, true or false if it is one, else the text itself."""
    try:
        return msgspec.json.decode(text, type=bool | int | float)
    except msgspec.MsgspecError:
        return text
