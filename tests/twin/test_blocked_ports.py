"""Ports that hold up whoever touches them do not hold up the loop; real time, real terminals."""

import asyncio
import contextlib
import os
import termios
import threading
import tty
from collections.abc import Awaitable, Callable, Iterator
from contextlib import closing, contextmanager
from itertools import takewhile
from pathlib import Path

import pytest
import serial

from gvgbot.clock import LoopClock
from gvgbot.config import load_config
from gvgbot.drivers.kobuki.commands import BaseControl, decode_commands
from gvgbot.drivers.kobuki.driver import KobukiBase, KobukiConfig
from gvgbot.drivers.kobuki.frames import BadFrame, Frame, FrameParser
from gvgbot.drivers.pty import PtyPort
from gvgbot.drivers.transport import SerialStream, open_port, open_serial, serve_twin
from gvgbot.errors import DeviceLost
from gvgbot.geometry import STANDSTILL, Twist
from gvgbot.hal.devices import Laser
from gvgbot.links import Devices, Links
from gvgbot.simulation import Simulation, open_place

pytestmark = pytest.mark.twin
BEATS = 100
SPEEDS = [0.001 * (1 + mm % 600) for mm in range(100_000)]


class Heart:
    """Beats when the loop comes round; after so many beats both events are set."""

    def __init__(self) -> None:
        self.has_beaten, self.for_threads = asyncio.Event(), threading.Event()

    async def beat(self) -> None:
        for _ in range(BEATS):
            await asyncio.sleep(0)
        self.has_beaten.set()
        self.for_threads.set()


def play(story: Callable[[Heart], Awaitable[None]]) -> None:
    """Play a story beside a beating heart. A loop that is held up hangs, and the test with it."""

    async def main() -> None:
        heart = Heart()
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(heart.beat())
            await story(heart)

    asyncio.run(main())


@contextmanager
def terminal() -> Iterator[tuple[int, str]]:
    """A terminal whose other end nobody reads: its descriptor, and what to open."""
    device, client = os.openpty()
    tty.setraw(client)
    try:
        yield device, os.ttyname(client)
    finally:
        os.close(device)
        os.close(client)


def test_a_port_whose_opening_waits_for_the_loop_is_opened() -> None:
    with terminal() as (_, path):

        async def story(heart: Heart) -> None:
            def slow(path: str, baud: int) -> serial.Serial:
                heart.for_threads.wait()
                return open_port(path, baud)

            stream = await open_serial(path, 115200, slow)
            assert heart.has_beaten.is_set()
            stream.close()

        play(story)


def test_a_port_that_is_unplugged_while_its_rate_is_searched_is_gone() -> None:
    async def story() -> None:
        device, client = os.openpty()
        path = os.ttyname(client)
        stream = await open_serial(path, 115200)
        os.close(client)
        os.close(device)
        with pytest.raises(DeviceLost, match=f"{path} is gone: plug it in again"):
            stream.set_baud(57600)
        stream.close()

    asyncio.run(story())


