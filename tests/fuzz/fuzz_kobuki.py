"""Coverage-guided fuzzing of what reads the base's bytes: `python tests/fuzz/fuzz_kobuki.py`.

Arguments are libFuzzer's, such as -max_total_time=60. It ends with a stack trace if a parser
raises, holds back more than a frame, or lets noise hide a good frame that follows.
"""

import sys

import atheris  # type: ignore[import-not-found,import-untyped,unused-ignore]

with atheris.instrument_imports():
    from gvgbot.drivers.kobuki.commands import decode_commands
    from gvgbot.drivers.kobuki.feedback import FeedbackReader
    from gvgbot.drivers.kobuki.frames import Frame, FrameParser
    from gvgbot.drivers.kobuki.payloads import decode_feedback, encode_feedback
    from gvgbot.drivers.kobuki.sub_payloads import Truncated

STOP = bytes.fromhex("aa55 06 01 04 0000 0000 03")
LONGEST = 259  # bytes of a frame


def read(data: bytes) -> None:
    """Feed the bytes, cut by their own first byte, and then frames that must be found."""
    size = 1 + (data[0] if data else 0)
    parser, reader = FrameParser(), FeedbackReader("gyro", 0.0)
    for number, start in enumerate(range(0, len(data), size)):
        chunk = data[start : start + size]
        reader.take(chunk, 0.02 * number)
        for frame in parser.feed(chunk):
            if isinstance(frame, Frame):
                check_payload(frame.payload)
    parser.feed(bytes(LONGEST))  # whatever the noise began is over by now
    assert Frame(STOP[3:-1]) in parser.feed(STOP), "a good frame is not found"


def check_payload(payload: bytes) -> None:
    """A payload reads without raising, and what was read writes back as it was."""
    decode_commands(payload)
    parts = decode_feedback(payload)
    if not isinstance(parts[-1], Truncated):
        again = decode_feedback(encode_feedback(parts))
        assert again == parts, "what was read does not survive writing"


def one_input(data: bytes) -> None:
    """Noise as it comes, and as the payload of a frame, which guessing a checksum rarely makes."""
    read(data)
    if 3 <= len(data) <= 255:
        check_payload(data)


if __name__ == "__main__":
    atheris.Setup(sys.argv, one_input)
    atheris.Fuzz()
