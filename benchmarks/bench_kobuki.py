"""CPU time of the Kobuki protocol and of simulating a base; run it as a script."""

import asyncio
from collections.abc import Callable
from time import process_time

from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.drivers.kobuki.driver import KobukiBase, KobukiConfig
from gvgbot.drivers.kobuki.feedback import FeedbackReader
from gvgbot.drivers.kobuki.frames import Frame, FrameParser, encode_frame
from gvgbot.drivers.kobuki.payloads import decode_feedback, encode_feedback
from gvgbot.drivers.kobuki.twin import KobukiTwin, KobukiTwinConfig
from gvgbot.drivers.transport import pipe, serve_twin
from gvgbot.geometry import Pose, Twist

FRAMES = 20_000
DRIVE_S = 120.0


class StandingBody:
    """A body that costs nothing to simulate."""

    left_travel = 0.0
    right_travel = 0.0
    pose = Pose()
    bumper = (False, False, False)

    def advance(self, now: float) -> None:
        self.left_travel = self.right_travel = 0.3 * now

    def command(self, linear: float, angular: float) -> None:
        pass


def report(what: str, seconds: float, count: float, unit: str) -> None:
    print(f"{what:42} {1e6 * seconds / count:8.1f} us per {unit} {count / seconds:12.0f} per s")


def timed(work: Callable[[], object]) -> float:
    start = process_time()
    work()
    return process_time() - start


def protocol() -> None:
    twin = KobukiTwin(KobukiTwinConfig(), StandingBody(), 1)
    frames = [twin.advance(twin.next_due()) for _ in range(FRAMES)]
    parser = FrameParser()

    def decode() -> None:
        for data in frames:
            for frame in parser.feed(data):
                assert isinstance(frame, Frame)
                decode_feedback(frame.payload)

    report("framing and decoding", timed(decode), FRAMES, "frame")
    parts = decode_feedback(frames[0][3:-1])
    encoding = timed(lambda: [encode_frame(encode_feedback(parts)) for _ in range(FRAMES)])
    report("encoding and framing", encoding, FRAMES, "frame")
    reader = FeedbackReader("gyro", 0.0)
    reading = timed(lambda: [reader.take(data, 0.02 * k) for k, data in enumerate(frames)])
    report("bytes to odometry, contact, battery", reading, FRAMES, "frame")
    twinning = timed(lambda: [twin.advance(twin.next_due()) for _ in range(FRAMES)])
    report("twin, body not counted", twinning, FRAMES, "frame")


async def drive() -> None:
    clock = LoopClock()
    here, there = pipe()
    base = KobukiBase(here, KobukiConfig(), clock)
    twin = KobukiTwin(KobukiTwinConfig(), StandingBody(), 1)
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
    report("driver, twin and 50 Hz commands", seconds, 50 * DRIVE_S, "cycle")
    print(f"{DRIVE_S / seconds:.0f} times faster than life")
