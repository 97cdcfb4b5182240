"""The client against a robot's telemetry in this process, and against one in a process of its own.

Nothing is found by shouting: every session is told its address.
"""

import asyncio
import base64
import json
import signal
import subprocess
import sys
import time
import tracemalloc
import zlib
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from functools import partial
from itertools import permutations
from pathlib import Path
from socket import create_server
from threading import Event as Flag

import msgspec
import numpy as np
import pytest
import structlog
import zenoh

from benchmarks.rigs.addresses import free_endpoint, plain_session, router
from benchmarks.rigs.programs import PATIENCE, program, until
from gvgbot import client
from gvgbot.client.newest import Newest
from gvgbot.errors import GvgbotError, UsageError
from gvgbot.telemetry import Telemetry
from gvgbot.telemetry_config import TelemetryConfig
from gvgbot.tiles import Grid, Tile
from gvgbot.topics import (
    Event,
    Events,
    Health,
    Map,
    MapEdge,
    MapVertex,
    Odometry,
    Plan,
    Scan,
    State,
    Trajectory,
)
from tests.unit.monitor.maps import SIDE, a_grid
from tests.unit.test_telemetry import EXAMPLE

pytestmark = pytest.mark.slow

A_MAP = Map(
    stamp=3.0,
    vertices=(
        MapVertex(
            id=4,
            kind="meetpoint",
            position=(0.5, 2.5),
            covariance=(1.0, 0.0, 0.0, 1.0),
            clearance=0.7,
            frontiers=(1.5,),
        ),
    ),
    edges=(MapEdge(start=4, end=4, length=2.0, points=np.array([1, 2, 3, 4], "<f4").tobytes()),),
)
A_WAY = Trajectory(
    stamp=3.0,
    stamps=np.array([1.0, 2.5], "<f8").tobytes(),
    poses=np.array([0.0, 0.0, 0.5, 1.5, -2.0, 3.0], "<f4").tobytes(),
)
A_HEALTH = Health(
    stamp=3.0,
    uptime=3.0,
    cycles=150,
    late_cycles=1,
    slowest_cycle=0.15,
    cpu=0.1,
    memory=80_000_000,
    unsent=0,
    laser=EXAMPLE.laser,
    base=EXAMPLE.base,
)
A_SCAN = Scan(
    stamp=4.0,
    time_increment=0.0001,
    angle_min=-1.0,
    angle_increment=1.0,
    range_max=30.0,
    base_laser=(0.1, 0.0, 0.0),
    map_base=(1.0, 2.0, 3.0),
    ranges=np.array([1500, 0, 65535], "<u2").tobytes(),
)
SOME_ODOMETRY = Odometry(
    stamp=5.0, map_base=(1.0, 2.0, 3.0), odom_base=(0.5, 0.0, 0.1), twist=(0.2, 0.0)
)
A_PLAN = Plan(
    stamp=6.0,
    vertex=4,
    bearing=1.5,
    reason="ear",
    track=np.array([0, 0, 1, 0], "<f4").tobytes(),
    route=b"",
)
ROBOT = """
import sys, time
from gvgbot.telemetry import Telemetry
from gvgbot.telemetry_config import TelemetryConfig
from tests.unit.monitor.maps import SIDE, a_grid
from tests.unit.test_telemetry import EXAMPLE
with Telemetry(TelemetryConfig(listen=(sys.argv[1],)), "far") as robot:
    print("there", flush=True)
    while True:
        robot.publish(EXAMPLE)
        time.sleep(0.1)
"""

STUCK = """
import ctypes, select, sys
from gvgbot.telemetry import Telemetry
from gvgbot.telemetry_config import TelemetryConfig
from tests.unit.test_telemetry import EXAMPLE
with Telemetry(TelemetryConfig(listen=(sys.argv[1],)), "far") as robot:
    while not select.select([sys.stdin], [], [], 0.1)[0]:
        robot.publish(EXAMPLE)
    ctypes.PyDLL(None).sleep(600)  # one call, during which no other Python runs
"""
WATCHER = """
import sys
from gvgbot import client
with client.connect("near", sys.argv[1]) as robot:
    for known in robot.map():
        print(known.stamp, flush=True)
"""
HURRIED = """
import asyncio, contextlib, sys
from concurrent.futures import ThreadPoolExecutor
from threading import Event
from gvgbot import client
async def leave():
    busy, free = ThreadPoolExecutor(1), Event()
    asyncio.get_running_loop().set_default_executor(busy)
    try:
        async with client.connect("near", sys.argv[1]):
            busy.submit(free.wait)
            asyncio.get_running_loop().call_later(0.1, asyncio.current_task().cancel)
    finally:
        free.set()
with contextlib.suppress(asyncio.CancelledError):
    asyncio.run(leave())
"""


