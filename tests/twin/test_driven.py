"""A robot that somebody else drives, in virtual time: it follows, learns, and stops by itself."""

import asyncio
import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from benchmarks.rigs.run_rig import Daemon, at_once
from gvgbot.clock import Clock
from gvgbot.geometry import Twist
from gvgbot.hal.messages import Odometry
from gvgbot.robot import Robot
from gvgbot.ros2.topics import MAP, ODOM, SCAN, TF, TF_STATIC, Topic
from tests.unit.ros2.oracle import STORE

pytestmark = [pytest.mark.twin, pytest.mark.slow]

EVERY = 0.1  # s between commands
HOLD = 0.5  # s that a command holds
AT_MOST = 0.25  # s of braking: half a metre a second and less, at one metre a second squared


class Ros:
    """A neighbour that hears all, and may drive."""

    def __init__(self) -> None:
        self.drive: Callable[[Twist], None]
        self.got: dict[Topic, int] = {}
        self.odometry: list[tuple[float, float]] = []  # stamp, speed

    def wants(self, topic: Topic) -> bool:
        return True

    def send(self, topic: Topic, data: bytes, unix_ns: int) -> None:
        STORE.deserialize_cdr(data, topic.message.ros_name)  # which fails if it is none
        self.got[topic] = self.got.get(topic, 0) + 1

    async def hear(self, drive: Callable[[Twist], None]) -> None:
        self.drive = drive
        await asyncio.Event().wait()


class Driven(Daemon):
    """A daemon with that neighbour, whose speed is taken down."""

    def __init__(self, out: Path) -> None:
        super().__init__(out)
        self.ros = Ros()
        self.robot = Robot(
            self.session,
            self.manager,
            self.network,
            off_loop=at_once,
            neighbours=[self.ros],
            driver=self.ros,
        )

    @property
    def newest(self) -> Odometry:
        odometry = self.robot._odometry
        assert odometry is not None
        return odometry

    @property
    def speed(self) -> float:
        return self.newest.twist.linear


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[Driven]:
    driven = Driven(tmp_path)
    with driven.session.directory:
        yield driven


async def looked_around(daemon: Driven, clock: Clock) -> None:
    """Wait until the robot knows its surroundings."""
    while daemon.session.pipeline.errands.whereabouts() is None:
        await clock.sleep_until(clock.now() + 0.1)


def test_a_driven_robot_follows_and_stops_when_nothing_more_is_heard(
    daemon: Driven, tmp_path: Path
) -> None:
    seen: dict[str, float] = {}

    async def story(clock: Clock) -> None:
        await looked_around(daemon, clock)
        for _ in range(30):  # three seconds of turning on the spot
            daemon.ros.drive(Twist(0.0, 0.5))
            await clock.sleep_until(clock.now() + EVERY)
        seen["turn rate"], before = daemon.newest.twist.angular, daemon.place
        last = clock.now() - EVERY
        while abs(daemon.newest.twist.angular) > 0.01:
            seen["stopped after"] = clock.now() - last
            await clock.sleep_until(clock.now() + 0.02)
        seen["after"] = before.distance(daemon.place)
        await clock.sleep_until(clock.now() + 3.0)
        seen["later"] = before.distance(daemon.place)
        seen["keyframes"] = len(daemon.session.pipeline.past.keyframes)
        daemon.ros.drive(Twist(0.0, 0.3))
        await clock.sleep_until(clock.now() + 3.0)
        seen["learnt"] = len(daemon.session.pipeline.past.keyframes) - seen["keyframes"]

    daemon.run(story)
    assert seen["turn rate"] == pytest.approx(0.5, abs=0.02)
    assert HOLD - 0.1 < seen["stopped after"] < HOLD + AT_MOST
    assert seen["after"] < 0.05
    assert seen["later"] == pytest.approx(seen["after"], abs=0.001)  # it stays there
    assert seen["learnt"] >= 2  # it looks at where it is, about once a second
    states = {state.errand for state in daemon.network.states}
    assert states == {None, "driven by somebody"}
    lines = [json.loads(line) for line in (tmp_path / "events.jsonl").read_text().splitlines()]
    asked = [line for line in lines if line["event"] == "requested"]
    assert [(line["request"], line["done"]) for line in asked] == [("cmd_vel", True)]


def test_the_guard_stands_between_a_driver_and_a_wall(daemon: Driven) -> None:

    async def story(clock: Clock) -> None:
        await looked_around(daemon, clock)
        for _ in range(80):
            daemon.ros.drive(Twist(0.7, 0.0))
            await clock.sleep_until(clock.now() + EVERY)

    daemon.run(story)
    assert daemon.session.contacts == 0
    assert daemon.newest.twist.linear == pytest.approx(0.0, abs=0.02)


def test_a_paused_robot_is_not_driven_and_exploring_takes_it_back(
    daemon: Driven, tmp_path: Path
) -> None:
    speeds: dict[str, float] = {}
    phases: dict[str, str] = {}

    async def story(clock: Clock) -> None:
        async def drive_for(seconds: float) -> None:
            for _ in range(round(seconds / EVERY)):
                daemon.ros.drive(Twist(0.0, 0.4))
                await clock.sleep_until(clock.now() + EVERY)

        await clock.sleep_until(clock.now() + 1.0)
        for _ in range(3):
            daemon.ros.drive(Twist(0.0, -0.4))  # before it knows its surroundings: not taken
        await clock.sleep_until(clock.now() + 0.4)
        phases["too early"] = daemon.network.states[-1].phase
        speeds["before"] = daemon.newest.twist.angular
        await looked_around(daemon, clock)
        await drive_for(1.0)
        phases["driven"] = daemon.network.states[-1].phase
        assert (await daemon.network.ask("pause")).done
        assert (await daemon.network.ask("stop")).done  # which is no leave to move
        await drive_for(3.0)
        speeds["paused"] = daemon.newest.twist.angular
        assert (await daemon.network.ask("resume")).done
        await drive_for(2.0)
        speeds["resumed"] = daemon.newest.twist.angular
        assert (await daemon.network.ask("explore")).done
        await clock.sleep_until(clock.now() + 3.0)
        phases["after"] = daemon.network.states[-1].phase

    daemon.run(story)
    assert speeds["before"] > 0.0  # it turns to look around, the other way
    assert speeds["paused"] == pytest.approx(0.0, abs=0.01)
    assert speeds["resumed"] == pytest.approx(0.4, abs=0.02)
    assert phases == {"too early": "exploring", "driven": "errand", "after": "exploring"}
    lines = [json.loads(line) for line in (tmp_path / "events.jsonl").read_text().splitlines()]
    told = [(line["done"], line["answer"]) for line in lines if line.get("request") == "cmd_vel"]
    assert told == [
        (False, "it has not seen enough yet to know where it is"),
        (True, "it is driven until it is asked for something else"),
        (False, "it is paused: ask it to resume first"),
        (True, "it is driven until it is asked for something else"),
    ]


def test_neighbours_are_told_what_is_to_be_seen(daemon: Driven) -> None:

    async def story(clock: Clock) -> None:
        await clock.sleep_until(8.0)

    daemon.run(story)
    got = daemon.ros.got
    assert got[SCAN] == pytest.approx(80, abs=10)  # 10 Hz, and the base 50 Hz
    assert got[ODOM] == pytest.approx(400, abs=30)
    assert got[TF] == got[ODOM]
    assert got[TF_STATIC] == 1
    assert got[MAP] >= 1
