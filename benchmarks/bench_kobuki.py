"""CPU time of the Kobuki protocol and of simulating a base: `python -m benchmarks.bench_kobuki`."""

import asyncio
from collections.abc import Callable
from time import process_time

from benchmarks.report import report_rate
from benchmarks.rigs.stamp_errors import RollingBody
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.drivers.kobuki.driver import KobukiBase, KobukiConfig
from gvgbot.drivers.kobuki.feedback import FeedbackReader
from gvgbot.drivers.kobuki.frames import Frame, FrameParser, encode_frame
from gvgbot.drivers.kobuki.payloads import decode_feedback, encode_feedback
from gvgbot.drivers.kobuki.twin import KobukiTwin, KobukiTwinConfig
from gvgbot.drivers.kobuki.wheel_odometry import KOBUKI
from gvgbot.drivers.transport import pipe, serve_twin
from gvgbot.geometry import Twist

FRAMES = 20_000
DRIVE_S = 120.0
UNIT = "per s of CPU"


def timed(work: Callable[[], object]) -> float:
    start = process_time()
    work()
    return process_time() - start


def protocol() -> None:
    twin = KobukiTwin(KobukiTwinConfig(), RollingBody(), 1)
    frames = [twin.advance(twin.next_due()) for _ in range(FRAMES)]
    parser = FrameParser()

    def decode() -> None:
        for data in frames:
            for frame in parser.feed(data):
                assert isinstance(frame, Frame)
                decode_feedback(frame.payload)

    parts = decode_feedback(frames[0][3:-1])
    reader = FeedbackReader("gyro", 0.0, KOBUKI)
    works = {
        "framing and decoding": decode,
        "encoding and framing": lambda: [
            encode_frame(encode_feedback(parts)) for _ in range(FRAMES)
        ],
        "bytes to odometry, contact, battery": lambda: [
            reader.take(data, 0.02 * k) for k, data in enumerate(frames)
        ],
        "twin, body not counted": lambda: [twin.advance(twin.next_due()) for _ in range(FRAMES)],
    }
    for name, work in works.items():
        report_rate(f"base frames: {name}", FRAMES / timed(work), UNIT, at_least=20_000)


async def drive() -> None:
    clock = LoopClock()
    here, there = pipe()
    base = KobukiBase(here, KobukiConfig(), clock)
    twin = KobukiTwin(KobukiTwinConfig(), RollingBody(), 1)
    async with asyncio.TaskGroup() as tasks:
        served = tasks.create_task(serve_twin(twin, there, clock))
        run = tasks.create_task(base.run())
        while clock.now() < DRIVE_S:
            await base.next_odometry()
            base.drive(Twist(0.3, 0.4))
        served.cancel()
        run.cancel()


if __name__ == "__main__":
    protocol()
    seconds = timed(lambda: run_in_virtual_time(drive()))
    report_rate("base driver, twin and commands", 50 * DRIVE_S / seconds, UNIT, at_least=2_500)
