"""A daemon's part in a team: tells the other robots, listens to them, compares maps on the side."""

import asyncio
import secrets
from collections.abc import Callable
from typing import Protocol

import numpy as np
import structlog

from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.clock import Clock, OffLoop
from gvgbot.config import RobotConfig
from gvgbot.errors import GvgbotError
from gvgbot.registration import assigned
from gvgbot.team.alignment import Alignment
from gvgbot.team.chart import Chart, chart_of
from gvgbot.team.member import Comparison, Member, TeamConfig
from gvgbot.team.news import Course, decode, encode
from gvgbot.topics import TeamPart

_COMPLAINTS = 10  # under one key, different ones; then it is known that something is wrong
_ALL_COMPLAINTS = 100

log = structlog.get_logger()


class TeamNetwork(Protocol):
    """How robots of a team hear each other."""

    def tell_team(self, part: TeamPart, data: bytes) -> None:
        """Send to all that listen, without waiting; the newest of each part is what counts."""

    async def hear_team(self, handle: Callable[[str, bytes], None]) -> None:
        """Hand on what others tell, and under which key expression, until cancelled."""


class LiveTeam:
    """Makes a mission share its frontiers with other robots on a network."""

    def __init__(
        self, robot: RobotConfig, config: TeamConfig, pipeline: Pipeline, network: TeamNetwork
    ) -> None:
        self._config, self._pipeline, self._network = config, pipeline, network
        self._clock: Clock
        life = secrets.randbits(31)
        self._lives = {life}  # of robots by this name
        self._complaints: set[tuple[str, str]] = set()  # under which key, and why
        assigned(np.empty((0, 0)), 0.0)  # loads its solver now, and not while the robot drives
        self.member = member_of(robot, config, pipeline, life)

    async def take_part(self, clock: Clock, off_loop: OffLoop) -> None:
        """Tell and hear until cancelled; `off_loop` runs what takes long."""
        self._clock = clock
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._network.hear_team(self._hear), name="hear team")
            tasks.create_task(self._compare(off_loop), name="compare maps")
            tasks.create_task(self._tell(), name="tell team")
            tasks.create_task(self._steer(), name="steer clear of team")

    def _hear(self, key: str, data: bytes) -> None:
        try:
            told = decode(data)
        except GvgbotError as error:
            self._complain(key, str(error))
            return
        is_namesake = told.robot == self.member.name and told.life not in self._lives
        if is_namesake and len(self._lives) <= _COMPLAINTS:
            self._lives.add(told.life)
            log.warning("another robot has this name; give one another robot.name", name=told.robot)
        self.member.hear(told, self._clock.now())

    def _complain(self, key: str, reason: str) -> None:
        """Say once why something is not understood: the same will come several times a second."""
        of_this = sum(other == key for other, _ in self._complaints)
        if of_this >= _COMPLAINTS or len(self._complaints) >= _ALL_COMPLAINTS:
            return
        if (key, reason) not in self._complaints:
            self._complaints.add((key, reason))
            log.warning("news of a team dropped", key=key, reason=reason)

    async def _tell(self) -> None:
        pipeline = self._pipeline
        while True:
            if not pipeline.is_lost:
                finished = pipeline.errands.is_resting
                on_errand = not (finished or pipeline.errands.is_exploring)
                now, map_base = self._clock.now(), pipeline.map_base
                news = self.member.news(now, map_base, finished=finished, on_errand=on_errand)
                self._network.tell_team("team", encode(news))
            await self._clock.sleep_until(self._clock.now() + self._config.tell_every_s)

    async def _steer(self) -> None:
        """Tell where the robot is and drives, and keep it clear of the others."""
        pipeline = self._pipeline
        while True:
            if not pipeline.is_lost:
                course = steered(self.member, pipeline, self._clock.now())
                self._network.tell_team("course", encode(course))
            await self._clock.sleep_until(self._clock.now() + self._config.steer_every_s)

    async def _compare(self, off_loop: OffLoop) -> None:
        while True:
            for comparison in self.member.due(self._clock.now()):
                self.member.settle(comparison, await _made(comparison, off_loop))
            for met in self.member.met:
                confidence = round(met.alignment.confidence, 4)
                log.info("maps joined", other=met.robot, confidence=confidence)
            self.member.met.clear()
            await self._clock.sleep_until(self._clock.now() + self._config.steer_every_s)


def member_of(robot: RobotConfig, config: TeamConfig, pipeline: Pipeline, life: int = 0) -> Member:
    """The robot as one of a team, with which its mission shares the frontiers from now on."""
    mapper, mission = pipeline.mapper, pipeline.mission

    def chart() -> Chart:
        return chart_of(mapper.graph, mapper.belief, mission.parts())

    member = Member(robot.name, config, chart, radius=robot.radius_m, life=life)
    mission.choice.sharing = member.auction
    pipeline.traffic.company = []
    return member


def steered(member: Member, pipeline: Pipeline, stamp: float) -> Course:
    """What to tell the others of where the robot is and drives; it keeps clear of them."""
    traffic = pipeline.traffic
    course = member.course(stamp, pipeline.map_base, pipeline.track, traffic.seen)
    traffic.company, traffic.strangers = member.company(), member.strangers()
    return course


async def _made(comparison: Comparison, off_loop: OffLoop) -> Alignment | None:
    """What a comparison shows."""
    results: list[Alignment | None] = []
    await off_loop(lambda: results.append(comparison.made()))
    return results[0]