def a_robot(endpoint: str, name: str = "near") -> Telemetry:
    return Telemetry(TelemetryConfig(listen=(endpoint,)), name)


def numbered(number: int) -> State:
    return msgspec.structs.replace(EXAMPLE, sequence=number)


def happened(number: int, kind: str = "decision") -> Event:
    return Event(number=number, stamp=float(number), kind=kind, details={"reason": "ear"})


def test_who_joins_gets_the_newest_values_at_once_though_nothing_more_is_sent(
    endpoint: str,
) -> None:
    with a_robot(endpoint) as robot:
        robot.publish(numbered(6))
        robot.publish(numbered(7))
        robot.publish(A_MAP)
        robot.publish(Events(events=(happened(0), happened(1))))
        with client.connect("near", endpoint) as seen:
            assert next(iter(seen.state())) == numbered(7)
            assert next(iter(seen.map())) == A_MAP
            events = iter(seen.events())
            assert [next(events), next(events)] == [happened(0), happened(1)]


def test_what_is_packed_is_unpacked_into_arrays(endpoint: str) -> None:
    with a_robot(endpoint) as robot, client.connect("near", endpoint) as seen:
        for value in (A_MAP, A_WAY, A_HEALTH, a_grid(".#\n# ", resolution=0.5)):
            robot.publish(value)
        assert next(iter(seen.map())).edges[0].polyline.tolist() == [[1.0, 2.0], [3.0, 4.0]]
        way = next(iter(seen.trajectory()))
        assert next(iter(seen.health())) == A_HEALTH
        floor = next(iter(seen.grid())).raster()
    assert way.times.tolist() == [1.0, 2.5]
    assert way.map_base.tolist() == [[0.0, 0.0, 0.5], [1.5, -2.0, 3.0]]
    assert floor.cells[:2, :2].tolist() == [[100, -1], [0, 100]]
    assert (floor.cells[2:] == -1).all()
    assert (floor.origin, floor.resolution) == ((0.0, 0.0), 0.5)


def spread(number: int, *columns: int) -> Grid:
    """A message with tiles beside each other, each of which has the number in its cells."""
    cells = zlib.compress(bytes([number]) * SIDE * SIDE)
    tiles = tuple(Tile(column=column, row=0, cells=cells) for column in columns)
    return msgspec.structs.replace(a_grid(" ", number=number), tiles=tiles)


def seen_in(grid: Newest[Grid]) -> list[int]:
    """The number in each tile."""
    latest = grid.latest
    return [] if latest is None else latest.raster().cells[0, ::SIDE].tolist()


def test_who_comes_late_or_misses_tiles_sees_the_whole_grid_all_the_same(endpoint: str) -> None:
    def watch(robot: Telemetry) -> None:
        with client.connect("near", endpoint) as seen:
            grid = seen.grid()
            until(lambda: seen_in(grid) == [1, 1, 2])
            robot.publish(spread(4, 0), spread(4, 0, 1, 2))  # the third was lost
            until(lambda: seen_in(grid) == [4, 4, 4])
            robot.publish(spread(5, 1), spread(5, 1))  # which nobody has to ask for
            until(lambda: seen_in(grid) == [4, 5, 4])

    async def story() -> None:
        with a_robot(endpoint) as robot:
            robot.publish(spread(1, 0, 1, 2))
            two = spread(2, 2)
            whole = msgspec.structs.replace(two, tiles=(*spread(1, 0, 1).tiles, *two.tiles))
            robot.publish(two, whole)
            async with asyncio.TaskGroup() as tasks:
                answering = tasks.create_task(robot.answer())
                await asyncio.to_thread(watch, robot)
                answering.cancel()

    asyncio.run(story())


