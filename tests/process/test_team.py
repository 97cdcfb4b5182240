"""Robots of a team hear all others over the network, wherever they meet, but not themselves."""

import asyncio
import contextlib
import json
import signal
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from benchmarks.rigs.addresses import free_endpoint, router
from benchmarks.rigs.programs import gvgbot, until
from gvgbot.telemetry import Telemetry
from gvgbot.telemetry_config import TelemetryConfig

pytestmark = pytest.mark.slow

NAMES = ("one", "two", "three")


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

    def hear(name: str, key: str, data: bytes) -> None:
        assert key == f"gvgbot/{data[5:-1].decode()}/team"
        heard[name].add(data)

    async def talk(team: list[Telemetry]) -> None:
        async with asyncio.timeout(30), asyncio.TaskGroup() as tasks:
            hearing = [
                tasks.create_task(robot.hear_team(partial(hear, name)))
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


def test_daemons_at_a_router_hear_each_other(tmp_path: Path) -> None:
    """Two by one name say so as soon as they do, and neither minds that the other one is killed."""
    meeting = free_endpoint()

    def daemon(run: str) -> contextlib.AbstractContextManager["subprocess.Popen[str]"]:
        settings = [
            *("robot.name=karl", "team.enabled=true", "twin.enabled=true", "twin.world=comb"),
            *(f"telemetry.connect=[{meeting}]", f"telemetry.listen=[{free_endpoint()}]"),
        ]
        more = [word for setting in settings for word in ("--set", setting)]
        return gvgbot("run", *more, "--out", str(tmp_path / run), cwd=tmp_path)

    with router(meeting), daemon("one") as one, daemon("two") as two:
        for process in (one, two):
            assert process.stdout is not None
            said = next(line for line in process.stdout if "warning" in line and "name" in line)
            assert "robot.name" in said
        until((tmp_path / "one" / "map.geojson").exists)  # it has seen something
        two.kill()
        one.send_signal(signal.SIGTERM)
        log, _ = one.communicate(timeout=40)
    assert one.returncode == 0, log
    assert "Traceback" not in log
    assert json.loads((tmp_path / "one" / "summary.json").read_text())["frames"] == {}
    assert json.loads((tmp_path / "one" / "team.geojson").read_text())["features"] is not None


def test_a_robot_in_a_team_has_loaded_all_that_it_needs_before_it_drives() -> None:
    """What robots that meet need first takes a small computer a second, by which it would stand."""
    code = """
import sys
from gvgbot.autonomy.config import AutonomyConfig
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.config import RobotConfig
from gvgbot.geometry import Pose
from gvgbot.live.team import LiveTeam
from gvgbot.team.chart import moved
from gvgbot.team.member import TeamConfig
from gvgbot.team.site import Site
from tests.unit.team.building import irregular

LiveTeam(RobotConfig(), TeamConfig(), Pipeline(AutonomyConfig(), ExplorationConfig(), 0.2), None)
before = set(sys.modules)
chart = irregular(1).chart({0, 1, 5, 6}, Pose())
Site([chart, moved(chart, Pose(0.1))])
print(set(sys.modules) - before)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=40
    )
    assert done.stdout == "set()\n"
