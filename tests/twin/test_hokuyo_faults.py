"""What goes wrong with a laser and its link, and how the driver comes through it."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field, fields, replace

import numpy as np
import pytest

from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.drivers.cable import Cable
from gvgbot.drivers.hokuyo.driver import HokuyoConfig, HokuyoLaser
from gvgbot.drivers.hokuyo.statistics import LinkStatistics
from gvgbot.drivers.hokuyo.twin import HokuyoTwin, HokuyoTwinConfig, LaserMishapConfig
from gvgbot.drivers.link_faults import FaultyLink, LinkFaultConfig
from gvgbot.drivers.transport import serve_twin
from gvgbot.errors import DeviceLost, DeviceRefused
from gvgbot.geometry import Array
from gvgbot.hal.messages import Scan

pytestmark = pytest.mark.twin

BEAMS = 1081
FIRST = 4  # beams that hold the number of the scan, six bits each
RETRY = 0.5  # s
LATE = 0.0005 + 1e-9  # m: half a millimetre of rounding


class CountedWorld:
    """Ranges of which every one tells the number of its scan, and when each scan was taken."""

    def __init__(self) -> None:
        self.stamps: list[float] = []
        self._pattern = 1.0 + (np.arange(BEAMS) * 7919 % 1000) / 1000.0

    def __call__(self, stamp: float) -> Array:
        self.stamps.append(stamp)
        return self.truth(len(self.stamps) - 1)

    def truth(self, number: int) -> Array:
        ranges = self._pattern + (number * 389 % 1000) / 1000.0
        ranges[:FIRST] = [1.0 + 0.01 * (number >> 6 * i & 63) for i in range(FIRST)]
        return ranges

    def number(self, scan: Scan) -> int:
        digits = np.rint((scan.ranges[:FIRST] - 1.0) / 0.01).astype(int)
        return int(sum(int(digit) << 6 * i for i, digit in enumerate(digits)))


@dataclass
class Rig:
    """A laser that is opened again whenever it is lost, and a record of every scan it gave."""

    world: CountedWorld
    twin: HokuyoTwin
    link: FaultyLink
    cable: Cable
    clock: LoopClock
    wrong: int = 0
    losses: int = 0
    errors: list[float] = field(default_factory=list)  # of the stamps, s
    arrivals: list[float] = field(default_factory=list)
    statistics: list[LinkStatistics] = field(default_factory=list)
    reasons: set[str] = field(default_factory=set)
    most_pending: int = 0

    async def run(self, config: HokuyoConfig) -> None:
        while True:
            laser = HokuyoLaser(self.cable.host, config, self.clock)
            self.statistics.append(laser.link)
            try:
                async with asyncio.TaskGroup() as tasks:
                    tasks.create_task(laser.run())
                    tasks.create_task(self.judge(laser))
            except* (DeviceLost, DeviceRefused) as group:
                self.losses += 1
                self.reasons.add(str(group.exceptions[0]))
            await self.clock.sleep_until(self.clock.now() + RETRY)

    async def judge(self, laser: HokuyoLaser) -> None:
        while True:
            scan = await laser.next_scan()
            if np.isnan(scan.ranges).all():
                continue  # the laser said itself that it was blind
            number = self.world.number(scan)
            known = number < len(self.world.stamps)
            right = known and np.allclose(
                scan.ranges, self.world.truth(number), rtol=0.0, atol=LATE
            )
            self.wrong += not right
            if right:
                self.errors.append(scan.stamp - self.world.stamps[number])
                self.arrivals.append(self.clock.now())

    async def good_scan(self, seconds: float) -> float:
        """How long (s) it takes until the next good scan; fails if longer than that."""
        began, before = self.clock.now(), len(self.arrivals)
        while len(self.arrivals) == before:
            assert self.clock.now() - began < seconds, "no scan came in time"
            await self.clock.sleep_until(self.clock.now() + 0.05)
        return self.arrivals[before] - began

    def total(self, name: str) -> int:
        return sum(getattr(each, name) for each in self.statistics)


def on_rig(
    scenario: Callable[[Rig], Awaitable[None]],
    *,
    link: LinkFaultConfig | None = None,
    mishaps: LaserMishapConfig | None = None,
    config: HokuyoConfig | None = None,
    seed: int = 41,
    **laser: object,
) -> Rig:
    """Run the scenario with the laser at work behind the link."""
    quiet = {"range_sigma_m": 0.0, "dropout_fraction": 0.0}
    settings = HokuyoTwinConfig(
        **{**quiet, **laser},  # type: ignore[arg-type]
        mishaps=mishaps or LaserMishapConfig(),
    )
    rigs: list[Rig] = []

    async def main() -> None:
        clock, world, cable = LoopClock(), CountedWorld(), Cable()
        twin = HokuyoTwin(settings, world, seed)
        faulty = FaultyLink(twin, link or LinkFaultConfig(), seed, cable.plug)
        rig = Rig(world, twin, faulty, cable, clock)
        rigs.append(rig)
        async with asyncio.TaskGroup() as tasks:
            work = [
                tasks.create_task(serve_twin(faulty, cable.device, clock)),
                tasks.create_task(rig.run(config or HokuyoConfig())),
            ]
            await scenario(rig)
            for task in work:
                task.cancel()

    run_in_virtual_time(main())
    return rigs[0]


async def stir(rig: Rig) -> None:
    """Let a fault that was injected begin: the twin looks at the time whenever it is due."""
    await rig.clock.sleep_until(rig.clock.now() + 0.1)


@pytest.mark.parametrize(
    ("mishap", "duration", "within"),
    [
        pytest.param("frozen", 3.0, 2.0, id="frozen"),
        pytest.param("stalled", 3.0, 2.0, id="stalled"),
        pytest.param("unstable", 3.0, 2.0, id="unstable"),
        pytest.param("blind", 3.0, 2.0, id="blind"),
        pytest.param("reboot", 0.0, 3.5, id="reboot"),  # 1.5 s of it is the reboot itself
        pytest.param("abnormal", 0.0, 6.0, id="abnormal"),  # needs a reboot to end
    ],
)
def test_scans_go_on_after_a_mishap(mishap: str, duration: float, within: float) -> None:
    async def scenario(rig: Rig) -> None:
        await rig.good_scan(2.0)
        rig.twin.inject(mishap, duration)  # type: ignore[arg-type]
        await rig.clock.sleep_until(rig.clock.now() + duration + 0.2)
        await rig.good_scan(within)
        assert rig.wrong == 0
        assert rig.twin.counts[mishap] == 1

    on_rig(scenario)


@pytest.mark.parametrize("fault", ["silence", "unplug"])
@pytest.mark.parametrize("duration", [0.3, 2.0, 20.0])
def test_scans_go_on_within_two_seconds_of_a_links_return(fault: str, duration: float) -> None:
    async def scenario(rig: Rig) -> None:
        await rig.good_scan(2.0)
        rig.link.inject(fault, duration)  # type: ignore[arg-type]
        await rig.clock.sleep_until(rig.clock.now() + duration + 0.1)
        await rig.good_scan(2.0)
        assert rig.wrong == 0

    on_rig(scenario)


def test_a_pulled_cable_is_noticed_at_once_and_silence_within_two_seconds() -> None:
    lost: dict[str, float] = {}

    async def scenario(rig: Rig, fault: str = "unplug") -> None:
        await rig.good_scan(2.0)
        began = rig.clock.now()
        rig.link.inject(fault, 30.0)  # type: ignore[arg-type]
        while not rig.total("restarts") and not rig.losses:
            await rig.clock.sleep_until(rig.clock.now() + 0.01)
        lost[fault] = rig.clock.now() - began

    on_rig(scenario)
    on_rig(lambda rig: scenario(rig, "silence"))
    assert lost["unplug"] < 0.15  # one scan's time: faults begin when the twin is next due
    assert 0.2 < lost["silence"] < 0.6


def test_every_loss_is_counted_and_no_damaged_scan_is_handed_on() -> None:
    link = LinkFaultConfig(
        flipped_bits_per_kb=0.02,
        lost_bytes_per_kb=0.01,
        inserted_bytes_per_kb=0.01,
        cut_messages_per_k=10.0,
    )

    async def scenario(rig: Rig) -> None:
        await rig.clock.sleep_until(120.0)
        assert rig.wrong == 0
        assert rig.total("bad_messages") > 20
        assert len(rig.arrivals) > 0.8 * len(rig.world.stamps)
        assert min(rig.link.counts[name] for name in rig.link.counts) > 5

    on_rig(scenario, link=link)


@pytest.mark.parametrize("drift_ppm", [-50.0, 50.0])
@pytest.mark.parametrize(
    ("sync", "latency", "limit"),
    [
        pytest.param(True, 0.0, 0.0015, id="synchronised"),
        pytest.param(False, 0.0, 0.0015, id="arrivals only"),
        pytest.param(True, 0.004, 0.0035, id="half of a one-sided latency is found out"),
    ],
)
def test_stamps_are_right_in_spite_of_jitter_and_drift(
    drift_ppm: float, latency: float, limit: float, *, sync: bool
) -> None:
    async def scenario(rig: Rig) -> None:
        await rig.clock.sleep_until(120.0)
        late = np.array(rig.errors[600:])
        assert len(late) > 500
        assert np.sqrt(np.mean(late**2)) < limit

    link = LinkFaultConfig(latency_s=latency, jitter_s=0.005)
    config = HokuyoConfig(synchronise=sync)
    on_rig(scenario, link=link, config=config, clock_drift_ppm=drift_ppm)


@pytest.mark.parametrize("sync", [True, False])
def test_a_reboot_to_the_same_time_of_its_clock_is_no_trap(*, sync: bool) -> None:
    """A clock that began again stands a little further than at the last scan before."""

    async def scenario(rig: Rig) -> None:
        for uptime in (2.0, 0.8, 0.9, 1.0, 1.1, 1.2):
            await rig.clock.sleep_until(rig.clock.now() + uptime + 1.5)
            rig.twin.inject("reboot")
        await rig.clock.sleep_until(rig.clock.now() + 10.0)
        assert np.abs(rig.errors).max() < 0.010

    on_rig(scenario, config=HokuyoConfig(synchronise=sync))


@pytest.mark.parametrize("sync", [True, False])
def test_a_stream_that_begins_with_an_old_scan_stamps_none_too_late(*, sync: bool) -> None:
    """The laser freezes while nobody listens, and then sends what it measured long ago."""

    async def scenario(rig: Rig) -> None:
        await rig.good_scan(2.0)
        rig.link.inject("unplug", 3.0)
        await rig.clock.sleep_until(rig.clock.now() + 2.8)
        rig.twin.inject("frozen", 1.0)
        await rig.clock.sleep_until(rig.clock.now() + 5.0)
        assert rig.total("repeated_scans") > 0
        assert np.abs(rig.errors).max() < 0.002

    on_rig(scenario, config=HokuyoConfig(synchronise=sync))


def test_a_chip_that_collects_bytes_costs_little_of_the_stamps() -> None:
    async def scenario(rig: Rig) -> None:
        await rig.clock.sleep_until(90.0)
        assert np.sqrt(np.mean(np.square(rig.errors[300:]))) < 0.0025

    on_rig(scenario, link=LinkFaultConfig(chip_timer_s=0.016))


def test_the_same_seed_gives_the_same_faults() -> None:
    link = LinkFaultConfig(flipped_bits_per_kb=0.1, silences_per_h=200.0, jitter_s=0.01)
    mishaps = LaserMishapConfig(freezes_per_h=200.0, reboots_per_h=100.0)

    async def scenario(rig: Rig) -> None:
        await rig.clock.sleep_until(60.0)

    first, second = (on_rig(scenario, link=link, mishaps=mishaps, seed=9) for _ in range(2))
    other = on_rig(scenario, link=link, mishaps=mishaps, seed=10)
    assert first.arrivals == second.arrivals
    assert first.arrivals != other.arrivals


EVERYTHING = LinkFaultConfig(
    latency_s=0.002,
    jitter_s=0.005,
    flipped_bits_per_kb=0.003,
    lost_bytes_per_kb=0.002,
    inserted_bytes_per_kb=0.002,
    cut_messages_per_k=2.0,
    silences_per_h=20.0,
    unplugs_per_h=20.0,
)
EVERY_MISHAP = LaserMishapConfig(
    reboots_per_h=15.0,
    freezes_per_h=15.0,
    stalls_per_h=15.0,
    unstable_per_h=15.0,
    abnormal_per_h=15.0,
    blinds_per_h=15.0,
)


def soak(hours: float, link: LinkFaultConfig, mishaps: LaserMishapConfig) -> Rig:
    """All faults at once, with a clock that wraps in the first minutes."""

    async def scenario(rig: Rig) -> None:
        await rig.clock.sleep_until(3600.0 * hours)

    return on_rig(
        scenario,
        link=link,
        mishaps=mishaps,
        seed=5,
        clock_start_ms=2**24 - 200_000,
        answers_once_per_turn=True,
        lost_stop_fraction=0.1,
    )


def check_soak(rig: Rig, hours: float) -> None:
    assert rig.wrong == 0
    assert len(rig.arrivals) > 0.5 * 10.0 * 3600.0 * hours
    faults = rig.link.counts + rig.twin.counts
    assert min(faults[name] for name in EVERY_MISHAP.rates) > 0
    assert min(faults[name] for name in ("silence", "unplug", "flipped bit", "lost byte")) > 0
    assert np.diff(rig.arrivals).max() < 15.0  # several faults may follow each other
    # Single scans after a restart have been seen stamped too late, by up to 0.6 s; why is not
    # known (perhaps a stream that begins with a frozen scan).
    assert np.percentile(np.abs(rig.errors), 99.0) < 0.006
    for name in ("bad_messages", "repeated_scans", "refused_scans", "restarts", "reboots"):
        assert rig.total(name) > 0, name


def test_minutes_of_all_faults_at_once_hand_on_no_wrong_scan() -> None:
    link = replace(EVERYTHING, silences_per_h=80.0, unplugs_per_h=80.0)
    often = {f.name: 4 * getattr(EVERY_MISHAP, f.name) for f in fields(EVERY_MISHAP)}
    mishaps = replace(EVERY_MISHAP, **often | {"duration_s": 1.0})
    check_soak(soak(0.15, link, mishaps), 0.15)


@pytest.mark.bench  # minutes of computing: run it with -m bench
@pytest.mark.timeout(1200)
def test_a_day_of_all_faults_at_once_hands_on_no_wrong_scan() -> None:
    check_soak(soak(24.0, EVERYTHING, EVERY_MISHAP), 24.0)
