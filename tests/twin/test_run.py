"""The daemon in virtual time: how it starts, goes on without a device, ends, and what it leaves."""

import asyncio
import errno
import gc
import json
import math
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import structlog
from scipy.spatial import cKDTree

from benchmarks.rigs.run_rig import STOP, Daemon, base_commands
from gvgbot.autonomy.events import Event
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.clock import Clock
from gvgbot.config import load_config
from gvgbot.daemon import run
from gvgbot.drivers.hokuyo.driver import HokuyoLaser
from gvgbot.drivers.kobuki.driver import KobukiBase
from gvgbot.errors import DeviceLost
from gvgbot.geometry import Pose, Twist
from gvgbot.hal.messages import Contact, Odometry, Scan, Sign
from gvgbot.links import Close, Links
from gvgbot.maps import run_directory
from gvgbot.robot import Robot
from gvgbot.saving import SAVE_EVERY
from gvgbot.simulation import Place
from gvgbot.stop_signals import StopSignals
from gvgbot.tiles import Grid
from gvgbot.worlds.canvas import Canvas

pytestmark = [pytest.mark.twin, pytest.mark.slow]

MAP = {"map.geojson", "map.yaml", "map.pgm", "map.png", "summary.json", "events.jsonl"}
WATCHED_S = 40.0
WAYS = {"estimate.tum", "online.tum", "odometry.tum", "truth.tum"}


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[Daemon]:
    rig = Daemon(tmp_path / "run")
    with rig.session.directory:
        yield rig


async def ten_seconds(clock: Clock) -> None:
    await clock.sleep_until(10.0)


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> tuple[Daemon, Pose]:
    """A daemon that was stopped after ten seconds, and where it was then."""
    rig, truth = Daemon(tmp_path_factory.mktemp("stopped") / "run"), list[Pose]()

    async def story(clock: Clock) -> None:
        await ten_seconds(clock)
        truth.append(rig.place)

    with rig.session.directory:
        rig.run(story)
    return rig, truth[0]


def test_the_last_command_on_the_wire_is_a_stop_though_the_robot_was_driving(
    stopped: tuple[Daemon, Pose],
) -> None:
    daemon, _ = stopped
    commands = base_commands(bytes(daemon.cable.written))
    assert daemon.network.states[-1].phase == "exploring"
    assert commands[-1] == STOP
    driving = [command for command in commands if command != STOP]
    assert len(driving) > 100
    assert commands.index(driving[-1]) < len(commands) - 1


def test_a_stopped_daemon_leaves_a_complete_run(stopped: tuple[Daemon, Pose]) -> None:
    daemon, _ = stopped
    path = daemon.session.directory.path
    assert {file.name for file in path.iterdir()} >= MAP | WAYS
    summary = json.loads((path / "summary.json").read_text())
    assert summary["outcome"] == "stopped"
    assert summary["duration_s"] == pytest.approx(10.0, abs=0.5)


def test_a_run_that_ended_by_a_fault_says_so_in_its_summary(daemon: Daemon) -> None:
    async def at_once(clock: Clock) -> None:
        await clock.sleep_until(1.0)

    daemon.session.failure = "the base does not answer"
    daemon.run(at_once)
    summary = json.loads((daemon.session.directory.path / "summary.json").read_text())
    assert (summary["outcome"], summary["reason"]) == ("failed", "the base does not answer")


def run_alone(out: Path) -> None:
    config = load_config(None, ["telemetry.enabled=false"])
    run(config, StopSignals(), out=out, known=None, anew=False)


def test_a_run_that_a_mistake_of_the_program_ended_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def mistaken(pipeline: Pipeline, scan: Scan) -> list[Event]:
        raise ValueError("a mistake")

    monkeypatch.setattr(Pipeline, "perceive", mistaken)
    with pytest.raises(ExceptionGroup):
        run_alone(tmp_path / "run")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (summary["outcome"], summary["reason"]) == ("failed", "a mistake")


def test_a_collection_of_garbage_while_it_runs_passes_over_what_the_program_was_at_its_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gone_through: list[bool] = []

    def looking(pipeline: Pipeline, scan: Scan) -> list[Event]:
        gone_through.append(any(each is vars(np) for each in gc.get_objects()))
        raise ValueError("seen enough")

    monkeypatch.setattr(Pipeline, "perceive", looking)
    with pytest.raises(ExceptionGroup):
        run_alone(tmp_path / "run")
    assert gone_through == [False]
    assert any(each is vars(np) for each in gc.get_objects())  # as before


