"""The laser driver against the simulated laser, in virtual time."""

import asyncio
import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.rigs.hokuyo_bench import (
    PERFECT,
    QUANTISATION,
    Bench,
    CutsReply,
    Deaf,
    FrozenClock,
    Reports,
    Scripted,
    SlowLink,
    World,
    increments,
    on_bench,
    quantised,
    until_lost,
)
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.drivers.hokuyo.driver import HokuyoConfig, HokuyoLaser
from gvgbot.drivers.hokuyo.models import MODELS
from gvgbot.drivers.hokuyo.twin import HokuyoTwin, HokuyoTwinConfig
from gvgbot.drivers.transport import ByteStream, pipe, serve_twin
from gvgbot.errors import DeviceLost, DeviceRefused
from gvgbot.geometry import Array

pytestmark = pytest.mark.twin


def test_a_utm_30lx_gives_every_fourth_of_its_scans() -> None:
    world = World()

    async def scenario(bench: Bench) -> None:
        scans = await bench.scans(50)
        assert increments(world.stamps) == pytest.approx(0.1)
        assert increments(scan.stamp for scan in scans) == pytest.approx(0.1, abs=0.0021)
        assert (await bench.scans(1))[0].stamp - scans[0].stamp == pytest.approx(5.0, abs=0.002)

    on_bench(HokuyoTwin(PERFECT, world, seed=1), scenario)


def test_ranges_are_those_of_the_world_to_half_a_millimetre() -> None:
    world = World()

    async def scenario(bench: Bench) -> None:
        for number, scan in enumerate(await bench.scans(5)):
            assert quantised(world.ranges(number))(scan.ranges)

    on_bench(HokuyoTwin(PERFECT, world, seed=1), scenario)


def test_a_laser_whose_walls_vanish_at_once_is_not_trusted_to_see_a_hall() -> None:
    world = World()

    def covered(stamp: float, steps: int) -> Array:
        ranges = world(stamp, steps)
        return ranges if len(world.stamps) <= 20 else np.full_like(ranges, math.inf)

    async def scenario(bench: Bench) -> None:
        assert np.isfinite((await bench.scans(15))[-1].ranges).any()
        assert np.isnan((await bench.scans(15))[-1].ranges).all()

    on_bench(HokuyoTwin(PERFECT, covered, seed=1), scenario)


@pytest.mark.parametrize("drift_ppm", [-90.0, 0.0, 90.0])
@pytest.mark.parametrize("start_ms", [0, 2**24 - 5000])
def test_stamps_keep_within_two_milliseconds_of_the_truth(drift_ppm: float, start_ms: int) -> None:
    world = World()
    twin_config = HokuyoTwinConfig(clock_drift_ppm=drift_ppm, clock_start_ms=start_ms)

    async def scenario(bench: Bench) -> None:
        stamps = [scan.stamp for scan in await bench.scans(1200)]
        assert np.abs(np.array(stamps) - world.stamps[: len(stamps)]).max() < 0.002
        assert bench.laser.link.clock_resets == 0

    on_bench(HokuyoTwin(twin_config, world, seed=2), scenario)


def test_a_urg_04lx_is_stamped_at_its_first_beam() -> None:
    parameters = MODELS["URG-04LX"].parameters
    world = World(beams=682)

    async def scenario(bench: Bench) -> None:
        scans = await bench.scans(20)
        first_beam = 44 * 0.1 / 1024
        for stamp, scan in zip(world.stamps, scans, strict=False):
            assert scan.stamp == pytest.approx(stamp + first_beam, abs=0.002)
        assert scans[0].bearings == pytest.approx(parameters.bearings)
        assert scans[0].bearings[[0, -1]] == pytest.approx(np.radians([-119.53, 119.88]), abs=1e-4)
        assert scans[0].time_increment == pytest.approx(0.1 / 1024)
        assert scans[0].range_max == 5.6

    config = HokuyoConfig(skip=0)
    twin = HokuyoTwin(HokuyoTwinConfig(model="URG-04LX"), world, seed=3)
    on_bench(twin, scenario, config)


def test_stamps_do_not_depend_on_how_long_a_scan_takes_to_come_over() -> None:
    world = World()

    async def scenario(bench: Bench) -> None:
        stamps = [scan.stamp for scan in await bench.scans(50)]
        assert stamps == pytest.approx(world.stamps[: len(stamps)], abs=0.002)

    on_bench(SlowLink(HokuyoTwin(PERFECT, world, seed=16)), scenario)


def test_a_frozen_laser_is_lost() -> None:
    async def scenario(bench: Bench) -> None:
        await bench.scans(5)
        await bench.running
        assert bench.laser.link.repeated_scans > 0
        assert bench.laser.link.scans == 5
        with pytest.raises(DeviceLost, match="over and over, by its stamp"):
            await HokuyoLaser(bench.link, HokuyoConfig(), bench.clock).run()

    on_bench(FrozenClock(HokuyoTwin(PERFECT, World(), seed=17), 5), scenario)


