"""What may be asked of a robot over the network, with which arguments, and how it answers."""

from dataclasses import dataclass
from typing import Annotated, Literal, get_args

import msgspec

RequestName = Literal[
    "pause",
    "resume",
    "stop",
    "home",
    "goto",
    "patrol",
    "coverage",
    "explore",
    "relocalise",
    "save",
    "set",
]
REQUESTS: tuple[RequestName, ...] = get_args(RequestName)
STOPS: tuple[RequestName, ...] = ("pause", "stop")  # are heard in any crowd
MESSAGEPACK, JSON = "application/msgpack", "application/json"

LONGEST_ARGUMENTS = 25_000  # bytes; of the most vertices, by the largest ids, in JSON
_LONGEST_KEY = 100  # characters
_FARTHEST_M = 1e5
_VERTICES = msgspec.Meta(min_length=1, max_length=1000)  # if some are named


class Nothing(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """No arguments."""


class Goto(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True
):
    """Where to drive: to a vertex, or to a point; one of both."""

    vertex: int | None = None  # its id
    x: float | None = None  # m, map frame
    y: float | None = None  # m, map frame

    def __post_init__(self) -> None:
        """Raises ValueError unless it is one place."""
        is_point = self.x is not None and self.y is not None
        is_partial = (self.x is None) != (self.y is None)
        if is_partial or (self.vertex is not None) == is_point:
            raise ValueError("give either vertex, or x and y")


class Patrol(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True
):
    """Which vertices to visit, over and over."""

    vertices: Annotated[tuple[int, ...], _VERTICES] = ()  # left out: all


class Set(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A key of the configuration, and what it shall be from now on."""

    key: Annotated[str, msgspec.Meta(max_length=_LONGEST_KEY)]
    value: bool | int | float | Annotated[str, msgspec.Meta(max_length=_LONGEST_KEY)]


Arguments = Nothing | Goto | Patrol | Set
_KINDS: dict[str, type[Arguments]] = {"goto": Goto, "patrol": Patrol, "set": Set}


class Answer(msgspec.Struct, frozen=True):
    """What became of a request."""

    done: bool  # false: refused, and nothing has changed
    text: str  # what happens now, or why not; for people


@dataclass(frozen=True, slots=True)
class Asked:
    """A request as it came, which may be wrong in every way."""

    name: str
    data: bytes  # the arguments
    encoding: str  # of the arguments
    origin: str  # who asks, as far as that is known


def request_key(robot: str, name: str) -> str:
    """The key expression by which a robot is asked for something."""
    return f"gvgbot/{robot}/ctl/{name}"


def in_words(name: str, arguments: Arguments) -> str:
    """The request as a person would write it."""
    match arguments:
        case Goto(vertex=None, x=float(x), y=float(y)):
            return f"{name} {x:g} {y:g}"
        case Goto(vertex=vertex):
            return f"{name} {vertex}"
        case Patrol(vertices=vertices):
            return " ".join([name, *map(str, vertices)])
        case Set(key=key, value=value):
            return f"{name} {key} {msgspec.json.encode(value).decode()}"
        case _:
            return name


def kind_of(name: str) -> type[Arguments]:
    """The type of a request's arguments."""
    return _KINDS.get(name, Nothing)


def parse(name: str, data: bytes, encoding: str) -> Arguments:
    """The arguments in a payload, JSON if its encoding says so, else MessagePack; empty for none.

    Raises ValueError that says what is wrong with them, or with the name.
    """
    if name not in REQUESTS:
        raise ValueError(f"there is no such request; there are {', '.join(REQUESTS)}")
    if len(data) > LONGEST_ARGUMENTS:
        raise ValueError(f"wrong arguments of {name}: more than {LONGEST_ARGUMENTS} bytes")
    if not data:
        data, encoding = b"{}", JSON
    decode = msgspec.json.decode if encoding.startswith(JSON) else msgspec.msgpack.decode
    try:
        arguments = decode(data, type=kind_of(name))
    except (msgspec.MsgspecError, RecursionError) as error:
        is_known = encoding.startswith((JSON, MESSAGEPACK))
        guess = "" if is_known else f", taken for {MESSAGEPACK} (its encoding does not say {JSON})"
        raise ValueError(f"wrong arguments of {name}{guess}: {error}") from error
    if isinstance(arguments, Goto):
        _check_near(arguments)
    return arguments


def _check_near(goal: Goto) -> None:
    """Raises ValueError for a coordinate that is no number, or far from any building."""
    for axis, metres in (("x", goal.x), ("y", goal.y)):
        if metres is not None and not abs(metres) <= _FARTHEST_M:  # what is no number is never so
            allowed = f"a number from {-_FARTHEST_M:.0f} to {_FARTHEST_M:.0f}"
            raise ValueError(f"wrong arguments of goto: {axis} is {metres:g}, must be {allowed}")
