"""`gvgbot web`: its server, by a client that is not ours, and its page, in a real browser.

With GVGBOT_PICTURES=docs/images a test leaves web.png and web-phone.png there.
"""

import asyncio
import base64
import json
import math
import os
import re
import signal
import socket
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import ExitStack, asynccontextmanager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Event as Flag
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import msgspec
import numpy as np
import pytest
import zenoh
from numpy.typing import NDArray
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect as sync_connect

from benchmarks.rigs.addresses import free_endpoint, plain_session, router
from benchmarks.rigs.programs import gvgbot
from gvgbot import client
from gvgbot.cli import main
from gvgbot.client.newest import Newest
from gvgbot.requests import REQUESTS, Answer, Asked, Goto, parse
from gvgbot.telemetry import Telemetry
from gvgbot.telemetry_config import TelemetryConfig
from gvgbot.topics import (
    Event,
    Events,
    Health,
    Mate,
    Plan,
    State,
    Trajectory,
    packed,
)
from gvgbot.web.feed import Feed
from gvgbot.web.server import Web
from gvgbot.web.viewers import Audience
from gvgbot.web.wire import Reply, Wish
from gvgbot.zenoh_config import has_listener
from tests.process.browser import Page, browser, chromium
from tests.process.test_requests import a_robot
from tests.unit.monitor.maps import a_grid, a_map, vertex
from tests.unit.test_telemetry import EXAMPLE, NOWHERE

pytestmark = pytest.mark.slow

PATIENCE = 30.0  # s, for a busy machine


# -- the server ------------------------------------------------------------------------------------


async def granted(wish: Wish) -> Reply:
    return Reply(id=wish.id, done=True, text=f"so be it: {wish.name}")


@asynccontextmanager
async def serving(audience: Audience) -> AsyncIterator[int]:
    """A server; its port."""
    async with (
        asyncio.timeout(PATIENCE),
        await Web("127.0.0.1", 0, audience, granted).open() as server,
    ):
        yield next(iter(server.sockets)).getsockname()[1]


def live(port: int, **more: str) -> connect:
    return connect(f"ws://127.0.0.1:{port}/live", **more)  # type: ignore[arg-type]


async def received(viewer: ClientConnection) -> tuple[str, dict[str, object]]:
    kind, value = msgspec.msgpack.decode(await viewer.recv(decode=False))
    return kind, value


async def so_many(audience: Audience, viewers: int) -> None:
    """Wait until there are so many."""
    while len(audience) != viewers:  # noqa: ASYNC110  # it has no event for that
        await asyncio.sleep(0.01)


def run(story: Callable[[Audience, int], Awaitable[None]]) -> None:
    async def all_of_it() -> None:
        audience = Audience()
        async with serving(audience) as port:
            await story(audience, port)

    asyncio.run(all_of_it())


def test_every_viewer_gets_what_is_known_and_what_comes() -> None:
    async def story(audience: Audience, port: int) -> None:
        audience.show("state", EXAMPLE)
        async with live(port) as one, live(port) as two:
            for viewer in (one, two):
                kind, state = await received(viewer)
                assert (kind, state["sequence"]) == ("state", 7)
            audience.show("events", Events(events=()))
            assert [await received(one), await received(two)] == 2 * [("events", {"events": []})]
        await so_many(audience, 0)

    run(story)


@pytest.mark.parametrize("path", ["/", "/main.js", "/nothing", "/live"])
def test_who_asks_for_the_head_only_gets_that_of_the_whole(path: str) -> None:
    async def story(_: Audience, port: int) -> None:
        whole, body = await asked(port, f"GET {path}")
        head, nothing = await asked(port, f"HEAD {path}")
        dated = re.compile(rb"\r\nDate: [^\r]*")
        assert dated.sub(b"", head) == dated.sub(b"", whole)
        assert (len(body) > 0, nothing) == (True, b"")

    run(story)


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS"])
@pytest.mark.parametrize("path", ["/", "/live"])
def test_nothing_can_be_done_to_the_page_but_to_read_it(method: str, path: str) -> None:
    async def story(_: Audience, port: int) -> None:
        head, _body = await asked(port, f"{method} {path}")
        assert head.startswith(b"HTTP/1.1 405 ")
        assert b"\r\nAllow: GET, HEAD" in head

    run(story)


