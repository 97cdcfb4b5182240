"""Requests on their way over the network: typed, answered, refused, and never by accident."""

import asyncio
import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import ExitStack, asynccontextmanager
from pathlib import Path

import msgspec
import pytest
import zenoh

from benchmarks.rigs.addresses import free_endpoint, plain_session, router
from benchmarks.rigs.programs import program
from gvgbot import client
from gvgbot.cli import main
from gvgbot.errors import GvgbotError
from gvgbot.requests import Answer, Asked, Goto, Patrol, Set, parse
from gvgbot.telemetry import Telemetry
from gvgbot.telemetry_config import TelemetryConfig
from gvgbot.topics import Events
from tests.unit.test_telemetry import EXAMPLE

pytestmark = pytest.mark.slow


async def obliging(asked: Asked) -> Answer:
    if asked.name == "stop":
        return Answer(done=False, text="not today")
    return Answer(done=True, text=f"does {asked.name}")


@asynccontextmanager
async def a_robot(
    endpoint: str,
    handle: Callable[[Asked], Awaitable[Answer]] = obliging,
    *,
    connect: str | None = None,
    name: str = "near",
) -> AsyncIterator[None]:
    routers = () if connect is None else (connect,)
    with Telemetry(TelemetryConfig(listen=(endpoint,), connect=routers), name) as robot:
        hearing = asyncio.ensure_future(robot.hear(handle))  # noqa: TID251  # cancelled below
        await asyncio.sleep(0)
        yield
        hearing.cancel()


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


def test_json_without_its_encoding_is_told_so(endpoint: str) -> None:
    async def read(asked: Asked) -> Answer:
        try:
            parse(asked.name, asked.data, asked.encoding)
        except ValueError as error:
            return Answer(done=False, text=str(error))
        return await obliging(asked)

    def ask() -> str:
        with plain_session(endpoint) as session:
            (reply,) = get(session, "ctl/goto", payload=b'{"vertex": 3}')
        assert reply.err is not None
        return str(msgspec.msgpack.decode(reply.err.payload.to_bytes())["text"])

    async def story() -> str:
        async with a_robot(endpoint, read):
            return await asyncio.to_thread(ask)

    assert "taken for application/msgpack" in asyncio.run(story())


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


def test_a_long_patrol_is_heard_whole_and_what_is_longer_called_too_long(endpoint: str) -> None:
    vertices = tuple(range(1000, 2000))
    asked: list[Asked] = []

    async def note(one: Asked) -> Answer:
        asked.append(one)
        return await obliging(one)

    async def story() -> None:
        async with a_robot(endpoint, note), client.connect("near", endpoint) as robot:
            await robot.patrol(*vertices)
            await robot.patrol(*range(2**62, 2**62 + 10_000))

    asyncio.run(story())
    whole, cut = [(one.name, one.data, one.encoding) for one in asked]
    assert parse(*whole) == Patrol(vertices=vertices)
    with pytest.raises(ValueError, match="more than 25000 bytes"):
        parse(*cut)


def test_what_would_fill_the_memory_is_not_let_in_and_holds_up_nothing(endpoint: str) -> None:
    asked: list[str] = []

    async def note(one: Asked) -> Answer:
        asked.append(one.name)
        return await obliging(one)

    def ask() -> list[zenoh.Reply]:
        with plain_session(endpoint) as session:
            list(session.get("gvgbot/near/ctl/save", payload=bytes(40_000_000), timeout=1.0))
            return get(session, "ctl/pause")

    async def story() -> list[zenoh.Reply]:
        async with a_robot(endpoint, note):
            return await asyncio.to_thread(ask)

    (reply,) = asyncio.run(story())
    assert reply.ok is not None
    assert asked == ["pause"]


def test_connections_that_say_nothing_keep_nobody_out(endpoint: str) -> None:
    """Zenoh lets go of them after ten seconds."""
    host, _, port = endpoint.removeprefix("tcp/").partition(":")

    def ask() -> list[zenoh.Reply]:
        with ExitStack() as silent:
            for _ in range(150):
                silent.enter_context(socket.create_connection((host, int(port))))
            with plain_session(endpoint, patience_s=5.0) as session:
                return get(session, "ctl/pause")

    async def story() -> list[zenoh.Reply]:
        async with a_robot(endpoint, obliging):
            return await asyncio.to_thread(ask)

    (reply,) = asyncio.run(story())
    assert reply.ok is not None


