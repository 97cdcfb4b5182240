"""Every kind of scan of every model, from the simulated laser to the HAL."""

import asyncio
import math
from typing import Any

import numpy as np
import pytest

from benchmarks.rigs.hokuyo_bench import QUANTISATION, Bench, World, on_bench
from gvgbot.clock import LoopClock
from gvgbot.drivers.hokuyo.config import Echo, HokuyoConfig
from gvgbot.drivers.hokuyo.models import MODELS
from gvgbot.drivers.hokuyo.twin import HokuyoTwin, HokuyoTwinConfig
from gvgbot.drivers.transport import ByteStream
from gvgbot.geometry import Array
from gvgbot.hal.messages import Scan

pytestmark = pytest.mark.twin


def twin_of(truth: Array | World, seed: int = 31, **config: Any) -> HokuyoTwin:
    quiet = {"range_sigma_m": 0.0, "dropout_fraction": 0.0, "double_echo_fraction": 0.0}
    settings = HokuyoTwinConfig(**{**quiet, **config})
    sense = truth if isinstance(truth, World) else lambda *_: truth
    return HokuyoTwin(settings, sense, seed)


def near(ranges: Array, truth: Array) -> bool:
    return np.allclose(ranges, truth, rtol=0.0, atol=QUANTISATION)


@pytest.mark.parametrize("model", MODELS)
def test_every_model_gives_its_scans_at_the_wanted_rate(model: str) -> None:
    parameters = MODELS[model].parameters
    truth = np.linspace(0.5, 3.5, len(parameters.bearings))

    async def scenario(bench: Bench) -> None:
        scans = await bench.scans(40)
        assert near(scans[-1].ranges, truth)
        assert scans[0].bearings == pytest.approx(parameters.bearings)
        rate = 39.0 / (scans[-1].stamp - scans[0].stamp)
        possible = 1.0 / (parameters.period * np.arange(1, 11))
        assert min(abs(rate - possible)) < 0.05
        assert abs(rate - 10.0) <= min(abs(possible - 10.0)) * 1.01 + 0.05

    on_bench(twin_of(truth, model=model), scenario)


@pytest.mark.parametrize("echo", ["first", "last", "strongest"])
def test_a_multi_echo_laser_sees_the_pane_or_the_wall_behind_it(echo: Echo) -> None:
    truth = np.full(1081, 4.0)
    seen: list[Scan] = []

    async def scenario(bench: Bench) -> None:
        seen.extend(await bench.scans(10))
        assert bench.laser.mode is not None
        assert bench.laser.mode.request.command == ("NE" if echo == "strongest" else "ND")

    twin = twin_of(truth, model="UTM-30LX-EW", double_echo_fraction=0.25)
    on_bench(twin, scenario, HokuyoConfig(echo=echo))
    panes = np.mean([np.isclose(scan.ranges, 2.0, atol=QUANTISATION) for scan in seen])
    walls = np.mean([np.isclose(scan.ranges, 4.0, atol=QUANTISATION) for scan in seen])
    assert panes == pytest.approx(0.25 if echo == "first" else 0.0, abs=0.02)
    assert walls + panes == pytest.approx(1.0)


@pytest.mark.parametrize("upside_down", [False, True])
def test_intensities_come_with_the_ranges_where_they_are_wanted(*, upside_down: bool) -> None:
    """In the order of the beams, also where that is not the order of the steps."""
    truth = np.linspace(0.5, 10.0, 1081)

    async def scenario(bench: Bench) -> None:
        (scan,) = await bench.scans(1)
        assert near(scan.ranges, truth[::-1] if upside_down else truth)
        intensities = bench.laser.intensities
        assert intensities is not None
        by_range = intensities[np.argsort(scan.ranges)]
        assert (np.diff(by_range) <= 0).all()  # the further, the weaker
        assert by_range[0] > 4 * by_range[-1]

    on_bench(twin_of(truth), scenario, HokuyoConfig(intensities=True, upside_down=upside_down))


@pytest.mark.parametrize(("intensities", "command"), [(False, "MD"), (True, "ME")])
def test_a_laser_without_multi_echo_is_asked_for_simple_scans(
    *, intensities: bool, command: str
) -> None:
    async def scenario(bench: Bench) -> None:
        await bench.scans(2)
        assert bench.laser.mode is not None
        assert bench.laser.mode.request.command == command
        assert "does not know" in (bench.laser.mode.adapted or "")
        assert (bench.laser.intensities is not None) == intensities

    config = HokuyoConfig(echo="strongest", intensities=intensities)
    on_bench(twin_of(np.full(1081, 3.0)), scenario, config)


def test_a_mark_of_ones_own_does_not_disturb() -> None:
    async def scenario(bench: Bench) -> None:
        await bench.scans(3)
        assert bench.laser.mode is not None
        assert bench.laser.mode.request.text() == "MD0000108001300;gvgbot 1"

    on_bench(twin_of(np.full(1081, 3.0)), scenario, HokuyoConfig(user_string="gvgbot 1"))


