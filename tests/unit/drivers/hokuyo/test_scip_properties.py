"""What holds for every message, every chunking and every noise."""

from itertools import pairwise

import numpy as np
from hypothesis import assume, example, given
from hypothesis import strategies as st

from gvgbot.drivers.hokuyo.scip import MESSAGE_LIMIT, ScipParser, encode_reply, encode_scan
from gvgbot.drivers.hokuyo.scip_codec import (
    block,
    decode_number,
    encode_number,
    to_characters,
    to_values,
    unblock,
)
from gvgbot.drivers.hokuyo.scip_messages import (
    BadReply,
    Message,
    Reply,
    ScanReply,
    ScanRequest,
    parse_request,
)

STRINGS = st.text("abcXYZ019 ._+@", max_size=16)
SINGLE_ECHO = ("MD", "MS", "ME", "GD", "GS", "GE", "%MD", "%ME")
MULTI_ECHO = ("ND", "NE", "HD", "HE")
PRINTED = st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=40)


@st.composite
def requests(draw: st.DrawFn, commands: tuple[str, ...] = SINGLE_ECHO) -> ScanRequest:
    command = draw(st.sampled_from(commands))
    start = draw(st.integers(0, 9000))
    end = start + draw(st.integers(0, 200))
    cluster = draw(st.integers(0, 99))
    if command[0] in "GH":
        return ScanRequest(command, start, end, cluster, string=draw(STRINGS))
    skip, count = draw(st.integers(0, 9)), draw(st.integers(0, 99))
    return ScanRequest(command, start, end, cluster, skip, count, draw(STRINGS))


@st.composite
def scans(draw: st.DrawFn) -> ScanReply:
    request = draw(requests())
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    top = 1 << 6 * request.width
    ranges = rng.integers(0, top, request.values, dtype=np.int32)
    intensities = rng.integers(0, top, request.values, dtype=np.int32)
    stamp_characters = 11 if request.command[0] == "%" else 4
    return ScanReply(
        request,
        "00" if request.is_single_shot else "99",
        draw(st.integers(0, (1 << 6 * stamp_characters) - 1)),
        ranges,
        intensities if request.numbers == 2 else None,
        stamp_characters=stamp_characters,
    )


@st.composite
def echo_scans(draw: st.DrawFn) -> ScanReply:
    echoes = np.array(draw(st.lists(st.integers(1, 3), min_size=1, max_size=120)), np.int32)
    request = ScanRequest(draw(st.sampled_from(MULTI_ECHO)), 0, len(echoes) - 1)
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    ranges, intensities = rng.integers(0, 1 << 18, (2, int(echoes.sum())), dtype=np.int32)
    status = "00" if request.is_single_shot else "99"
    return ScanReply(
        request, status, 0, ranges, intensities if request.numbers == 2 else None, echoes
    )


@st.composite
def replies(draw: st.DrawFn) -> Reply:
    command = draw(st.sampled_from(("VV", "PP", "II", "TM1", "QT", "BM", "RS", "%ST", "XX")))
    string = draw(STRINGS)
    status = draw(st.sampled_from(("00", "01", "0E", "0M", "10")))
    lines = draw(st.lists(PRINTED, max_size=8))
    return Reply(f"{command};{string}" if string else command, status, tuple(lines))


any_scan = scans() | echo_scans()
any_message = any_scan | replies()


def encode(message: Message) -> bytes:
    assert not isinstance(message, BadReply)
    return encode_scan(message) if isinstance(message, ScanReply) else encode_reply(message)


def listed(message: Message) -> tuple[object, ...]:
    """A message as something that compares."""
    if not isinstance(message, ScanReply):
        return (message,)
    arrays = (message.ranges, message.intensities, message.echoes)
    return message.request, message.stamp, *(None if a is None else a.tolist() for a in arrays)