async def asked(port: int, question: str) -> tuple[bytes, bytes]:
    """Head and body of the answer to a method and a path."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(f"{question} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
    head, _, body = (await reader.read()).partition(b"\r\n\r\n")
    writer.close()
    return head, body


def test_a_wish_is_answered_to_who_had_it() -> None:
    async def story(audience: Audience, port: int) -> None:
        async with live(port) as one, live(port) as two:
            await one.send('{"id": 5, "name": "pause"}')
            assert await received(one) == (
                "reply",
                {"id": 5, "done": True, "text": "so be it: pause"},
            )
            audience.show("events", Events(events=()))
            assert (await received(two))[0] == "events"

    run(story)


WISHES: dict[str, dict[str, object]] = {
    "pause": {},
    "goto": {"vertex": 7},
    "patrol": {"vertices": [3, 7]},
    "set": {"key": "exploration.patience_s", "value": 30},
}


def test_a_wish_comes_to_the_robot_with_its_arguments() -> None:
    wishes = [Wish(id=1, name="goto", arguments={"x": 1.5, "y": -2.0})]
    wishes += [Wish(id=2, name=name, arguments=WISHES.get(name, {})) for name in REQUESTS]
    asked: list[Asked] = []

    async def note(one: Asked) -> Answer:
        asked.append(one)
        return Answer(done=True, text=f"does {one.name}")

    async def story() -> list[str]:
        endpoint = free_endpoint()
        feed = Feed("near", endpoint, None, Audience())
        async with a_robot(endpoint, note), asyncio.TaskGroup() as tasks:
            watching = tasks.create_task(feed.run())
            while not (await feed.fulfil(wishes[0])).done:  # noqa: ASYNC110
                await asyncio.sleep(0.01)
            told = [(await feed.fulfil(wish)).text for wish in wishes[1:]]
            watching.cancel()
            return told

    assert asyncio.run(story()) == [f"does {wish.name}" for wish in wishes[1:]]
    heard = [parse(one.name, one.data, one.encoding) for one in asked]
    assert heard == [wish.typed for wish in wishes]


@pytest.mark.parametrize("text", ["drive!", '{"id": 1, "name": "fly"}', "x" * 5000, b"\x00"])
def test_who_talks_nonsense_has_to_leave_and_the_others_stay(text: str | bytes) -> None:
    async def story(audience: Audience, port: int) -> None:
        async with live(port) as one, live(port) as two:
            await one.send(text)
            with pytest.raises(ConnectionClosed):
                await one.recv()
            audience.show("state", EXAMPLE)
            assert (await received(two))[0] == "state"

    run(story)


def test_a_page_from_elsewhere_gets_nothing() -> None:
    async def story(audience: Audience, port: int) -> None:
        with pytest.raises(InvalidStatus, match="403"):
            await live(port, origin="https://example.com")
        async with live(port, origin=f"http://127.0.0.1:{port}"):
            pass

    run(story)


def test_the_thirty_third_viewer_is_told_that_there_are_too_many() -> None:
    async def story(audience: Audience, port: int) -> None:
        viewers = [await live(port) for _ in range(32)]
        with pytest.raises(ConnectionClosed, match="too many viewers"):
            await (await live(port)).recv()
        await viewers[0].close()
        await so_many(audience, 31)
        async with live(port):
            pass

    run(story)


def test_a_viewer_that_does_not_read_holds_nobody_up() -> None:
    big = msgspec.structs.replace(EXAMPLE, reason="".join(map(chr, range(32, 50_000))))

    async def story(audience: Audience, port: int) -> None:
        async with live(port, compression=None) as quick:  # type: ignore[arg-type]
            frozen = socket.create_connection(("127.0.0.1", port))
            fields = {
                "Host": f"127.0.0.1:{port}",
                "Upgrade": "websocket",
                "Connection": "Upgrade",
                "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
                "Sec-WebSocket-Version": "13",
            }
            lines = "".join(f"{name}: {value}\r\n" for name, value in fields.items())
            frozen.sendall(f"GET /live HTTP/1.1\r\n{lines}\r\n".encode())
            await so_many(audience, 2)
            for number in range(200):  # 20 MB, far more than the sockets take
                audience.show("state", msgspec.structs.replace(big, sequence=number))
                assert (await received(quick))[1]["sequence"] == number
            frozen.close()

    run(story)


# -- the program -----------------------------------------------------------------------------------


@contextmanager
def web(*arguments: str) -> Iterator[str]:
    """The program on a free port; the address of its page."""
    with gvgbot("web", "--port", "0", *arguments) as process:
        assert process.stdout is not None
        said = process.stdout.readline()
        assert "http://" in said, said
        yield next(word for word in said.split() if word.startswith("http://"))
        process.send_signal(signal.SIGINT)
        rest, _ = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0
        told = (
            "looking for a robot at ",  # a busy machine takes its time
            "connected to ",
            "karl",
            "near",
            "no robot ",
            "nobody ",
            "connection ",
            "the robot ",
            "several robots ",
        )
        assert all(line.startswith(told) for line in rest.split("\n") if line.strip()), rest


def get(address: str, **fields: str) -> tuple[int, bytes]:
    try:
        with urlopen(Request(address, headers=fields), timeout=PATIENCE) as answer:
            return answer.status, answer.read()
    except HTTPError as refused:
        return refused.code, refused.read()


def test_the_program_serves_its_page_and_ends_when_told() -> None:
    with web("karl", "--connect", free_endpoint()) as address:
        status, body = get(address)
        assert (status, body[:15]) == (200, b"<!doctype html>")
        assert get(f"{address}secrets.txt")[0] == 404
        assert get(f"{address}live")[0] == 426
        assert get(address, Host="example.com")[0] == 403


@pytest.mark.parametrize(
    ("arguments", "status", "named"),
    [
        (["--port", "{taken}"], 1, "--port"),
        (["--host", "192.0.2.1"], 1, "192.0.2.1:8080: this machine has no such address"),
        (["--host", "a..b"], 1, "a..b:8080: this machine has no such address"),
        (["--host", "a" * 70], 1, "a:8080: this machine has no such address"),
        (["--port", "99999"], 2, "'99999' is no port: there are 0 to 65535"),
        (["a/b"], 2, "a/b"),
        (["--connect", "here"], 2, "here"),
    ],
)
def test_what_cannot_be_is_one_line(
    arguments: list[str], status: int, named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        words = [word.replace("{taken}", port) for word in arguments]
        try:
            ended: object = main(["web", *words])
        except SystemExit as refused:
            ended = refused.code
    assert ended == status
    said = capsys.readouterr()
    assert said.out == ""
    (line,) = said.err.splitlines()
    assert named in line


def test_of_several_robots_one_has_to_be_named() -> None:
    endpoint = free_endpoint()

    def joining(name: str) -> Telemetry:
        return Telemetry(TelemetryConfig(listen=(free_endpoint(),), connect=(endpoint,)), name)

    with router(endpoint), joining("karl"), joining("otto"):
        with client.connect("otto", endpoint) as seen:
            while seen.others() != ["karl", "otto"]:
                pass
        with gvgbot("web", "--port", "0", "--connect", endpoint) as process:
            said, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 2
    (line,) = said.splitlines()
    assert "there are several robots: karl, otto" in line


def test_it_says_that_no_robot_answers_yet() -> None:
    with gvgbot("web", "--port", "0", "--connect", free_endpoint()) as process:
        assert process.stdout is not None
        assert "http://" in process.stdout.readline()
        assert "nobody answers" in process.stdout.readline()


def test_it_says_once_each_time_that_the_robot_comes_and_goes() -> None:
    endpoint = free_endpoint()
    with gvgbot("web", "--port", "0", "--connect", endpoint) as process:
        assert process.stdout is not None
        said = [process.stdout.readline() for _ in range(2)]
        for _ in range(2):
            with Telemetry(TelemetryConfig(listen=(endpoint,)), "karl") as robot:
                robot.publish(EXAMPLE)
                said.append(process.stdout.readline())
            said.append(process.stdout.readline())
        process.send_signal(signal.SIGINT)
        said += process.communicate(timeout=PATIENCE)[0].splitlines()
    assert "nobody answers" in said[1]
    assert said[2:] == 2 * ["connected to karl\n", "karl has gone (waiting for it)\n"]


def test_a_robot_of_another_version_is_said_to_be_one() -> None:
    endpoint = free_endpoint()

    async def story(address: str) -> None:
        async with asyncio.timeout(PATIENCE), live(int(address.rpartition(":")[2][:-1])) as viewer:
            while True:
                kind, value = await received(viewer)
                if kind == "link" and value["word"] == "unreachable":
                    assert "install the same gvgbot on both" in str(value["trouble"])
                    return

    with Telemetry(TelemetryConfig(listen=(endpoint,)), "karl"), plain_session(endpoint) as other:
        encoding = zenoh.Encoding("application/msgpack;gvgbot.State.v9")
        with web("karl", "--connect", endpoint) as address:
            publisher = other.declare_publisher("gvgbot/karl/state", encoding=encoding)
            while not has_listener(publisher):
                pass
            publisher.put(b"\x80")
            asyncio.run(story(address))


def test_a_robot_has_its_walls_again_when_another_one_of_its_name_has_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Also when the two take turns while a reader is at it."""
    endpoint, audience, swap = free_endpoint(), Audience(), Newest.swap
    there = TelemetryConfig(listen=(free_endpoint(),), connect=(endpoint,))
    happened = Events(events=(Event(number=0, stamp=3.0, kind="meetpoint", details={}),))

    def slow_swap(box: Newest[Any], read: Callable[[], Any] | None) -> Callable[[], Any] | None:
        before = swap(box, read)
        Flag().wait(0.001)
        return before

    async def until(robot: Telemetry, *kinds: str) -> None:
        while True:
            latest = audience._latest.items()
            said = {kind: value for (kind, _), value in latest if value != Events(events=())}
            known = said.keys() & {"map", "tile", "events"}
            if said.get("life") == robot.zid and known == set(kinds):
                return
            robot.publish(EXAMPLE)
            await asyncio.sleep(0.01)

    async def story() -> None:
        with Telemetry(TelemetryConfig(listen=(endpoint,)), "karl") as karl:
            for one in (ROOM, GRAPH, happened):
                karl.publish(one)
            async with asyncio.timeout(PATIENCE), asyncio.TaskGroup() as tasks:
                watching = tasks.create_task(Feed("karl", endpoint, None, audience).run())
                await until(karl, "map", "tile", "events")
                with Telemetry(there, "karl") as other:
                    await until(other)
                await until(karl, "map", "tile", "events")
                watching.cancel()

    monkeypatch.setattr(Newest, "swap", slow_swap)
    asyncio.run(story())


