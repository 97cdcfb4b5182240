"""The example messages of SCIP 2, read and written."""

import json
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gvgbot.drivers.hokuyo.scip import (
    ScipParser,
    decode_time,
    encode_command,
    encode_reply,
    encode_scan,
)
from gvgbot.drivers.hokuyo.scip_codec import (
    Values,
    checked,
    decode_number,
    encode_number,
    with_checksum,
)
from gvgbot.drivers.hokuyo.scip_messages import (
    BadReply,
    Message,
    Reply,
    ScanReply,
    parse_request,
)

VECTORS: list[dict[str, Any]] = json.loads(
    (Path(__file__).parents[3] / "data" / "scip_vectors.json").read_text("ascii")
)["vectors"]


def named(kind: str, *, scan: bool | None = None) -> list[Any]:
    return [
        pytest.param(vector["rx"].encode("latin-1"), vector["expect"], id=vector["name"])
        for vector in VECTORS
        if vector["kind"] == kind and scan in (None, is_scan(vector["expect"]))
    ]


def is_scan(expect: dict[str, Any]) -> bool:
    return "ranges" in expect or "echoes" in expect


def read_one(data: bytes) -> Message:
    (message,) = ScipParser().feed(data)
    return message


def read_scan(data: bytes) -> ScanReply:
    message = read_one(data)
    assert isinstance(message, ScanReply)
    return message


def readings(expect: dict[str, Any]) -> tuple[Values, Values | None, Values | None]:
    """Ranges, intensities and echoes per step as a vector lists them."""
    if "echoes" not in expect:
        intensities = expect.get("intensities")
        return array(expect["ranges"]), None if intensities is None else array(intensities), None
    flat = [reading for step in expect["echoes"] for reading in step]
    intensities = array([reading[1] for reading in flat]) if len(flat[0]) > 1 else None
    counts = array([len(step) for step in expect["echoes"]])
    return array([reading[0] for reading in flat]), intensities, counts


def array(values: list[int]) -> Values:
    return np.array(values, np.int32)


def same(left: Values | None, right: Values | None) -> bool:
    if left is None or right is None:
        return left is right
    return np.array_equal(left, right)


def expected_scan(data: bytes, expect: dict[str, Any]) -> ScanReply:
    request = parse_request(data.partition(b"\n")[0])
    assert request is not None
    stamp, characters = (expect["ts"], 4) if "ts" in expect else (expect["ts_us"], 11)
    return ScanReply(request, expect["status"], stamp, *readings(expect), characters)


@pytest.mark.parametrize(("data", "expect"), named("encoding"))
def test_a_number_reads_and_writes_as_specified(data: bytes, expect: dict[str, int]) -> None:
    assert decode_number(data) == expect["value"]
    assert encode_number(expect["value"], expect["chars"]) == data


@pytest.mark.parametrize(("data", "expect"), named("status"))
def test_a_status_line_reads_and_writes_as_specified(data: bytes, expect: dict[str, str]) -> None:
    assert checked(data) == expect["status"].encode()
    assert with_checksum(expect["status"].encode()) == data


@pytest.mark.parametrize("data", [each.values[0] for each in named("status")])
def test_a_flipped_bit_makes_no_other_status(data: bytes) -> None:
    """Bits 6 and 7 do not count in the sum."""
    for place, bit in product(range(len(data)), range(8)):
        flipped = bytearray(data)
        flipped[place] ^= 1 << bit
        messages = ScipParser().feed(b"QT\n" + flipped + b"\n\n")
        assert not any(isinstance(message, Reply) for message in messages)


@pytest.mark.parametrize(("data", "expect"), named("reply", scan=False))
def test_a_reply_reads_as_specified(data: bytes, expect: dict[str, Any]) -> None:
    reply = read_one(data)
    assert isinstance(reply, Reply)
    assert reply.status == expect.get("status", "00")
    for key in expect.keys() - {"status", "string", "time_ms"}:
        assert reply.fields[key] == str(expect[key])
    if "time_ms" in expect:
        assert decode_time(reply) == expect["time_ms"]
    if "string" in expect:
        assert reply.echo.partition(";")[2] == expect["string"]