def test_a_crowd_of_requests_is_refused_and_a_pause_among_them_is_done(endpoint: str) -> None:
    asked: list[str] = []

    async def note(one: Asked) -> Answer:
        asked.append(one.name)
        return await obliging(one)

    async def story() -> list[zenoh.Reply]:
        async with a_robot(endpoint, note):
            with plain_session(endpoint) as session:
                names = [*["home"] * 200, "pause", *["home"] * 200]
                replies = [session.get(f"gvgbot/near/ctl/{name}", timeout=5.0) for name in names]
                time.sleep(0.5)  # noqa: ASYNC251, TID251  # a busy loop
                return [reply for each in replies for reply in await asyncio.to_thread(list, each)]

    replies = asyncio.run(story())
    refusals = [msgspec.msgpack.decode(one.err.payload.to_bytes()) for one in replies if one.err]
    assert len(replies) == 401
    assert "pause" in asked
    assert len(asked) + len(refusals) == 401
    assert {told["text"] for told in refusals} == {"too many requests wait: ask again"}


def test_what_came_while_the_program_was_asleep_is_refused_but_a_pause(endpoint: str) -> None:
    """Who asked may have been told that nobody answers, and stand before the robot by now."""

    async def story() -> tuple[list[zenoh.Reply], list[zenoh.Reply]]:
        async with a_robot(endpoint):
            with plain_session(endpoint) as session:
                selectors = [f"gvgbot/near/ctl/{name}" for name in ("home", "resume", "pause")]
                replies = [session.get(one, timeout=9.0) for one in selectors]
                time.sleep(2.5)  # noqa: ASYNC251, TID251  # a loop that hangs
                early = [reply for one in replies for reply in await asyncio.to_thread(list, one)]
                await asyncio.sleep(1.5)
                return early, await asyncio.to_thread(get, session, "ctl/home")

    early, late = asyncio.run(story())
    refusals = [msgspec.msgpack.decode(one.err.payload.to_bytes()) for one in early if one.err]
    assert ["asleep" in refusal["text"] for refusal in refusals] == [True, True]
    assert [str(one.ok.key_expr) for one in early if one.ok] == ["gvgbot/near/ctl/pause"]
    assert [one.ok is not None for one in late] == [True]


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


NO_EVENTS = Events(events=())
DEAF = """
import sys, time, zenoh
from benchmarks.rigs.addresses import plain_session
with plain_session(sys.argv[1]) as session:
    session.declare_subscriber("gvgbot/near/**", lambda sample: time.sleep(60))
    print("there", flush=True)
    while True:
        for key in ("state?format=json", "ctl/pause"):
            session.get(f"gvgbot/near/{key}", lambda reply: time.sleep(60), timeout=60.0)
        time.sleep(0.002)
"""
WATCHER = """
import sys, zenoh
from gvgbot import client
with client.connect("near", sys.argv[1]) as robot:
    robot.scan()
    next(iter(robot.state()))
    print("there", flush=True)
    for state in robot.state():
        pass
"""
SLEEPER = """
import asyncio, sys
from gvgbot.telemetry import Telemetry
from gvgbot.telemetry_config import TelemetryConfig
async def handle(asked):
    print("asked", flush=True)
    await asyncio.Event().wait()
async def sleep(robot):
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(robot.hear(handle))
        await asyncio.sleep(0)
        print("there", flush=True)
with Telemetry(TelemetryConfig(listen=(sys.argv[1],)), "near") as robot:
    asyncio.run(sleep(robot))
"""


async def answered(ask: Callable[[], client.Asking]) -> str:
    """The answer, as soon as there is anybody to give one."""
    while True:
        try:
            return await ask()
        except GvgbotError:
            await asyncio.sleep(0.1)


def test_a_router_in_between_may_come_and_go(endpoint: str) -> None:
    async def story() -> list[str]:
        with router(endpoint) as first:
            async with (
                a_robot(free_endpoint(), connect=endpoint),
                client.connect("near", endpoint) as robot,
            ):
                answers = [await answered(robot.pause)]
                await asyncio.to_thread(first.close)
                with pytest.raises(GvgbotError):
                    await robot.pause()
                with router(endpoint):
                    answers.append(await answered(robot.resume))
                return answers

    assert asyncio.run(story()) == ["does pause", "does resume"]


def test_of_two_robots_only_the_one_that_is_asked_does_something(endpoint: str) -> None:
    asked: list[tuple[str, str]] = []

    def noting(name: str) -> Callable[[Asked], Awaitable[Answer]]:
        async def note(one: Asked) -> Answer:
            asked.append((name, one.name))
            return await obliging(one)

        return note

    async def story() -> None:
        with router(endpoint):
            async with (
                a_robot(free_endpoint(), noting("near"), connect=endpoint),
                a_robot(free_endpoint(), noting("other"), connect=endpoint, name="other"),
                client.connect("near", endpoint) as near,
                client.connect("other", endpoint) as other,
            ):
                await answered(near.pause)
                await answered(other.home)
                await answered(near.resume)

    asyncio.run(story())
    assert asked == [("near", "pause"), ("other", "home"), ("near", "resume")]


