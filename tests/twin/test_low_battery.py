"""A robot whose battery is low while it explores, in virtual time, in the world of the errands."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from benchmarks.rigs import doors_rig
from benchmarks.rigs.doors_rig import swing
from benchmarks.rigs.lives_rig import Lives
from benchmarks.rigs.run_rig import Daemon
from gvgbot.clock import Clock
from gvgbot.config import ServiceConfig, TwinConfig, load_config
from gvgbot.drivers.hokuyo.twin import HokuyoTwinConfig
from gvgbot.drivers.kobuki.twin import KobukiTwin, KobukiTwinConfig
from gvgbot.geometry import STANDSTILL, Pose
from gvgbot.journal import SAGGING_S
from gvgbot.robot import CALL_EVERY
from gvgbot.session import Session
from gvgbot.simulation import Place
from gvgbot.worlds.canvas import Canvas
from tests.twin.lollipop_rig import IN_RING, LOLLIPOP
from tests.twin.lollipop_rig import START as HOME
from tests.twin.test_errands import NEAR, START, a_while, theta, until

pytestmark = [pytest.mark.twin, pytest.mark.slow]

DOORS = (2.8, 3.0, 1.2, 2.8), (4.0, 4.2, 1.2, 2.8)  # x, x, y, y; to either side of the start
BASE = KobukiTwinConfig(odometry="perfect", battery_v=13.8)  # a Kobuki is low below 14 V


def daemon(tmp_path: Path, *, home_when_low: bool = True) -> Daemon:
    service = ServiceConfig(home_when_low=home_when_low)
    return Daemon(tmp_path / "run", theta(), twin=TwinConfig(base=BASE), service=service)


def told(lives: Daemon, kind: str) -> list[dict[str, Any]]:
    text = (lives.session.directory.path / "events.jsonl").read_text()
    return [line for line in map(json.loads, text.splitlines()) if line["event"] == kind]


def short() -> Place:
    """A corridor whose end is in sight."""
    canvas = Canvas(7.0, 4.0)
    canvas.carve_path([(2.0, 2.0), (5.0, 2.0)], 1.4)
    return Place(canvas.world("short"), Pose(2.0, 2.0, 0.3))


def begun(lives: Daemon) -> bool:
    return bool(lives.network.states)


def off(place: Pose) -> float:
    return math.hypot(place.x - START.x, place.y - START.y)


def test_it_drives_to_where_it_started_and_waits_there(tmp_path: Path) -> None:
    lives, offs = daemon(tmp_path), list[float]()

    async def story(clock: Clock) -> None:
        await until(clock, lambda: begun(lives) and lives.network.states[-1].errand == "home")
        offs.append(off(lives.place))
        await until(clock, lambda: lives.network.states[-1].errand is None)
        await a_while(clock, CALL_EVERY + 2.0)
        offs.append(off(lives.place))

    with lives.session.directory:
        lives.run(story)
    (asked,) = told(lives, "requested")
    assert (asked["request"], asked["origin"], asked["done"]) == ("home", "low battery", True)
    assert asked["stamp"] == pytest.approx(SAGGING_S + 1.0, abs=1.0)
    assert [line["outcome"] for line in told(lives, "errand_ended")] == ["arrived"]
    assert offs[0] > 1.0
    assert offs[1] < NEAR
    assert lives.session.pipeline.errands.is_waiting


def test_who_looks_for_its_place_drives_home_when_it_has_found_that(tmp_path: Path) -> None:
    """It was restarted elsewhere, with a battery that is low already."""
    config = load_config(None, ["twin.seed=1"])
    Lives(config, Place(LOLLIPOP, HOME), tmp_path / "whole").run([])
    config = load_config(None, ["twin.seed=1", f"twin.base.battery_v={BASE.battery_v}"])
    place, known = Place(LOLLIPOP, IN_RING), tmp_path / "whole"
    lives = Lives(config, place, tmp_path / "run", known=known, over=waits)
    lives.run([])
    text = (tmp_path / "run/events.jsonl").read_text()
    told = [json.loads(line) for line in text.splitlines()]
    about = [line for line in told if line["event"] in ("requested", "recovery")]
    assert [line["event"] for line in about] == ["recovery", "recovery", "requested"]
    assert about[1]["action"] == "go on from its place on the map"
    assert (about[2]["origin"], about[2]["done"]) == ("low battery", True)
    assert lives.world.body.pose.distance(HOME) < NEAR


def waits(session: Session) -> bool:
    return session.pipeline.errands.is_waiting


def test_it_goes_on_if_it_shall_not(tmp_path: Path) -> None:
    lives = daemon(tmp_path, home_when_low=False)

    async def story(clock: Clock) -> None:
        await clock.sleep_until(SAGGING_S + 5.0)

    with lives.session.directory:
        lives.run(story)
    assert told(lives, "requested") == []
    assert lives.network.states[-1].phase == "exploring"


@pytest.mark.parametrize("name", ["pause", "stop"])
def test_who_was_told_to_stand_stands(name: str, tmp_path: Path) -> None:
    lives, places = daemon(tmp_path), list[Pose]()

    async def story(clock: Clock) -> None:
        await clock.sleep_until(8.0)
        await lives.network.ask(name)
        await a_while(clock, 2.0)  # to brake
        places.append(lives.place)
        await clock.sleep_until(SAGGING_S + 5.0)
        places.append(lives.place)

    with lives.session.directory:
        lives.run(story)
    before, after = places
    assert math.hypot(after.x - before.x, after.y - before.y) < 1e-3
    assert [line["request"] for line in told(lives, "requested")] == [name]


def test_who_could_not_go_home_before_it_was_charged_stands_in_the_end(tmp_path: Path) -> None:
    lives, places = Daemon(tmp_path / "run", short(), twin=TwinConfig(base=BASE)), list[Pose]()

    async def story(clock: Clock) -> None:
        await clock.sleep_until(3.0)
        await lives.network.ask("pause")
        await clock.sleep_until(SAGGING_S + 5.0)
        assert lives.session.simulation is not None
        base = lives.session.simulation.base_twin._device
        assert isinstance(base, KobukiTwin)
        base.plug_adapter(True)
        base._power.volts = 16.0
        await a_while(clock, 5.0)
        base.plug_adapter(False)
        await a_while(clock, 1.0)
        await lives.network.ask("resume")
        await until(clock, lambda: lives.network.states[-1].phase == "finished")
        base._power.volts = 13.8
        for seconds in (2.0, SAGGING_S + 5.0):
            await a_while(clock, seconds)
            places.append(lives.place)

    with lives.session.directory:
        lives.run(story)
    before, after = places
    assert math.hypot(after.x - before.x, after.y - before.y) < 1e-3
    assert [line["request"] for line in told(lives, "requested")] == ["pause", "resume"]


def test_it_drives_home_once_there_is_a_way(tmp_path: Path) -> None:
    """In a long corridor no edge is known before its end is in sight."""
    canvas = Canvas(15.0, 7.0)
    canvas.carve_path([(1.0, 1.5), (13.0, 1.5), (13.0, 5.0)], 1.4)
    place = Place(canvas.world("long"), Pose(2.0, 1.5))
    base = replace(BASE, battery_v=13.98, battery_drain_v_per_h=10.0)  # 13.9 after a while
    twin = TwinConfig(base=base, laser=HokuyoTwinConfig(model="URG-04LX"))
    lives = Daemon(tmp_path / "run", place, twin=twin)

    async def story(clock: Clock) -> None:
        await until(clock, lambda: bool(told(lives, "errand_ended")))

    with lives.session.directory:
        lives.run(story)
    asked = [line["done"] for line in told(lives, "requested")]
    assert asked == [False, True]
    assert lives.session.pipeline.map_base.distance(Pose()) < NEAR


def test_it_drives_home_once_nothing_stands_in_the_way_any_more(tmp_path: Path) -> None:
    world = doors_rig.theta()
    place, offs = Place(world, START), list[float]()
    lives = Daemon(tmp_path / "run", place, twin=TwinConfig(base=BASE))

    async def story(clock: Clock) -> None:
        await until(clock, lambda: begun(lives) and lives.network.states[-1].errand == "home")
        for door in DOORS:
            swing(world, door, shut=True)
        await until(clock, lambda: bool(told(lives, "errand_ended")))
        offs.append(off(lives.place))
        for door in DOORS:
            swing(world, door, shut=False)
        await until(clock, lambda: len(told(lives, "errand_ended")) == 2)
        offs.append(off(lives.place))

    with lives.session.directory:
        lives.run(story)
    assert [line["outcome"] for line in told(lives, "errand_ended")] == ["given up", "arrived"]
    assert offs[0] > 1.0
    assert offs[1] < NEAR


def test_who_is_driven_by_somebody_is_driven_on(tmp_path: Path) -> None:
    lives = daemon(tmp_path)
    errands = lives.session.pipeline.errands

    async def story(clock: Clock) -> None:
        await clock.sleep_until(8.0)
        while clock.now() < SAGGING_S + 5.0:
            lives.robot._let_drive(STANDSTILL)
            await a_while(clock, 0.2)
        assert errands.progress == "driven by somebody"

    with lives.session.directory:
        lives.run(story)
    assert [line["request"] for line in told(lives, "requested")] == ["cmd_vel"]
