"""What every Base must do, written once: for the twins, in memory or on a pseudo-terminal."""

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager, closing
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from gvgbot.clock import Clock, LoopClock, run_in_virtual_time
from gvgbot.config import Config, load_config
from gvgbot.drivers.pty import PtyPort
from gvgbot.drivers.transport import serve_twin
from gvgbot.geometry import STANDSTILL, Twist
from gvgbot.hal.devices import Base
from gvgbot.links import Links
from gvgbot.simulation import Simulation, open_place

Story = Callable[[Base, Clock], Coroutine[Any, Any, None]]
CONFIGS = ["sim.yaml", "husky.yaml"]


@asynccontextmanager
async def in_memory(config: Config) -> AsyncIterator[Base]:
    """The base of a configuration on an in-memory stream, being served."""
    clock = LoopClock()
    simulation = Simulation(config, open_place(config), clock)
    base, close = await Links(config, clock, simulation).open_base()
    async with asyncio.TaskGroup() as tasks:
        work = [tasks.create_task(simulation.run()), tasks.create_task(base.run())]
        yield base
        for task in work:
            task.cancel()
    close()


@asynccontextmanager
async def on_a_terminal(config: Config) -> AsyncIterator[Base]:
    """The base on a pseudo-terminal, opened like a serial port."""
    clock = LoopClock()
    simulation = Simulation(config, open_place(config), clock)
    with closing(PtyPort()) as port:
        settings = [f"base.port={port.path}", "twin.enabled=false"]
        there = load_config(None, settings)
        base, close = await Links(there, clock, None).open_base()
        async with asyncio.TaskGroup() as tasks:
            work = [
                tasks.create_task(serve_twin(simulation.base_twin, port, clock)),
                tasks.create_task(base.run()),
            ]
            yield base
            for task in work:
                task.cancel()
        close()


def play_in_memory(name: str) -> Callable[[Story], None]:
    def play(story: Story) -> None:
        async def main() -> None:
            async with in_memory(load_config(Path(name))) as base:
                await story(base, LoopClock())

        run_in_virtual_time(main())

    return play


def play_on_a_terminal(story: Story) -> None:
    async def main() -> None:
        async with on_a_terminal(load_config()) as base:
            await story(base, LoopClock())

    asyncio.run(main())


def play_on_hardware(port: str) -> Callable[[Story], None]:
    async def main(story: Story) -> None:
        clock = LoopClock()
        config = load_config(None, [f"base.port={port}", "twin.enabled=false"])
        base, close = await Links(config, clock, None).open_base()
        async with asyncio.TaskGroup() as tasks:
            serving = tasks.create_task(base.run())
            await story(base, clock)
            serving.cancel()
        close()

    return lambda story: asyncio.run(main(story))


PLAYERS = [
    *(pytest.param(play_in_memory(name), id=name) for name in CONFIGS),
    pytest.param(play_on_a_terminal, id="terminal", marks=pytest.mark.slow),
    pytest.param(None, id="hardware", marks=pytest.mark.hardware),
]


@pytest.fixture(params=PLAYERS)
def play(request: pytest.FixtureRequest) -> Callable[[Story], None]:
    """Tell a story to a base that is being served; a real one needs 0.2 m of free way ahead."""
    if request.param is not None:
        player: Callable[[Story], None] = request.param
        return player
    port = request.config.getoption("--base-port")
    if port is None:
        pytest.skip("needs --base-port")
    return play_on_hardware(port)


def test_odometry_comes_steadily_with_rising_stamps_that_are_not_in_the_future(
    play: Callable[[Story], None],
) -> None:
    async def story(base: Base, clock: Clock) -> None:
        stamps = []
        for _ in range(50):
            stamps.append((await base.next_odometry()).stamp)
            assert clock.now() - 0.5 < stamps[-1] < clock.now() + 0.005
        assert all(before < after for before, after in pairwise(stamps))
        assert 0.5 < stamps[-1] - stamps[0] < 3.0

    play(story)


def test_it_begins_at_the_origin_standing(play: Callable[[Story], None]) -> None:
    async def story(base: Base, clock: Clock) -> None:
        odometry = await base.next_odometry()
        assert abs(odometry.odom_base.x) + abs(odometry.odom_base.y) < 1e-3
        assert abs(odometry.twist.linear) < 1e-3

    play(story)


def test_contact_and_battery_are_known_with_the_odometry(play: Callable[[Story], None]) -> None:
    async def story(base: Base, clock: Clock) -> None:
        await base.next_odometry()
        assert base.contact is not None
        assert not base.contact.wheel_drop
        assert base.battery is not None
        assert 0.0 <= base.battery.fraction <= 1.0
        assert base.battery.voltage > 5.0

    play(story)


def test_it_does_what_drive_says_and_stands_when_no_longer_driven(
    play: Callable[[Story], None],
) -> None:
    async def story(base: Base, clock: Clock) -> None:
        odometry = await base.next_odometry()
        start, told = odometry, STANDSTILL
        while odometry.stamp < start.stamp + 1.0:
            told = base.drive(Twist(0.1, 0.0))
            odometry = await base.next_odometry()
        assert told.linear == pytest.approx(0.1, abs=0.002)
        assert odometry.twist.linear == pytest.approx(told.linear, abs=0.03)
        assert 0.04 < odometry.odom_base.x - start.odom_base.x < 0.11
        while odometry.stamp < start.stamp + 2.2:
            odometry = await base.next_odometry()
        assert abs(odometry.twist.linear) < 0.005

    play(story)


def test_a_twist_that_is_no_number_is_a_standstill(play: Callable[[Story], None]) -> None:
    async def story(base: Base, clock: Clock) -> None:
        await base.next_odometry()
        assert base.drive(Twist(float("nan"), 0.1)) == STANDSTILL

    play(story)