# -- the page -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    program = chromium()
    if program is None:
        pytest.skip("there is no chromium here: apt install chromium")
    with browser(program, tmp_path_factory.mktemp("browser")) as tab:
        yield tab


def desktop(page: Page, address: str, *, dark: bool = True) -> None:
    page.open(address, 1280, 800, phone=False, dark=dark)


WALLS = "\n".join(["#" * 20, *["#" + "." * 18 + "#"] * 8, "#" * 20])
ROOM = a_grid(WALLS, resolution=0.5)  # 10 by 5 m
GRAPH = a_map((vertex((6.0, 2.0)),))
WAY = Trajectory(
    stamp=3.0,
    stamps=np.array([1.0, 2.0], "<f8").tobytes(),
    poses=np.array([[1.0, 4.0, 0.0], [8.0, 4.0, 0.0]], "<f4").tobytes(),
)
HERE = msgspec.structs.replace(EXAMPLE, pose=(3.0, 2.0, 0.0), requests=("pause", "goto"))


@dataclass
class Play:
    """A robot at (3, 2) that looks at the vertex, and who watches it."""

    endpoint: str
    page: Page
    sequence: int = 0
    state: State = HERE

    def __post_init__(self) -> None:
        self.robot = Telemetry(TelemetryConfig(listen=(self.endpoint,)), "karl")
        self.robot.publish(ROOM)
        self.robot.publish(GRAPH)
        decision: dict[str, str | int | float | bool | None]
        decision = {"vertex": 1, "bearing": 0.0, "reason": "ear"}
        happened = Event(number=0, stamp=3.0, kind="decision", details=decision)
        self.robot.publish(Events(events=(happened,)))

    def tell(self) -> None:
        """Let the robot say how it is."""
        self.sequence += 1
        self.robot.publish(msgspec.structs.replace(self.state, sequence=self.sequence))

    def until(self, expression: str) -> None:
        """Let the robot say how it is, until something is so on the page."""
        end = time.perf_counter() + PATIENCE
        while True:
            self.tell()
            if self.page.look(expression):
                return
            assert time.perf_counter() < end, (expression, self.page.text())
            Flag().wait(0.03)

    def until_read(self, words: str) -> None:
        self.until(f"document.body.innerText.includes({json.dumps(words)})")

    def until_drawn(
        self, is_so: Callable[[dict[str, tuple[NDArray[np.float64], int]]], bool], *names: str
    ) -> dict[str, tuple[NDArray[np.float64], int]]:
        """Wait until the stretches of colours are as wanted, and return them."""
        end = time.perf_counter() + PATIENCE
        while True:
            self.drawn()
            found = stretches(self.page, *names)
            if is_so(found):
                return found
            assert time.perf_counter() < end, found

    def drawn(self) -> None:
        """Wait until what was done is on the screen, and the map."""
        self.until("document.querySelector('#map').ariaLabel.includes('1 vertex,')")
        for _ in range(3):
            self.until("new Promise((done) => requestAnimationFrame(() => done(true)))")


@pytest.fixture(scope="module")
def living(page: Page) -> Iterator[tuple[Play, str]]:
    """A robot for tests that have it say nothing but its state, and the address of its page."""
    endpoint = free_endpoint()
    with web("--connect", endpoint) as address:
        play = Play(endpoint, page)
        with play.robot:
            yield play, address


@dataclass
class Shown:
    """That robot: no page that is opened from now on shows what it said in an earlier test."""

    play: Play
    address: str

    def says(self, state: State) -> Play:
        """The robot, as soon as the server has heard it say that."""
        self.play.state, before = state, self.play.sequence
        heard = before
        with sync_connect(self.address.replace("http", "ws") + "live", max_size=None) as viewer:
            while heard <= before:
                self.play.tell()
                kind, value = msgspec.msgpack.decode(viewer.recv(PATIENCE, decode=False))
                heard = value["sequence"] if kind == "state" else before
        return self.play


