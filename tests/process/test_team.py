"""Robots of a team hear all others over the network, wherever they meet, but not themselves."""

import asyncio
import contextlib
import json
import math
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gvgbot import client
from gvgbot.telemetry import Telemetry
from gvgbot.topics import State, TelemetryConfig
from tests.process.addresses import free_endpoint, router
from tests.process.test_run_process import gvgbot

pytestmark = [pytest.mark.slow, pytest.mark.timeout(60)]

NAMES = ("one", "two", "three")
WORLD = ("--set", "twin.world=floor_plan:3", "--set", "twin.seed=3")
STARTS_AT = ("8.78", "1.43", "2.79")
AWAY_M = 1.0  # a robot drives on while others are told where it is


def at_a_router(robots: list[str], meeting: str) -> list[tuple[str, ...]]:
    return [(meeting,) for _ in robots]


def at_the_first(robots: list[str], meeting: str) -> list[tuple[str, ...]]:
    return [(), *((robots[0],) for _ in robots[1:])]


def in_a_row(robots: list[str], meeting: str) -> list[tuple[str, ...]]:
    return [(), *((robot,) for robot in robots[:-1])]


@pytest.mark.parametrize("meet", [at_a_router, at_the_first, in_a_row])
def test_all_robots_of_a_team_hear_all_others(
    meet: Callable[[list[str], str], list[tuple[str, ...]]],
) -> None:
    heard: dict[str, set[bytes]] = {name: set() for name in NAMES}
    meeting, endpoints = free_endpoint(), [free_endpoint() for _ in NAMES]

    async def talk(team: list[Telemetry]) -> None:
        async with asyncio.timeout(30), asyncio.TaskGroup() as tasks:
            hearing = [
                tasks.create_task(robot.hear_team(heard[name].add))
                for name, robot in zip(NAMES, team, strict=True)
            ]
            while any(len(others) < 2 for others in heard.values()):  # not found each other yet
                for name, robot in zip(NAMES, team, strict=True):
                    robot.tell_team("team", b"\x00 by " + name.encode() + b"\xff")
                await asyncio.sleep(0.05)
            for task in hearing:
                task.cancel()

    with contextlib.ExitStack() as stack:
        stack.enter_context(router(meeting))
        team = [
            stack.enter_context(
                Telemetry(TelemetryConfig(listen=(here,), connect=there), name, relays=True)
            )
            for name, here, there in zip(NAMES, endpoints, meet(endpoints, meeting), strict=True)
        ]
        asyncio.run(talk(team))
    for name, others in heard.items():
        assert others == {b"\x00 by " + n.encode() + b"\xff" for n in NAMES if n != name}


@pytest.fixture
def known(tmp_path: Path) -> Path:
    """The first rooms of a building, as a run knows them that had no more time."""
    run = tmp_path / "known"
    command = ["explore", *WORLD, "--set", "twin.time_limit_s=50", "--out", str(run)]
    subprocess.run(
        [sys.executable, "-m", "gvgbot", *command, "--start", *STARTS_AT],
        check=False,
        capture_output=True,
    )
    return run


def until(robot: client.Robot, is_so: Callable[[State], bool]) -> State:
    """The first state for which something is so."""
    return next(state for state in robot.state() if is_so(state))


@pytest.mark.timeout(300)
def test_daemons_see_each_other_on_their_maps_and_live_on_alone(
    known: Path, tmp_path: Path
) -> None:
    """Both begin with the same map: so each has to see the other where that one says it is."""
    _, x, y, *_, z, w = np.loadtxt(known / "truth.tum")[-1]
    meeting, start = free_endpoint(), f"twin.start=[{x}, {y}, {2 * math.atan2(z, w)}]"

    def daemon(name: str) -> contextlib.AbstractContextManager["subprocess.Popen[str]"]:
        settings = [
            *(start, f"robot.name={name}", f"telemetry.listen=[{free_endpoint()}]"),
            *(f"telemetry.connect=[{meeting}]", "team.enabled=true", "team.align_every_s=1"),
        ]
        more = [word for setting in settings for word in ("--set", setting)]
        run = ["run", *WORLD, *more, "--map", str(known), "--out", str(tmp_path / name)]
        return gvgbot(*run, cwd=tmp_path)

    with (
        router(meeting),
        daemon("karl") as one,
        daemon("lisa") as two,
        client.connect("karl", meeting) as karl,
        client.connect("lisa", meeting) as lisa,
    ):
        for robot, other in ((karl, lisa), (lisa, karl)):
            (mate,) = until(robot, lambda state: bool(state.team)).team
            assert mate.name == other.name
            there = next(iter(other.state())).pose
            assert math.dist(mate.pose[:2], there[:2]) < AWAY_M
        two.kill()
        went = next(iter(karl.state())).cycles
        until(karl, lambda state: state.cycles > went + 50)  # alone
        one.send_signal(signal.SIGTERM)
        log, _ = one.communicate(timeout=60)
    assert one.returncode == 0, log
    assert "Traceback" not in log
    (joined,) = [line for line in log.splitlines() if "maps joined" in line]
    assert "lisa" in joined
    summary = json.loads((tmp_path / "karl" / "summary.json").read_text())
    assert summary["frames"]["lisa"] == pytest.approx([0.0, 0.0, 0.0], abs=0.2)
    both = json.loads((tmp_path / "karl" / "team.geojson").read_text())
    points = [f for f in both["features"] if f["geometry"]["type"] == "Point"]
    assert len(points) >= summary["vertices"] >= 6
