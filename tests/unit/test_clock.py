"""Virtual time: it jumps, it is orderly, and it reports what would hang."""

import asyncio
import math
import time

import pytest

from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.errors import Deadlock

HOUR = 3600.0


async def ticker(name: str, period: float, times: int, log: list[tuple[str, float]]) -> None:
    clock = LoopClock()
    start = clock.now()
    for n in range(1, times + 1):
        await clock.sleep_until(start + n * period)
        log.append((name, clock.now() - start))


async def two_tickers(period: float, times: int) -> list[tuple[str, float]]:
    log: list[tuple[str, float]] = []
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(ticker("odometry", period, 5 * times, log))
        tasks.create_task(ticker("scan", 5 * period, times, log))
    return log


def test_an_hour_passes_at_once() -> None:
    async def an_hour() -> float:
        start = LoopClock().now()
        await LoopClock().sleep_until(start + HOUR)
        return LoopClock().now() - start

    before = time.perf_counter()
    assert run_in_virtual_time(an_hour()) == pytest.approx(HOUR)
    assert time.perf_counter() - before < 1.0


def test_timers_fire_at_their_stamps_and_interleave_as_their_periods_say() -> None:
    log = run_in_virtual_time(two_tickers(0.02, 10))
    scans = [stamp for name, stamp in log if name == "scan"]
    assert scans == pytest.approx([0.1 * n for n in range(1, 11)])
    assert len([name for name, _ in log if name == "odometry"]) == 50
    assert [stamp for _, stamp in log] == sorted(stamp for _, stamp in log)


def test_the_order_of_tasks_is_the_same_every_time() -> None:
    first = run_in_virtual_time(two_tickers(0.02, 50))
    assert first == run_in_virtual_time(two_tickers(0.02, 50))


def test_tasks_due_at_the_same_stamp_run_in_the_same_order_every_time() -> None:
    async def run() -> list[int]:
        order: list[int] = []

        async def wake(number: int) -> None:
            await LoopClock().sleep_until(1.0)
            order.append(number)

        async with asyncio.TaskGroup() as tasks:
            for number in range(20):
                tasks.create_task(wake(number))
        assert LoopClock().now() == pytest.approx(1.0)
        return order

    first = run_in_virtual_time(run())
    assert sorted(first) == list(range(20))
    assert first == run_in_virtual_time(run())


def test_time_stands_still_while_something_is_ready() -> None:
    async def run() -> float:
        for _ in range(1000):
            await asyncio.sleep(0)
        return LoopClock().now()

    assert run_in_virtual_time(run()) == 0.0


def test_a_stamp_that_has_passed_returns_at_once_but_lets_others_run() -> None:
    async def run() -> tuple[list[str], float]:
        log: list[str] = []

        async def other() -> None:
            log.append("other")

        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(other())
            await LoopClock().sleep_until(-1.0)
            log.append("late")
        return log, LoopClock().now()

    assert run_in_virtual_time(run()) == (["other", "late"], 0.0)


def test_a_wait_that_nothing_can_end_is_reported_as_a_deadlock() -> None:
    async def run() -> None:
        await asyncio.Event().wait()

    with pytest.raises(Deadlock):
        run_in_virtual_time(run())


def test_two_tasks_that_wait_for_each_other_are_reported_as_a_deadlock() -> None:
    async def run() -> None:
        first, second = asyncio.Event(), asyncio.Event()

        async def one() -> None:
            await first.wait()
            second.set()

        async def other() -> None:
            await second.wait()
            first.set()

        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(one())
            tasks.create_task(other())

    with pytest.raises(Deadlock):
        run_in_virtual_time(run())


def test_a_timeout_ends_a_wait_after_exactly_that_long() -> None:
    async def run() -> float:
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(12.5):
                await asyncio.Event().wait()
        return LoopClock().now()

    assert run_in_virtual_time(run()) == pytest.approx(12.5)


def test_an_error_of_the_program_comes_out_unchanged() -> None:
    async def run() -> None:
        await LoopClock().sleep_until(1.0)
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        run_in_virtual_time(run())


def test_the_same_program_runs_on_the_real_clock() -> None:
    before = time.perf_counter()
    log = asyncio.run(two_tickers(0.001, 3))
    assert 0.014 <= time.perf_counter() - before < 5.0
    assert [name for name, _ in log].count("odometry") == 15
    assert [name for name, _ in log].count("scan") == 3


def test_two_tasks_that_wait_for_the_next_instant_do_not_stop_time() -> None:
    """Each wakes the other up, so that the loop is never idle; timers must not fire early."""

    async def wait(clock: LoopClock, stamp: float) -> int:
        rounds = 0
        while clock.now() < stamp and rounds < 1000:
            await clock.sleep_until(stamp)
            rounds += 1
        return rounds

    async def main() -> tuple[int, int]:
        clock = LoopClock()
        await clock.sleep_until(5.1)
        later = math.nextafter(clock.now(), math.inf)
        return await asyncio.gather(wait(clock, later), wait(clock, later))

    assert max(run_in_virtual_time(main())) <= 2
