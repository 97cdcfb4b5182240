"""The codec refuses what breaks a rule, and raises nothing but that refusal."""

import contextlib
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.drivers.hokuyo.scip_codec import (
    DamagedError,
    block,
    checked,
    checked_key_line,
    decode_number,
    encode_key_line,
    split_echoes,
    to_values,
    unblock,
    with_checksum,
)

characters = st.lists(st.integers(0, 0x6F), max_size=300).map(
    lambda codes: np.array(codes, np.uint8)
)
separated = st.lists(st.sampled_from((5, 6, 7, 0x26 + 256 - 0x30)), max_size=40).map(
    lambda codes: np.array(codes, np.uint8)
)


@pytest.mark.parametrize("read", [checked, checked_key_line, decode_number, unblock])
@given(data=st.binary(max_size=300))
def test_noise_is_refused_or_read(read: Callable[[bytes], object], data: bytes) -> None:
    with contextlib.suppress(DamagedError):
        read(data)


@given(st.binary(max_size=80))
def test_lines_give_back_their_content(content: bytes) -> None:
    assert checked_key_line(encode_key_line(content)) == content
    if content:
        assert checked(with_checksum(content)) == content


@given(characters, st.sampled_from((2, 3)))
def test_characters_are_numbers_of_six_bits_a_digit(codes: np.ndarray, width: int) -> None:
    digits = codes.tolist()
    if len(digits) % width or max(digits, default=0) > 63:
        with pytest.raises(DamagedError):
            to_values(codes, width)
        return
    whole = [digits[i : i + width] for i in range(0, len(digits), width)]
    expected = [sum(digit << 6 * k for k, digit in enumerate(reversed(each))) for each in whole]
    assert to_values(codes, width).tolist() == expected


@given(separated, st.sampled_from((2, 3, 6)))
def test_echoes_are_counted_or_refused(codes: np.ndarray, size: int) -> None:
    """Truth: the text is numbers of that size; between two, there may be one separator."""
    text = bytes(codes + np.uint8(0x30)).decode("ascii")
    runs = text.split("&")
    if any(not run or len(run) % size for run in runs) and text:
        with pytest.raises(DamagedError):
            split_echoes(codes, size)
        return
    kept, echoes = split_echoes(codes, size)
    expected: list[int] = []
    for number, run in enumerate(runs):
        further = [1] * (len(run) // size)
        if number:
            expected[-1] += 1
            further.pop()
        expected += further
    assert echoes.tolist() == expected
    assert len(kept) == len(text.replace("&", ""))


@given(st.integers(1, 300), st.data())
def test_blocks_are_as_long_as_their_checksums_and_line_feeds_make_them(
    count: int, data: st.DataObject
) -> None:
    codes = np.array(data.draw(st.lists(st.integers(0, 63), min_size=count, max_size=count)))
    rows = block(codes.astype(np.uint8)).split(b"\n")
    assert [len(row) for row in rows[:-1]] == [65] * (count // 64) + [count % 64 + 1] * (
        count % 64 > 0
    )
    for row in rows[:-1]:
        assert row[-1] == sum(row[:-1]) % 64 + 0x30
