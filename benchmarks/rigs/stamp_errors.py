"""How far the drivers' stamps are from the truth, when the link delays messages by chance."""

import asyncio

import numpy as np

from benchmarks.rigs.hokuyo_bench import Bench, World, on_bench
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.drivers.hokuyo.driver import HokuyoConfig
from gvgbot.drivers.hokuyo.twin import HokuyoTwin, HokuyoTwinConfig
from gvgbot.drivers.kobuki.driver import KobukiBase, KobukiConfig
from gvgbot.drivers.kobuki.twin import KobukiTwin, KobukiTwinConfig
from gvgbot.drivers.link_faults import FaultyLink, LinkFaultConfig
from gvgbot.drivers.transport import TwinDevice, pipe, serve_twin
from gvgbot.geometry import Array, Pose

SETTLING = 60.0  # s in which errors do not count
MEASURED = 20.0  # s after that
FRAME_PERIOD = 0.02  # s of the base's clock
FRAME_WAY = 0.006  # m that the body rolls in one


class OtherClock:
    """A device whose clock runs faster than the host's by so many parts in a million."""

    def __init__(self, device: TwinDevice, drift_ppm: float) -> None:
        self._device = device
        self.speed = 1.0 + drift_ppm * 1e-6

    def receive(self, data: bytes, now: float) -> bytes:
        return self._device.receive(data, now * self.speed)

    def advance(self, now: float) -> bytes:
        is_due = self.next_due() <= now  # even if rounding puts its own time a little before that
        own = now * self.speed
        return self._device.advance(max(own, self._device.next_due()) if is_due else own)

    def next_due(self) -> float:
        return self._device.next_due() / self.speed


class RollingBody:
    """A body that has always rolled straight ahead at the same speed."""

    bumper = (False, False, False)
    travel = 0.0

    @property
    def left_travel(self) -> float:
        return self.travel

    @property
    def right_travel(self) -> float:
        return self.travel

    @property
    def pose(self) -> Pose:
        return Pose(self.travel, 0.0, 0.0)

    def advance(self, now: float) -> None:
        self.travel = now * FRAME_WAY / FRAME_PERIOD

    def command(self, linear: float, angular: float) -> None:
        pass


def scan_stamp_errors(
    link: LinkFaultConfig, drift_ppm: float, config: HokuyoConfig | None = None, seed: int = 41
) -> Array:
    """Stamp minus truth (s) of every scan once the driver has settled."""
    world = World()  # whose ranges tell the number of their scan
    quiet = HokuyoTwinConfig(range_sigma_m=0.0, dropout_fraction=0.0, clock_drift_ppm=drift_ppm)
    errors: list[float] = []

    async def scenario(bench: Bench) -> None:
        while bench.clock.now() < SETTLING + MEASURED:
            (scan,) = await bench.scans(1)
            number = round(100.0 * (scan.ranges[1] - world.ranges(0)[1]))
            if bench.clock.now() > SETTLING:
                errors.append(scan.stamp - world.stamps[number])

    twin = HokuyoTwin(quiet, world, seed)
    on_bench(FaultyLink(twin, link, seed), scenario, config)
    return np.array(errors)


def odometry_stamp_errors(
    link: LinkFaultConfig, drift_ppm: float, config: KobukiConfig | None = None, seed: int = 41
) -> Array:
    """Stamp minus truth (s) of every odometry message once the driver has settled."""
    twin = KobukiTwin(KobukiTwinConfig(odometry="perfect"), RollingBody(), seed)
    drifting = OtherClock(twin, drift_ppm)
    errors: list[float] = []

    async def main() -> None:
        here, there = pipe()
        clock = LoopClock()
        base = KobukiBase(here, config or KobukiConfig(), clock)
        async with asyncio.TaskGroup() as tasks:
            work = [
                tasks.create_task(serve_twin(FaultyLink(drifting, link, seed), there, clock)),
                tasks.create_task(base.run()),
            ]
            while clock.now() < SETTLING + MEASURED:
                odometry = await base.next_odometry()
                frame = round(odometry.odom_base.x / FRAME_WAY)
                if clock.now() > SETTLING:
                    errors.append(odometry.stamp - frame * FRAME_PERIOD / drifting.speed)
            for task in work:
                task.cancel()

    run_in_virtual_time(main())
    return np.array(errors)


def rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))