def test_the_state_is_published_ten_times_a_second_with_the_truth_in_it(
    stopped: tuple[Daemon, Pose],
) -> None:
    daemon, truth = stopped
    states = daemon.network.states
    assert len(states) == pytest.approx(100, abs=1)
    assert [state.sequence for state in states] == list(range(len(states)))
    assert all(b.stamp - a.stamp == pytest.approx(0.1) for a, b in pairwise(states))
    assert states[-1].cycles == pytest.approx(50 * 10, abs=25)
    start = daemon.session.place
    assert start is not None
    map_base = start.start.to(truth)
    assert states[-1].pose == pytest.approx((map_base.x, map_base.y, map_base.theta), abs=0.15)


def test_the_service_manager_hears_ready_once_signs_of_life_and_stopping(
    stopped: tuple[Daemon, Pose],
) -> None:
    daemon, _ = stopped
    told = daemon.manager.told
    assert daemon.manager.count("READY=1") == 1
    assert daemon.manager.count("WATCHDOG=1") == pytest.approx(100, abs=1)
    assert daemon.manager.count("STOPPING=1") == 1
    assert "WATCHDOG=1" not in told[told.index("STOPPING=1") :]
    before = told[: told.index("READY=1")]
    assert [line for line in before if line.startswith("STATUS=")][-1].startswith(
        "STATUS=exploring"
    )


def test_a_finished_daemon_saves_the_map_and_stands_until_it_is_stopped(tmp_path: Path) -> None:
    canvas = Canvas(7.0, 4.0)
    canvas.carve_path([(2.0, 2.0), (5.0, 2.0)], 1.4)
    path = tmp_path / "run"
    daemon = Daemon(path, Place(canvas.world("short"), Pose(2.0, 2.0, 0.3)))
    seen: list[Any] = []

    async def story(clock: Clock) -> None:
        while not daemon.network.states or daemon.network.states[-1].phase != "finished":
            await clock.sleep_until(clock.now() + 1.0)
        await clock.sleep_until(clock.now() + 3.0)
        seen.append(json.loads((path / "summary.json").read_text())["outcome"])
        seen.append(daemon.place)
        await clock.sleep_until(clock.now() + 20.0)
        seen.append(daemon.place)

    with daemon.session.directory, structlog.testing.capture_logs() as logs:
        daemon.run(story)
    assert seen[0] == "explored"
    assert seen[1] == seen[2]
    assert daemon.network.states[-1].outcome == "explored"
    assert daemon.network.states[-1].cycle_age == pytest.approx(0.0, abs=0.1)
    assert [log["event"] for log in logs].count("finished") == 1
    late = base_commands(bytes(daemon.cable.written))[-1000:]  # of 50 a second
    assert set(late) == {STOP}


