"""Explorations in which a device goes away and comes back, against the geometry of their world."""

import asyncio
import json
import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import load_config
from gvgbot.driving import drive
from gvgbot.geometry import Array, Pose, wrap_angle
from gvgbot.hal.messages import Odometry
from gvgbot.links import Devices, Links
from gvgbot.simulation import Simulation, open_place
from tests.twin.test_explore import Case, Point, Run, explore, lollipop, matched

pytestmark = [pytest.mark.slow, pytest.mark.twin]

AT, AWAY = (12.0, 32.0), 8.0  # s: when the device is lost, and for how long
DEAD_TIME, FRAME, BRAKING = 0.06, 0.02, 1.0  # s, s, m/s2 of the simulated base
OUTAGES = {
    "laser unplugged": (
        f"twin.laser.link.unplugs_at_s=[{AT[0]}, {AT[1]}]",
        f"twin.laser.link.unplugged_s={AWAY}",
    ),
    "base unplugged": (
        f"twin.base.link.unplugs_at_s=[{AT[0]}, {AT[1]}]",
        f"twin.base.link.unplugged_s={AWAY}",
    ),
    "laser reboots": (
        f"twin.laser.mishaps.reboots_at_s=[{AT[0]}, {AT[1]}]",
        f"twin.laser.reboot_s={AWAY}",
    ),
}


def interrupted(case: Case, out: Path, *settings: str) -> Run:
    options = [word for setting in settings for word in ("--set", setting)]
    return explore(case, out, "--seed", "3", *options)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Run]:
    return {
        name: interrupted(lollipop(), tmp_path_factory.mktemp("outage"), *settings)
        for name, settings in OUTAGES.items()
    }


by_outage = pytest.mark.parametrize("name", OUTAGES)


@by_outage
def test_the_map_is_the_world_s_graph_all_the_same(runs: dict[str, Run], name: str) -> None:
    run = runs[name]
    assert (run.status, run.summary["outcome"]) == (0, "explored")
    assert run.summary["contacts"] == 0
    places: dict[int, Point] = {}
    for kind, wanted in (
        ("meetpoint", [*run.case.meetpoints]),
        ("endpoint", run.case.endpoints),
    ):
        pairs = matched(run.vertices(kind), wanted)
        assert Counter(pairs.values()) == Counter(wanted)
        places |= pairs
    found = Counter((places[edge["startid"]], places[edge["endid"]]) for edge in run.edges)
    assert found == Counter([*run.case.edges, *((b, a) for a, b in run.case.edges)])


@by_outage
def test_the_robot_knows_where_it_is_all_the_same(runs: dict[str, Run], name: str) -> None:
    truth = runs[name].trajectory("truth")
    for believed, limit in (("estimate", 0.1), ("online", 0.15)):
        rows = runs[name].trajectory(believed)
        assert np.hypot(*(rows[:, 1:3] - truth[:, 1:3]).T).max() < limit
        assert np.cos(rows[:, 3] - truth[:, 3]).min() > math.cos(math.radians(3))


def truth_at(run: Run, stamp: float) -> Array:
    """The first row (t, x, y, theta) of the truth from a stamp on."""
    truth = run.trajectory("truth")
    return np.asarray(truth[np.searchsorted(truth[:, 0], stamp)])


@pytest.mark.parametrize("name", ["laser unplugged", "laser reboots"])
@pytest.mark.parametrize("lost", AT)
def test_the_robot_brakes_as_soon_as_the_laser_is_gone_and_then_stands(
    runs: dict[str, Run], name: str, lost: float
) -> None:
    """It rolls on for the base's dead time, and brakes as hard as it can."""
    before, after = truth_at(runs[name], lost - 0.5), truth_at(runs[name], lost)
    speed = math.dist(before[1:3], after[1:3]) / (after[0] - before[0])
    assert speed > 0.1, "it should be driving when the laser is lost"
    still = lost + 3 * FRAME + DEAD_TIME + speed / BRAKING + 0.1  # rows are a tenth apart
    standing, end = truth_at(runs[name], still), truth_at(runs[name], lost + AWAY - 0.2)
    assert end[0] - standing[0] > 5.0
    assert math.dist(standing[1:3], end[1:3]) == 0.0


def test_the_robot_has_rolled_while_nobody_heard_the_base(runs: dict[str, Run]) -> None:
    """The base goes on until it misses its commands; its way is in the odometry afterwards."""
    before = truth_at(runs["base unplugged"], AT[0] - 0.1)
    after = truth_at(runs["base unplugged"], AT[0] + AWAY)
    assert math.dist(before[1:3], after[1:3]) > 0.2


def test_a_robot_that_rolled_and_was_turned_while_its_base_was_away_finds_its_place() -> None:
    """Wheels and gyro add up alike whether it rolled or turned first, half a metre apart."""
    wheels: list[Odometry] = []

    async def main() -> tuple[Pose, Pose, Pose]:
        config, clock = load_config(None, ["twin.world=rooms"]), LoopClock()
        simulation = Simulation(config, open_place(config), clock)
        devices, body = Devices(Links(config, clock, simulation)), simulation.body
        pipeline = Pipeline(config.mind, config.exploration, config.robot.radius_m)
        driving = drive(config.robot, devices, pipeline, on_cycle=wheels.append)
        async with asyncio.TaskGroup() as tasks:
            work = tasks.create_task(driving)
            await clock.sleep_until(31.0)
            assert body.linear > 0.4
            simulation.base_twin.inject("unplug", 8.0)
            await clock.sleep_until(34.0)
            assert body.linear == 0.0
            body.command(0.0, 0.5)
            await clock.sleep_until(37.0)
            body.command(0.0, 0.0)
            await clock.sleep_until(43.0)
            work.cancel()
        body.advance(clock.now())
        start = simulation.place.start
        odom_base = wheels[-1].odom_base
        return body.pose, start.compose(odom_base), start.compose(pipeline.map_base)

    truth, dead_reckoning, believed = run_in_virtual_time(main())
    assert truth.distance(dead_reckoning) > 0.4
    assert truth.distance(believed) < 0.1
    assert abs(wrap_angle(truth.theta - believed.theta)) < math.radians(2)


def test_devices_that_never_come_back_end_the_exploration_with_a_line_and_a_map(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gone = ("unplugs_at_s=[12]", "unplugged_s=86400")
    settings = [f"twin.{device}.link.{fault}" for device in ("laser", "base") for fault in gone]
    run = interrupted(lollipop(), tmp_path, *settings, "twin.time_limit_s=120")
    assert run.status == 1
    said = capsys.readouterr()
    (line,) = [line for line in said.err.splitlines() if line.startswith("failed: ")]
    assert "no base: " in line
    assert "no laser: " in line
    assert str(run.path / "map.geojson") in said.out
    assert json.loads((run.path / "summary.json").read_text())["outcome"] == "failed"
    assert run.features
    assert (run.path / "map.png").stat().st_size > 1000


def test_an_exploration_that_takes_too_long_is_ended(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = interrupted(lollipop(), tmp_path, "twin.time_limit_s=10")
    assert run.status == 1
    assert "failed: not explored after 10 s" in capsys.readouterr().err
    assert run.summary["duration_s"] == pytest.approx(10.0, abs=0.2)
