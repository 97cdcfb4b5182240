"""The laser of the whole simulation behind a bad link, as its configuration says."""

import asyncio
import contextlib
from itertools import pairwise

import pytest

from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import load_config
from gvgbot.drivers.hokuyo.driver import HokuyoLaser
from gvgbot.errors import DeviceLost
from gvgbot.hal.reopening import ReopeningLaser
from gvgbot.links import Links
from gvgbot.simulation import Simulation, open_place

pytestmark = pytest.mark.twin


def test_a_laser_that_is_pulled_comes_back_when_it_is_plugged_in() -> None:
    """The cable is out for two seconds about every ten; the robot stands, scans come again."""

    async def main() -> None:
        config = load_config(
            None, ["twin.laser.link.unplugs_per_h=360", "twin.laser.link.unplugged_s=2"]
        )
        clock = LoopClock()
        simulation = Simulation(config, open_place(config), clock)
        laser = ReopeningLaser(Links(config, clock, simulation).open_laser, clock)
        stamps = []
        async with asyncio.TaskGroup() as tasks:
            work = [tasks.create_task(simulation.run()), tasks.create_task(laser.run())]
            while clock.now() < 60.0:
                with contextlib.suppress(DeviceLost):
                    stamps.append((await laser.next_scan()).stamp)
            for task in work:
                task.cancel()
        gaps = [after - before for before, after in pairwise(stamps)]
        pulled = [gap for gap in gaps if gap > 1.0]
        assert 2 <= len(pulled) <= 12
        assert min(pulled) > 2.0
        assert sorted(pulled)[len(pulled) // 2] < 2.0 + 4.0  # the wait to reopen doubles
        assert simulation.laser_twin.counts["unplug"] >= len(pulled)

    run_in_virtual_time(main())


def test_a_pulled_laser_is_lost_at_once() -> None:
    async def main() -> None:
        config = load_config(None, [])
        clock = LoopClock()
        simulation = Simulation(config, open_place(config), clock)
        async with asyncio.TaskGroup() as tasks:
            work = tasks.create_task(simulation.run())
            driver = HokuyoLaser(simulation.laser, config.laser, clock)
            running = tasks.create_task(_lost(driver))
            await driver.next_scan()
            began = clock.now()
            simulation.laser_twin.inject("unplug", 5.0)
            await running
            assert clock.now() - began < 0.2
            work.cancel()

    async def _lost(driver: HokuyoLaser) -> None:
        with pytest.raises(DeviceLost):
            await driver.run()

    run_in_virtual_time(main())