def test_a_map_that_could_not_be_saved_is_saved_as_soon_as_that_is_possible(
    daemon: Daemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    path = daemon.session.directory.path
    disk, away = path.parent, path.parent.with_name("unplugged")
    reasons: list[str] = []

    async def story(clock: Clock) -> None:
        await clock.sleep_until(4.0)
        disk.rename(away)
        monkeypatch.setattr(run_directory, "_append", full)
        answer = await daemon.network.ask("stop")
        assert "map not saved" in answer.text
        await clock.sleep_until(4.0 + SAVE_EVERY + 2.0)  # it has tried once more
        away.rename(disk)
        monkeypatch.undo()
        await clock.sleep_until(4.0 + 2 * SAVE_EVERY + 2.0)
        reasons.append(json.loads((path / "summary.json").read_text())["reason"])
        *_, ended, _ = map(json.loads, (path / "events.jsonl").read_text().splitlines())
        reasons.append(ended["reason"])

    with structlog.testing.capture_logs() as logs:
        daemon.run(story)
    assert reasons == 2 * ["stopped by a request"]
    assert [log["event"] for log in logs].count("map not saved") == 1


def test_a_disk_that_hangs_does_not_hold_up_the_robot(daemon: Daemon) -> None:
    async def never(_: Callable[[], None]) -> None:
        await asyncio.Event().wait()

    path = daemon.session.directory.path / "events.jsonl"
    written: list[str] = []

    async def story(clock: Clock) -> None:
        await clock.sleep_until(20.0)
        written.append(path.read_text())

    daemon.robot = Robot(daemon.session, daemon.manager, daemon.network, never)
    daemon.run(story)
    assert daemon.network.states[-1].vertices > 0
    assert written == [""]
    assert "vertex_added" in path.read_text()


def test_a_robot_goes_on_where_it_was_after_its_base_was_lost_for_a_while(
    daemon: Daemon,
) -> None:
    standing: list[Pose] = []
    truth: list[Pose] = []

    async def story(clock: Clock) -> None:
        await clock.sleep_until(8.0)
        daemon.cable.is_cut = True
        await clock.sleep_until(11.0)
        standing.append(daemon.place)
        await clock.sleep_until(20.0)
        standing.append(daemon.place)
        daemon.cable.is_cut = False
        await clock.sleep_until(32.0)
        truth.append(daemon.place)

    with structlog.testing.capture_logs() as logs:
        daemon.run(story)
    assert standing[0] == standing[1]
    halted = [state for state in daemon.network.states if 11.0 < state.stamp < 20.0]
    assert {state.phase for state in halted} == {"halted"}
    assert {(state.laser.connected, state.base.connected) for state in halted} == {(True, False)}
    assert [daemon.network.states[at].base.reconnects for at in (30, -1)] == [0, 1]
    assert all("no base" in state.reason for state in halted)
    assert {state.phase for state in daemon.network.states if state.stamp > 26.0} == {"exploring"}
    events = [log["event"] for log in logs]
    assert (events.count("base lost"), events.count("base back")) == (1, 1)
    assert daemon.session.place is not None
    map_base = daemon.session.place.start.to(truth[0])
    x, y, _ = daemon.network.states[-1].pose
    assert math.hypot(x - map_base.x, y - map_base.y) < 0.2
    assert standing[1].distance(truth[0]) > 0.3  # it has driven on
    assert daemon.manager.count("WATCHDOG=1") == pytest.approx(10 * 32, abs=3)


def test_a_robot_stands_while_its_laser_is_unplugged_and_then_goes_on(daemon: Daemon) -> None:
    places: list[Pose] = []

    async def story(clock: Clock) -> None:
        await clock.sleep_until(8.0)
        assert daemon.session.simulation is not None
        daemon.session.simulation.laser_twin.inject("unplug", 6.0)
        for stamp in (9.0, 13.5, 25.0):
            await clock.sleep_until(stamp)
            places.append(daemon.place)

    daemon.run(story)
    assert places[0] == places[1]
    assert places[1].distance(places[2]) > 0.3
    away = [state for state in daemon.network.states if 8.3 < state.stamp < 13.5]
    assert {state.phase for state in away} == {"halted"}
    assert all("no laser" in state.reason and state.guard == "no scan" for state in away)
    last = daemon.network.states[-1]
    assert (last.phase, last.laser.connected, last.laser.reconnects) == ("exploring", True, 1)


@pytest.fixture(scope="module")
def sent_home(tmp_path_factory: pytest.TempPathFactory) -> tuple[Daemon, str, list[str]]:
    """A daemon without a laser on its way home, its phase before, and what it had logged then."""
    rig, phases = Daemon(tmp_path_factory.mktemp("sent_home") / "run"), list[str]()
    logged: list[str] = []

    async def story(clock: Clock) -> None:
        await clock.sleep_until(8.0)
        for request in ("stop", "home"):
            assert (await rig.network.ask(request)).done
        await clock.sleep_until(10.0)
        phases.append(rig.network.states[-1].phase)
        logged.extend(log["event"] for log in logs)
        assert rig.session.simulation is not None
        rig.session.simulation.laser_twin.inject("unplug", 6.0)
        await clock.sleep_until(12.0)

    with rig.session.directory, structlog.testing.capture_logs() as logs:
        rig.run(story)
    return rig, phases[0], logged


def test_a_robot_on_an_errand_does_not_say_that_it_stands(
    sent_home: tuple[Daemon, str, list[str]],
) -> None:
    _, phase, logged = sent_home
    assert phase == "errand"
    assert "base is there" in logged
    assert "standing still until stopped" not in logged


def test_on_an_errand_it_says_what_it_waits_for_and_not_how_the_exploration_ended(
    sent_home: tuple[Daemon, str, list[str]],
) -> None:
    daemon, *_ = sent_home
    last = daemon.network.states[-1]
    assert (last.phase, last.outcome, last.errand) == ("halted", "stopped", "home")
    assert last.reason.startswith("no laser")
    status = [told for told in daemon.manager.told if told.startswith("STATUS=")]
    assert status[-1].startswith("STATUS=home: no laser")


class NoPorts(Links):
    async def open_laser(self) -> tuple[HokuyoLaser, Close]:
        raise DeviceLost("cannot open /dev/hokuyo")

    async def open_base(self) -> tuple[KobukiBase, Close]:
        raise DeviceLost("cannot open /dev/kobuki")


def test_missing_ports_are_waited_for_and_said_once_each(daemon: Daemon) -> None:
    with structlog.testing.capture_logs() as logs:
        daemon.run_on(NoPorts, 600.0)
    waiting = [log for log in logs if log["event"].startswith("waiting")]
    assert sorted(log["reason"] for log in waiting) == [
        "cannot open /dev/hokuyo",
        "cannot open /dev/kobuki",
    ]
    last = daemon.network.states[-1]
    assert last.phase == "starting"
    assert "/dev/hokuyo" in last.reason
    assert "/dev/kobuki" in last.reason
    assert daemon.manager.count("READY=1") == 0
    assert daemon.manager.count("WATCHDOG=1") > 2000
    daemon.session.save()
    assert {file.name for file in daemon.session.directory.path.iterdir()} >= MAP


class Frozen:
    """A base whose odometry comes once and never again, though it does not complain."""

    contact: Contact | None = None
    battery = None

    def __init__(self) -> None:
        self._told = False

    async def run(self) -> None:
        await asyncio.Event().wait()

    async def next_odometry(self) -> Odometry:
        if self._told:
            await asyncio.Event().wait()
        self._told = True
        return Odometry(asyncio.get_running_loop().time(), Pose(), Twist(0.0, 0.0))

    def drive(self, twist: Twist) -> Twist:
        return twist

    def show(self, sign: Sign) -> None:
        pass


class FrozenLinks(NoPorts):
    async def open_base(self) -> tuple[Any, Close]:  # a base of another kind
        return Frozen(), lambda: None


def test_a_control_loop_that_is_stuck_gives_no_sign_of_life(daemon: Daemon) -> None:
    daemon.run_on(FrozenLinks, 30.0)
    assert daemon.manager.count("WATCHDOG=1") < 15  # of 300
    assert daemon.network.states[-1].cycle_age == pytest.approx(30.0, abs=0.5)


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Daemon:
    """A daemon that has explored for a while."""
    rig = Daemon(tmp_path_factory.mktemp("watched") / "run")

    async def story(clock: Clock) -> None:
        await clock.sleep_until(WATCHED_S)

    with rig.session.directory:
        rig.run(story)
    return rig


def test_those_who_watch_get_the_map_and_each_event_of_the_list(watched: Daemon) -> None:
    daemon = watched
    path = daemon.session.directory.path
    lines = [json.loads(line) for line in (path / "events.jsonl").read_text().splitlines()]
    told = {event.number: event for sent in daemon.network.events for event in sent.events}
    assert [
        {"event": told[n].kind, "stamp": told[n].stamp} | told[n].details for n in sorted(told)
    ] == lines[: len(told)]
    assert len(lines) - len(told) in (0, 1)  # one may have come too late for the last message
    last = daemon.network.maps[-1]
    assert [vertex.id for vertex in last.vertices] == [
        line["vertex"]
        for line in lines
        if line["event"] == "vertex_added"
        if line["stamp"] < WATCHED_S - 2.0
    ]
    for vertex in last.vertices:
        (line,) = [x for x in lines if x["event"] == "vertex_added" and x["vertex"] == vertex.id]
        assert math.dist(vertex.position, (line["x"], line["y"])) < 0.3
    driven = daemon.network.trajectories[-1].map_base
    assert daemon.network.states[-1].distance == pytest.approx(
        np.hypot(*np.diff(driven[:, :2], axis=0).T).sum(), abs=2.0
    )


def test_the_walls_that_are_shown_are_those_of_the_world(watched: Daemon) -> None:
    daemon = watched
    assert daemon.session.place is not None
    world, start = daemon.session.place.world, daemon.session.place.start
    assert isinstance(daemon.network.whole_grid, Grid)
    last = daemon.network.whole_grid.raster()
    rows, columns = np.nonzero(last.cells > 65)
    corners = np.column_stack([columns + 0.5, rows + 0.5]) * last.resolution + last.origin
    for squares in (world.occupied, ~world.occupied):  # a wall is where both are near
        places = (np.argwhere(squares)[:, ::-1] + 0.5) * world.resolution_m + world.origin
        away, _ = cKDTree(places).query(start.transform(corners))
        assert np.size(away) > 100
        assert np.quantile(away, 0.95) < 1.5 * last.resolution
