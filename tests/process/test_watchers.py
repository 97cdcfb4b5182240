"""Many watchers of one robot, which drives as if there were none."""

import signal
import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import msgspec
import pytest
from websockets.sync.client import connect

from benchmarks.rigs.addresses import free_endpoint
from benchmarks.rigs.programs import gvgbot, until
from gvgbot import client
from gvgbot.client import State

pytestmark = pytest.mark.slow

PATIENCE = 60.0  # s, for a busy machine
WATCHERS = 10
KOBUKI_HZ = 50.0  # of its feedback, and so of the control loop
WINDOW = 50  # cycles over which the rate is taken


@contextmanager
def page(endpoint: str) -> Iterator[tuple["subprocess.Popen[str]", str]]:
    """The program that serves the page, and where its live values come from."""
    with gvgbot("web", "tester", "--port", "0", "--connect", endpoint) as process:
        assert process.stdout is not None
        address = process.stdout.readline().split("http://")[1].split("/")[0]
        yield process, f"ws://{address}/live"


def all_topics(robot: client.Robot) -> list[Callable[[], object]]:
    """Listens to everything; the newest value of each."""
    topics = (robot.state(), robot.scan(), robot.odometry(), robot.plan())
    return [lambda topic=topic: topic.latest for topic in topics]  # type: ignore[misc]


def keeps_its_rate(newest: Callable[[], State | None]) -> None:
    """Wait for a stretch without a lost cycle in twenty; what a busy machine spoils is tried again.

    A robot that its watchers hold up has no such stretch.
    """
    last: State | None = None

    def is_so() -> bool:
        nonlocal last
        now = newest()
        if last is None or now is None:
            last = now
        elif now.cycles - last.cycles >= WINDOW:
            rate = (now.cycles - last.cycles) / (now.stamp - last.stamp)
            last = now
            return rate > 0.95 * KOBUKI_HZ
        return False

    until(is_so, patience_s=PATIENCE)


def test_ten_watchers_and_a_page_cost_the_robot_no_cycle(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    settings = ["robot.name=tester", f"telemetry.listen=[{endpoint}]"]
    robot = ["run", "--out", str(tmp_path / "run")]
    with gvgbot(*robot, *(f"--set={one}" for one in settings)), ExitStack() as watching:
        watchers = [
            watching.enter_context(client.connect("tester", endpoint, patience_s=PATIENCE))
            for _ in range(WATCHERS)
        ]
        web, live = watching.enter_context(page(endpoint))
        viewer = watching.enter_context(connect(live, max_size=None, ping_interval=None))
        topics = [newest for watcher in watchers for newest in all_topics(watcher)]
        until(lambda: all(newest() is not None for newest in topics), patience_s=PATIENCE)
        kinds: set[str] = set()
        while not {"state", "map", "scan"} <= kinds:  # the map comes once a second
            kinds.add(msgspec.msgpack.decode(viewer.recv(PATIENCE, decode=False))[0])
        keeps_its_rate(lambda: watchers[0].state().latest)
        web.send_signal(signal.SIGSTOP)  # and from now on one of them takes nothing
        keeps_its_rate(lambda: watchers[0].state().latest)
        reached = watchers[0].state().latest
        assert reached is not None
        web.send_signal(signal.SIGCONT)
        for watcher in watchers:
            until(lambda seen=watcher: seen.state().latest.cycles >= reached.cycles)  # type: ignore[misc]
