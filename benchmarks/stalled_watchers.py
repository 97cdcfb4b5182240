"""What watchers that stall, routers that go away and robots that die cost; takes three minutes.

Run: python -m benchmarks.stalled_watchers [SECONDS]

A daemon on twins, in a process of its own, joined by a router to two watchers in processes of
theirs: one that is stopped for so long (60 s), and one whose reader hangs while its network goes
on. Counted are the control cycles that were lost or late meanwhile, and by how much the daemon's
memory grew while the robot was paused; the same without watchers tells what the machine itself
does. Then the router is killed and started again, and the robot is killed.
"""

import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from benchmarks.report import report, report_fact
from benchmarks.rigs.addresses import free_endpoint
from benchmarks.rigs.programs import program
from gvgbot import client
from gvgbot.client import Health, Robot

KOBUKI_HZ = 50.0
SETTLING_S = 15.0
ROUTER = """
import sys, threading, zenoh
from gvgbot.zenoh_config import session_config
with zenoh.open(session_config({"mode": "router", "listen/endpoints": [sys.argv[1]]})):
    print("there", flush=True)
    threading.Event().wait()
"""
WATCHER = """
import sys, threading
from gvgbot import client
with client.connect("bench", sys.argv[1], patience_s=60.0) as robot:
    for topic in (robot.scan, robot.odometry, robot.grid, robot.trajectory, robot.health):
        topic()
    next(iter(robot.state()))
    print("there", flush=True)
    hang = sys.argv[2] == "hang"
    for state in robot.state():
        while hang:
            threading.Event().wait(1.0)
"""


@contextmanager
def daemon(out: str, own: str, router: str) -> Iterator["subprocess.Popen[bytes]"]:
    settings = ["robot.name=bench", f"telemetry.listen=[{own}]", f"telemetry.connect=[{router}]"]
    command = [sys.executable, "-m", "gvgbot", "run", "--out", out]
    command += [f"--set={one}" for one in settings]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        try:
            yield process
        finally:
            process.kill()


def wait_for(is_so: Callable[[], bool], patience_s: float = 60.0) -> float:
    """Seconds until something is so."""
    begin = time.perf_counter()
    while not is_so():
        if time.perf_counter() > begin + patience_s:
            raise TimeoutError
        time.sleep(0.01)  # noqa: TID251  # a program of its own
    return time.perf_counter() - begin


def newest(robot: Robot) -> Health:
    health = robot.health().latest
    assert health is not None
    return health


def stretch(robot: Robot, name: str, seconds: float) -> None:
    """Report how the daemon fared for so long."""
    before = newest(robot)
    time.sleep(seconds)  # noqa: TID251  # as above
    after = newest(robot)
    due = KOBUKI_HZ * (after.stamp - before.stamp)
    lost = 100 * (1 - (after.cycles - before.cycles) / due)
    report_fact(f"{name}: cycles lost", lost, "%")
    report_fact(f"{name}: cycles late", float(after.late_cycles - before.late_cycles), "")
    report_fact(f"{name}: memory grown", (after.memory - before.memory) / 1e6, "MB")
    report_fact(f"{name}: samples not sent", float(after.unsent - before.unsent), "")


def main(seconds: float) -> None:
    own, through = free_endpoint(), free_endpoint()
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        robot = stack.enter_context(daemon(str(Path(folder) / "run"), own, through))
        near = stack.enter_context(client.connect("bench", own, patience_s=60.0))
        near.health()
        wait_for(lambda: near.health().latest is not None)
        time.sleep(SETTLING_S)  # noqa: TID251  # as above
        near.pause().result()  # a map that grows takes memory of its own
        stretch(near, "nobody stalled", seconds / 2)
        with program(ROUTER, through) as router, ExitStack() as watchers:
            stopped = watchers.enter_context(program(WATCHER, through, "read"))
            watchers.enter_context(program(WATCHER, through, "hang"))
            stopped.send_signal(signal.SIGSTOP)
            stretch(near, "one watcher stopped, one hanging", seconds)
            stopped.send_signal(signal.SIGCONT)
            far = stack.enter_context(client.connect("bench", through, patience_s=60.0))
            wait_for(lambda: far.presence.word == "alive")
            router.kill()
            report_fact(
                "router killed, noticed", wait_for(lambda: far.presence.word != "alive"), "s"
            )
        begin = time.perf_counter()
        with program(ROUTER, through):
            wait_for(lambda: far.presence.word == "alive")
            report_fact("router started again, robot seen", time.perf_counter() - begin, "s")
            robot.kill()
            seen = wait_for(lambda: near.presence.word == "gone")
            report("robot killed, noticed", seen, "s", at_most=3.0)


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 60.0)
