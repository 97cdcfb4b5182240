"""How a daemon's memory grows while it explores, and what for.

Run: python -m benchmarks.memory [WORLD] [MINUTES] [--objects]

A daemon on twins in virtual time, saving and publishing as it does in life, but to nobody. Before
each reading, a minute apart, what is free is given back to the system. With --objects, which takes
some times as long, also the lines of code that allocated most of what has been kept.
"""

import argparse
import asyncio
import ctypes
import gc
import tempfile
import tracemalloc
from collections.abc import Awaitable, Callable
from pathlib import Path

import msgspec

from benchmarks.report import report_fact
from benchmarks.rigs.run_rig import at_once
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import Config, TwinConfig
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.requests import Answer, Asked
from gvgbot.robot import Robot
from gvgbot.service import Notifier
from gvgbot.session import Session
from gvgbot.simulation import open_place
from gvgbot.topics import Payload

_TOP = 15  # lines of code


class Nobody:
    """Keeps the newest of each kind, as telemetry does."""

    failures = 0

    def __init__(self) -> None:
        self._latest: dict[type[Payload], Payload] = {}

    def publish(self, value: Payload, latest: Payload | None = None) -> None:
        self._latest[type(value)] = value if latest is None else latest
        msgspec.msgpack.encode(value)

    def is_heard(self, payload: type[Payload]) -> bool:
        return True

    async def answer(self) -> None:
        await asyncio.Event().wait()

    async def hear(self, handle: Callable[[Asked], Awaitable[Answer]]) -> None:
        await asyncio.Event().wait()


def resident_mb() -> float:
    """Of this process, after what is free has been given back."""
    gc.collect()
    ctypes.CDLL("libc.so.6").malloc_trim(0)
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * 4096 / 1e6


async def look_on(session: Session, minutes: int) -> str:
    """Report the memory once a minute."""
    clock, pipeline, begin = LoopClock(), session.pipeline, 0.0
    for minute in range(minutes + 1):
        await clock.sleep_until(20.0 + 60.0 * minute)
        begin = begin or resident_mb()
        report_fact(f"after {minute} min and {pipeline.past.travelled:.0f} m", resident_mb(), "MB")
    grown = resident_mb() - begin
    report_fact("for each metre driven", 1e3 * grown / pipeline.past.travelled, "kB")
    return "SIGINT"


def main(world: str, minutes: int, *, objects: bool) -> None:
    config = Config(twin=TwinConfig(world=world))
    with tempfile.TemporaryDirectory() as folder:
        session = Session(config, RunDirectory(Path(folder) / "run"), open_place(config))
        robot = Robot(session, Notifier(None), Nobody(), off_loop=at_once)
        if objects:
            tracemalloc.start()
        with session.directory:
            run_in_virtual_time(robot.serve(look_on(session, minutes)))
        if objects:
            for line in tracemalloc.take_snapshot().statistics("lineno")[:_TOP]:
                print(line)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("world", nargs="?", default="floor_plan:12")
    parser.add_argument("minutes", nargs="?", type=int, default=10)
    parser.add_argument("--objects", action="store_true")
    chosen = parser.parse_args()
    main(chosen.world, chosen.minutes, objects=chosen.objects)
