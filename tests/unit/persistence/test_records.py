"""Records are read back as they were written, and nothing else passes for one."""

import struct
import zlib
from dataclasses import dataclass

import msgspec
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gvgbot.geometry import Array
from gvgbot.persistence.records import Damaged, packed, record, records, unpacked

payloads = st.lists(st.binary(max_size=60), min_size=1, max_size=5)


def read(data: bytes) -> list[bytes]:
    return [payload for payload, _ in records(data)]


@given(payloads)
def test_records_come_back_in_their_order(contents: list[bytes]) -> None:
    assert read(b"".join(map(record, contents))) == contents


def test_a_record_is_made_as_its_page_says() -> None:
    """Length and CRC-32, little-endian, then deflated content."""
    data = record(b"gvg" * 10)
    length, checksum = struct.unpack("<II", data[:8])
    assert (length, checksum) == (len(data) - 8, zlib.crc32(data[8:]))
    assert zlib.decompress(data[8:]) == b"gvg" * 10


@given(payloads, st.data())
def test_of_a_file_that_was_cut_all_whole_records_are_read(
    contents: list[bytes], data: st.DataObject
) -> None:
    framed = [record(content) for content in contents]
    whole = b"".join(framed)
    cut = data.draw(st.integers(0, len(whole)))
    ends = np.cumsum([len(frame) for frame in framed])
    assert read(whole[:cut]) == contents[: int((ends <= cut).sum())]


@given(payloads, st.data())
def test_a_flipped_bit_costs_its_record_and_what_follows_but_nothing_before(
    contents: list[bytes], data: st.DataObject
) -> None:
    framed = [record(content) for content in contents]
    altered = bytearray(b"".join(framed))
    at = data.draw(st.integers(0, len(altered) - 1))
    altered[at] ^= 1 << data.draw(st.integers(0, 7))
    ends = np.cumsum([len(frame) for frame in framed])
    assert read(bytes(altered)) == contents[: int((ends <= at).sum())]


@example(bytes(8))  # the checksum of nothing is 0
@given(st.binary(max_size=200))
def test_noise_is_no_record_and_no_error(noise: bytes) -> None:
    assert read(noise) == []


@dataclass(eq=False)
class Example:
    points: Array
    votes: NDArray[np.int16]
    names: dict[tuple[int, int], float]
    inner: tuple[float, ...]


def test_arrays_keep_their_values_types_and_shapes() -> None:
    points = np.array([[1.5, np.nan], [np.inf, -0.0]])
    votes = np.arange(6, dtype=np.int16).reshape(3, 2)[:, ::-1]
    before = Example(points, votes, {(1, -2): 0.5}, (float("inf"), 2.0))
    after = unpacked(packed(before), Example)
    assert after.points.tobytes() == points.tobytes()
    assert after.votes.dtype == np.int16
    assert after.votes.tolist() == [[1, 0], [3, 2], [5, 4]]
    assert (after.names, after.inner) == (before.names, before.inner)
    after.points[0, 0] = 2.0  # it can be worked with


@pytest.mark.parametrize(
    "array",
    [
        {"dtype": "|O", "shape": [1], "data": b"12345678"},
        {"dtype": "<f8", "shape": [2], "data": b"12345678"},
        {"dtype": "<f8", "shape": [1]},
        "no array",
        7,
    ],
)
def test_what_is_no_array_is_damage(array: object) -> None:
    value = {"points": array, "votes": array, "names": {}, "inner": []}
    with pytest.raises(Damaged):
        unpacked(msgspec.msgpack.encode(value), Example)


@pytest.mark.parametrize("payload", [b"", b"\xc1", b"\x81\xa1a\x01", b"\x93\x01\x02"])
def test_what_has_another_form_is_damage(payload: bytes) -> None:
    with pytest.raises(Damaged):
        unpacked(payload, Example)