def test_a_bad_checksum_loses_only_its_own_scan() -> None:
    world = World()
    config = HokuyoTwinConfig(range_sigma_m=0.0, dropout_fraction=0.0, bad_checksum_fraction=0.3)

    async def scenario(bench: Bench) -> None:
        scans = await bench.scans(100)
        link = bench.laser.link
        assert link.bad_messages > 10
        assert link.scans + link.bad_messages == len(world.stamps)
        for scan in scans:
            number = int(np.argmin(np.abs(np.array(world.stamps) - scan.stamp)))
            assert quantised(world.ranges(number))(scan.ranges)

    on_bench(HokuyoTwin(config, world, seed=4), scenario, HokuyoConfig(missed_scans=20))


@pytest.mark.parametrize(
    "left_over",
    [b"MD0000108000000\n", b"TM0\n", b"BM\n", b"MD00", b"MD0000108001200;x.1\nVV\n", b"RS\n"],
)
def test_it_opens_whatever_the_last_program_left_behind(left_over: bytes) -> None:
    async def first(link: ByteStream, clock: LoopClock) -> None:
        link.write(left_over)
        await clock.sleep_until(clock.now() + 5.01)

    async def scenario(bench: Bench) -> None:
        started = bench.clock.now()
        (scan,) = await bench.scans(1)
        assert bench.clock.now() - started < 0.5
        assert started < scan.stamp < bench.clock.now()

    on_bench(HokuyoTwin(PERFECT, World(), seed=5), scenario, first=first)


def test_a_cut_reply_costs_one_time_out_and_not_two() -> None:
    async def scenario(bench: Bench) -> None:
        await bench.scans(1)
        assert bench.laser.link.unanswered == 1

    on_bench(CutsReply(HokuyoTwin(PERFECT, World(), seed=19), b"VV\n"), scenario)


def test_identity_and_parameters_are_those_of_the_laser() -> None:
    async def scenario(bench: Bench) -> None:
        await bench.scans(1)
        assert bench.laser.parameters == MODELS["UTM-30LX"].parameters
        assert bench.laser.identity is not None
        assert "UTM-30LX" in bench.laser.identity.product

    on_bench(HokuyoTwin(PERFECT, World(), seed=6), scenario)


def test_clusters_point_to_their_middle_and_tell_the_range_there() -> None:
    async def scenario(bench: Bench) -> None:
        (scan,) = await bench.scans(1)
        assert len(scan.ranges) == 360
        assert scan.ranges[whole] == pytest.approx(ranges[1::3][whole], abs=2 * QUANTISATION)
        assert scan.bearings == pytest.approx(MODELS["UTM-30LX"].parameters.bearings[1::3])

    ranges = World().ranges(0)
    is_hit = np.isfinite(ranges[:1080]).reshape(-1, 3).all(axis=1)
    whole = np.convolve(is_hit, np.ones(3), mode="same") == 3  # and so are those beside it
    twin = HokuyoTwin(PERFECT, lambda *_: ranges, seed=7)
    on_bench(twin, scenario, HokuyoConfig(cluster=3))


def test_noise_and_dropouts_are_as_configured() -> None:
    async def scenario(bench: Bench) -> None:
        ranges = np.array([scan.ranges for scan in await bench.scans(100)])
        assert np.isnan(ranges).mean() == pytest.approx(0.005, rel=0.1)
        assert np.nanstd(ranges) == pytest.approx(0.01, rel=0.02)
        assert np.nanmean(ranges) == pytest.approx(3.0, abs=1e-3)

    twin = HokuyoTwin(HokuyoTwinConfig(), lambda *_: np.full(1081, 3.0), seed=8)
    on_bench(twin, scenario)


@pytest.mark.parametrize("ahead", [0.0, 5000.0, -5000.0])
def test_a_silent_laser_is_lost_within_a_few_seconds(ahead: float) -> None:
    """After a restart of the computer its clock, and so the loop's, is not the robot's."""

    async def scenario(bench: Bench) -> None:
        await bench.scans(3)
        bench.served.cancel()
        silent_since = bench.clock.now()
        await bench.running
        assert 0.3 < bench.clock.now() - silent_since < 4.0
        assert bench.laser.link.restarts == 1

    twin = HokuyoTwin(PERFECT, World(), seed=9, on_since=ahead)
    on_bench(twin, scenario, ahead=ahead)