@pytest.fixture
def shown(living: tuple[Play, str]) -> Shown:
    return Shown(*living)


@pytest.fixture(scope="module")
def robotless() -> Iterator[str]:
    """The address of a page for which there is no robot."""
    with web("karl", "--connect", free_endpoint()) as address:
        yield address


def colour(page: Page, name: str) -> list[int]:
    """A colour of the page's style sheet, red, green, blue."""
    text = page.look(f"getComputedStyle(document.body).getPropertyValue('--{name}').trim()")
    return [int(text[at : at + 2], 16) for at in (1, 3, 5)]


def stretch(page: Page, name: str) -> tuple[NDArray[np.float64], int]:
    """The middle (x, y) of what has a colour on the map, in pixels of the page, and how many."""
    return stretches(page, name)[name]


def stretches(page: Page, *names: str) -> dict[str, tuple[NDArray[np.float64], int]]:
    """The same of several colours at one moment."""
    left, top, width, height = page.look(
        "(() => { const r = document.querySelector('#map').getBoundingClientRect();"
        "return [r.x, r.y, r.width, r.height].map(Math.round) })()"
    )
    ratio = page.look("devicePixelRatio")
    whole = page.pixels().astype(int)[::ratio, ::ratio]
    picture = whole[top : top + height, left : left + width]
    found = {}
    for name in names:
        rows, columns = np.nonzero(np.abs(picture - colour(page, name)).sum(axis=2) < 12)
        middle = np.array([columns.mean() + left, rows.mean() + top]) if len(rows) else np.zeros(2)
        found[name] = middle, len(rows)
    return found


