"""A daemon on twins in virtual time, with all that can be seen of it from outside."""

import asyncio
import struct
from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec

from gvgbot.clock import Clock, LoopClock, run_in_virtual_time
from gvgbot.config import Config, RobotConfig, ServiceConfig, TwinConfig
from gvgbot.drivers.kobuki.driver import KobukiBase
from gvgbot.drivers.kobuki.twin import KobukiTwinConfig
from gvgbot.drivers.transport import ByteStream
from gvgbot.geometry import Pose
from gvgbot.links import Close, Links
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.requests import MESSAGEPACK, REQUESTS, Answer, Asked, RequestName
from gvgbot.robot import Robot
from gvgbot.service import Notifier
from gvgbot.session import Session
from gvgbot.simulation import Place, Simulation
from gvgbot.telemetry_config import TelemetryConfig
from gvgbot.tiles import Grid
from gvgbot.topics import Events, Health, Map, Odometry, Payload, Plan, Scan, State, Trajectory
from gvgbot.worlds.canvas import Canvas

STOP = (0, 0)


def base_commands(data: bytes) -> list[tuple[int, int]]:
    """Speed (mm/s) and radius (mm) of the base controls in a stream of undamaged frames.

    A frame is AA 55, a length, sub-payloads (id, length, data) and the XOR of all but AA 55.
    """
    commands = []
    while data:
        assert data[:2] == b"\xaa\x55"
        body, checksum = data[3 : 3 + data[2]], data[3 + data[2]]
        for byte in data[2 : 3 + data[2]]:
            checksum ^= byte
        assert checksum == 0
        data = data[4 + len(body) :]
        while body:
            if body[0] == 1:
                commands.append(struct.unpack("<hh", body[2:6]))
            body = body[2 + body[1] :]
    return commands


@dataclass
class Cable:
    """A stream that remembers what the host wrote, and lets nothing through while it is cut."""

    inner: ByteStream
    written: bytearray = field(default_factory=bytearray)
    is_cut: bool = False

    async def read(self) -> bytes:
        while True:
            data = await self.inner.read()
            if not self.is_cut:
                return data

    def write(self, data: bytes) -> None:
        self.written += data
        if not self.is_cut:
            self.inner.write(data)

    def close(self) -> None:
        self.inner.close()


class CabledLinks(Links):
    """The twins of a simulation, with a cable to the base that can be looked into and cut."""

    cable: Cable

    async def open_base(self) -> tuple[KobukiBase, Close]:
        return KobukiBase(self.cable, self.config.base, self.clock, self.feedback), lambda: None


class Manager(Notifier):
    """A service manager that remembers what it was told."""

    def __init__(self) -> None:
        super().__init__(None)
        self.told: list[str] = []

    def _send(self, message: str) -> None:
        self.told.append(message)

    def count(self, message: str) -> int:
        return self.told.count(message)


class Network:
    """Remembers what was published."""

    def __init__(self) -> None:
        self.states: list[State] = []
        self.maps: list[Map] = []
        self.events: list[Events] = []
        self.plans: list[Plan] = []
        self.odometry: list[Odometry] = []
        self.scans: list[Scan] = []
        self.grids: list[Grid] = []
        self.whole_grid: Payload | None = None
        self.trajectories: list[Trajectory] = []
        self.healths: list[Health] = []
        self.failures = 0

    def publish(self, value: Payload, latest: Payload | None = None) -> None:
        match value:
            case State():
                self.states.append(value)
            case Map():
                self.maps.append(value)
            case Events():
                self.events.append(value)
            case Plan():
                self.plans.append(value)
            case Odometry():
                self.odometry.append(value)
            case Scan():
                self.scans.append(value)
            case Grid():
                self.grids.append(value)
                self.whole_grid = latest
            case Trajectory():
                self.trajectories.append(value)
            case Health():
                self.healths.append(value)

    def is_heard(self, payload: type[Payload]) -> bool:
        return True

    async def answer(self) -> None:
        await asyncio.Event().wait()

    async def hear(self, handle: Callable[[Asked], Awaitable[Answer]]) -> None:
        self._handle = handle
        await asyncio.Event().wait()

    async def ask(self, name: str, **arguments: object) -> Answer:
        """Ask the robot for something, as a client would."""
        data = msgspec.msgpack.encode(arguments)
        return await self._handle(Asked(name, data, MESSAGEPACK, "a test"))


async def at_once(function: Callable[[], None]) -> None:
    function()


class Daemon:
    """A daemon in a corridor around three corners, and all that can be seen of it from outside."""

    def __init__(
        self,
        out: Path,
        place: Place | None = None,
        requests: tuple[RequestName, ...] = REQUESTS,
        twin: TwinConfig | None = None,
        service: ServiceConfig | None = None,
    ) -> None:
        canvas = Canvas(14.0, 14.0)
        canvas.carve_path([(2.0, 2.0), (12.0, 2.0), (12.0, 12.0), (2.0, 12.0), (2.0, 5.0)], 1.4)
        place = place or Place(canvas.world("corridor"), Pose(5.0, 2.1, 0.3))
        self.config = Config(
            robot=RobotConfig(name="tester"),
            twin=twin or TwinConfig(base=KobukiTwinConfig(odometry="perfect")),
            telemetry=TelemetryConfig(requests=requests),
            service=service or ServiceConfig(),
        )
        self.manager, self.network = Manager(), Network()
        self.session = Session(self.config, RunDirectory(out), place)
        self.robot = Robot(self.session, self.manager, self.network, off_loop=at_once)
        self.cable: Cable

    def run(self, story: Callable[[Clock], Coroutine[Any, Any, None]]) -> None:
        """Live for as long as the story takes; then save, as the command does."""
        run_in_virtual_time(self._live(story))
        self.session.save()

    def run_on(self, kind: type[Links], seconds: float) -> None:
        """Live for so long on other links, without a simulation."""

        async def live() -> None:
            clock = LoopClock()

            async def told() -> str:
                await clock.sleep_until(seconds)
                return "SIGINT"

            await self.robot.serve(told(), kind(self.config, clock, None))

        run_in_virtual_time(live())

    async def _live(self, story: Callable[[Clock], Coroutine[Any, Any, None]]) -> None:
        clock, place = LoopClock(), self.session.place
        assert place is not None
        self.session.simulation = Simulation(self.config, place, clock)
        links = CabledLinks(self.config, clock, self.session.simulation)
        self.cable = Cable(self.session.simulation.base)
        links.cable = self.cable

        async def told() -> str:
            await story(clock)
            return "SIGTERM"

        await self.robot.serve(told(), links)

    @property
    def place(self) -> Pose:
        """world_base, the truth."""
        assert self.session.simulation is not None
        self.session.simulation.body.advance(asyncio.get_running_loop().time())
        return self.session.simulation.body.pose