@pytest.mark.parametrize(
    ("config", "beams"),
    [
        (HokuyoConfig(link="serial", rate_hz=10.0), 341),
        (HokuyoConfig(link="serial", rate_hz=10.0, max_range_m=4.0, first_angle_deg=0.0), 342),
    ],
)
def test_a_urg_04lx_on_a_serial_line_keeps_its_rate(config: HokuyoConfig, beams: int) -> None:
    world = World(beams=682)

    async def scenario(bench: Bench) -> None:
        scans = await bench.scans(60)
        assert len(scans[0].ranges) == beams
        assert np.diff([scan.stamp for scan in scans]) == pytest.approx(0.1, abs=0.003)
        assert bench.clock.now() - scans[-1].stamp < 0.25
        assert bench.laser.link.bad_messages == 0

    on_bench(twin_of(world, model="URG-04LX", serial_baud=115200), scenario, config)


def test_a_line_that_is_too_slow_drops_scans_but_none_grows_old() -> None:
    """A laser that is asked for more than its line carries sends the newest scan it has."""
    world = World(beams=682)

    async def scenario(bench: Bench) -> None:
        stamps = []
        for _ in range(50):
            (scan,) = await bench.scans(1)
            stamps.append(scan.stamp)
            assert bench.clock.now() - scan.stamp < 0.5
            number = int(np.argmin(np.abs(np.array(world.stamps) + 0.0043 - scan.stamp)))
            assert near(scan.ranges, world.ranges(number))
        assert 49 / (stamps[-1] - stamps[0]) == pytest.approx(5.37, rel=0.05)  # all that fits

    config = HokuyoConfig(link="serial", adapt=False)
    on_bench(twin_of(world, model="URG-04LX", serial_baud=115200), scenario, config)


def test_a_hanging_laser_shows_the_world_as_an_upright_one_does() -> None:
    """The same room, seen from the same place by a laser either way up."""
    bearings = MODELS["UTM-30LX"].parameters.bearings

    def room(bearing: Array) -> Array:
        return 3.0 + np.sin(bearing) + 0.1 * np.cos(5 * bearing)

    views: list[Scan] = []

    async def scenario(bench: Bench) -> None:
        views.extend(await bench.scans(1))

    on_bench(twin_of(room(bearings)), scenario)
    on_bench(twin_of(room(-bearings)), scenario, HokuyoConfig(upside_down=True))
    assert views[1].ranges == pytest.approx(views[0].ranges)
    assert views[1].bearings == pytest.approx(views[0].bearings)


def test_cropped_beams_are_not_sent() -> None:
    truth = np.linspace(0.5, 10.0, 1081)

    async def scenario(bench: Bench) -> None:
        (scan,) = await bench.scans(1)
        assert len(scan.ranges) == 361
        assert math.degrees(scan.angle_min) == pytest.approx(-45.0)
        assert near(scan.ranges, truth[360:721])

    config = HokuyoConfig(first_angle_deg=-45.0, last_angle_deg=45.0)
    on_bench(twin_of(truth), scenario, config)


def test_a_motor_off_its_nominal_speed_costs_nothing() -> None:
    world = World()

    async def scenario(bench: Bench) -> None:
        stamps = [scan.stamp for scan in await bench.scans(300)]
        assert np.abs(np.array(stamps) - world.stamps[: len(stamps)]).max() < 0.002
        await asyncio.sleep(0)

    on_bench(twin_of(world, motor_error_ppm=3000.0), scenario)


async def slowed(link: ByteStream, clock: LoopClock) -> None:
    """What a host before us did: the motor at its slowest level, 540 rpm."""
    link.write(b"CR10\n")
    await link.read()


def test_a_motor_that_somebody_slowed_down_is_lived_with() -> None:
    async def scenario(bench: Bench) -> None:
        stamps = [scan.stamp for scan in await bench.scans(50)]
        assert np.diff(stamps) == pytest.approx(60 / 540, abs=0.002)
        assert bench.laser.link.restarts == 0

    on_bench(twin_of(World(beams=682), model="URG-04LX"), scenario, first=slowed)


async def sabotaged(link: ByteStream, clock: LoopClock) -> None:
    """A host before us wanted a malfunction that mends itself, in mid-stream."""
    link.write(b"DB03\n")
    await link.read()


def test_scans_come_again_after_a_malfunction_that_mends_itself() -> None:
    async def scenario(bench: Bench) -> None:
        stamps = [scan.stamp for scan in await bench.scans(60)]
        gaps = np.diff(stamps)
        assert (gaps > 0.5).any()  # ten scans are not made
        assert gaps[-10:] == pytest.approx(0.1, abs=0.002)
        assert bench.laser.link.restarts == 0

    on_bench(twin_of(World(beams=682), model="URG-04LX"), scenario, first=sabotaged)