def test_the_grid_comes_though_the_robot_could_not_answer_at_first(endpoint: str) -> None:
    async def story() -> None:
        with a_robot(endpoint) as robot:
            robot.publish(spread(2, 0), spread(2, 0, 1))  # the first was long ago, and no more come
            with client.connect("near", endpoint) as seen:
                grid = seen.grid()
                await asyncio.to_thread(until, lambda: seen._tiles._heard == 2)
                async with asyncio.TaskGroup() as tasks:
                    answering = tasks.create_task(robot.answer())
                    await asyncio.to_thread(until, lambda: seen_in(grid) == [2, 2])
                    answering.cancel()

    asyncio.run(story())


def test_who_comes_while_two_of_one_name_speak_has_the_walls_of_each(endpoint: str) -> None:
    there = TelemetryConfig(listen=(free_endpoint(),), connect=(endpoint,))

    def watch(*robots: Telemetry) -> None:
        with client.connect("near", endpoint) as seen:
            grid = seen.grid()

            def is_seen(robot: Telemetry, number: int) -> bool:
                robot.publish(EXAMPLE)
                return (seen.life, seen_in(grid)) == (robot.zid, [number, number])

            for number in (2, 3, 2, 3):
                until(partial(is_seen, robots[number - 2], number))

    async def story() -> None:
        with a_robot(endpoint) as one, Telemetry(there, "near") as two:
            for number, robot in ((2, one), (3, two)):
                sent = [spread(number, *columns) for columns in ((0,), (0, 1))]
                robot.publish(*(msgspec.structs.replace(g, began=float(number)) for g in sent))
            async with asyncio.TaskGroup() as tasks:
                answering = [tasks.create_task(robot.answer()) for robot in (one, two)]
                await asyncio.to_thread(watch, one, two)
                for task in answering:
                    task.cancel()

    asyncio.run(story())


def test_scans_and_odometry_are_sent_to_those_who_ask_for_them(endpoint: str) -> None:
    with a_robot(endpoint) as robot, client.connect("near", endpoint) as seen:
        until(lambda: seen.presence.word == "alive")
        assert not robot.is_heard(Scan)
        scans = seen.scan()
        until(lambda: robot.is_heard(Scan))
        assert not robot.is_heard(Odometry)
        robot.publish(A_SCAN)
        got = next(iter(scans))
        assert got == A_SCAN
        assert got.metres == pytest.approx([1.5, np.nan, np.inf], nan_ok=True)
        odometry = seen.odometry()
        until(lambda: robot.is_heard(Odometry))
        robot.publish(SOME_ODOMETRY)
        assert next(iter(odometry)) == SOME_ODOMETRY
        assert seen.scan() is scans


def test_who_joins_gets_the_plan_that_was_made_before(endpoint: str) -> None:
    with a_robot(endpoint) as robot:
        robot.publish(A_PLAN)
        with client.connect("near", endpoint) as seen:
            got = next(iter(seen.plan()))
    assert got == A_PLAN
    assert got.ahead.tolist() == [[0.0, 0.0], [1.0, 0.0]]


def test_the_loop_of_a_program_gets_state_after_state(endpoint: str) -> None:
    async def watch() -> list[int]:
        with a_robot(endpoint) as robot:
            async with asyncio.timeout(PATIENCE), client.connect("near", endpoint) as seen:
                numbers: list[int] = []
                robot.publish(numbered(1))
                async for state in seen.state():
                    numbers.append(state.sequence)
                    if len(numbers) == 5:
                        break
                    robot.publish(numbered(state.sequence + 1))
                return numbers

    assert asyncio.run(watch()) == [1, 2, 3, 4, 5]


def test_events_come_once_each_whatever_is_lost_between(endpoint: str) -> None:
    with a_robot(endpoint) as robot, client.connect("near", endpoint) as seen:
        robot.publish(Events(events=(happened(0), happened(1))))
        events = iter(seen.events())
        got = [next(events), next(events)]
        robot.publish(Events(events=(happened(0), happened(1), happened(2))))
        until(lambda: len(seen.events().latest) == 3)
        robot.publish(Events(events=(happened(1), happened(2), happened(3))))
        got += [next(events), next(events)]
        assert [event.number for event in got] == [0, 1, 2, 3]
        robot.publish(Events(events=(happened(0, "recovery"),)))  # it began anew
        assert next(events) == happened(0, "recovery")


