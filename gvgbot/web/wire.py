"""What passes between the server and the page, and in which form.

To the page: MessagePack, a pair of a kind and a value. State, map, trajectory, plan, odometry,
scan, events and health are as they travel between robot and client, and so is each tile of the
grid; a life is an id, and what comes before another one is void; the others are below. From the
page: a wish, in JSON.
"""

from typing import Annotated, Any, Literal, get_args

import msgspec

from gvgbot.client.presence import Word
from gvgbot.requests import JSON, Arguments, RequestName, parse
from gvgbot.tiles import Tile
from gvgbot.topics import Events, Health, Map, Odometry, Plan, Scan, State, Trajectory

Known = Literal[
    "state", "map", "floor", "tile", "trajectory", "plan", "odometry", "scan", "events", "health"
]
Kind = Known | Literal["life", "link", "history", "reply"]
KNOWN: tuple[Known, ...] = get_args(Known)

_LARGEST = 2**53 - 1  # id that a browser counts to


class Link(msgspec.Struct, frozen=True, kw_only=True):
    """How the server stands with the robot."""

    robot: str | None  # its name, as far as it is known
    endpoint: str  # where the server looks for it
    word: Word | Literal["unreachable"]  # the latter: no connection to the robot's address
    for_s: float  # since when
    others: tuple[str, ...] = ()  # who else is there, if the robot is absent
    trouble: str = ""  # why it is unreachable


class History(msgspec.Struct, frozen=True, kw_only=True):
    """How some values went, for the plots; columns of equal length."""

    stamps: tuple[float, ...]  # s, the robot's monotonic clock
    sigmas: tuple[float | None, ...]  # m, of the position; None where that is not known
    batteries: tuple[float | None, ...]  # of a full charge, 0..1


class Floor(msgspec.Struct, frozen=True, kw_only=True):
    """Begins a grid; the tiles that were sent before belong to it no more."""

    resolution: float  # m, the side of a cell
    side: int  # cells along the side of a tile


class Reply(msgspec.Struct, frozen=True, kw_only=True):
    """What became of a wish."""

    id: int
    done: bool
    text: str  # for people


class Wish(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What somebody at the page wants of the robot."""

    id: Annotated[int, msgspec.Meta(ge=0, le=_LARGEST)]  # for the reply
    name: RequestName
    arguments: dict[str, Any] = {}

    @property
    def typed(self) -> Arguments:
        """The arguments of the request. Raises ValueError if they do not fit."""
        return parse(self.name, msgspec.json.encode(self.arguments), JSON)


Told = State | Map | Floor | Tile | Trajectory | Plan | Odometry | Scan | Events | Health
Value = Told | Link | History | Reply | str


def frame(kind: Kind, value: Value) -> bytes:
    """A message to the page."""
    return msgspec.msgpack.encode((kind, value))


def wish(text: str | bytes) -> Wish:
    """A message from the page. Raises ValueError if it is none."""
    try:
        return msgspec.json.decode(text, type=Wish)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise ValueError(f"no wish: {error}") from error