@pytest.mark.parametrize(("data", "expect"), named("reply", scan=False))
def test_writing_a_reply_gives_back_its_bytes(data: bytes, expect: dict[str, Any]) -> None:
    reply = read_one(data)
    assert isinstance(reply, Reply)
    assert encode_reply(reply) == data


@pytest.mark.parametrize(("data", "expect"), named("reply", scan=True))
def test_a_scan_reads_as_specified(data: bytes, expect: dict[str, Any]) -> None:
    scan = read_scan(data)
    ranges, intensities, echoes = readings(expect)
    assert scan.status == expect["status"]
    assert scan.stamp == expect.get("ts", expect.get("ts_us"))
    assert scan.request.count == expect.get("remaining", 0)
    assert same(scan.ranges, ranges)
    assert same(scan.intensities, intensities)
    assert same(scan.echoes, echoes)


@pytest.mark.parametrize(("data", "expect"), named("reply", scan=True))
def test_a_scan_writes_as_specified(data: bytes, expect: dict[str, Any]) -> None:
    assert encode_scan(expected_scan(data, expect)) == data


@pytest.mark.parametrize("vector", [v for v in VECTORS if "tx" in v], ids=lambda v: v["name"])
def test_a_scan_command_reads_and_writes_as_specified(vector: dict[str, Any]) -> None:
    sent = vector["tx"].encode()
    request = parse_request(sent.rstrip(b"\n"))
    assert (request is not None) == (sum(chr(c).isdigit() for c in sent.partition(b";")[0]) >= 10)
    if request is not None:
        assert encode_command(request.text()) == sent


@pytest.mark.parametrize(
    ("data", "expect"), [each for each in named("bad") if each.values[1]["error"] is not None]
)
def test_damage_is_noticed_and_the_next_message_read(data: bytes, expect: dict[str, Any]) -> None:
    messages = ScipParser().feed(data + b"\n\nTM2\n03S\n\n")
    assert isinstance(messages[0], BadReply)
    assert messages[-1] == Reply("TM2", "03")
    assert not any(isinstance(message, ScanReply) for message in messages)


def test_a_cut_scan_does_not_take_the_next_one_with_it() -> None:
    vectors = {vector["name"]: vector["rx"].encode("latin-1") for vector in VECTORS}
    cut, whole = vectors["BAD truncated"], vectors["MD 22 points (value 21 straddles)"]
    for length in range(len(cut)):
        messages = ScipParser().feed(cut[:length] + whole)
        assert isinstance(messages[-1], ScanReply)
        assert messages[-1].stamp == 1


def test_after_several_cut_scans_the_whole_one_is_read() -> None:
    vectors = {vector["name"]: vector["rx"].encode("latin-1") for vector in VECTORS}
    cut, whole = vectors["BAD truncated"], vectors["MD 22 points (value 21 straddles)"]
    bad, scan = ScipParser().feed(3 * cut + whole)
    assert isinstance(bad, BadReply)
    assert isinstance(scan, ScanReply)
    assert scan.stamp == 1


def test_a_scan_without_one_of_its_blocks_is_bad() -> None:
    whole = next(v["rx"] for v in VECTORS if v["name"] == "MS 33 points").encode()
    start = whole.index(b"\n", whole.index(b"99b\n") + 4) + 1
    assert isinstance(read_one(whole[:start] + whole[start + 66 :]), BadReply)


@pytest.mark.parametrize("wrong", [b"M", b"J", b"\r", b"\x00"])
def test_a_block_that_ends_without_line_feed_is_bad(wrong: bytes) -> None:
    whole = next(v["rx"] for v in VECTORS if v["name"] == "MD 64 points (exact lines)").encode()
    end = whole.index(b"\n", whole.index(b"99b\n") + 4) + 66
    assert whole[end : end + 1] == b"\n"
    assert isinstance(read_one(whole[:end] + wrong + whole[end + 1 :]), BadReply)


@pytest.mark.parametrize("echo", [b"MD000000040100", b"MD0000000401", b"D0000000401000", b"MD"])
def test_a_scan_whose_echo_is_damaged_is_bad(echo: bytes) -> None:
    whole = next(v["rx"] for v in VECTORS if v["name"] == "MD 5 points").encode()
    assert isinstance(read_one(echo + whole[whole.index(b"\n") :]), BadReply)
