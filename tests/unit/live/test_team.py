"""Two daemons' parts in a team, joined by a network in memory that can be cut; virtual time."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence

import msgspec
import pytest
import structlog

from gvgbot.autonomy.config import AutonomyConfig
from gvgbot.autonomy.errands.plans import Kept
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import RobotConfig
from gvgbot.live.team import LiveTeam
from gvgbot.team.member import TeamConfig
from gvgbot.team.news import Claim, Course, News, decode
from gvgbot.topics import TeamPart, team_key

CONFIG = TeamConfig(enabled=True)
NESTED = b"\x82\xa4type\xa4news\xa5extra" + b"\x91" * 100_000 + b"\xc0"


class Air:
    """Carries what is told to all who listen, unless it is cut."""

    def __init__(self) -> None:
        self.ears: list[asyncio.Queue[tuple[str, bytes]]] = []
        self.is_cut = False

    def tell_team(self, part: TeamPart, data: bytes, sender: str = "one") -> None:
        for ear in self.ears if not self.is_cut else ():
            ear.put_nowait((team_key(sender, part), data))

    async def hear_team(self, handle: Callable[[str, bytes], None]) -> None:
        ear = asyncio.Queue[tuple[str, bytes]]()
        self.ears.append(ear)
        while True:
            handle(*await ear.get())


async def at_once(work: Callable[[], None]) -> None:
    work()


def together(
    scene: Callable[[Air, list[LiveTeam]], Awaitable[None]], names: Sequence[str] = ("one", "two")
) -> None:
    """Let robots that have seen nothing take part while a scene goes on."""

    async def play() -> None:
        air, clock = Air(), LoopClock()
        minds = [Pipeline(AutonomyConfig(), ExplorationConfig(), 0.177) for _ in names]
        parts = [
            LiveTeam(RobotConfig(name=n), CONFIG, p, air) for n, p in zip(names, minds, strict=True)
        ]
        async with asyncio.TaskGroup() as tasks:
            running = [tasks.create_task(part.take_part(clock, at_once)) for part in parts]
            await scene(air, parts)
            for task in running:
                task.cancel()

    run_in_virtual_time(play())


def test_robots_hear_of_each_other_and_lose_each_other() -> None:
    async def scene(air: Air, parts: list[LiveTeam]) -> None:
        one, two = (part.member for part in parts)
        await asyncio.sleep(5.0)
        assert not one.is_lost("two")
        assert not two.is_lost("one")
        air.is_cut = True
        await asyncio.sleep(CONFIG.lost_after_s + 5.0)
        one.due(5.0 + CONFIG.lost_after_s + 5.0)
        assert one.is_lost("two")
        air.is_cut = False
        await asyncio.sleep(5.0)
        assert not one.is_lost("two")

    together(scene)


def test_who_is_sent_on_a_patrol_claims_no_frontier_that_others_would_wait_for() -> None:
    """One that is on its way to a frontier keeps it until then."""
    claim, pipeline = (
        Claim(1.0, 2.0, 0.0, 3.0),
        Pipeline(AutonomyConfig(), ExplorationConfig(), 0.2),
    )
    air, told = Air(), list[tuple[Claim | None, bool, bool]]()

    def hear(_: str, data: bytes) -> None:
        news = decode(data)
        if isinstance(news, News):
            told.append((news.claim, news.idle, news.finished))

    async def play() -> None:
        part = LiveTeam(RobotConfig(name="one"), CONFIG, pipeline, air)
        part.member.auction.claim = claim
        async with asyncio.TaskGroup() as tasks:
            running = [
                tasks.create_task(part.take_part(LoopClock(), at_once)),
                tasks.create_task(air.hear_team(hear)),
            ]
            await asyncio.sleep(3.0)
            pipeline.errands.recall(Kept("patrol", (1, 2)))
            await asyncio.sleep(3.0)
            for task in running:
                task.cancel()

    run_in_virtual_time(play())
    assert (told[0], told[-1]) == ((claim, False, False), (None, True, False))


class Lost(Pipeline):
    """A mind that may not know where it is."""

    lost = True

    @property
    def is_lost(self) -> bool:
        return self.lost


def test_who_does_not_know_where_it_is_tells_nobody_a_place() -> None:
    pipeline = Lost(AutonomyConfig(), ExplorationConfig(), 0.2)
    air, told = Air(), set[type]()

    async def play() -> None:
        part = LiveTeam(RobotConfig(name="one"), CONFIG, pipeline, air)
        async with asyncio.TaskGroup() as tasks:
            running = [
                tasks.create_task(part.take_part(LoopClock(), at_once)),
                tasks.create_task(air.hear_team(lambda _, data: told.add(type(decode(data))))),
            ]
            await asyncio.sleep(5.0)
            assert not told
            pipeline.lost = False
            await asyncio.sleep(5.0)
            for task in running:
                task.cancel()

    run_in_virtual_time(play())
    assert told == {News, Course}


def test_who_is_heard_and_may_be_anywhere_is_looked_out_for() -> None:
    """By its size: a body as wide may be that robot."""

    async def scene(_: Air, parts: list[LiveTeam]) -> None:
        await asyncio.sleep(5.0)
        for part in parts:
            assert part._pipeline.traffic.strangers == [RobotConfig().radius_m]

    together(scene)


@pytest.mark.parametrize("noise", [b"", b"\xff" * 40, b"\x80", NESTED])
def test_noise_from_the_network_changes_nothing(noise: bytes) -> None:
    async def scene(air: Air, parts: list[LiveTeam]) -> None:
        air.tell_team("team", noise)
        await asyncio.sleep(5.0)
        air.tell_team("team", noise)
        await asyncio.sleep(5.0)
        assert not parts[0].member.is_lost("two")

    together(scene)


@pytest.mark.parametrize(
    ("names", "warnings"), [(("one", "two"), 0), (("one", "one"), 2), (("one", "one", "two"), 2)]
)
def test_who_hears_another_robot_by_its_own_name_says_so_once(
    names: tuple[str, ...], warnings: int
) -> None:
    async def scene(air: Air, parts: list[LiveTeam]) -> None:
        await asyncio.sleep(20.0)

    with structlog.testing.capture_logs() as lines:
        together(scene, names)
    said = [line for line in lines if line["log_level"] == "warning"]
    assert len(said) == warnings
    assert all("robot.name" in line["event"] and line["name"] == "one" for line in said)


def test_what_is_not_understood_is_said_once_for_each_reason() -> None:
    async def scene(air: Air, parts: list[LiveTeam]) -> None:
        for _ in range(50):
            air.tell_team("team", b"")
            air.tell_team("team", b"\x80")  # an empty map
            await asyncio.sleep(0.1)

    with structlog.testing.capture_logs() as lines:
        together(scene, ["one"])
    reasons = [line["reason"] for line in lines if line["log_level"] == "warning"]
    assert len(reasons) == len(set(reasons)) == 2


def test_it_is_said_who_is_not_understood_whatever_else_is_heard() -> None:
    async def scene(air: Air, parts: list[LiveTeam]) -> None:
        for number in range(300):
            air.tell_team("team", bytes([0xC0 + number % 32]) * (1 + number), "noise")
            await asyncio.sleep(0.01)
        air.tell_team("team", msgspec.msgpack.encode({"type": "news2"}), "newer")
        await asyncio.sleep(0.1)

    with structlog.testing.capture_logs() as lines:
        together(scene, ["one"])
    keys = [line["key"] for line in lines if line["log_level"] == "warning"]
    assert keys[-1] == "gvgbot/newer/team"
    assert 1 < keys.count("gvgbot/noise/team") <= 10
