"""Coverage-guided fuzzing of what a simulated laser hears: `python -m tests.fuzz.fuzz_scip_twin`.

Arguments are libFuzzer's, such as -max_total_time=60. It ends with a stack trace if the laser
raises, works without end, or does not fall silent when it is told to.
"""

import math

import atheris

from tests.fuzz.harness import chunks, fuzz, vectors

with atheris.instrument_imports(include=["gvgbot"]):
    import numpy as np

    from gvgbot.drivers.hokuyo.twin import HokuyoTwin, HokuyoTwinConfig

RANGES = np.full(1081, 2.0)
LASERS = (
    HokuyoTwinConfig(),
    HokuyoTwinConfig(serial_baud=19200, starts_in_scip_1=True),
    HokuyoTwinConfig(starts_abnormal=True, answers_once_per_turn=True),
    HokuyoTwinConfig(boot_s=0.005),
)
STOP = b"\nSCIP2.0\nTM2\nRS\nQT\n"
HEARING = 0.001  # s between two chunks
MOMENTS = 500  # in which a laser that was stopped must be done


def one_input(data: bytes) -> None:
    """Type the bytes into a laser, which must obey a stop afterwards."""
    laser = HokuyoTwin(LASERS[len(data) % len(LASERS)], lambda *_: RANGES, seed=1)
    now = 0.0
    for chunk in chunks(data):
        now += HEARING
        work(laser, now)
        laser.receive(chunk, now)
    laser.receive(STOP, now + HEARING)
    for _ in range(MOMENTS):
        due = laser.next_due()
        if due == math.inf:
            return
        laser.advance(due)
    raise AssertionError("does not stop")


def work(laser: HokuyoTwin, until: float) -> None:
    """Let the laser do what is due."""
    for _ in range(MOMENTS):
        if (due := laser.next_due()) > until:
            return
        laser.advance(due)
    raise AssertionError("time stands still")


if __name__ == "__main__":
    fuzz(one_input, (vector.get("tx", "").encode() for vector in vectors("scip_vectors.json")))
