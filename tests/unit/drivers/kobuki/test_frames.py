"""Framing: any chunking, any noise."""

from functools import reduce
from operator import xor

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gvgbot.drivers.kobuki.frames import (
    MAX_PAYLOAD,
    BadFrame,
    Frame,
    FrameParser,
    checksum,
    encode_frame,
)

payloads = st.binary(min_size=3, max_size=255)
STOP = bytes.fromhex("aa 55 06 01 04 00 00 00 00 03")


@given(st.binary(max_size=256))
def test_the_checksum_is_the_xor_of_all_bytes(data: bytes) -> None:
    assert checksum(data) == reduce(xor, data, 0)


@given(payloads)
@example(bytes(MAX_PAYLOAD))
def test_a_frame_reads_back_as_its_payload(payload: bytes) -> None:
    assert FrameParser().feed(encode_frame(payload)) == [Frame(payload)]


@pytest.mark.parametrize("size", [0, 1, 2, 256])
def test_a_payload_that_no_frame_can_hold_is_refused(size: int) -> None:
    with pytest.raises(ValueError, match=f"{size} bytes"):
        encode_frame(bytes(size))


@given(st.lists(payloads | st.just(b"\xaa\x55\xaa\x55\x03"), max_size=5), st.data())
def test_any_chunking_gives_the_same_frames(sent: list[bytes], data: st.DataObject) -> None:
    stream = b"".join(map(encode_frame, sent))
    cuts = data.draw(st.lists(st.integers(0, len(stream)), max_size=12).map(sorted))
    parser = FrameParser()
    got = [
        frame
        for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True)
        for frame in parser.feed(stream[start:end])
    ]
    assert got == [Frame(payload) for payload in sent]
    assert (parser.frames, parser.bad_frames, parser.skipped_bytes) == (len(sent), 0, 0)


@given(st.lists(st.binary(max_size=40) | st.just(b"\xaa\x55\xff"), max_size=6), payloads)
def test_noise_never_raises_and_good_frames_after_it_are_found(
    noise: list[bytes], payload: bytes
) -> None:
    """Noise can hide as much as the longest frame it pretends to begin, and no more."""
    parser = FrameParser()
    for chunk in noise:
        parser.feed(chunk)
    flood = encode_frame(payload) * (2 + 259 // (len(payload) + 4))
    assert Frame(payload) in parser.feed(flood + bytes(259))


@given(st.binary(max_size=2000))
def test_every_byte_is_accounted_for(data: bytes) -> None:
    parser = FrameParser()
    frames = [frame for frame in parser.feed(data) if isinstance(frame, Frame)]
    used = sum(len(frame.payload) + 4 for frame in frames)
    assert 0 <= len(data) - used - parser.skipped_bytes < 259


def test_the_frame_inside_a_damaged_one_is_found() -> None:
    cut = STOP[:6]
    frames = FrameParser().feed(cut + STOP + STOP)
    assert [frame for frame in frames if isinstance(frame, Frame)] == [Frame(STOP[3:-1])] * 2
    assert isinstance(frames[0], BadFrame)


def test_a_flipped_bit_costs_one_frame_and_is_counted() -> None:
    damaged = STOP[:7] + b"\x40" + STOP[8:]
    parser = FrameParser()
    assert parser.feed(STOP + damaged + STOP) == [
        Frame(STOP[3:-1]),
        BadFrame(damaged),
        Frame(STOP[3:-1]),
    ]
    assert (parser.frames, parser.bad_frames, parser.skipped_bytes) == (2, 1, len(STOP))


def test_stray_bytes_between_frames_are_skipped() -> None:
    parser = FrameParser()
    assert len(parser.feed(STOP + b"\x00" + STOP + b"\xaa" + STOP)) == 3
    assert parser.skipped_bytes == 2


def test_who_begins_to_listen_in_the_middle_of_a_frame_has_lost_nothing() -> None:
    parser = FrameParser()
    parser.feed(STOP[3:] + STOP)
    assert parser.skipped_bytes == parser.leading_bytes == len(STOP) - 3
    parser.feed(b"\x00" + STOP)
    assert (parser.skipped_bytes, parser.leading_bytes) == (len(STOP) - 2, len(STOP) - 3)
