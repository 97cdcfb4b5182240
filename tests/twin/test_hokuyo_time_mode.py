"""What a simulated laser tells of its clock before the scans, and when it tells nothing."""

import asyncio

import numpy as np
import pytest

from benchmarks.rigs.hokuyo_bench import CutsReply, Scripted, TiresOfTime, World
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.drivers.hokuyo.clock_sync import Synchronisation
from gvgbot.drivers.hokuyo.dialogue import Dialogue
from gvgbot.drivers.hokuyo.opening import quiet
from gvgbot.drivers.hokuyo.scip import ScipParser, decode_time
from gvgbot.drivers.hokuyo.scip_messages import Reply
from gvgbot.drivers.hokuyo.statistics import LinkStatistics
from gvgbot.drivers.hokuyo.time_mode import synchronise
from gvgbot.drivers.hokuyo.twin import HokuyoTwin, HokuyoTwinConfig
from gvgbot.drivers.transport import TwinDevice, pipe, serve_twin

pytestmark = pytest.mark.twin


class LosesStops(Scripted):
    """A laser that says yes to a stop and goes on, so many times."""

    def __init__(self, twin: TwinDevice, losses: int) -> None:
        super().__init__({b"QT\n": b"QT\n00P\n\n"}, twin)
        self.losses = losses

    def answer(self, command: bytes, now: float) -> bytes:
        if command == b"QT\n":
            self.losses -= 1
            if self.losses < 0:
                return self.twin.receive(command, now)
        return super().answer(command, now)


def laser_of() -> HokuyoTwin:
    """A laser whose clock is the host's, but for what it rounds off and when it ticks."""
    return HokuyoTwin(HokuyoTwinConfig(clock_drift_ppm=0.0), World(), seed=18)


def told(
    twin: TwinDevice, *, left_over: bytes = b"", unanswered: int = 0
) -> Synchronisation | None:
    """What is known of the clock of a laser that was at work and is brought to rest."""

    async def main() -> Synchronisation | None:
        here, there = pipe()
        clock = LoopClock()
        dialogue = Dialogue(here, clock, 0.5, LinkStatistics())
        async with asyncio.TaskGroup() as tasks:
            served = tasks.create_task(serve_twin(twin, there, clock))
            here.write(left_over)
            await clock.sleep_until(clock.now() + 1.0)
            await quiet(dialogue, patience=1.0)
            sync = await synchronise(dialogue)
            served.cancel()
        assert dialogue.link.unanswered == unanswered
        return sync

    return run_in_virtual_time(main())


def assert_right(sync: Synchronisation | None) -> None:
    assert sync is not None
    assert abs(sync.host - sync.stamp_ms / 1000.0 - first_tick()) <= sync.error < 0.001


def first_tick() -> float:
    """How long before zero (s, negative) the laser's clock began its first millisecond."""
    twin = laser_of()
    twin.receive(b"TM0\n", 0.0)
    asked = np.arange(0.0, 1e-3, 1e-5)
    replies = b"".join(twin.receive(b"TM1\n", now) for now in asked.tolist())
    stamps = [decode_time(m) for m in ScipParser().feed(replies) if isinstance(m, Reply)]
    return float(asked[stamps.index(1)]) - 1e-3


def test_clocks_are_known_to_within_the_error_that_is_told() -> None:
    assert_right(told(laser_of()))


@pytest.mark.parametrize("losses", [1, 2])
def test_a_lost_stop_costs_no_synchronisation(losses: int) -> None:
    assert_right(told(LosesStops(laser_of(), losses), left_over=b"MD0000108001300\n"))


def test_a_laser_that_is_in_time_mode_already_is_synchronised() -> None:
    """It is when its reply to the first TM0 got lost, and then it answers 02 to the second."""
    assert_right(told(CutsReply(laser_of(), b"TM0\n"), unanswered=1))


@pytest.mark.parametrize("mute", [b"TM0\n", b"TM1\n"])
def test_a_laser_may_keep_its_time_to_itself(mute: bytes) -> None:
    assert told(Scripted({mute: b""}, laser_of()), unanswered=3) is None


def test_times_from_before_a_silence_say_nothing_of_the_clock() -> None:
    assert told(TiresOfTime(laser_of(), 5), unanswered=3) is None