def test_a_slow_reader_skips_to_the_newest_and_costs_no_memory(endpoint: str) -> None:
    with a_robot(endpoint) as robot, client.connect("near", endpoint) as seen:
        states = iter(seen.state())
        robot.publish(numbered(0))
        assert next(states).sequence == 0
        big = msgspec.structs.replace(numbered(1), reason="x" * 100_000)
        tracemalloc.start()
        for _ in range(500):  # 50 MB
            robot.publish(big)
            Flag().wait(0.001)

        def is_newest_there() -> bool:
            robot.publish(numbered(999))  # again and again, as states are: one may be dropped
            return (seen.state().latest or EXAMPLE).sequence == 999

        until(is_newest_there)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < 10_000_000
        assert next(states).sequence == 999


def test_closing_ends_every_iteration_and_leaves_no_session_behind(endpoint: str) -> None:
    async def watch() -> list[State]:
        async with client.connect("near", endpoint) as seen:
            got, is_first = [], asyncio.Event()

            async def read() -> None:
                async for state in seen.state():
                    got.append(state)
                    is_first.set()

            async with asyncio.timeout(PATIENCE), asyncio.TaskGroup() as tasks:
                reading = tasks.create_task(read())
                await is_first.wait()
                seen.close()
                await reading
            return got

    with a_robot(endpoint) as robot:
        robot.publish(EXAMPLE)
        assert asyncio.run(watch()) == [EXAMPLE]
        info = robot._session.info
        until(lambda: not info.peers_zid() and not info.routers_zid())


def test_a_program_that_is_ended_while_it_leaves_ends(endpoint: str) -> None:
    program = [sys.executable, "-c", HURRIED, endpoint]
    with a_robot(endpoint):
        assert subprocess.run(program, check=False, timeout=PATIENCE).returncode == 0


def put_an_empty_state(robot: Telemetry, seen: client.Robot, version: str) -> None:
    """Until that is heard: at first the robot may not know yet who listens."""
    encoding = zenoh.Encoding(f"application/msgpack;gvgbot.State.{version}")

    def is_heard() -> bool:
        robot._session.put("gvgbot/near/state", b"\x80", encoding=encoding)
        return seen.state().age is not None

    until(is_heard)


def test_a_state_of_another_version_is_refused_in_words(endpoint: str) -> None:
    with a_robot(endpoint) as robot, client.connect("near", endpoint) as seen:
        put_an_empty_state(robot, seen, "v9")
        with pytest.raises(GvgbotError, match=r"State\.v9.*State\.v1"):
            next(iter(seen.state()))


def test_a_damaged_state_is_refused_in_words(endpoint: str) -> None:
    with a_robot(endpoint) as robot, client.connect("near", endpoint) as seen:
        put_an_empty_state(robot, seen, "v1")
        with pytest.raises(GvgbotError, match="damaged sample of state"):
            next(iter(seen.state()))


def test_every_topic_answers_who_asks_for_its_newest_sample(endpoint: str) -> None:
    def ask(session: zenoh.Session, selector: str) -> bytes:
        (reply,) = list(session.get(selector, timeout=PATIENCE))
        sample = reply.ok if reply.ok is not None else reply.err
        assert sample is not None
        return sample.payload.to_bytes()

    async def answers() -> list[bytes]:
        with a_robot(endpoint) as robot, plain_session(endpoint) as session:
            robot.publish(A_MAP)
            robot.publish(a_grid(" ", number=2), a_grid("#", number=2))
            robot.publish(Events(events=(happened(3),)))
            async with asyncio.timeout(PATIENCE), asyncio.TaskGroup() as tasks:
                answering = tasks.create_task(robot.answer())
                await asyncio.sleep(0.1)
                selectors = ["map", "grid?format=json", "events?format=json", "state"]
                got = [
                    await asyncio.to_thread(ask, session, f"gvgbot/near/{selector}")
                    for selector in selectors
                ]
                answering.cancel()
            return got

    as_msgpack, as_json, events, state = asyncio.run(answers())
    assert msgspec.msgpack.decode(as_msgpack, type=Map) == A_MAP
    plain = json.loads(as_json)
    assert zlib.decompress(base64.b64decode(plain["tiles"][0]["cells"]))[0] == 100  # of the whole
    assert json.loads(events)["events"][0]["details"] == {"reason": "ear"}
    assert state == b"no state yet"


