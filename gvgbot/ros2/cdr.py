"""Messages -> CDR, little endian, and the text in which ROS defines their types.

A message is a dataclass; the annotations of its fields say how they travel.
"""

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from functools import cache, partial
from typing import Annotated, Any, ClassVar, cast, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from gvgbot.geometry import Array

LITTLE_ENDIAN = b"\x00\x01\x00\x00"  # what a message begins with; alignment counts from behind it

Write = Callable[[bytearray, Any], None]


class Message:
    """What all messages have in common: the name of their type, such as std_msgs/msg/Header."""

    ros_name: ClassVar[str]
    type_hash: ClassVar[str] = ""  # RIHS01, of those that travel by themselves


@dataclass(frozen=True, slots=True)
class Number:
    """A number: the name that ROS has for its type, and its code for `struct` and numpy."""

    name: str
    code: str


@dataclass(frozen=True, slots=True)
class Numbers:
    """An array of numbers; without a count its length travels, too."""

    number: Number
    count: int | None = None


@dataclass(frozen=True, slots=True)
class Rows:
    """An array (N, fields) instead of N messages whose fields are all float64."""

    item: type[Message]


BOOL, INT8, UINT8 = Number("bool", "?"), Number("int8", "b"), Number("uint8", "B")
INT32, UINT32 = Number("int32", "i"), Number("uint32", "I")
FLOAT32, FLOAT64 = Number("float32", "f"), Number("float64", "d")

Bool = Annotated[bool, BOOL]
Int32 = Annotated[int, INT32]
UInt32 = Annotated[int, UINT32]
Float32 = Annotated[float, FLOAT32]
Float64 = Annotated[float, FLOAT64]
Bytes = Annotated[NDArray[Any], Numbers(UINT8)]
Int8s = Annotated[NDArray[Any], Numbers(INT8)]
Float32s = Annotated[Array, Numbers(FLOAT32)]
Matrix6 = Annotated[Array, Numbers(FLOAT64, 36)]


def encode(message: Message) -> bytes:
    """The message as it travels. Raises struct.error for a number that has no place there."""
    out, kind = bytearray(LITTLE_ENDIAN), cast("Any", type(message))
    _writer(kind)(out, message)
    return bytes(out)


@cache
def _writer(kind: Any) -> Write:
    """What writes values of a kind: numbers, text, messages, or many of them."""
    match kind:
        case Number(code=code):
            number = struct.Struct("<" + code)
            return lambda out, value: _put(out, number.size, number.pack(value))
        case Numbers(number=number, count=count):
            return partial(_write_array, np.dtype("<" + number.code), count is None)
        case Rows():
            return partial(_write_array, np.dtype("<f8"), True)
    if kind is str:
        return _write_text
    if get_origin(kind) is tuple:
        return partial(_write_items, _writer(get_args(kind)[0]))
    parts = [(name, _writer(part)) for name, part in _parts(kind)]

    def write(out: bytearray, value: Any) -> None:
        for name, write_part in parts:
            write_part(out, getattr(value, name))

    return write


def _parts(kind: type[Message]) -> Iterator[tuple[str, Any]]:
    """The fields of a message, each with what says how it travels."""
    hints = get_type_hints(kind, include_extras=True)
    for field in fields(kind):  # type: ignore[arg-type]  # all messages are dataclasses
        hint = hints[field.name]
        yield field.name, hint.__metadata__[0] if get_origin(hint) is Annotated else hint


def _put(out: bytearray, size: int, data: bytes) -> None:
    """Add data whose parts are so large, in bytes, at the next place that fits them."""
    out += bytes((len(LITTLE_ENDIAN) - len(out)) % size) + data


def _write_array(dtype: np.dtype[Any], with_length: bool, out: bytearray, value: Array) -> None:
    if with_length:
        _put(out, 4, struct.pack("<I", len(value)))
    if len(value):
        _put(out, dtype.itemsize, np.asarray(value).astype(dtype).tobytes())


def _write_text(out: bytearray, value: str) -> None:
    data = value.encode() + b"\0"
    _put(out, 4, struct.pack("<I", len(data)) + data)


def _write_items(write: Write, out: bytearray, value: tuple[Message, ...]) -> None:
    _put(out, 4, struct.pack("<I", len(value)))
    for item in value:
        write(out, item)


def decode_twist(data: bytes, *, stamped: bool) -> tuple[float, float]:
    """Velocity ahead (m/s) and turn rate (rad/s) of a Twist, or of a TwistStamped.

    What else a twist can say no wheels could follow. Raises ValueError for data that are no such
    message.
    """
    if data[:2] not in (b"\0\0", b"\0\1"):
        raise ValueError("not plain CDR")
    order, body = "<" if data[1] else ">", data[len(LITTLE_ENDIAN) :]
    try:
        begin = 0
        if stamped:
            (length,) = struct.unpack_from(order + "I", body, _FRAME_AT)
            begin = -(-(_FRAME_AT + 4 + length) // 8) * 8
        linear, *_, angular = struct.unpack_from(order + "6d", body, begin)
    except struct.error as error:
        raise ValueError("cut short") from error
    return linear, angular


_FRAME_AT = 8  # bytes; where the length of a header's frame_id is


def definition(kind: type[Message]) -> str:
    """The text that defines a type and all that it is made of, as files of recordings have it."""
    needed: dict[type[Message], None] = {}
    _collect(kind, needed)
    own, *others = (f"MSG: {_short(part)}\n{_lines(part)}" for part in needed)
    separator = "=" * 80 + "\n"
    return separator.join([own.split("\n", 1)[1], *others])


def _collect(kind: type[Message], found: dict[type[Message], None]) -> None:
    found.setdefault(kind)
    for _, part in _parts(kind):
        item = _item(part)
        if isinstance(item, type) and issubclass(item, Message) and item not in found:
            _collect(item, found)


def _item(part: Any) -> Any:
    """What a field holds, or holds many of."""
    if isinstance(part, Rows):
        return part.item
    return get_args(part)[0] if get_origin(part) is tuple else part


def _lines(kind: type[Message]) -> str:
    return "".join(f"{_type_name(part)} {name}\n" for name, part in _parts(kind))


def _type_name(part: Any) -> str:
    match part:
        case Number(name=name):
            return name
        case Numbers(number=number, count=count):
            return f"{number.name}[{'' if count is None else count}]"
    item = _item(part)
    name = "string" if item is str else _short(item)
    return name if item is part else name + "[]"


def _short(kind: type[Message]) -> str:
    return kind.ros_name.replace("/msg/", "/")
