"""Coverage-guided fuzzing of what reads a laser's bytes: `python -m tests.fuzz.fuzz_scip`.

Arguments are libFuzzer's, such as -max_total_time=60. It ends with a stack trace if the parser
raises, remembers without bound, reads other numbers than were sent, or lets noise hide a good
message that follows.
"""

import atheris

from tests.fuzz.harness import chunks, fuzz, vectors

with atheris.instrument_imports(include=["gvgbot"]):
    import numpy as np

    from gvgbot.drivers.hokuyo.models import Identity, Parameters
    from gvgbot.drivers.hokuyo.scan_geometry import one_per_step
    from gvgbot.drivers.hokuyo.scip import (
        MESSAGE_LIMIT,
        ScipParser,
        decode_time,
        encode_reply,
        encode_scan,
    )
    from gvgbot.drivers.hokuyo.scip_codec import encode_key_line, with_checksum
    from gvgbot.drivers.hokuyo.scip_messages import Message, Reply, ScanReply, ScanRequest

ANY = Parameters("any", 0, 2**18, 1440, 0, 1080, 540, 2400)  # every number is a range
STOPPED = b"QT\n00P\n\n"
SCANS = ("MD", "MS", "ME", "ND", "NE", "GD", "GS", "GE", "HD", "HE", "%MD", "%ME")
KEY_REPLIES = (b"VV", b"PP", b"II")
OTHER_REPLIES = (b"TM1", b"TM0;a7", b"QT", b"BM", b"CR00", b"%ST", b"SCIP2.0")
ROW = 64  # characters
FLOOD = b"\xff"  # a first byte that has the rest repeated


def one_input(data: bytes) -> None:
    """Noise as it comes, and in replies with good checksums, which guessing would rarely make."""
    read(data)
    if data.startswith(FLOOD):
        flood(data[1:])
    read_reply(data[1:])
    read_scan(data[1:])


def read(data: bytes) -> None:
    """Feed the bytes, and then a reply that must be found."""
    parser = ScipParser()
    for chunk in chunks(data):
        for message in parser.feed(chunk):
            check(message)
    assert parser.feed(b"\n\n" + STOPPED)[-1] == Reply("QT", "00"), "a good reply is not found"


def flood(data: bytes) -> None:
    """The same over and over, of which no message ends, must not be remembered for ever."""
    if not data or b"\n\n" in 2 * data:
        return
    parser = ScipParser()
    piece = data * (MESSAGE_LIMIT // 8 // len(data) + 1)
    for _ in range(16):
        parser.feed(piece)
        assert parser.pending < MESSAGE_LIMIT, "memory without bound"


def check(message: Message) -> None:
    """What was read can be used, and survives being written and read again."""
    if isinstance(message, ScanReply):
        (again,) = ScipParser().feed(encode_scan(message))
        assert isinstance(again, ScanReply)
        for name in ("ranges", "intensities", "echoes"):
            was, now = getattr(message, name), getattr(again, name)
            assert (was is None) == (now is None), name
            assert was is None or np.array_equal(was, now), f"{name} do not survive writing"
        for echo in ("first", "last", "strongest"):
            assert len(one_per_step(message, echo, ANY)[0]) == message.request.values
    elif isinstance(message, Reply):
        (again,) = ScipParser().feed(encode_reply(message))
        assert again == message, "a reply does not survive writing"
        use(message)


def use(reply: Reply) -> None:
    """Make of the reply what the driver would."""
    Identity.from_lines(reply.fields)
    for read_as in (lambda: Parameters.from_lines(reply.fields), lambda: decode_time(reply)):
        try:
            read_as()
        except ValueError:
            continue  # the driver refuses such a laser


def read_reply(data: bytes) -> None:
    """The lines of the data as those of a reply must all be found in it."""
    kind, lines = data[:1], [line for line in data[1:].split(b"\n") if line]
    echoes = KEY_REPLIES if kind < b"\x80" else OTHER_REPLIES
    seal = encode_key_line if kind < b"\x80" else with_checksum
    echo = echoes[sum(kind) % len(echoes)]
    (reply,) = ScipParser().feed(b"\n".join([echo, b"00P", *map(seal, lines)]) + b"\n\n")
    assert isinstance(reply, Reply), "a good reply is not read"
    assert [line.encode("latin-1") for line in reply.lines] == lines
    check(reply)


def read_scan(data: bytes) -> None:
    """The data as characters of a scan, of which about every fourth byte separates two echoes."""
    if len(data) < 3:
        return
    request = ScanRequest(SCANS[data[0] % len(SCANS)], 0, 0)
    characters = bytes(ord("&") if byte >= 0xC0 else 0x30 + byte % 64 for byte in data[2:])
    if not request.is_multi_echo:
        characters = characters.replace(b"&", b"")
    size = request.width * request.numbers
    expected = [step.split(b"&") for step in steps(characters, size)]
    end = len(expected) - 1 + (data[1] > 0xF0)  # sometimes one step more than there is
    (message,) = ScipParser().feed(scan_bytes(request.command, max(0, end), characters))
    whole = [len(echo) == size for step in expected for echo in step]
    if expected and all(whole) and end == len(expected) - 1:
        assert isinstance(message, ScanReply), "a good scan is not read"
        first = [number(step[0][: request.width]) for step in expected]
        assert one_per_step(message, "first", ANY)[0].tolist() == first, "other numbers than sent"
    else:
        assert not isinstance(message, ScanReply), "a scan of the wrong length is read"
    check(message)


def steps(characters: bytes, size: int) -> list[bytes]:
    """The characters cut after each reading that no separator follows, one by one."""
    found, start, place = [], 0, 0
    while place < len(characters):
        place += size
        if characters[place : place + 1] == b"&":
            place += 1
        else:
            found.append(characters[start:place])
            start = place
    return found if start == len(characters) else [*found, characters[start:]]


def number(characters: bytes) -> int:
    """Six bits a character, most significant first."""
    value = 0
    for character in characters:
        value = 64 * value + character - 0x30
    return value


def scan_bytes(command: str, end: int, characters: bytes) -> bytes:
    """A scan with good checksums."""
    single = command[0] in "GH"
    echo = f"{command}0000{end:04}01{'' if single else '000'}".encode()
    rows = [characters[start : start + ROW] for start in range(0, len(characters), ROW)]
    head = [echo, b"00P" if single else b"99b", with_checksum(b"0100")]
    return b"\n".join([*head, *map(with_checksum, rows)]) + b"\n\n"


if __name__ == "__main__":
    fuzz(one_input, (vector["rx"].encode("latin-1") for vector in vectors("scip_vectors.json")))
