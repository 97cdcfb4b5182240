"""Records with a checksum, one after the other, and values as MessagePack inside them.

A record is the length of its payload and the payload's CRC-32 (both 32 bits, little-endian), then
the payload: MessagePack, deflated. Arrays are maps of `dtype`, `shape` and `data` (bytes, C order).
"""

import struct
import zlib
from collections.abc import Iterator
from typing import Any, TypeVar

import msgspec
import numpy as np

from gvgbot.hal.messages import Scan
from gvgbot.hal.packed_scan import PackedScan

T = TypeVar("T")

_HEAD = struct.Struct("<II")
_LEVEL = 1  # of deflation: half the size for little time
_DTYPES = frozenset({"<f8", "<f4", "<i8", "<i4", "<i2", "|b1", "|u1"})


class Damaged(Exception):
    """What was read is not what was written."""


def packed(value: object) -> bytes:
    """A value of dataclasses, structs, arrays and plain things as MessagePack."""
    return msgspec.msgpack.encode(value, enc_hook=_plain)


def record(payload: bytes) -> bytes:
    """A record around MessagePack."""
    deflated = zlib.compress(payload, _LEVEL)
    return _HEAD.pack(len(deflated), zlib.crc32(deflated)) + deflated


def records(data: bytes) -> Iterator[tuple[bytes, int]]:
    """The payloads of the records up to the first damaged one, and where each record ends."""
    at = 0
    while at + _HEAD.size <= len(data):
        length, checksum = _HEAD.unpack_from(data, at)
        deflated = data[at + _HEAD.size : at + _HEAD.size + length]
        at += _HEAD.size + length
        if len(deflated) < length or zlib.crc32(deflated) != checksum:
            return
        try:
            yield zlib.decompress(deflated), at
        except zlib.error:
            return


def unpacked(payload: bytes, kind: type[T]) -> T:
    """The value in a payload. Raises Damaged if it is none of this kind."""
    try:
        return msgspec.msgpack.decode(payload, type=kind, dec_hook=_restored, strict=True)
    except (msgspec.MsgspecError, ValueError) as error:
        raise Damaged(str(error)) from error


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray):
        little = value.astype(value.dtype.newbyteorder("<"), copy=False)
        return {"dtype": little.dtype.str, "shape": little.shape, "data": little.tobytes()}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, PackedScan):
        return value.unpacked()
    raise TypeError(f"a {type(value).__name__} cannot be kept")


def _restored(kind: Any, value: Any) -> object:
    """Raises ValueError for what is no array, and no scan."""
    if kind is PackedScan:
        return PackedScan(msgspec.convert(value, Scan, dec_hook=_restored))
    try:
        dtype, shape, data = value["dtype"], value["shape"], value["data"]
    except (TypeError, KeyError) as error:
        raise ValueError(f"no {kind}") from error
    if dtype not in _DTYPES:
        raise ValueError(f"arrays of {dtype} are not kept")
    return np.frombuffer(data, dtype).reshape(shape).copy()