def test_a_laser_that_never_answers_is_lost() -> None:
    async def main() -> None:
        here, there = pipe()
        clock = LoopClock()
        async with asyncio.TaskGroup() as tasks:
            deaf = Deaf()
            served = tasks.create_task(serve_twin(deaf, there, clock))
            with pytest.raises(DeviceLost, match="does not answer"):
                await HokuyoLaser(here, HokuyoConfig(), clock).run()
            assert clock.now() < 5.0
            # The bare line feed ends whatever an earlier program had half sent.
            assert deaf.heard.startswith(b"\nTM2\nQT\n")
            served.cancel()

    run_in_virtual_time(main())


def test_a_cut_cable_is_noticed_at_once() -> None:
    async def scenario(bench: Bench) -> None:
        await bench.scans(3)
        cut = bench.clock.now()
        bench.link.close()
        await bench.running
        assert bench.clock.now() == cut

    on_bench(HokuyoTwin(PERFECT, World(), seed=10), scenario)


def test_a_stream_that_stopped_is_started_again() -> None:
    async def scenario(bench: Bench) -> None:
        await bench.scans(3)
        stopped = bench.clock.now()
        twin.receive(b"QT\n", stopped)
        (scan,) = await bench.scans(1)
        assert scan.stamp - stopped < 0.5
        assert bench.laser.link.restarts == 1

    twin = HokuyoTwin(PERFECT, World(), seed=11)
    on_bench(twin, scenario)


def test_a_reset_clock_costs_no_scan_its_stamp() -> None:
    world = World()

    async def scenario(bench: Bench) -> None:
        await bench.scans(3)
        twin.receive(b"RS\n", bench.clock.now())
        scans = await bench.scans(10)
        stamps = [scan.stamp for scan in scans]
        assert stamps == pytest.approx(world.stamps[-10:], abs=0.002)
        assert bench.laser.link.clock_resets == 1

    twin = HokuyoTwin(HokuyoTwinConfig(clock_start_ms=9_000_000), world, seed=12)
    on_bench(twin, scenario)


def test_the_laser_is_switched_off_when_the_driver_is_cancelled() -> None:
    twin = HokuyoTwin(PERFECT, World(), seed=13)

    async def scenario(bench: Bench) -> None:
        await bench.scans(2)
        assert twin.next_due() < math.inf
        bench.running.cancel()
        await bench.clock.sleep_until(bench.clock.now() + 0.01)
        assert twin.next_due() == math.inf

    on_bench(twin, scenario)


@pytest.mark.parametrize(
    ("status", "remedy"),
    [
        ("0Ll", "if that lasts, switch it off and on"),
        ("0Mm", "check its power"),
        ("10Q", "end other programs that use it"),
    ],
)
def test_a_refused_stream_is_reported_with_its_status_and_a_remedy(
    status: str, remedy: str
) -> None:
    async def main() -> None:
        here, there = pipe()
        clock = LoopClock()
        command = b"MD0000108001300\n"
        reply = command + status.encode() + b"\n\n"
        twin = Scripted({command: reply}, HokuyoTwin(PERFECT, World(), seed=14))
        async with asyncio.TaskGroup() as tasks:
            served = tasks.create_task(serve_twin(twin, there, clock))
            with pytest.raises(DeviceRefused, match=f"status {status[:2]}: .*{remedy}"):
                await HokuyoLaser(here, HokuyoConfig(), clock).run()
            served.cancel()

    run_in_virtual_time(main())


@pytest.mark.parametrize("mark", ["", "gvgbot 1"])
@pytest.mark.parametrize("status", ["50", "97", "0L"])
def test_a_fault_of_its_own_ends_the_stream_at_once(mark: str, status: str) -> None:
    async def scenario(bench: Bench) -> None:
        await bench.running
        assert bench.clock.now() == pytest.approx(5.0, abs=0.15)
        link = bench.laser.link
        assert (link.refused_scans, link.stray_messages, link.restarts) == (1, 0, 0)

    twin = Reports(HokuyoTwin(PERFECT, World(), seed=20), status, 5.0, 6.0)
    on_bench(twin, scenario, HokuyoConfig(user_string=mark))


@pytest.mark.parametrize("status", ["", "0M", "21", "98"])
@pytest.mark.parametrize("wait", [0.8, 2.0, 4.5])
def test_a_motor_may_take_its_time_before_the_first_scan(wait: float, status: str) -> None:
    async def scenario(bench: Bench) -> None:
        await bench.scans(20)
        assert bench.clock.now() == pytest.approx(wait + 2.0, abs=0.4)
        assert bench.laser.link.restarts == twin.resets == 0

    twin = Reports(HokuyoTwin(PERFECT, World(), seed=21), status, 0.0, wait, after_md=True)
    on_bench(twin, scenario)