def test_the_robot_s_answer_counts_where_a_storage_answers_as_well(endpoint: str) -> None:
    """One as in `configs/zenoh/router.json5` knows no formats, and what it keeps has a time."""
    config = TelemetryConfig(listen=(free_endpoint(),), connect=(endpoint,))
    kept = list[zenoh.Sample]()

    def recall(query: zenoh.Query) -> None:
        with query:
            map_ = kept[-1]
            query.reply(
                map_.key_expr, map_.payload, encoding=map_.encoding, timestamp=map_.timestamp
            )

    async def answer(robot: Telemetry, session: zenoh.Session) -> list[zenoh.Reply]:
        async with asyncio.timeout(PATIENCE), asyncio.TaskGroup() as tasks:
            answering = tasks.create_task(robot.answer())
            await asyncio.sleep(0.1)
            asked = session.get("gvgbot/near/map?format=json", timeout=PATIENCE)
            got = await asyncio.to_thread(list, asked)
            answering.cancel()
        return got

    with router(endpoint) as between:
        between.declare_subscriber("gvgbot/near/map", kept.append)
        between.declare_queryable("gvgbot/near/map", recall, complete=True)
        with Telemetry(config, "near") as robot, plain_session(endpoint) as session:
            robot.publish(A_MAP)
            until(lambda: bool(kept))
            (reply,) = asyncio.run(answer(robot, session))
    assert reply.ok is not None
    assert reply.ok.encoding == zenoh.Encoding.APPLICATION_JSON
    assert msgspec.json.decode(reply.ok.payload.to_bytes(), type=Map) == A_MAP


def test_a_sample_tells_the_time_of_day(endpoint: str) -> None:
    with a_robot(endpoint) as robot, plain_session(endpoint) as session:
        heard = session.declare_subscriber("gvgbot/near/state")
        samples: list[zenoh.Sample] = []

        def is_heard() -> bool:
            robot.publish(numbered(1))
            samples.extend(filter(None, [heard.try_recv()]))
            return bool(samples)

        until(is_heard)
        now = session.new_timestamp().get_time()
    assert samples[0].timestamp is not None
    assert abs((samples[0].timestamp.get_time() - now).total_seconds()) < PATIENCE


def test_each_of_a_crowd_that_asks_at_once_gets_the_newest_sample(endpoint: str) -> None:
    async def replies() -> list[zenoh.Reply]:
        with a_robot(endpoint) as robot, plain_session(endpoint) as session:
            robot.publish(A_MAP)
            answering = asyncio.ensure_future(robot.answer())  # noqa: TID251  # cancelled below
            await asyncio.sleep(0)
            asked = [session.get("gvgbot/near/map", timeout=PATIENCE) for _ in range(300)]
            time.sleep(0.5)  # noqa: ASYNC251, TID251  # a busy loop
            got = [reply for each in asked for reply in await asyncio.to_thread(list, each)]
            answering.cancel()
            return got

    got = [reply.ok.payload.to_bytes() for reply in asyncio.run(replies()) if reply.ok]
    assert got == [msgspec.msgpack.encode(A_MAP)] * 300


def test_an_address_where_nobody_answers_is_one_error(endpoint: str) -> None:
    with (
        pytest.raises(GvgbotError, match=f"nobody answers at {endpoint}"),
        client.connect("near", endpoint, patience_s=0.3),
    ):
        pass


def test_an_address_that_lets_nobody_in_is_told_from_one_where_nobody_is() -> None:
    """Such as a robot that wants certificates or is suspended, or something else at that port."""
    with create_server(("127.0.0.1", 0)) as listener:
        endpoint = f"tcp/127.0.0.1:{listener.getsockname()[1]}"
        with (
            pytest.raises(GvgbotError, match=r"something listens there, but .* is suspended"),
            client.connect("near", endpoint, patience_s=0.3),
        ):
            pass