def at_rest(play: Play) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The middles of robot and vertex once two looks agree: as more of a map comes it is fitted."""
    looks = [np.zeros((2, 2))]

    def agree(seen: dict[str, tuple[NDArray[np.float64], int]]) -> bool:
        looks.append(np.array([seen["robot"][0], seen["vertex"][0]]))
        return bool(np.abs(looks[-1] - looks[-2]).max() < 1.0)

    play.until_drawn(agree, "robot", "vertex")
    return looks[-1][0], looks[-1][1]


def test_the_page_decodes_what_msgpack_encodes(page: Page, robotless: str) -> None:
    values = [
        *(None, True, False, 0, 1, -1, 127, 128, -32, -33, -128, -129, 255, 256, 65535, 65536),
        *(-32768, -32769, 2**32 - 1, 2**32, -(2**31), -(2**31) - 1, 2**50, 1.5, -1e300, 0.1),
        *("", "a" * 31, "a" * 32, "ä€😀" * 100, "x" * 70_000),
        *([], [1] * 15, [1] * 16, [0] * 70_000, {}, {str(n): n for n in range(20)}),
        {f"_{number}": [number] for number in range(66_000)},
    ]
    desktop(page, robotless)
    assert json.loads(decoded_by(page, values, "JSON.stringify(got)")) == values
    pairs = np.array([1.5, -2.0], "<f4").tobytes()
    assert decoded_by(page, pairs, "Array.from(m.points(got))") == [1.5, -2.0]


def decoded_by(page: Page, value: object, then: str) -> Any:
    """What the page makes of an encoded value, called `got`."""
    data = base64.b64encode(msgspec.msgpack.encode(value)).decode()
    return page.look(
        "import('/msgpack.js').then((m) => { const got = m.decode(Uint8Array.from("
        f"atob('{data}'), (c) => c.charCodeAt(0)).buffer); return {then} }})"
    )


def test_the_page_shows_a_robot_on_its_map_that_can_be_moved_and_zoomed(
    page: Page, shown: Shown
) -> None:
    play = shown.says(HERE)
    desktop(page, shown.address)
    play.until("document.querySelector('#robot').textContent === 'karl'")
    for words in ("vertex 1, 0°: ear", "31.5 m", "90 %, 16.1 V", "3.00, 2.00 m, 0°"):
        play.until_read(words)
    robot, ahead = at_rest(play)
    assert ahead[0] - robot[0] > 50  # 3 m to the east of it
    assert ahead[1] == pytest.approx(robot[1], abs=12)
    page.click("#zoom-in")
    begin, end = at_rest(play)
    wider = end - begin
    assert wider[0] == pytest.approx(1.4 * (ahead - robot)[0], rel=0.06)
    page.mouse("mouseWheel", *page.middle("#map"), deltaX=0, deltaY=-200)
    play.drawn()
    before = stretch(page, "robot")[0]
    assert (stretch(page, "vertex")[0] - before)[0] > 1.2 * wider[0]
    x, y = page.middle("#map")
    page.mouse("mousePressed", x, y, button="left", clickCount=1)
    page.mouse("mouseMoved", x - 40, y + 30, button="left", buttons=1)
    page.mouse("mouseReleased", x - 40, y + 30, button="left", clickCount=1)
    play.drawn()
    assert stretch(page, "robot")[0] - before == pytest.approx([-40, 30], abs=4)
    page.click("#layer-vertices")
    play.drawn()
    assert stretch(page, "vertex")[1] == 0
    page.click("#fit")
    play.drawn()
    assert stretch(page, "robot")[0] == pytest.approx(robot, abs=4)


def test_walls_the_way_driven_and_the_health_are_shown_as_they_change(page: Page) -> None:
    endpoint = free_endpoint()
    health = Health(
        stamp=3.0,
        uptime=125.0,
        cycles=6000,
        late_cycles=2,
        slowest_cycle=0.015,
        cpu=0.143,
        memory=82_400_000,
        unsent=0,
        laser=EXAMPLE.laser,
        base=EXAMPLE.base,
    )
    with web("--connect", endpoint) as address:
        play = Play(endpoint, page)
        with play.robot:
            play.robot.publish(WAY)
            play.robot.publish(health)
            desktop(page, address)
            for words in ("14 % of a core, 82 MB", "2 min 5 s", "2, slowest 15 ms", "all sent"):
                play.until_read(words)
            names = ("robot", "vertex", "trail", "wall")
            seen = play.until_drawn(
                lambda seen: seen["wall"][1] > 1000 and min(seen[n][1] for n in names) > 20, *names
            )
            robot, ahead, way, walls = (seen[name][0] for name in names)
            scale = (ahead - robot)[0] / 3.0
            last = math.hypot(5.0, 2.0)  # from (1, 4) to (8, 4), and then to the robot at (3, 2)
            middle = (np.array([4.5, 4.0]) * 7.0 + np.array([5.5, 3.0]) * last) / (7.0 + last)
            assert (way - robot) / scale == pytest.approx((middle - [3, 2]) * [1, -1], abs=0.4)
            assert (walls - robot) / scale == pytest.approx(
                [2.0, -0.5], abs=0.1
            )  # the room's middle
            squares = seen["wall"][1] / (0.5 * scale) ** 2
            assert squares == pytest.approx(WALLS.count("#"), rel=0.15)
            play.robot.publish(a_grid(WALLS.replace("#", "."), resolution=0.5, number=2))
            play.until_drawn(
                lambda seen: seen["wall"][1] < 1000 < seen["floor"][1], "wall", "floor"
            )  # of walls remains what is written on the buttons in the same colour
            page.click("#layer-grid")
            play.until_drawn(
                lambda seen: seen["floor"][1] < 1000 and seen["robot"][1] > 20, "floor", "robot"
            )


def test_the_way_driven_has_a_gap_where_the_robot_was_carried(page: Page) -> None:
    """It drove from (1, 4) to (3, 4), and was put down at (8, 4), whence it came to (3, 2)."""
    poses = np.array([[1.0, 4.0, 0.0], [3.0, 4.0, 0.0], [8.0, 4.0, 0.0]], "<f4")
    way = msgspec.structs.replace(WAY, stamps=bytes(24), poses=poses.tobytes())
    endpoint, lengths = free_endpoint(), list[int]()
    with web("--connect", endpoint) as address:
        play = Play(endpoint, page)
        with play.robot:
            desktop(page, address)
            for breaks in ((), (2,), (1,)):
                play.robot.publish(msgspec.structs.replace(way, breaks=breaks))
                seen = play.until_drawn(
                    lambda seen: min(abs(seen["trail"][1] - one) for one in [0, *lengths]) > 20,
                    "trail",
                )
                lengths.append(seen["trail"][1])
    gaps = lengths[0] - lengths[1], lengths[0] - lengths[2]  # of 5 and 2 m
    assert gaps[0] / gaps[1] == pytest.approx(5.0 / 2.0, rel=0.1)


def test_virtual_walls_are_dots_that_come_and_go_with_the_other_walls(page: Page) -> None:
    """From (2, 4.5) to (8, 4.5), where no number and no plan is."""
    wall = np.column_stack([np.linspace(2.0, 8.0, 61), np.full(61, 4.5)])
    endpoint = free_endpoint()
    with web("--connect", endpoint) as address:
        play = Play(endpoint, page)
        with play.robot:
            desktop(page, address)
            before = play.until_drawn(lambda seen: seen["wall"][1] > 1000, "wall")["wall"][1]
            play.robot.publish(msgspec.structs.replace(GRAPH, virtual_walls=packed(wall)))
            least = before + len(wall)
            after = play.until_drawn(lambda seen: seen["wall"][1] > least, "wall")["wall"][1]
            assert after - before < 10 * len(wall)  # a line would be 9 pixels for each
            page.click("#layer-grid")
            play.until_drawn(lambda seen: seen["wall"][1] < 1000, "wall")


def test_vertices_have_their_numbers_wherever_there_is_room(page: Page, shown: Shown) -> None:
    boxes = [(0, 10), (11, 21), (30, 40), (22, 32)]  # from left to right
    box = "({ left, right, top: 0, bottom: 10 })"
    play = shown.says(HERE)
    desktop(page, shown.address)
    play.drawn()
    page.look(
        "(() => { const p = CanvasRenderingContext2D.prototype, fill = p.fillText;"
        "window.said = new Set();"
        "p.fillText = function (text, ...at) { said.add(`${text}`); "
        "fill.call(this, text, ...at) } })()"
    )
    scale = "parseFloat(document.querySelector('#scale-bar').style.width)"
    scale += " / parseFloat(document.querySelector('#scale-text').textContent)"
    while page.look(scale) > 10:
        page.click("#zoom-out")
        play.drawn()
    page.look("said.clear()")
    play.until("said.has('1')")
    kept = page.look(
        f"import('/map.js').then((m) => m.apart({json.dumps(boxes)}"
        f".map(([left, right]) => {box}), [[100, 110]].map(([left, right]) => {box}))"
        ".map((one) => one.left))"
    )
    assert kept == [0, 30]


def test_the_view_of_all_ends_where_the_floor_does_after_a_correction(
    page: Page, robotless: str
) -> None:
    """Tiles of two metres: one from the origin on, and for a while one from (10, -4) on."""
    steps = [(0, 0, [0, 0, -1, 0]), (5, -2, [-1, 100, -1, -1]), (5, -2, [-1, -1, -1, -1])]
    desktop(page, robotless)
    boxes = page.look(
        "import('/floor.js').then(async ({ Floor }) => {"
        "const floor = new Floor(1, 2, { floor: '#ffffff', wall: '#000000' });"
        "const packed = (cells) => new Response(new Blob([new Int8Array(cells)]).stream()"
        ".pipeThrough(new CompressionStream('deflate'))).arrayBuffer();"
        "const boxes = [floor.box];"
        f"for (const [column, row, cells] of {json.dumps(steps)}) {{"
        "await floor.take({ column, row, cells: await packed(cells) });"
        "boxes.push(floor.box) } return boxes })"
    )
    assert boxes == [None, [0, 0, 2, 2], [0, -4, 12, 2], [0, 0, 2, 2]]


def test_what_a_robot_showed_before_it_was_started_again_is_shown_no_more(page: Page) -> None:
    endpoint, label = free_endpoint(), "document.querySelector('#map').ariaLabel"
    with web("karl", "--connect", endpoint) as address:
        desktop(page, address)
        play = Play(endpoint, page)
        with play.robot:
            play.until_drawn(lambda seen: seen["wall"][1] > 1000, "wall")
        with Telemetry(TelemetryConfig(listen=(endpoint,)), "karl") as again:
            play.robot, play.sequence = again, 1000  # as if it had long been there
            play.until(f"{label} === 'map, nothing known yet'")
            for _ in range(2):
                assert stretch(page, "wall")[1] < 1000
                play.until("!document.body.innerText.includes('vertex 1, 0°: ear')")
                desktop(page, address)  # who comes later sees no more
                play.until_read("31.5 m")


def test_the_other_robots_of_the_team_are_shown_where_they_are(page: Page, shown: Shown) -> None:
    anna = Mate(name="anna", pose=(3.0, 4.0, 0.0))  # two metres to the north
    play = shown.says(msgspec.structs.replace(HERE, team=(anna,)))
    desktop(page, shown.address)
    play.until_read("anna")
    play.until_read("3.00, 4.00 m")
    names = ("robot", "vertex", "trail")
    seen = play.until_drawn(lambda seen: min(seen[n][1] for n in names) > 20, *names)
    robot, ahead, mate = (seen[name][0] for name in names)
    scale = (ahead - robot)[0] / 3.0
    assert (mate - robot) / scale == pytest.approx([0.0, -2.0], abs=0.4)


def test_names_of_other_robots_can_be_read_whatever_their_length_and_what_is_below_them(
    page: Page, shown: Shown
) -> None:
    name = "the_robot_that_has_the_longest_name_of_all"
    mate = Mate(name=name, pose=(3.0, 4.0, 0.0))
    play = shown.says(msgspec.structs.replace(HERE, team=(mate,)))
    page.open(shown.address, 390, 844, phone=True, dark=False)
    page.look(
        "(() => { const p = CanvasRenderingContext2D.prototype, stroke = p.strokeText;"
        "window.haloed = new Set();"
        "p.strokeText = function (text, ...at) { haloed.add(`${text}`); "
        "stroke.call(this, text, ...at) } })()"
    )
    play.until(f"haloed.has('{name}')")
    play.until_read("3.00, 4.00 m")
    assert page.look("document.documentElement.scrollWidth") == 390
    left = "[...document.querySelectorAll('#facts dd')].map((dd) => dd.offsetLeft)"
    assert len(set(page.look(left))) == 1  # all values in one column


def test_no_word_of_an_event_sticks_out(page: Page) -> None:
    endpoint, key = free_endpoint(), "robot.limits.max_angular_acceleration_radps2"
    details: dict[str, str | int | float | bool | None]
    details = {"request": f"set {key} 1", "origin": "me", "done": False, "answer": "no"}
    asked = Event(number=1, stamp=4.0, kind="requested", details=details)
    with web("--connect", endpoint) as address:
        play = Play(endpoint, page)
        with play.robot:
            play.robot.publish(Events(events=(asked,)))
            desktop(page, address)
            play.until_read(f"set {key} 1")
            widths = "(({clientWidth, scrollWidth}) => [clientWidth, scrollWidth])"
            inner, needed = page.look(f"{widths}(document.querySelector('aside'))")
            assert needed == inner  # no bar to scroll sideways
            play.state = msgspec.structs.replace(HERE, stamp=86_343.0)
            play.until_read("23 h 58 min")
            boxes = "[...document.querySelector('#events li:last-child').children].map((one) => {"
            boxes += " const text = document.createRange(); text.selectNodeContents(one);"
            boxes += " const box = text.getBoundingClientRect();"
            boxes += " return [box.left, box.right, box.height] })"
            (_, end, height), (begin, *_) = page.look(boxes)
            assert end < begin
            assert height < 25  # px: one line


def test_all_layers_and_a_short_word_on_a_vertex_find_room_on_a_phone(
    page: Page, shown: Shown
) -> None:
    play = shown.says(HERE)
    page.open(shown.address, 390, 844, phone=True, dark=False)
    play.drawn()
    ends = "[...document.querySelectorAll('#layers label')].map((one) => "
    ends += "one.getBoundingClientRect().right)"
    assert max(page.look(ends)) <= 390
    assert page.look("document.querySelector('#layers').offsetHeight") < 100
    assert page.look("document.querySelector('header').offsetHeight") < 60
    named = "document.querySelector('#robot').textContent = 'turtlebot2-of-the-third-floor'"
    assert page.look(f"{named}, document.querySelector('#headline').offsetWidth") > 100
    play.until_drawn(lambda seen: seen["wall"][1] > 1000, "wall")
    play.drawn()
    x, y = stretch(page, "vertex")[0]
    page.touch("touchStart", (x, y))
    page.touch("touchEnd")
    play.until_read("meetpoint 1 at 6.00, 2.00 m")
    play.until("!document.querySelector('#place-go').hidden")
    assert page.look("document.querySelector('#place').offsetHeight") < 50
    known = json.dumps(msgspec.to_builtins(vertex((6.0, 2.0), frontiers=(0.5,))))
    said = page.look(f"import('/words.js').then((words) => words.ofVertex({known}))")
    assert said.endswith(" m, 1 frontier")
    page.click("#place-close")
    play.until("document.querySelector('#place').hidden")


def test_a_browser_that_may_keep_nothing_shows_the_robot_too(page: Page, shown: Shown) -> None:
    """Reading the storage raises an error where a person has forbidden it to all pages."""
    refused = "Object.defineProperty(window, 'localStorage', {get() { throw new DOMException() }})"
    script = page.do("Page.addScriptToEvaluateOnNewDocument", source=refused)
    play = shown.says(HERE)
    desktop(page, shown.address)
    play.until_read("vertex 1, 0°: ear")
    page.click("#theme")
    play.until_read("theme: dark")
    assert page.complaints == []
    page.do("Page.removeScriptToEvaluateOnNewDocument", identifier=script["identifier"])


def test_the_button_that_opens_a_menu_neither_moves_the_map_nor_marks_a_place(
    page: Page, shown: Shown
) -> None:
    play = shown.says(HERE)
    desktop(page, shown.address)
    walled = play.until_drawn(lambda seen: seen["wall"][1] > 1000, "wall", "robot")
    before = walled["robot"][0]
    x, y = page.middle("#map")
    page.mouse("mousePressed", x, y, button="right", clickCount=1)
    page.mouse("mouseMoved", x - 40, y + 30)  # the menu has kept the end
    play.drawn()
    assert stretch(page, "robot")[0] == pytest.approx(before, abs=1)
    page.mouse("mouseReleased", x, y, button="right", clickCount=1)
    play.drawn()
    assert page.look("document.querySelector('#place').hidden")


def test_the_whole_map_is_seen_on_a_small_phone_that_lies_on_its_side(
    page: Page, shown: Shown
) -> None:
    play = shown.says(HERE)
    page.open(shown.address, 568, 240, phone=True, dark=False)
    assert page.look("document.querySelector('#sheet').offsetHeight") < 80
    play.until("parseFloat(document.querySelector('#scale-bar').style.width) >= 60")


def test_two_fingers_zoom_on_a_phone(page: Page, shown: Shown) -> None:
    """The last on a phone: of what is touched later, the browser tells a page the clicks alone."""
    play = shown.says(HERE)
    page.open(shown.address, 390, 844, phone=True, dark=False)
    play.until_read("vertex 1, 0°: ear")
    assert page.look("document.documentElement.scrollWidth") == 390  # nothing sticks out
    scale = "document.querySelector('#scale-bar').offsetWidth"
    text = "parseFloat(document.querySelector('#scale-text').textContent)"
    play.drawn()
    before = page.look(f"{scale} / {text}")
    x, y = page.middle("#map")
    page.touch("touchStart", (x - 40, y), (x + 40, y))
    page.touch("touchMove", (x - 60, y), (x + 60, y))
    page.touch("touchMove", (x - 80, y), (x + 80, y))
    page.touch("touchEnd")
    play.drawn()
    assert page.look(f"{scale} / {text}") == pytest.approx(2 * before, rel=0.1)


def test_plots_above_each_other_have_one_axis_of_time(page: Page) -> None:
    """The battery is known from the second of three moments on, and drawn below that one."""
    endpoint = free_endpoint()
    unknown = msgspec.structs.replace(HERE, battery_fraction=None)
    with web("--connect", endpoint) as address:
        play = Play(endpoint, page, state=unknown)
        with play.robot:
            desktop(page, address)
            play.drawn()
            page.look(
                "(() => { const p = CanvasRenderingContext2D.prototype, line = p.lineTo,"
                "begin = p.beginPath; window.xs = {};"
                "p.beginPath = function () { xs[this.canvas.id] = []; begin.call(this) };"
                "p.lineTo = function (x, y) { xs[this.canvas.id]?.push(x); line.call(this, x, y) }"
                "})()"
            )
            for stamp, battery in ((100.0, None), (400.0, 0.9), (700.0, 0.8)):
                play.state = msgspec.structs.replace(
                    HERE, stamp=stamp, distance=stamp, battery_fraction=battery
                )
                play.until_read(f"{stamp:.1f} m")
            play.until("(xs['battery-plot'] ?? []).length === 2")
            sigmas, batteries = page.look("[xs['sigma-plot'], xs['battery-plot']]")
    assert sigmas[-2:] == pytest.approx(batteries)
    assert batteries[0] < batteries[1]


def test_a_robot_that_is_stuck_waits_is_silent_or_has_left_and_a_lost_server_are_told_apart(
    page: Page,
) -> None:
    endpoint = free_endpoint()
    banner = "document.querySelector('#banner').innerText"
    with web("--connect", endpoint) as address:
        port = address.rstrip("/").rpartition(":")[2]
        desktop(page, address)
        page.until("document.querySelector('#banner').innerText.includes('nobody answers')")
        play = Play(endpoint, page)
        with play.robot:
            page.until(f"{banner}.startsWith('quiet for')")  # it has not said anything
            play.until("document.querySelector('#banner').hidden")
            headline = "document.querySelector('#headline').innerText"
            there = msgspec.structs.replace(HERE.base, connected=True)
            halted = msgspec.structs.replace(HERE, phase="halted", reason="no laser: plug it in")
            play.state = halted  # what the narrow headline cuts off can be read below
            play.until(
                "document.querySelector('#facts').innerText.includes('no laser: plug it in')"
            )
            track = packed(np.array([[3.0, 2.0], [4.0, 2.0]]))
            first = Plan(stamp=1.0, vertex=None, bearing=None, reason="", track=track, route=b"")
            play.robot.publish(first)
            play.state = msgspec.structs.replace(HERE, vertices=0)
            play.until_read("the end of its first edge")
            lost = "not sure where it is: 2 places fit"
            nowhere = msgspec.structs.replace(HERE, covariance=NOWHERE, reason=lost)
            play.state = nowhere
            play.until(f"{headline} === '{lost}'")
            assert page.look("document.querySelector('#headline').dataset.tone") == "warning"
            play.until(f"document.querySelector('#facts').innerText.includes('{lost}')")
            assert "not known" in page.look("document.querySelector('#facts').innerText")
            assert page.look("document.querySelector('#sigma-now').innerText") == "unknown"
            play.until_drawn(lambda found: found["robot"][1] == 0, "robot")
            play.state = HERE
            play.until_drawn(lambda found: found["robot"][1] > 50, "robot")
            play.state = msgspec.structs.replace(nowhere, phase="errand", errand="goto 7")
            play.until(f"{headline} === '{lost}'")
            reason, team = "no frontier is left", (Mate(name="anna", pose=(3.0, 2.0, 0.0)),)
            ended = msgspec.structs.replace(HERE, outcome="explored", reason=reason, team=team)
            play.state = msgspec.structs.replace(ended, phase="finished")
            play.until(f"{headline} === 'no frontier is left'")
            assert "4 followed by others" in page.look("document.querySelector('#facts').innerText")
            play.state = msgspec.structs.replace(ended, phase="errand", errand="goto 7")
            play.until(f"{headline} === 'goto 7'")
            two = "several robots are named karl: give one another robot.name"
            other = TelemetryConfig(listen=(free_endpoint(),), connect=(endpoint,))
            with Telemetry(other, "karl") as namesake:
                while page.look(headline) != two:
                    namesake.publish(play.state)
                    play.until("true")
            waits = msgspec.structs.replace(ended, phase="paused", base=there)
            play.state = msgspec.structs.replace(waits, cycle_age=5.0)
            play.until(f"{headline} === 'its control loop is stuck'")
            play.state = msgspec.structs.replace(waits, pose=(-0.001,) * 3, twist=(-0.001, -0.001))
            play.until(f"{headline} === 'paused'")
            told = page.text()
            assert "0.00, 0.00 m, 0°" in told
            assert "-0.00" not in told
            page.until(f"{banner}.startsWith('quiet for 3 s')")
            spoken = "document.querySelector('[role=alert]').textContent"
            first = page.look(spoken)
            assert first.startswith("quiet for")
            page.until(f"{banner}.startsWith('quiet for 5 s')")
            assert page.look(spoken) == first  # nobody is made to listen to seconds
            assert page.look("document.querySelector('[data-request=pause]').disabled")
            play.until("document.querySelector('#banner').hidden")
        page.until(f"{banner}.startsWith('robot gone for')")
        assert "31.5 m" in page.text()  # what was known last remains
    page.until(f"{banner}.startsWith('connection to gvgbot web lost')")
    with web("--connect", endpoint, "--port", port):
        play = Play(endpoint, page)
        with play.robot:
            play.until("document.querySelector('#banner').hidden")


def test_a_page_for_which_there_is_no_room_says_so_until_another_one_is_closed(
    page: Page, robotless: str
) -> None:
    banner = "document.querySelector('#banner')"
    with ExitStack() as others:
        there = robotless.replace("http", "ws") + "live"
        viewers = [others.enter_context(sync_connect(there)) for _ in range(32)]
        desktop(page, robotless)
        page.until(f"{banner}.innerText.startsWith('there are too many viewers')")
        viewers[0].close()
        page.until(f"{banner}.innerText.includes('nobody answers')")


def test_a_button_asks_the_robot_and_its_answer_is_shown(page: Page) -> None:
    endpoint = free_endpoint()
    asked: list[tuple[str, bytes]] = []

    async def answer(request: Asked) -> Answer:
        asked.append((request.name, request.data))
        if request.name == "goto":
            return Answer(done=False, text="no way leads there")
        return Answer(done=True, text="it stands")

    def person(play: Play, address: str) -> None:
        desktop(page, address)
        play.until(
            "document.querySelector('[data-request=pause]:enabled:not([hidden])')?.id === ''"
        )
        assert page.look("document.querySelector('[data-request=stop]').hidden")  # not announced
        assert page.look("document.querySelector('[data-request=stop]').title") == "gvgbot ctl stop"
        page.click("[data-request=pause]")
        play.until_read("pause: it stands")
        play.drawn()
        x, y = stretch(page, "vertex")[0]
        for kind in ("mousePressed", "mouseReleased"):
            page.mouse(kind, x, y, button="left", clickCount=1)
        play.until_read("meetpoint 1 at 6.00, 2.00 m")
        page.click("#place-go")
        play.until_read("refused: no way leads there")

    async def story(address: str) -> None:
        play = Play(endpoint, page)
        with play.robot:
            async with asyncio.TaskGroup() as tasks:
                hearing = tasks.create_task(play.robot.hear(answer))
                await asyncio.to_thread(person, play, address)
                hearing.cancel()

    with web("--connect", endpoint) as address:
        asyncio.run(story(address))
    assert [name for name, _ in asked] == ["pause", "goto"]
    assert msgspec.msgpack.decode(asked[1][1], type=Goto) == Goto(vertex=1)


def test_a_twin_that_explores_is_seen_doing_so(page: Page, tmp_path: Path) -> None:
    endpoint = free_endpoint()
    listen, requests = f"telemetry.listen=[{endpoint}]", "telemetry.requests=[pause, resume]"
    run_it = gvgbot("run", "--set", listen, "--set", requests, cwd=tmp_path)
    with run_it, web("--connect", endpoint) as address:
        with client.connect("sim", endpoint, patience_s=PATIENCE) as seen:
            next(state for state in seen.state() if state.distance > 0.3)  # it has looked around
        desktop(page, address)
        page.until("document.body.innerText.includes('exploring')")
        driven = "parseFloat([...document.querySelectorAll('#facts div')].find("
        driven += "(one) => one.firstChild.textContent === 'driven').lastChild.textContent)"
        page.until(f"{driven} > 0.5")
        floor, _ = stretch(page, "floor")
        robot, size = stretch(page, "robot")
        assert size > 50
        assert stretch(page, "floor")[1] > 5000
        assert stretch(page, "scan")[1] > 200
        assert stretch(page, "plan")[1] > 50
        assert np.abs(robot - floor).max() < 600
        page.click("#follow")
        page.until("document.querySelector('#follow').getAttribute('aria-pressed') === 'true'")
        page.click("#zoom-out")
        page.until(f"{driven} > 1.0")
        assert stretch(page, "robot")[0] == pytest.approx(page.middle("#map"), abs=25)
        key = "new KeyboardEvent('keydown', {key: 'ArrowLeft', cancelable: true, altKey: %s})"
        press = f"!document.querySelector('#map').dispatchEvent({key})"
        assert not page.look(press % "true")  # back, for the browser
        assert page.look(press % "false")
        page.until("document.querySelector('#follow').getAttribute('aria-pressed') === 'false'")
        page.click("[data-request=pause]")
        page.until("document.querySelector('#headline').innerText.includes('paused')")
        page.until("document.querySelector('#answer').dataset.tone === 'good'")
        page.until("document.body.innerText.includes('0.00 m/s')")
        page.until("!document.querySelector('[data-request=resume]').disabled")
        page.click("[data-request=resume]")
        page.until("document.querySelector('#headline').innerText === 'exploring'")
        assert page.complaints == []


@pytest.mark.skipif("GVGBOT_PICTURES" not in os.environ, reason="no pictures are asked for")
@pytest.mark.timeout(1200)
def test_pictures_for_the_guide(page: Page, tmp_path: Path) -> None:
    """Takes some minutes: the robot has to have something to show."""
    endpoint, folder = free_endpoint(), Path(os.environ["GVGBOT_PICTURES"])
    settings = ["--set", f"telemetry.listen=[{endpoint}]"]
    with gvgbot("run", *settings, cwd=tmp_path), web("--connect", endpoint) as address:
        page.open(address, 1440, 1040, phone=False, dark=True)
        vertices = "parseInt([...document.querySelectorAll('#facts div')].find("
        vertices += "(one) => one.firstChild.textContent === 'map')?.lastChild.textContent)"
        page.until(f"{vertices} >= 9", patience_s=1000.0)
        (folder / "web.png").write_bytes(page.png())
        page.open(address, 390, 844, phone=True, dark=False)
        page.until(f"{vertices} >= 9")
        page.until("new Promise((done) => setTimeout(() => done(true), 3000))")
        (folder / "web-phone.png").write_bytes(page.png())