@pytest.mark.parametrize("status", ["", "0M", "21"])
def test_a_laser_without_a_first_scan_is_reset_and_lost(status: str) -> None:
    async def scenario(bench: Bench) -> None:
        await bench.running
        assert bench.clock.now() == pytest.approx(5.0, abs=0.4)
        assert twin.resets == 1

    twin = Reports(HokuyoTwin(PERFECT, World(), seed=22), status, 0.0, math.inf)
    on_bench(twin, scenario)


@pytest.mark.parametrize(
    ("status", "damaged", "told"),
    [
        pytest.param("", 0.0, "no scans: switch it off", id="silent"),
        pytest.param("0M", 0.0, "status 0M in place of scans: switch it off", id="unstable"),
        pytest.param("21", 0.0, "status 21 in place of scans: switch it off", id="checking"),
        pytest.param("99", 1.0, "damaged scans only: try another cable", id="damaged"),
    ],
)
def test_a_laser_without_a_first_scan_is_lost_with_what_it_sent(
    status: str, damaged: float, told: str
) -> None:
    async def main() -> None:
        here, there = pipe()
        clock = LoopClock()
        config = replace(PERFECT, bad_checksum_fraction=damaged)
        since = math.inf if damaged else 0.0
        twin = Reports(HokuyoTwin(config, World(), seed=27), status, since, math.inf)
        async with asyncio.TaskGroup() as tasks:
            served = tasks.create_task(serve_twin(twin, there, clock))
            with pytest.raises(DeviceLost, match=told):
                await HokuyoLaser(here, HokuyoConfig(), clock).run()
            served.cancel()

    run_in_virtual_time(main())


@pytest.mark.parametrize(("lost", "wait"), [(1, 8.0), (2, 18.0), (3, 38.0)])
@pytest.mark.parametrize("status", ["", "0M", "21"])
def test_a_motor_that_takes_longer_is_given_twice_the_time_when_opened_again(
    lost: int, wait: float, status: str
) -> None:
    async def scenario(bench: Bench) -> None:
        link = bench.laser.link
        await bench.running
        for _ in range(lost - 1):
            await until_lost(HokuyoLaser(bench.link, HokuyoConfig(), bench.clock, link))
        laser = HokuyoLaser(bench.link, HokuyoConfig(), bench.clock, link)
        running = asyncio.ensure_future(until_lost(laser))  # noqa: TID251  # cancelled below
        await laser.next_scan()
        assert twin.resets == lost
        assert link.fruitless == 0
        running.cancel()

    twin = Reports(HokuyoTwin(PERFECT, World(), seed=26), status, 0.0, wait, after_md=True)
    on_bench(twin, scenario)


@pytest.mark.parametrize("status", ["0M", "21", "49", "98"])
def test_a_laser_that_says_why_there_is_no_scan_is_waited_for(status: str) -> None:
    async def scenario(bench: Bench) -> None:
        gaps = increments(scan.stamp for scan in await bench.scans(60))
        assert gaps.max() == pytest.approx(4.5, abs=0.11)
        assert np.delete(gaps, gaps.argmax()) == pytest.approx(0.1, abs=0.0021)
        link = bench.laser.link
        assert (link.restarts, twin.resets) == (0, 0)
        assert link.missed_scans == link.refused_scans == pytest.approx(44, abs=1)

    twin = Reports(HokuyoTwin(PERFECT, World(), seed=23), status, 2.0, 6.4)
    on_bench(twin, scenario)


@pytest.mark.parametrize(
    ("status", "patience"),
    [
        pytest.param("0M", 5.0, id="unstable for ever"),
        pytest.param("21", 5.0, id="checking for ever"),
        pytest.param("0E", 0.3, id="knows no such stream"),
        pytest.param("", 0.3, id="silent"),
    ],
)
def test_a_stream_without_scans_is_started_again_in_time(status: str, patience: float) -> None:
    async def scenario(bench: Bench) -> None:
        while not bench.laser.link.restarts:
            await bench.clock.sleep_until(bench.clock.now() + 0.01)
        assert bench.clock.now() == pytest.approx(2.0 + patience, abs=0.15)

    on_bench(Reports(HokuyoTwin(PERFECT, World(), seed=24), status, 2.0, math.inf), scenario)


@pytest.mark.parametrize("status", ["", "0M", "21"])
def test_silence_is_noticed_at_once_after_the_laser_took_its_time(status: str) -> None:
    async def scenario(bench: Bench) -> None:
        await bench.scans(1)
        bench.served.cancel()
        silent_since = bench.clock.now()
        while not bench.laser.link.restarts:
            await bench.clock.sleep_until(bench.clock.now() + 0.01)
        assert bench.clock.now() - silent_since == pytest.approx(0.3, abs=0.15)

    twin = Reports(HokuyoTwin(PERFECT, World(), seed=25), status, 0.0, 1.0, after_md=True)
    on_bench(twin, scenario)
