"""What every laser promises the rest of the program: simulated, on a terminal, on the bench.

The bench needs `-m hardware --laser-port /dev/...`, or `tcp://host:10940`; it takes some seconds.
"""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest

from gvgbot.clock import Clock, LoopClock, run_in_virtual_time
from gvgbot.drivers.hokuyo.config import HokuyoConfig
from gvgbot.drivers.hokuyo.driver import HokuyoLaser
from gvgbot.drivers.hokuyo.twin import HokuyoTwin, HokuyoTwinConfig
from gvgbot.drivers.pty import PtyPort
from gvgbot.drivers.tcp import SCHEME, TcpStream
from gvgbot.drivers.transport import ByteStream, SerialStream, pipe, serve_twin
from gvgbot.errors import DeviceLost
from gvgbot.geometry import Array
from gvgbot.hal.devices import Laser
from gvgbot.hal.messages import Scan

BAUD = 115200
FRESH = 0.35  # s; the age of a scan that is handed out as it comes
RATE = 10.0  # Hz


@dataclass(frozen=True)
class Place:
    """Where lasers are: `open` makes one on a new link, `close` gives the last link up."""

    open: Callable[[], Laser]
    close: Callable[[], None]
    clock: Clock


def room(stamp: float, steps: int) -> Array:
    """A square room of 4 m, seen from its middle."""
    bearings = np.radians(np.linspace(-135.0, 135.0, 1081))
    return np.asarray(2.0 / np.maximum(np.abs(np.cos(bearings)), np.abs(np.sin(bearings))))


def laser_on(stream: ByteStream, clock: Clock, port: str) -> Laser:
    return HokuyoLaser(stream, HokuyoConfig(port=port, baud=BAUD, rate_hz=RATE), clock)


def close_last(links: Sequence[ByteStream]) -> None:
    links[-1].close()


@contextlib.asynccontextmanager
async def in_memory(_: str) -> AsyncIterator[Place]:
    clock, twin = LoopClock(), HokuyoTwin(HokuyoTwinConfig(), room, seed=51)
    links: list[ByteStream] = []
    async with asyncio.TaskGroup() as tasks:
        served: list[asyncio.Task[None]] = []

        def open_laser() -> Laser:
            here, there = pipe()
            links.append(here)
            served.append(tasks.create_task(serve_twin(twin, there, clock)))
            return laser_on(here, clock, "/dev/ttyACM0")

        yield Place(open_laser, partial(close_last, links), clock)
        for task in served:
            task.cancel()


@contextlib.asynccontextmanager
async def on_terminal(_: str) -> AsyncIterator[Place]:
    clock, twin = LoopClock(), HokuyoTwin(HokuyoTwinConfig(), room, seed=51)
    port = PtyPort()
    links: list[SerialStream] = []

    def open_laser() -> Laser:
        assert port.path is not None
        links.append(SerialStream(port.path, BAUD))
        return laser_on(links[-1], clock, "/dev/ttyACM0")

    async with asyncio.TaskGroup() as tasks:
        served = tasks.create_task(serve_twin(twin, port, clock))
        yield Place(open_laser, partial(close_last, links), clock)
        served.cancel()
    port.close()