@pytest.mark.parametrize("step", ["tcgetattr", "tcsetattr", "tcflush"])
def test_a_port_that_is_unplugged_while_it_is_opened_has_gone(
    step: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    device, client = os.openpty()
    path = os.ttyname(client)
    os.close(client)
    real = getattr(termios, step)

    def too_late(*arguments: object) -> object:
        os.close(device)
        return real(*arguments)

    monkeypatch.setattr(termios, step, too_late)
    with pytest.raises(DeviceLost, match=f"cannot open {path}: it has just gone: plug it in"):
        open_port(path, 115200)


class Stuffed(serial.Serial):
    """A port that has bytes left which its device does not take, so that closing it waits."""

    def __init__(self, path: str, baud: int, heart: Heart) -> None:
        self.heart: Heart | None = None
        super().__init__(path, baud, timeout=0)
        self.heart = heart

    @property
    def out_waiting(self) -> int:
        return 1

    def close(self) -> None:
        if self.heart is not None:
            self.heart.for_threads.wait()
        super().close()


def test_a_port_whose_closing_waits_for_the_loop_is_closed() -> None:
    with terminal() as (_, path):
        ports: list[Stuffed] = []

        async def story(heart: Heart) -> None:
            ports.append(Stuffed(path, 115200, heart))
            stream = SerialStream(path, 115200, ports[0])
            stream.close()
            stream.close()
            assert ports[0].is_open
            await heart.has_beaten.wait()

        play(story)
        assert not ports[0].is_open


def test_a_device_that_takes_no_more_bytes_costs_its_own_bytes_only() -> None:
    with terminal() as (device, path):

        async def story(heart: Heart) -> None:
            stream = await open_serial(path, 115200)
            for _ in range(2000):
                with contextlib.suppress(DeviceLost):
                    stream.write(bytes(1000))  # of which a terminal holds some kilobytes
            await heart.has_beaten.wait()
            stream.close()

        play(story)
        os.set_blocking(device, False)
        assert 0 < len(os.read(device, 1 << 20)) < 100_000


def all_read(device: int) -> bytes:
    """What waits at the other end of a terminal, which does not block."""
    found = b""
    with contextlib.suppress(BlockingIOError):
        while True:
            found += os.read(device, 1 << 16)
    return found


def test_what_a_base_is_told_comes_whole_and_what_does_not_fit_was_not_told() -> None:
    """Until nothing more fits, and when somebody has read that."""
    with terminal() as (device, path):
        os.set_blocking(device, False)

        async def story() -> None:
            stream, found = await open_serial(path, 115200), b""
            base = KobukiBase(stream, KobukiConfig(), Standing())
            told = list(takewhile(lambda speed: base.drive(Twist(speed)) != STANDSTILL, SPEEDS))
            assert base.drive(Twist(0.5)) == STANDSTILL
            for _ in range(2):
                found += all_read(device)
                assert base.drive(Twist(0.5)) == Twist(0.5)
            found += all_read(device)
            stream.close()
            parser = FrameParser()
            heard = [speed_of(frame) for frame in parser.feed(found)]
            assert parser.skipped_bytes == 0
            whole = heard[: len(told)], heard[-2:]
            assert whole == ([round(1000 * speed) for speed in told], [500, 500])
            assert len(heard) <= len(told) + 3  # one that did not fit may have begun

        asyncio.run(story())


class Standing(LoopClock):
    """A clock by which nothing takes any time."""

    def now(self) -> float:
        return 0.0


def speed_of(frame: Frame | BadFrame) -> int:
    """The speed, mm/s, that a base is told."""
    assert isinstance(frame, Frame)
    (command,) = decode_commands(frame.payload)
    assert isinstance(command, BaseControl)
    return command.speed_mmps


async def lost(laser: Laser) -> None:
    """Wait until the laser is lost."""
    with contextlib.suppress(DeviceLost):
        while True:
            await laser.next_scan()


def test_a_port_that_comes_back_as_another_terminal_under_its_name_is_used_again(
    tmp_path: Path,
) -> None:
    """As udev does it: the name is a link, and the terminal behind it changes."""

    async def main() -> None:
        config, clock = load_config(None, ["twin.enabled=false"]), LoopClock()
        simulation = Simulation(load_config(), open_place(load_config()), clock)
        names = {name: tmp_path / name for name in ("laser", "base")}
        config = load_config(
            None, ["twin.enabled=false", *(f"{n}.port={path}" for n, path in names.items())]
        )
        with closing(PtyPort(names["laser"])) as laser, closing(PtyPort(names["base"])) as base:
            devices = Devices(Links(config, clock, None))
            async with asyncio.TaskGroup() as tasks:
                serving = [
                    tasks.create_task(serve_twin(simulation.laser_twin, laser, clock)),
                    tasks.create_task(serve_twin(simulation.base_twin, base, clock)),
                    tasks.create_task(devices.run()),
                ]
                await devices.laser.next_scan()
                await devices.base.next_odometry()
                before = [path.resolve() for path in names.values()]
                laser.plug(False)
                base.plug(False)
                await lost(devices.laser)
                squatters = [os.openpty() for _ in range(2)]  # take the old terminals' numbers
                laser.plug(True)
                base.plug(True)
                await devices.laser.next_scan()
                await devices.base.next_odometry()
                while devices.base.reconnects == 0:
                    await devices.base.next_odometry()
                after = [path.resolve() for path in names.values()]
                assert not set(before) & set(after)
                assert (devices.laser.reconnects, devices.base.reconnects) == (1, 1)
                for task in serving:
                    task.cancel()
        for pair in squatters:
            os.close(pair[0])
            os.close(pair[1])

    asyncio.run(main())
