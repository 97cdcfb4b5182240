"""The mailbox keeps only the newest value."""

import asyncio

import pytest

from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.errors import Deadlock
from gvgbot.hal.latest import Latest


def test_a_reader_gets_the_newest_of_several_values() -> None:
    async def run() -> int:
        box = Latest[int]()
        for value in (1, 2, 3):
            box.put(value)
        return await box.next()

    assert run_in_virtual_time(run()) == 3


def test_a_value_is_handed_out_only_once() -> None:
    async def run() -> None:
        box = Latest[int]()
        box.put(1)
        await box.next()
        await box.next()

    with pytest.raises(Deadlock):
        run_in_virtual_time(run())


def test_a_reader_waits_for_a_value() -> None:
    async def run() -> tuple[str, float]:
        box = Latest[str]()
        asyncio.get_running_loop().call_later(4.0, box.put, "here")
        return await box.next(), LoopClock().now()

    value, now = run_in_virtual_time(run())
    assert value == "here"
    assert now == pytest.approx(4.0)


def test_a_slow_reader_sees_fresh_values_not_a_queue() -> None:
    async def write(box: Latest[int]) -> None:
        for step in range(100):
            box.put(step)
            await LoopClock().sleep_until(0.01 * (step + 1))

    async def run() -> list[tuple[int, float]]:
        box, seen, clock = Latest[int](), [], LoopClock()
        async with asyncio.TaskGroup() as tasks:
            writer = tasks.create_task(write(box))
            while not writer.done():
                seen.append((await box.next(), clock.now()))
                await clock.sleep_until(clock.now() + 0.2525)
        return seen

    seen = run_in_virtual_time(run())
    assert len(seen) == 4
    assert all(value == int(stamp / 0.01) for value, stamp in seen)