class Accepted:
    """The device's end of a TCP connection."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer

    async def read(self) -> bytes:
        data = await self.reader.read(4096)
        if not data:
            raise DeviceLost("the client has gone")
        return data

    def write(self, data: bytes) -> None:
        self.writer.write(data)

    def close(self) -> None:
        self.writer.close()


@contextlib.asynccontextmanager
async def on_loopback(_: str) -> AsyncIterator[Place]:
    clock, twin = LoopClock(), HokuyoTwin(HokuyoTwinConfig(model="UST-10LX"), room, seed=51)

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(asyncio.CancelledError):
            await serve_twin(twin, Accepted(reader, writer), clock)
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    address = "{}{}:{}".format(SCHEME, *server.sockets[0].getsockname())
    async with server, on_bench(address) as place:
        yield place


@contextlib.asynccontextmanager
async def on_bench(port: str) -> AsyncIterator[Place]:
    clock = LoopClock()
    links: list[ByteStream] = []

    def open_laser() -> Laser:
        links.append(TcpStream(port) if port.startswith(SCHEME) else SerialStream(port, BAUD))
        return laser_on(links[-1], clock, port)

    yield Place(open_laser, partial(close_last, links), clock)


Judge = Callable[[Place], Awaitable[None]]


@pytest.fixture(
    params=[
        pytest.param("memory", marks=pytest.mark.twin),
        pytest.param("terminal", marks=pytest.mark.slow),
        pytest.param("loopback", marks=pytest.mark.slow),
        pytest.param("bench", marks=pytest.mark.hardware),
    ]
)
def judged(request: pytest.FixtureRequest) -> Callable[[Judge], None]:
    """Runs a judgement where the lasers are; the last link is given up afterwards."""
    port = str(request.config.getoption("--laser-port"))
    places = {
        "memory": in_memory,
        "terminal": on_terminal,
        "loopback": on_loopback,
        "bench": on_bench,
    }
    place = places[request.param]

    async def main(judge: Judge) -> None:
        async with place(port) as here:
            await judge(here)

    run = run_in_virtual_time if request.param == "memory" else asyncio.run
    return lambda judge: run(main(judge))


@contextlib.asynccontextmanager
async def running(place: Place) -> AsyncIterator[Laser]:
    """A laser at work; its link is given up afterwards."""
    laser = place.open()
    async with asyncio.TaskGroup() as tasks:
        work = tasks.create_task(laser.run())
        yield laser
        work.cancel()
    place.close()


async def taken(laser: Laser, count: int) -> list[Scan]:
    return [await laser.next_scan() for _ in range(count)]


def test_scans_come_in_order_and_fresh(judged: Callable[[Judge], None]) -> None:
    async def judge(place: Place) -> None:
        async with running(place) as laser:
            await taken(laser, 2)
            stamps = []
            for _ in range(15):
                stamps.append((await laser.next_scan()).stamp)
                assert 0.0 < place.clock.now() - stamps[-1] < FRESH
        assert (np.diff(stamps) > 0.0).all()
        assert np.median(np.diff(stamps)) == pytest.approx(1.0 / RATE, rel=0.2)

    judged(judge)


def test_who_listens_seldom_gets_the_newest_scan(judged: Callable[[Judge], None]) -> None:
    async def judge(place: Place) -> None:
        async with running(place) as laser:
            await taken(laser, 2)
            await place.clock.sleep_until(place.clock.now() + 1.05)
            (scan,) = await taken(laser, 1)
            assert place.clock.now() - scan.stamp < FRESH

    judged(judge)


def test_a_scan_keeps_the_promises_of_its_type(judged: Callable[[Judge], None]) -> None:
    async def judge(place: Place) -> None:
        async with running(place) as laser:
            for scan in await taken(laser, 3):
                promises_hold(scan)

    judged(judge)


def promises_hold(scan: Scan) -> None:
    assert scan.ranges.dtype == np.float64
    assert not scan.ranges.flags.writeable
    assert scan.bearings.shape == scan.ranges.shape
    assert scan.angle_increment > 0.0
    assert scan.bearings[-1] - scan.bearings[0] <= 2 * np.pi
    seen = scan.ranges[np.isfinite(scan.ranges)]
    assert len(seen) > 0
    assert scan.range_min <= seen.min()
    assert seen.max() <= scan.range_max
    assert not (scan.ranges == -np.inf).any()
    assert 0.0 < abs(scan.time_increment) * len(scan.ranges) < 1.0 / RATE + 0.01


def test_a_laser_that_was_left_can_be_opened_again(judged: Callable[[Judge], None]) -> None:
    async def judge(place: Place) -> None:
        for _ in range(3):
            began = place.clock.now()
            async with running(place) as laser:
                assert (await laser.next_scan()).stamp > began
            assert place.clock.now() - began < 3.0

    judged(judge)


def test_a_link_that_is_given_up_is_a_lost_laser(judged: Callable[[Judge], None]) -> None:
    async def judge(place: Place) -> None:
        laser = place.open()
        lost = []

        async def work() -> None:
            with contextlib.suppress(DeviceLost):
                await laser.run()
            lost.append(place.clock.now())

        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(work())
            await taken(laser, 1)
            began = place.clock.now()
            place.close()
        assert lost[0] - began < 5.0

    judged(judge)