@pytest.mark.parametrize(
    ("name", "address"),
    [
        *(
            ("a/b", "tcp/h:1"),
            ("", "tcp/h:1"),
            ("a", "h:1"),
            ("a", "tcp/h"),
            ("a", "tls/h#iface=x:1"),
        ),
        *(
            ("a", "tcp/:1"),
            ("a", "tcp/h:"),
            ("a", "tcp/h:x"),
            ("a", "tcp/h:65536"),
            ("a", "udp/h:-1"),
        ),
    ],
)
def test_a_name_or_an_address_that_cannot_be_is_refused(name: str, address: str) -> None:
    with pytest.raises(UsageError):
        client.connect(name, address)


@pytest.mark.parametrize(
    "address", ["tcp/h:65535", "tls/[::1]:7447#iface=lo", "quic/h:1", "unixsock-stream/socket"]
)
def test_an_address_that_can_be_is_taken(address: str) -> None:
    client.connect("a", address)


def test_a_robot_of_another_name_is_told_from_none(endpoint: str) -> None:
    with a_robot(endpoint):
        with client.connect("near", endpoint) as seen:
            assert seen.presence.word == "alive"
        with client.connect("stranger", endpoint) as seen:
            assert seen.presence.word == "absent"
            assert seen.others() == ["near"]
        assert client.robots(endpoint) == ["near"]


def test_what_is_asked_of_a_connection_that_is_closed_is_an_error_in_words(endpoint: str) -> None:
    with a_robot(endpoint), client.connect("near", endpoint) as seen:
        pass
    for ask in (seen.others, seen.pause):
        with pytest.raises(GvgbotError, match="the connection to the robot is closed"):
            ask()


def test_silence_is_told_from_absence(endpoint: str) -> None:
    with a_robot(endpoint) as robot, client.connect("near", endpoint) as seen:
        robot.publish(EXAMPLE)
        until(lambda: seen.presence.word == "quiet", patience_s=5.0)
        assert seen.presence.for_s > 1.0
        robot.publish(EXAMPLE)
        until(lambda: seen.presence.word == "alive")
        robot.close()
        until(lambda: seen.presence.word == "gone")


def test_who_leaves_a_frozen_robot_is_not_held(endpoint: str) -> None:
    with program(ROBOT, endpoint) as process, client.connect("far", endpoint) as seen:
        process.send_signal(signal.SIGSTOP)
        until(lambda: seen.presence.word == "gone")  # and the client tries to connect again
        seen.close()
        assert next(iter(seen.state()), None) is None


def test_a_robot_that_was_killed_is_gone_and_back_when_it_starts_again(endpoint: str) -> None:
    with program(ROBOT, endpoint) as process, client.connect("far", endpoint) as seen:
        assert next(iter(seen.state())) == EXAMPLE
        until(lambda: seen.presence.word == "alive")
        process.send_signal(signal.SIGKILL)
        until(lambda: seen.presence.word == "gone", patience_s=3.0)
        with program(ROBOT, endpoint):
            until(lambda: seen.presence.word == "alive")
            until(lambda: (seen.state().age or 9.0) < 1.0)


def test_what_a_robot_said_before_it_was_started_again_is_forgotten(endpoint: str) -> None:
    def known(seen: client.Robot) -> list[bool]:
        said = (seen.map(), seen.plan(), seen.grid(), seen.trajectory(), seen.health())
        return [one.latest is not None for one in said] + [bool(seen.events().latest)]

    robot = a_robot(endpoint)
    with client.connect("near", endpoint) as seen:
        for value in (numbered(7), A_MAP, A_PLAN, a_grid(" "), A_WAY, A_HEALTH):
            robot.publish(value)
        robot.publish(Events(events=(happened(0),)))
        until(lambda: all(known(seen)))
        maps = iter(seen.map())
        assert next(maps) == A_MAP
        robot.close()
        until(lambda: seen.presence.word == "gone")
        assert all(known(seen))
        with a_robot(endpoint) as again:
            again.publish(numbered(9))
            until(lambda: seen.state().latest == numbered(9))
            assert not any(known(seen))
            another = msgspec.structs.replace(A_MAP, stamp=9.0)
            again.publish(another)
            assert next(maps) == another


