"""A payload is a row of sub-payloads, each an id, a length and data; here they become values.

What is known under which id is a table of decoders, and one of encoders, that the caller brings.
"""

from collections.abc import Callable, Container, Iterable, Iterator
from dataclasses import dataclass, fields
from operator import attrgetter
from struct import Struct
from typing import Any

Decoder = Callable[[bytes], Any]
Encoder = Callable[[Any], bytes]


@dataclass(frozen=True, slots=True)
class Unknown:
    """A sub-payload with an unknown id, or a length that its id does not have."""

    id: int
    data: bytes


@dataclass(frozen=True, slots=True)
class Truncated:
    """The end of a payload that promises more bytes than there are: do not trust the frame."""

    data: bytes


def split_payload(payload: bytes) -> Iterator[tuple[int, bytes] | Truncated]:
    """The (id, data) of each sub-payload, by its stated length; `Truncated` for a short end."""
    start, size = 0, len(payload)
    while start < size:
        end = start + 2 + payload[start + 1] if start + 1 < size else size + 1
        if end > size:
            yield Truncated(payload[start:])
            return
        yield payload[start], payload[start + 2 : end]
        start = end


def decode_parts(
    payload: bytes, decoders: dict[int, Decoder], unread: Container[int] = ()
) -> list[Any]:
    """The values in a payload, without those with `unread` ids.

    What the decoders do not know or refuse becomes `Unknown`.
    """
    parts: list[Any] = []
    for item in split_payload(payload):
        if isinstance(item, Truncated):
            parts.append(item)
            continue
        number, data = item
        if number in unread:
            continue
        decode = decoders.get(number)
        value = None if decode is None else decode(data)
        parts.append(Unknown(number, data) if value is None else value)
    return parts


def encode_parts(parts: Iterable[Any], encoders: dict[type, tuple[int, Encoder]]) -> bytes:
    """The payload with these values, in this order. Raises struct.error if a field is too large."""
    chunks = []
    for part in parts:
        if isinstance(part, Truncated):
            chunks.append(part.data)
            continue
        if isinstance(part, Unknown):
            number, data = part.id, part.data
        else:
            number, encode = encoders[type(part)]
            data = encode(part)
        chunks.append(bytes((number, len(data))) + data)
    return b"".join(chunks)


def fixed_decoder(kind: Callable[..., Any], layout: Struct) -> Decoder:
    """Decoder of a value whose fields are the layout's; it returns None for another length."""

    def decode(data: bytes) -> Any:
        return kind(*layout.unpack(data)) if len(data) == layout.size else None

    return decode


def fixed_encoder(kind: Any, layout: Struct) -> Encoder:
    """The inverse of `fixed_decoder`."""
    names = [field.name for field in fields(kind)]
    values = attrgetter(*names)
    if len(names) == 1:
        return lambda part: layout.pack(values(part))
    return lambda part: layout.pack(*values(part))
