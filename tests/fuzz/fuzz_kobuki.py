"""Coverage-guided fuzzing of what reads the base's bytes: `python -m tests.fuzz.fuzz_kobuki`.

Arguments are libFuzzer's, such as -max_total_time=60. It ends with a stack trace if a parser
raises, holds back more than a frame, or lets noise hide a good frame that follows.
"""

import math

import atheris

from tests.fuzz.harness import chunks, fuzz, vectors

with atheris.instrument_imports(include=["gvgbot"]):
    from gvgbot.drivers.kobuki.feedback import FeedbackReader
    from gvgbot.drivers.kobuki.frames import Frame, FrameParser, encode_frame
    from gvgbot.drivers.kobuki.payloads import decode_feedback, encode_feedback
    from gvgbot.drivers.kobuki.sub_payloads import Truncated
    from gvgbot.drivers.kobuki.wheel_odometry import KOBUKI

STOP = bytes.fromhex("aa55 06 01 04 0000 0000 03")
LONGEST = 259  # bytes of a frame


def one_input(data: bytes) -> None:
    """Noise as it comes, and as payloads of frames, which guessing a checksum rarely makes."""
    read(data)
    read(b"".join(encode_frame(part) for part in chunks(data) if 3 <= len(part) <= 255))
    if 3 <= len(payload := data[1:]) <= 255:
        check_payload(payload)


def read(data: bytes) -> None:
    """Feed the bytes, and then frames that must be found."""
    parser, reader = FrameParser(), FeedbackReader("gyro", 0.0, KOBUKI)
    fed = used = 0
    for moment, chunk in enumerate(chunks(data)):
        odometry = reader.take(chunk, 0.02 * moment)
        assert odometry is None or math.isfinite(odometry.odom_base.x + odometry.stamp)
        found = [frame for frame in parser.feed(chunk) if isinstance(frame, Frame)]
        fed += len(chunk)
        used += sum(len(frame.payload) + 4 for frame in found)
        assert fed - used - parser.skipped_bytes < LONGEST, "holds back more than a frame"
        for frame in found:
            check_payload(frame.payload)
    parser.feed(bytes(LONGEST))  # whatever the noise began is over by now
    assert Frame(STOP[3:-1]) in parser.feed(STOP), "a good frame is not found"


def check_payload(payload: bytes) -> None:
    """A payload reads without raising, and what was read writes back as it was."""
    parts = decode_feedback(payload)
    if not isinstance(parts[-1], Truncated):
        again = decode_feedback(encode_feedback(parts))
        assert again == parts, "what was read does not survive writing"


if __name__ == "__main__":
    seeds = [bytes.fromhex(vector["hex"]) for vector in vectors("kobuki_vectors.json")]
    fuzz(one_input, [*seeds, *(seed[3:-1] for seed in seeds)])
