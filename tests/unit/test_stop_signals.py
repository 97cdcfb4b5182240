"""Programs that are told to end."""

import asyncio
import os
import signal

import pytest

from gvgbot.clock import VirtualTimeLoop, run_in_virtual_time
from gvgbot.stop_signals import StopSignals, standing_while_suspended


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_the_waiting_and_is_named(number: signal.Signals) -> None:
    async def main() -> str:
        async with asyncio.TaskGroup() as tasks:
            waiting = tasks.create_task(signals.wait())
            await asyncio.sleep(1.0)
            assert not waiting.done()
            signal.raise_signal(number)
        return waiting.result()

    with StopSignals() as signals:
        assert run_in_virtual_time(main()) == number.name


def test_a_signal_that_came_before_anybody_waited_is_not_lost() -> None:
    with StopSignals() as signals:
        signal.raise_signal(signal.SIGTERM)
        assert run_in_virtual_time(signals.wait()) == "SIGTERM"


def test_signals_after_the_first_change_nothing() -> None:
    with StopSignals() as signals:
        signal.raise_signal(signal.SIGINT)
        assert run_in_virtual_time(signals.wait()) == "SIGINT"
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGINT)
        assert run_in_virtual_time(signals.wait()) == "SIGINT"


def test_a_signal_ends_work_and_the_next_one_does_not_break_into_how_it_ends() -> None:
    done = []

    async def work() -> None:
        try:
            signal.raise_signal(signal.SIGINT)
            await asyncio.sleep(1.0)
            done.append("all of it")
        finally:
            signal.raise_signal(signal.SIGINT)
            await asyncio.sleep(1.0)
            done.append("tidied up")

    with StopSignals() as signals, pytest.raises(KeyboardInterrupt):
        signals.run(work(), VirtualTimeLoop)
    assert done == ["tidied up"]


def test_work_does_not_begin_after_a_signal() -> None:
    async def work() -> None:
        await asyncio.sleep(1.0)
        raise AssertionError("it went on")

    with StopSignals() as signals:
        signal.raise_signal(signal.SIGTERM)
        with pytest.raises(KeyboardInterrupt):
            signals.run(work(), VirtualTimeLoop)


def test_a_signal_that_was_blocked_can_stay_so() -> None:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        with StopSignals(unblocks=False):
            assert signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, {})
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def test_signals_are_what_they_were_afterwards() -> None:
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with StopSignals():
        assert signal.getsignal(signal.SIGINT) != before[0]
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_a_signal_that_was_blocked_is_heard_and_blocked_again_afterwards() -> None:
    """As the command line has Ctrl-C of a program that a script left in the background."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        with StopSignals() as signals:
            signal.raise_signal(signal.SIGINT)
            assert run_in_virtual_time(signals.wait()) == "SIGINT"
        assert signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, {})
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def test_a_robot_started_by_nohup_outlives_its_terminal() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with StopSignals():
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_robot_stands_each_time_before_it_is_suspended(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []

    async def main() -> None:
        suspended = asyncio.Event()

        def suspend(number: signal.Signals) -> None:
            done.append(number.name)
            suspended.set()

        monkeypatch.setattr(signal, "raise_signal", suspend)
        with standing_while_suspended(lambda: done.append("stand")):
            for _ in range(2):
                os.kill(os.getpid(), signal.SIGTSTP)
                await suspended.wait()
                suspended.clear()

    asyncio.run(main())
    assert done == ["stand", "SIGTSTP", "stand", "SIGTSTP"]
    assert signal.getsignal(signal.SIGTSTP) is signal.SIG_DFL


def test_a_program_that_nobody_can_suspend_stays_so() -> None:
    async def main() -> None:
        with standing_while_suspended(lambda: None):
            assert signal.getsignal(signal.SIGTSTP) is signal.SIG_IGN

    before = signal.signal(signal.SIGTSTP, signal.SIG_IGN)
    try:
        asyncio.run(main())
        assert signal.getsignal(signal.SIGTSTP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGTSTP, before)
