"""Requests on their way over the network: typed, answered, refused, and never by accident."""

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager

import pytest
import zenoh

from gvgbot import client
from gvgbot.errors import GvgbotError
from gvgbot.requests import Answer, Asked, Goto, Set, parse
from gvgbot.telemetry import Telemetry
from gvgbot.topics import TelemetryConfig
from tests.process.addresses import free_endpoint, plain_session

pytestmark = [pytest.mark.slow, pytest.mark.timeout(60)]


async def obliging(asked: Asked) -> Answer:
    if asked.name == "stop":
        return Answer(done=False, text="not today")
    return Answer(done=True, text=f"does {asked.name}")


@asynccontextmanager
async def a_robot(
    endpoint: str, handle: Callable[[Asked], Awaitable[Answer]] = obliging
) -> AsyncIterator[None]:
    with Telemetry(TelemetryConfig(listen=(endpoint,)), "near") as robot:
        hearing = asyncio.ensure_future(robot.hear(handle))  # noqa: TID251
        await asyncio.sleep(0)
        yield
        hearing.cancel()


@pytest.fixture
def endpoint() -> str:
    return free_endpoint()


def get(session: zenoh.Session, name: str, **settings: object) -> list[zenoh.Reply]:
    return list(session.get(f"gvgbot/near/{name}", timeout=5.0, **settings))  # type: ignore[call-overload]


def test_a_request_is_answered_to_who_awaits_it_and_to_who_waits(endpoint: str) -> None:
    asked: list[Asked] = []

    async def note(one: Asked) -> Answer:
        asked.append(one)
        return await obliging(one)

    async def story() -> list[str]:
        async with a_robot(endpoint, note), client.connect("near", endpoint) as robot:
            return [
                await robot.pause(),
                await asyncio.to_thread(robot.home().result),
                await robot.goto(7),
                await robot.goto(1.5, -2.0),
                await robot.set("exploration.patience_s", 30),
            ]

    answers = asyncio.run(story())
    assert answers == ["does pause", "does home", "does goto", "does goto", "does set"]
    arguments = [parse(one.name, one.data, one.encoding) for one in asked[2:]]
    assert arguments == [
        Goto(vertex=7),
        Goto(x=1.5, y=-2.0),
        Set(key="exploration.patience_s", value=30),
    ]
    assert all("@" in one.origin and "gvgbot" in one.origin for one in asked)


def test_a_refusal_has_the_robot_s_reason(endpoint: str) -> None:
    async def story() -> None:
        async with a_robot(endpoint), client.connect("near", endpoint) as robot:
            with pytest.raises(client.Refused, match="not today"):
                await robot.stop()

    asyncio.run(story())


def test_a_robot_that_is_not_there_does_not_answer(endpoint: str) -> None:
    async def story() -> None:
        async with a_robot(endpoint), client.connect("far", endpoint) as robot:
            with pytest.raises(GvgbotError, match="far does not answer"):
                await robot.pause()

    asyncio.run(story())


def test_who_speaks_json_is_answered_in_json(endpoint: str) -> None:
    def ask() -> tuple[object, object]:
        with plain_session(endpoint) as session:
            (done,) = get(
                session, "ctl/goto", payload=b'{"vertex": 3}', encoding="application/json"
            )
            (refused,) = get(session, "ctl/stop", payload=b"{}", encoding="application/json")
        assert done.ok is not None
        assert refused.err is not None
        return (
            json.loads(done.ok.payload.to_bytes()),
            json.loads(refused.err.payload.to_bytes()),
        )

    async def story() -> tuple[object, object]:
        async with a_robot(endpoint):
            return await asyncio.to_thread(ask)

    assert asyncio.run(story()) == (
        {"done": True, "text": "does goto"},
        {"done": False, "text": "not today"},
    )


def test_who_reads_everything_asks_for_nothing(endpoint: str) -> None:
    """A query for all keys, as tools that look around make, must not stop the robot."""
    asked: list[Asked] = []

    async def note(one: Asked) -> Answer:
        asked.append(one)
        return await obliging(one)

    def look_around() -> None:
        with plain_session(endpoint) as session:
            for keys in ("ctl/*", "**", "*/stop", "ctl/st$*"):
                assert get(session, keys) == []
            session.put("gvgbot/near/ctl/stop", b"")  # a sample is no request either
            assert len(get(session, "ctl/pause")) == 1

    async def story() -> None:
        async with a_robot(endpoint, note):
            await asyncio.to_thread(look_around)

    asyncio.run(story())
    assert [one.name for one in asked] == ["pause"]


def test_a_slow_answer_does_not_hold_up_the_next_request(endpoint: str) -> None:
    async def story() -> None:
        stopped = asyncio.Event()

        async def handle(one: Asked) -> Answer:
            if one.name == "save":
                await stopped.wait()
            else:
                stopped.set()
            return await obliging(one)

        async with a_robot(endpoint, handle), client.connect("near", endpoint) as robot:
            saving = robot.save()
            with pytest.raises(client.Refused):
                await robot.stop()
            assert await saving == "does save"

    asyncio.run(story())


def test_who_asks_can_name_itself_but_not_flood_the_log(endpoint: str) -> None:
    origins: list[str] = []

    async def note(one: Asked) -> Answer:
        origins.append(one.origin)
        return await obliging(one)

    def ask() -> None:
        with plain_session(endpoint) as session:
            for name in (b"ana", b"\x1b[2J\nstop" * 100, b"\xff\xfe", b""):
                get(session, "ctl/pause", attachment=name)
            get(session, "ctl/pause", payload=b"x" * 1_000_000)

    async def story() -> None:
        async with a_robot(endpoint, note):
            await asyncio.to_thread(ask)

    asyncio.run(story())
    assert origins[0] == "ana"
    assert all(len(origin) <= 80 and origin.isprintable() for origin in origins)
    assert origins[3] == "somebody"
