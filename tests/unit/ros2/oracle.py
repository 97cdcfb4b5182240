"""Messages of random content, ours and those of `rosbags`, an independent implementation."""

from dataclasses import fields
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import numpy as np
from rosbags.typesys import Stores, get_typestore

from gvgbot.ros2.cdr import Message, Number, Numbers, Rows

STORES = [Stores.ROS2_HUMBLE, Stores.ROS2_JAZZY, Stores.ROS2_KILTED, Stores.ROS2_LYRICAL]
STORE = get_typestore(Stores.ROS2_JAZZY)
WORDS = ["", "a", "map", "odom", "base_link", "Mitte é ∞", "x" * 37]
EXTREMES = {
    "f": [0.0, -0.0, np.nan, np.inf, -np.inf, 3.4e38, 1e-45],
    "d": [0.0, -0.0, np.nan, np.inf, -np.inf, 1.7e308, 5e-324],
}


def random_message(kind: type[Message], rng: np.random.Generator) -> Any:
    """A message with anything in it that its type allows."""
    hints = get_type_hints(kind, include_extras=True)
    return kind(**{f.name: _value(hints[f.name], rng) for f in fields(kind)})  # type: ignore[arg-type]


def _value(hint: Any, rng: np.random.Generator) -> Any:
    how = hint.__metadata__[0] if get_origin(hint) is Annotated else hint
    length = int(rng.integers(0, 12))
    match how:
        case Number(code=code):
            return _numbers(code, 1, rng).tolist()[0]
        case Numbers(number=number, count=count):
            return _numbers(number.code, length if count is None else count, rng)
        case Rows():
            return _numbers("d", 3 * length, rng).reshape(-1, 3)
    if how is str:
        return str(rng.choice(WORDS))
    if get_origin(how) is tuple:
        return tuple(random_message(get_args(how)[0], rng) for _ in range(length % 4))
    return random_message(how, rng)


def _numbers(code: str, count: int, rng: np.random.Generator) -> Any:
    if code == "?":
        return rng.random(count) < 0.5
    if code in EXTREMES:
        drawn = rng.normal(0.0, 10.0 ** rng.integers(-3, 6), count)
        extreme = rng.choice(EXTREMES[code], count)
        return np.where(rng.random(count) < 0.2, extreme, drawn).astype(code)
    limits = np.iinfo(np.dtype(code))
    return rng.integers(limits.min, limits.max, count, dtype=code, endpoint=True)


def by_rosbags(message: Message, *, little_endian: bool = True) -> bytes:
    """The same message, as `rosbags` encodes it."""
    theirs = _theirs(message)
    return bytes(STORE.serialize_cdr(theirs, message.ros_name, little_endian=little_endian))


def _theirs(message: Any) -> Any:
    hints = get_type_hints(type(message), include_extras=True)
    values: dict[str, Any] = {}
    for f in fields(message):
        value, hint = getattr(message, f.name), hints[f.name]
        how = hint.__metadata__[0] if get_origin(hint) is Annotated else hint
        match value, how:
            case _, Rows(item=item):
                point = STORE.types[item.ros_name]
                values[f.name] = [point(*row) for row in value.reshape(-1, 3).tolist()]
            case np.ndarray(), Numbers(number=number):
                values[f.name] = value.astype(number.code)
            case tuple(), _:
                values[f.name] = [_theirs(item) for item in value]
            case Message(), _:
                values[f.name] = _theirs(value)
            case _:
                values[f.name] = value
    return STORE.types[message.ros_name](**values)