def test_two_robots_of_one_name_are_both_asked_and_that_is_said(endpoint: str) -> None:
    async def refuse(_: Asked) -> Answer:
        return Answer(done=False, text="not today")

    async def story(second: Callable[[Asked], Awaitable[Answer]]) -> None:
        async with (
            a_robot(free_endpoint(), connect=endpoint),
            a_robot(free_endpoint(), second, connect=endpoint),
            client.connect("near", endpoint) as robot,
        ):
            async with asyncio.timeout(20.0):
                while True:  # until the router knows both
                    try:
                        await robot.pause()
                    except GvgbotError as error:
                        if "2 robots are named near" in str(error):
                            return
                    await asyncio.sleep(0.1)

    with router(endpoint):
        for second in (obliging, refuse):
            asyncio.run(story(second))


def test_a_watcher_that_hangs_holds_up_no_request(endpoint: str) -> None:
    async def story() -> None:
        with Telemetry(TelemetryConfig(listen=(endpoint,)), "near") as robot:
            robot.publish(EXAMPLE)
            async with asyncio.TaskGroup() as tasks:
                hearing = tasks.create_task(robot.hear(obliging))
                await asyncio.to_thread(watched, robot)
                hearing.cancel()

    def watched(robot: Telemetry) -> None:
        with program(WATCHER, endpoint) as watcher:
            watcher.send_signal(signal.SIGSTOP)
            big = msgspec.structs.replace(EXAMPLE, reason="x" * 100_000)
            with client.connect("near", endpoint) as seen:
                for _ in range(20):
                    for _ in range(10):
                        robot.publish(big)  # fills the buffers of the watcher's link
                    assert seen.pause().result() == "does pause"

    asyncio.run(story())


def test_who_asks_over_and_over_and_reads_no_answer_does_not_hold_up_the_robot(
    endpoint: str,
) -> None:
    big = msgspec.structs.replace(EXAMPLE, reason="x" * 400_000)

    async def longest_s(robot: Telemetry) -> float:
        """The longest that a turn of the loop takes in some seconds."""
        loop, longest = asyncio.get_running_loop(), 0.0
        end = loop.time() + 6.0
        while (begun := loop.time()) < end:
            robot.publish(NO_EVENTS)  # as important as the answers
            await asyncio.sleep(0.02)
            await asyncio.to_thread(bool)  # as whoever saves the map does
            longest = max(longest, loop.time() - begun)
        return longest

    async def story() -> float:
        with Telemetry(TelemetryConfig(listen=(endpoint,)), "near") as robot:
            robot.publish(big)
            async with asyncio.TaskGroup() as tasks:
                serving = [tasks.create_task(one) for one in (robot.answer(), robot.hear(obliging))]
                with program(DEAF, endpoint):
                    longest = await longest_s(robot)
                for task in serving:
                    task.cancel()
                return longest

    assert asyncio.run(story()) < 2.0


def test_a_robot_that_dies_over_a_request_is_noticed(endpoint: str) -> None:
    with program(SLEEPER, endpoint) as process, client.connect("near", endpoint) as robot:
        asking = robot.pause()
        assert process.stdout is not None
        assert process.stdout.readline() == "asked\n"
        process.send_signal(signal.SIGKILL)
        with pytest.raises(GvgbotError, match="near does not answer"):
            asking.result(timeout=3.0)


def test_a_person_asks_a_running_robot_from_the_command_line(
    endpoint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def ctl(*words: str) -> tuple[int, str, str]:
        status = main(["ctl", *words, "--connect", endpoint])
        said = capsys.readouterr()
        return status, said.out, said.err

    arguments = ["--out", str(tmp_path / "run"), "--set", f"telemetry.listen=[{endpoint}]"]
    with subprocess.Popen(
        [sys.executable, "-m", "gvgbot", "run", *arguments], cwd=tmp_path, stderr=subprocess.PIPE
    ) as process:
        try:
            with client.connect("sim", endpoint, patience_s=30.0) as robot:
                for state in robot.state():
                    if state.distance > 0.3:  # it has looked around, and drives
                        break
            paused = ctl("pause")  # the only robot need not be named
            moving = ctl("sim", "goto", "999")
            resumed = ctl("sim", "resume")
            unknown = ctl("sim", "goto", "999")
            saved = ctl("sim", "save")
            nobody = ctl("karl", "pause")
        finally:
            process.terminate()
            process.communicate(timeout=30)
    assert paused == (0, "it stands still until it is asked to resume\n", "")
    assert moving == (1, "", "gvgbot: it is paused: ask it to resume first\n")
    assert resumed == (0, "it goes on exploring\n", "")
    assert unknown[0] == 1
    assert "there is no vertex 999" in unknown[2]
    assert nobody == (1, "", "gvgbot: no robot named karl here; there is sim\n")
    assert saved == (0, f"map saved in {tmp_path / 'run'}\n", "")
    events = (tmp_path / "run" / "events.jsonl").read_text().splitlines()
    requested = [line for line in map(json.loads, events) if line["event"] == "requested"]
    assert [line["request"] for line in requested] == [
        "pause",
        "goto 999",
        "resume",
        "goto 999",
        "save",
    ]
    assert all("@" in line["origin"] for line in requested)
