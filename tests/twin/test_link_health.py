"""What the robot says about the links to its devices, against what they suffered; virtual time."""

import asyncio
from collections.abc import Sequence

import pytest

from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import load_config
from gvgbot.links import Devices, Links
from gvgbot.simulation import Simulation, open_place
from gvgbot.topics import LinkHealth

pytestmark = pytest.mark.twin


def served(settings: Sequence[str], seconds: float) -> list[tuple[LinkHealth, LinkHealth]]:
    """The health of laser and base at the end of each second."""
    log: list[tuple[LinkHealth, LinkHealth]] = []

    async def main() -> None:
        config, clock = load_config(None, settings), LoopClock()
        simulation = Simulation(config, open_place(config), clock)
        devices = Devices(Links(config, clock, simulation))
        async with asyncio.TaskGroup() as tasks:
            serving = tasks.create_task(devices.run())
            while clock.now() < seconds:
                await clock.sleep_until(clock.now() + 1.0)
                log.append((devices.laser_health, devices.base_health))
            serving.cancel()

    run_in_virtual_time(main())
    return log


def test_sound_links_lose_nothing() -> None:
    laser, base = served([], 20.0)[-1]
    assert (laser.connected, laser.damaged, laser.lost, laser.reconnects) == (True, 0, 0, 0)
    assert (base.connected, base.damaged, base.lost, base.reconnects) == (True, 0, 0, 0)
    assert laser.messages == pytest.approx(10 * 20, abs=10)  # 10 scans a second
    assert base.messages == pytest.approx(50 * 20, abs=3)


def test_clocks_are_as_far_apart_as_they_were_set() -> None:
    """The base counts from when it was switched on, here with the robot's own clock."""
    settings = ["twin.laser.clock_start_ms=100000", "twin.laser.clock_drift_ppm=0"]
    laser, base = served(settings, 10.0)[-1]
    assert laser.clock_offset == pytest.approx(-100.0, abs=0.005)
    assert base.clock_offset == pytest.approx(0.0, abs=0.005)


def test_before_a_device_is_heard_nothing_is_known() -> None:
    gone = [f"twin.{name}.link.unplugs_at_s=[0]" for name in ("laser", "base")]
    for health in served(gone, 2.0)[0]:
        assert (health.connected, health.messages, health.clock_offset) == (False, 0, None)


@pytest.mark.parametrize("seed", range(3))
def test_damaged_messages_are_counted_and_so_are_the_gaps_they_leave(seed: int) -> None:
    spoilt = ["twin.laser.bad_checksum_fraction=0.1", "twin.base.link.lost_bytes_per_kb=0.5"]
    first, *_, last = served([*spoilt, f"twin.seed={seed}"], 30.0)
    for before, after, rate in zip(first, last, (10, 50), strict=True):
        came, lost = after.messages - before.messages, after.lost - before.lost
        assert came + lost == pytest.approx(29 * rate, abs=2)
        assert lost > 0
        assert after.damaged > 0
        assert after.reconnects == 0


def test_an_unplugged_device_is_not_connected_and_its_counters_go_on() -> None:
    settings = [
        f"twin.{name}.link.{fault}"
        for name in ("laser", "base")
        for fault in ("unplugs_at_s=[5.5, 12.5]", "unplugged_s=2")
    ]
    log = served(settings, 20.0)
    for device in (0, 1):
        health = [both[device] for both in log]
        assert [health[second - 1].connected for second in (5, 7, 11, 14, 20)] == [
            *(True, False, True, False, True)
        ]
        assert [health[second - 1].reconnects for second in (5, 7, 11, 14, 20)] == [0, 0, 1, 1, 2]
        messages = [each.messages for each in health]
        assert messages == sorted(messages)
        assert messages[-1] > messages[10] > messages[4] > 0
