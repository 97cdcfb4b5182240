"""Coverage-guided fuzzing of what reads SCIP bytes: `python tests/fuzz/fuzz_scip.py`.

Arguments are libFuzzer's, such as -max_total_time=60. It ends with a stack trace if the parser or
the simulated laser raises, remembers without bound, or lets noise hide a good message that follows.
"""

import json
import math
import sys
import tempfile
from pathlib import Path

import atheris  # type: ignore[import-not-found,import-untyped,unused-ignore]

with atheris.instrument_imports():
    import numpy as np

    from gvgbot.drivers.hokuyo.models import Identity, Parameters
    from gvgbot.drivers.hokuyo.scip import (
        MESSAGE_LIMIT,
        ScipParser,
        decode_time,
        encode_reply,
        encode_scan,
    )
    from gvgbot.drivers.hokuyo.scip_codec import DamagedError, with_checksum
    from gvgbot.drivers.hokuyo.scip_messages import Message, Reply, ScanReply
    from gvgbot.drivers.hokuyo.twin import HokuyoTwin, HokuyoTwinConfig

STOPPED = b"QT\n00P\n\n"
RANGES = np.full(1081, 2.0)
SOON = 0.1  # s in which the twin is let work


def sealed(data: bytes) -> bytes:
    """The lines with their checksums put right, which guessing would rarely do."""
    echo, *lines = data.split(b"\n")
    return b"\n".join([echo, *(with_checksum(line) if line else line for line in lines)])


def read(data: bytes) -> None:
    """Feed the bytes, cut by their own first byte, and then a reply that must be found."""
    size = 1 + (data[0] if data else 0)
    parser = ScipParser()
    for start in range(0, len(data), size):
        for message in parser.feed(data[start : start + size]):
            check_message(message)
        assert parser.pending < MESSAGE_LIMIT, "memory without bound"
    assert parser.feed(b"\n\n" + STOPPED)[-1] == Reply("QT", "00"), "a good reply is not found"


def check_message(message: Message) -> None:
    """What was read can be used, and survives being written and read again."""
    if isinstance(message, ScanReply):
        (again,) = ScipParser().feed(encode_scan(message))
        assert isinstance(again, ScanReply)
        assert np.array_equal(again.ranges, message.ranges), "a scan does not survive writing"
    elif isinstance(message, Reply):
        (again,) = ScipParser().feed(encode_reply(message))
        assert again == message, "a reply does not survive writing"
        use(message)


def use(reply: Reply) -> None:
    """Make of the reply what the driver would."""
    Identity.from_lines(reply.fields)
    try:
        Parameters.from_lines(reply.fields)
        decode_time(reply)
    except ValueError:
        return  # DamagedError is one: the driver refuses such a laser


def command(data: bytes) -> None:
    """Type the bytes into a simulated laser, which must obey a stop afterwards."""
    assert issubclass(DamagedError, ValueError)
    twin = HokuyoTwin(HokuyoTwinConfig(), lambda stamp: RANGES, seed=1)
    twin.receive(data, 0.0)
    for _ in range(100):
        due = twin.next_due()
        if due > SOON:
            break
        twin.advance(due)
    twin.receive(b"\nSCIP2.0\nTM2\nRS\nQT\n", SOON)
    assert twin.next_due() == math.inf or b"RB" in data, "does not stop"


def one_input(data: bytes) -> None:
    """Noise as it comes, as a message with good checksums, and as what a host types."""
    read(data)
    read(sealed(data) + b"\n\n")
    command(data)


def plant(folder: Path) -> None:
    """Write the example messages into the folder, from which the fuzzer sets out."""
    examples = json.loads((Path(__file__).parents[1] / "data" / "scip_vectors.json").read_text())
    for number, vector in enumerate(examples["vectors"]):
        (folder / f"{number}.rx").write_bytes(vector["rx"].encode("latin-1"))
        (folder / f"{number}.tx").write_bytes(vector.get("tx", "").encode("latin-1"))


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as seeds:  # left behind: the fuzzer ends the process itself
        plant(Path(seeds))
        atheris.Setup([*sys.argv, seeds], one_input)
        atheris.Fuzz()