def feed_in_chunks(data: bytes, cuts: list[int]) -> list[tuple[object, ...]]:
    parser = ScipParser()
    edges = [0, *sorted(cut % (len(data) + 1) for cut in cuts), len(data)]
    return [
        listed(message)
        for start, end in pairwise(edges)
        for message in parser.feed(data[start:end])
    ]


@given(st.integers(1, 11), st.data())
def test_reading_a_written_number_gives_it_back(characters: int, data: st.DataObject) -> None:
    value = data.draw(st.integers(0, (1 << 6 * characters) - 1))
    assert decode_number(encode_number(value, characters)) == value


@given(requests(SINGLE_ECHO + MULTI_ECHO))
def test_reading_a_written_request_gives_it_back(request: ScanRequest) -> None:
    assert parse_request(request.text().encode()) == request


@given(any_message)
def test_reading_a_written_message_gives_it_back(message: Message) -> None:
    (again,) = ScipParser().feed(encode(message))
    assert listed(again) == listed(message)


@given(st.lists(any_message.map(encode) | st.binary(max_size=80)), st.lists(st.integers(0)))
def test_any_chunking_gives_the_same_messages(parts: list[bytes], cuts: list[int]) -> None:
    data = b"".join(parts)
    assert feed_in_chunks(data, cuts) == feed_in_chunks(data, [])


@given(scans(), scans())
def test_scans_that_come_byte_by_byte_are_read(first: ScanReply, second: ScanReply) -> None:
    data = encode_scan(first) + b"\n" + encode_scan(second)
    assert feed_in_chunks(data, list(range(len(data)))) == [listed(first), listed(second)]


@given(st.binary(max_size=400), any_message)
@example(
    b"MD0000108001000\n99b\n", ScanReply(ScanRequest("MD", 0, 0), "99", 7, np.zeros(1, np.int32))
)
def test_the_message_after_noise_is_found(noise: bytes, message: Message) -> None:
    messages = ScipParser().feed(noise + b"\n\n" + encode(message))
    assert listed(messages[-1]) == listed(message)


@given(any_scan, any_scan, st.data())
def test_the_scan_after_a_cut_one_is_found(
    cut: ScanReply, whole: ScanReply, data: st.DataObject
) -> None:
    damaged = encode_scan(cut)
    damaged = damaged[: data.draw(st.integers(0, len(damaged) - 1))]
    # After the start of a user string the second echo can pass for the rest of it.
    assume(b";" not in damaged[-5:])
    messages = ScipParser().feed(damaged + encode_scan(whole))
    assert listed(messages[-1]) == listed(whole)


@given(any_scan, st.integers(0), st.integers(0, 7))
def test_one_flipped_bit_never_changes_a_range(scan: ScanReply, place: int, bit: int) -> None:
    data = bytearray(encode_scan(scan))
    start = data.index(b"\n", data.index(b"\n") + 1) + 1  # echo and status only name the scan
    place = start + place % (len(data) - start)
    data[place] ^= 1 << bit
    for message in ScipParser().feed(bytes(data) + b"\n\n"):
        if isinstance(message, ScanReply):
            assert listed(message) == listed(scan)


def test_endless_noise_is_bounded_and_then_forgotten() -> None:
    parser = ScipParser()
    for _ in range(40):
        assert all(isinstance(message, BadReply) for message in parser.feed(b"\xff" * 5000))
        assert parser.pending <= MESSAGE_LIMIT
    assert parser.feed(b"\n\nQT\n00P\n\n")[-1] == Reply("QT", "00")


@given(st.integers(1, 300), st.integers(0, 2**32))
def test_blocks_give_back_their_characters(count: int, seed: int) -> None:
    values = np.random.default_rng(seed).integers(0, 1 << 18, count, dtype=np.int32)
    data = block(to_characters(values, 3))
    assert max(map(len, data.split(b"\n"))) <= 65
    assert np.array_equal(to_values(unblock(data), 3), values)