def test_of_two_robots_of_one_name_each_is_seen_with_its_own_map(
    endpoint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also if both speak at once: topics come in threads of their own."""
    there = TelemetryConfig(listen=(free_endpoint(),), connect=(endpoint,))
    note_life = client.Robot._note_life

    def note_slowly(seen: client.Robot, sample: zenoh.Sample) -> None:
        note_life(seen, sample)
        Flag().wait(0.001)

    monkeypatch.setattr(client.Robot, "_note_life", note_slowly)
    with a_robot(endpoint) as here, client.connect("near", endpoint) as seen:

        def is_seen(robot: Telemetry, number: int, own: Map | None) -> bool:
            robot.publish(numbered(number))
            return (seen.state().latest, seen.map().latest) == (numbered(number), own)

        here.publish(A_MAP)
        until(partial(is_seen, here, 1, A_MAP))
        for number in (2, 4):
            grown = msgspec.structs.replace(A_MAP, stamp=float(number))
            with Telemetry(there, "near") as other:
                other.publish(numbered(number))
                here.publish(grown)
                until(partial(is_seen, other, number, None))
            until(partial(is_seen, here, number + 1, grown))


def test_two_robots_of_one_name_are_told_from_one_that_was_started_again(endpoint: str) -> None:
    there = TelemetryConfig(listen=(free_endpoint(),), connect=(endpoint,))
    with a_robot(endpoint) as here, client.connect("near", endpoint) as seen:
        here.publish(numbered(1))
        until(lambda: seen.state().latest == numbered(1))
        with Telemetry(there, "near") as other:
            other.publish(numbered(2))
            until(lambda: seen.state().latest == numbered(2))
            words = [seen.presence.word]
            here.publish(numbered(3))
            until(lambda: seen.state().latest == numbered(3))
            assert [*words, seen.presence.word] == ["alive", "doubled"]


def test_a_robot_that_is_frozen_is_noticed(endpoint: str) -> None:
    """A stopped process is as silent as one whose cable was pulled."""
    with program(ROBOT, endpoint) as process, client.connect("far", endpoint) as seen:
        until(lambda: seen.presence.word == "alive")
        process.send_signal(signal.SIGSTOP)
        until(lambda: seen.presence.word in ("quiet", "gone"), patience_s=3.0)
        process.send_signal(signal.SIGCONT)
        until(lambda: seen.presence.word == "alive")


def test_a_program_that_hangs_is_quiet_and_not_gone_until_it_is(endpoint: str) -> None:
    """The network's own threads live on in it, and hold its token."""
    command = [sys.executable, "-c", STUCK, endpoint]
    with subprocess.Popen(command, stdin=subprocess.PIPE) as process:
        try:
            with client.connect("far", endpoint, patience_s=40.0) as seen:
                until(lambda: seen.presence.word == "alive")
                assert process.stdin is not None
                process.stdin.write(b"\n")
                process.stdin.flush()
                until(lambda: seen.presence.word == "quiet")
                lease = TelemetryConfig().lease_s
                until(lambda: seen.presence.for_s > 2.5 * lease)  # longer than the dead are there
                assert seen.presence.word == "quiet"
                process.kill()
                until(lambda: seen.presence.word == "gone", patience_s=3.0)
        finally:
            process.kill()


def test_the_last_map_arrives_though_a_stalled_link_has_dropped_it(endpoint: str) -> None:
    command = [sys.executable, "-c", WATCHER, endpoint]
    line = np.random.default_rng(1).uniform(0.0, 9.0, 30_000).astype("<f4").tobytes()
    big = msgspec.structs.replace(A_MAP, edges=(MapEdge(start=4, end=4, length=2.0, points=line),))
    with a_robot(endpoint) as robot, subprocess.Popen(command, stdout=subprocess.PIPE) as watcher:
        try:
            robot.publish(A_MAP)
            assert watcher.stdout is not None
            assert watcher.stdout.readline() == b"3.0\n"
            watcher.send_signal(signal.SIGSTOP)
            for _ in range(300):  # 36 MB, more than a link holds
                robot.publish(big)
            robot.publish(msgspec.structs.replace(A_MAP, stamp=9.0))
            watcher.send_signal(signal.SIGCONT)
            while watcher.stdout.readline() != b"9.0\n":
                pass
        finally:
            watcher.kill()


ORDERS = list(permutations(["router", "robot", "watcher"]))


@pytest.mark.parametrize("order", ORDERS, ids="-".join)
def test_router_robot_and_watcher_start_in_any_order(endpoint: str, order: list[str]) -> None:
    config = TelemetryConfig(listen=(free_endpoint(),), connect=(endpoint,))
    seen = client.connect("near", endpoint, patience_s=PATIENCE)
    with ExitStack() as stack, ThreadPoolExecutor() as pool:

        def start(which: str) -> None:
            if which == "router":
                stack.enter_context(router(endpoint))
            elif which == "robot":
                stack.enter_context(Telemetry(config, "near")).publish(numbered(7))
            else:
                opening.append(pool.submit(seen.open))
                stack.callback(seen.close)

        opening: list[Future[None]] = []
        for one in order:
            start(one)
        opening[0].result(PATIENCE)
        until(lambda: seen.presence.word == "alive")
        until(lambda: seen.state().latest == numbered(7))


def test_a_robot_that_is_a_router_for_its_team_is_gone_when_it_has_left(endpoint: str) -> None:
    config = TelemetryConfig(listen=(endpoint,))
    with Telemetry(config, "near", relays=True) as robot:
        watcher = client.connect("near", endpoint)
        with watcher:
            robot.publish(numbered(1))
            until(lambda: watcher.state().latest is not None)
            assert watcher.presence.word == "alive"
            robot.close()
            until(lambda: watcher.presence.word == "gone")


@pytest.mark.parametrize("relays", [(False, False), (True, False)])
def test_two_robots_of_one_name_say_so_once(endpoint: str, relays: tuple[bool, bool]) -> None:
    """In a team is none of them, or one, as `relays` says; two in a team hear each other."""
    there = TelemetryConfig(listen=(free_endpoint(),), connect=(endpoint,))

    async def meet(robots: list[Telemetry]) -> None:
        async with asyncio.TaskGroup() as tasks:
            serving = [tasks.create_task(robot.answer()) for robot in robots]
            for _ in range(80):
                for robot in robots:
                    robot.publish(numbered(1))
                await asyncio.sleep(0.02)
            for task in serving:
                task.cancel()

    with (
        structlog.testing.capture_logs() as logs,
        Telemetry(TelemetryConfig(listen=(endpoint,)), "near", relays=relays[0]) as here,
        Telemetry(there, "near", relays=relays[1]) as other,
    ):
        asyncio.run(meet([here]))
        assert logs == []
        asyncio.run(meet([here, other]))
    assert [log["event"] for log in logs] == [
        "another robot has this name; give one another robot.name"
    ] * 2


def test_what_a_router_puts_its_own_time_on_is_known_to_be_the_robot_s(
    endpoint: str, tmp_path: Path
) -> None:
    """A router does so if the robot's clock is ahead of its own by more than half a second."""
    file = tmp_path / "no_time.json5"
    file.write_text("{timestamping: {enabled: false}}")
    config = TelemetryConfig(listen=(free_endpoint(),), connect=(endpoint,), zenoh_file=file)
    with router(endpoint) as between, client.connect("near", endpoint) as seen:
        with Telemetry(config, "near") as robot:
            robot.publish(numbered(1))
            robot.publish(A_MAP)
            until(lambda: seen.map().latest == A_MAP)
            assert seen.life == robot.zid
        with Telemetry(config, "near") as again:
            again.publish(numbered(2))
            until(lambda: seen.state().latest == numbered(2))
            assert (seen.life, seen.map().latest) == (again.zid, None)
            between.close()
            until(lambda: seen.presence.word == "cut off")


def test_a_router_in_between_may_come_and_go(endpoint: str) -> None:
    config = TelemetryConfig(listen=(free_endpoint(),), connect=(endpoint,))
    with router(endpoint) as first:
        robot = Telemetry(config, "near")
        seen = client.connect("near", endpoint)
        with robot, seen:
            robot.publish(numbered(1))
            robot.publish(A_MAP)
            until(lambda: seen.presence.word == "alive")
            until(lambda: seen.map().latest == A_MAP)
            first.close()
            until(lambda: seen.presence.word == "cut off")
            later = msgspec.structs.replace(A_MAP, stamp=9.0)
            robot.publish(later)
            with router(endpoint):
                until(lambda: seen.presence.word == "alive")
                until(lambda: seen.map().latest == later)  # though it was sent to nobody
                robot.close()
                until(lambda: seen.presence.word == "gone")
