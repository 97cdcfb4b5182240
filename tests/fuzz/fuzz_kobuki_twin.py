"""Coverage-guided fuzzing of what a simulated base hears: `python -m tests.fuzz.fuzz_kobuki_twin`.

Arguments are libFuzzer's, such as -max_total_time=60. It ends with a stack trace if the base
raises, sends anything but good frames at its pace, or does not stand when it is told to.
"""

from collections.abc import Iterable

import atheris

from tests.fuzz.harness import chunks, fuzz, vectors

with atheris.instrument_imports(include=["gvgbot"]):
    from gvgbot.drivers.kobuki.commands import decode_commands
    from gvgbot.drivers.kobuki.frames import Frame, FrameParser, encode_frame
    from gvgbot.drivers.kobuki.twin import KobukiTwin, KobukiTwinConfig
    from gvgbot.geometry import STANDSTILL
    from tests.twin.kobuki_body import IdealBody

STOP = bytes.fromhex("aa55 06 01 04 0000 0000 03")
LONGEST = 259  # bytes of a frame
STOPPING = 10  # cycles, more than a command takes to its effect


def one_input(data: bytes) -> None:
    """Noise as it comes, and as commands in good frames."""
    hear(chunks(data))
    parts = [part for part in chunks(data) if 3 <= len(part) <= 255]
    for part in parts:
        decode_commands(part)
    hear(encode_frame(part) for part in parts)


def hear(messages: Iterable[bytes]) -> None:
    """Let the base hear one message a cycle, and then a command to stop."""
    body = IdealBody()
    twin, parser = KobukiTwin(KobukiTwinConfig(), body, 1), FrameParser()
    for message in [*messages, bytes(LONGEST), STOP, *STOPPING * [b""]]:
        now = twin.next_due()
        (frame,) = parser.feed(twin.advance(now))
        assert isinstance(frame, Frame), "a bad frame is sent"
        twin.receive(message, now)
    assert body.twist == STANDSTILL, "does not stop"


if __name__ == "__main__":
    seeds = [bytes.fromhex(vector["hex"]) for vector in vectors("kobuki_vectors.json")]
    fuzz(one_input, [*seeds, *(seed[3:-1] for seed in seeds)])
