"""What the service manager and the log hear."""

import ctypes
import io
import json
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
import structlog

from gvgbot.autonomy.events import Decision, Finished, LoopClosed, Recovery, VertexAdded
from gvgbot.hal.messages import Battery
from gvgbot.journal import BatteryJournal, GuardJournal, log_event, status_line
from gvgbot.service import Notifier, set_up_logging
from tests.unit.test_telemetry import EXAMPLE


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.setblocking(False)
        yield manager


def heard(manager: socket.socket) -> list[bytes]:
    messages = []
    while True:
        try:
            messages.append(manager.recv(4096))
        except BlockingIOError:
            return messages


def test_a_service_manager_hears_one_datagram_for_each_message(manager: socket.socket) -> None:
    notifier = Notifier(manager.getsockname())
    notifier.ready()
    notifier.alive()
    notifier.stopping()
    assert heard(manager) == [b"READY=1", b"WATCHDOG=1", b"STOPPING=1"]


def test_a_status_is_sent_when_it_has_changed(manager: socket.socket) -> None:
    notifier = Notifier(manager.getsockname())
    for text in ("exploring", "exploring", "finished: große Halle"):
        notifier.status(text)
    assert heard(manager) == [b"STATUS=exploring", "STATUS=finished: große Halle".encode()]


def test_a_name_with_an_at_sign_is_an_abstract_one() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(f"\0gvgbot-test-{os.getpid()}")
        manager.setblocking(False)
        Notifier(f"@gvgbot-test-{os.getpid()}").ready()
        assert heard(manager) == [b"READY=1"]


def test_an_at_sign_within_a_path_is_part_of_it(tmp_path: Path) -> None:
    path = tmp_path / "gvgbot@2"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(path))
        manager.setblocking(False)
        Notifier(str(path)).ready()
        assert heard(manager) == [b"READY=1"]


def test_the_manager_is_found_in_the_environment(
    manager: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NOTIFY_SOCKET", manager.getsockname())
    Notifier.from_environment().ready()
    assert heard(manager) == [b"READY=1"]


@pytest.mark.parametrize("address", [None, "", "/nowhere/at/all"])
def test_a_manager_that_does_not_listen_is_no_trouble(address: str | None) -> None:
    notifier = Notifier(address)
    notifier.ready()
    notifier.alive()


def test_a_manager_that_is_too_slow_does_not_hold_up_the_robot(manager: socket.socket) -> None:
    notifier = Notifier(manager.getsockname())
    for _ in range(10_000):  # more than any queue takes
        notifier.alive()
    assert 0 < len(heard(manager)) < 10_000


# -- the log ---------------------------------------------------------------------------------------


@pytest.fixture
def _fresh_log() -> Iterator[None]:
    yield
    structlog.reset_defaults()


@pytest.mark.usefixtures("_fresh_log")
@pytest.mark.parametrize(("method", "prefix"), [("info", "<6>"), ("warning", "<4>")])
def test_a_journal_gets_json_with_its_severity(tmp_path: Path, method: str, prefix: str) -> None:
    path = tmp_path / "journal"
    with path.open("w") as stream:
        status = os.fstat(stream.fileno())
        set_up_logging(stream, {"JOURNAL_STREAM": f"{status.st_dev}:{status.st_ino}"})
        getattr(structlog.get_logger(), method)("laser lost", port="/dev/hokuyo", after_s=None)
    (line,) = path.read_text().splitlines()
    assert line.startswith(prefix)
    assert json.loads(line.removeprefix(prefix)) == {
        "event": "laser lost",
        "port": "/dev/hokuyo",
        "level": method,
    }


@pytest.mark.usefixtures("_fresh_log")
def test_a_terminal_that_a_service_has_opened_is_no_journal(tmp_path: Path) -> None:
    path = tmp_path / "terminal"
    with path.open("w") as stream:
        set_up_logging(stream, {"JOURNAL_STREAM": "8:1234"})
        structlog.get_logger().info("laser lost")
    assert "<6>" not in path.read_text()


@pytest.mark.usefixtures("_fresh_log")
def test_people_get_a_line_without_escapes_where_there_is_no_terminal() -> None:
    stream = io.StringIO()
    set_up_logging(stream, {})
    structlog.get_logger().info("laser lost", port="/dev/hokuyo")
    structlog.get_logger().debug("cycle")
    (line,) = stream.getvalue().splitlines()
    assert "laser lost" in line
    assert "port=/dev/hokuyo" in line
    assert "\x1b" not in line


class Watched(io.StringIO):
    """A terminal."""

    def isatty(self) -> bool:
        return True


@pytest.mark.usefixtures("_fresh_log")
@pytest.mark.parametrize(
    ("environment", "is_coloured"),
    [({}, True), ({"NO_COLOR": ""}, True), ({"NO_COLOR": "1"}, False)],
    ids=["as it is", "empty, which asks for nothing", "asked for none"],
)
def test_a_terminal_gets_colours_unless_somebody_wants_none(
    environment: dict[str, str], is_coloured: bool
) -> None:
    stream = Watched()
    set_up_logging(stream, environment)
    structlog.get_logger().info("laser lost", port="/dev/hokuyo")
    assert "laser lost" in stream.getvalue()
    assert ("\x1b[" in stream.getvalue()) == is_coloured


class HungUp(io.StringIO):
    def write(self, text: str) -> int:
        raise OSError(5, "Input/output error")


@pytest.mark.usefixtures("_fresh_log")
def test_a_terminal_that_is_gone_does_not_end_the_robot() -> None:
    set_up_logging(HungUp(), {})
    structlog.get_logger().info("still here")


@pytest.mark.usefixtures("_fresh_log")
def test_a_log_that_nobody_reads_does_not_hold_up_the_robot() -> None:
    """As after Ctrl-S in its terminal, or behind a pager. What was left out is owned up to."""
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb", buffering=0) as reader, os.fdopen(writing, "w") as stream:
        status = os.fstat(stream.fileno())
        set_up_logging(stream, {"JOURNAL_STREAM": f"{status.st_dev}:{status.st_ino}"})
        for number in range(2000):
            structlog.get_logger().info("vertex added", vertex=number)
        before = reader.read(1_000_000).splitlines()
        structlog.get_logger().info("still here")
        structlog.get_logger().info("as ever")
        one, other = (json.loads(line[3:]) for line in reader.read(1000).splitlines())
    assert 0 < len(before) < 2000
    assert one == {"event": "still here", "missing": 2000 - len(before), "level": "info"}
    assert other == {"event": "as ever", "level": "info"}


def test_what_happens_is_logged_but_for_details() -> None:
    with structlog.testing.capture_logs() as logs:
        log_event(VertexAdded(1.0, 3, "meetpoint", 1.234, 5.678, 3, 1.0))
        log_event(Decision(1.0, 3, 0.5, "nearest frontier"))
        log_event(LoopClosed(2.0, 3, 25.04, 1.0, 0.1, 0.9))
        log_event(Recovery(3.0, "look around", "no edge in sight"))
        log_event(Finished(4.0, "explored", "no frontier is left"))
    events = [log["event"] for log in logs]
    assert events == ["vertex added", "loop closed", "recovery", "finished"]
    assert (logs[0]["vertex"], logs[0]["x"], logs[0]["y"]) == (3, 1.23, 5.68)


@pytest.mark.parametrize(
    ("outcome", "level"),
    [
        ("explored", "info"),
        ("explored_with_blocked", "info"),
        ("stopped", "info"),
        ("failed", "error"),
    ],
)
def test_an_exploration_that_failed_is_an_error(outcome: str, level: str) -> None:
    with structlog.testing.capture_logs() as logs:
        log_event(Finished(4.0, outcome, "as it is"))
    assert [log["log_level"] for log in logs] == [level]


def guard_lines(reasons: list[tuple[float, str | None]]) -> list[tuple[str, str]]:
    journal = GuardJournal()
    with structlog.testing.capture_logs() as logs:
        for stamp, reason in reasons:
            journal.note(reason, stamp)
    return [(log["event"], log.get("reason") or log["was"]) for log in logs]


def every_cycle(start: float, end: float, reason: str | None) -> list[tuple[float, str | None]]:
    return [(start + 0.02 * i, reason) for i in range(round((end - start) / 0.02))]


def test_a_stop_and_its_end_are_a_line_each_however_long_it_lasts() -> None:
    cycles = [
        *every_cycle(0, 2, None),
        *every_cycle(2, 9, "bumper"),
        *every_cycle(9, 12, None),
    ]
    assert guard_lines(cycles) == [("guard stopped", "bumper"), ("guard released", "bumper")]


@pytest.mark.parametrize("reason", ["bumper", "cliff"])
def test_what_is_felt_and_does_not_go_away_needs_somebody(reason: str) -> None:
    journal, needed = GuardJournal(), []
    cycles = [*every_cycle(0, 12, reason), *every_cycle(12, 14, None), *every_cycle(14, 20, reason)]
    with structlog.testing.capture_logs() as logs:
        for stamp, now in cycles:
            journal.note(now, stamp)
            needed.append(journal.needs_somebody)
    stuck = [log for log in logs if log["event"] == "robot is stuck"]
    assert [log["log_level"] for log in stuck] == ["warning"]
    assert reason in stuck[0]["remedy"]
    assert [stamp for (stamp, _), is_so in zip(cycles, needed, strict=True) if is_so] == (
        pytest.approx([stamp for stamp, _ in cycles if 10 < stamp < 12], abs=0.02)
    )


def test_slowing_down_and_short_stops_before_obstacles_are_no_news() -> None:
    cycles = [
        *every_cycle(0, 5, "obstacle near"),
        *every_cycle(5, 5.5, "obstacle"),
        *every_cycle(5.5, 8, None),
    ]
    assert guard_lines(cycles) == []


def test_an_obstacle_that_keeps_the_robot_is_news() -> None:
    assert guard_lines(every_cycle(0, 5, "obstacle")) == [("guard stopped", "obstacle")]


def test_a_stop_that_flickers_is_said_once() -> None:
    cycles: list[tuple[float, str | None]] = []
    for i in range(10):
        cycles += [(0.4 * i, "cliff"), (0.4 * i + 0.2, None)]
    assert guard_lines(cycles) == [("guard stopped", "cliff")]


def battery_lines(charges: list[float], *, charging_from: int | None = None) -> list[str]:
    """What is said of a charge a second."""
    journal = BatteryJournal()
    with structlog.testing.capture_logs() as logs:
        for stamp, charge in enumerate(charges):
            charging = charging_from is not None and stamp >= charging_from
            journal.note(Battery(float(stamp), 13.2, charge, charging), float(stamp))
    assert all(log["log_level"] == "warning" for log in logs)
    return [log["event"] for log in logs]


def test_a_battery_that_runs_down_is_told_of_twice() -> None:
    assert battery_lines([1.0 - second / 600 for second in range(601)]) == [
        "battery low",
        "battery empty",
    ]


def test_a_battery_that_is_low_while_motors_start_is_no_news() -> None:
    assert battery_lines(20 * [0.15, 0.15, 0.15, 0.15, 0.3]) == []


def test_a_battery_that_was_charged_is_told_of_anew() -> None:
    low, full = 30 * [0.1], 30 * [0.9]
    assert battery_lines(low + full + low) == ["battery low", "battery low"]
    assert battery_lines(low + low, charging_from=30) == ["battery low"]


def test_an_unknown_battery_is_no_news() -> None:
    with structlog.testing.capture_logs() as logs:
        BatteryJournal().note(None, 1.0)
    assert logs == []


def test_the_status_says_what_counts() -> None:
    assert status_line(EXAMPLE) == "exploring: 3 vertices, 4 frontiers"


@pytest.mark.parametrize(
    ("now", "said"),
    [
        ({"guard": "wheel drop"}, "exploring: wheel drop"),
        ({"guard": "obstacle near"}, "exploring: 3 vertices"),
        ({"phase": "errand", "errand": "home", "reason": "all explored"}, "home: all explored"),
        (
            {
                "phase": "errand",
                "errand": "home",
                "reason": "all explored",
                "guard": "over-current",
            },
            "home: over-current",
        ),
        ({"phase": "halted", "reason": "no laser: gone", "guard": "no scan"}, "halted: no laser"),
    ],
)
def test_the_status_says_why_the_robot_needs_somebody(now: dict[str, Any], said: str) -> None:
    assert status_line(msgspec.structs.replace(EXAMPLE, **now)).startswith(said)


def test_the_status_says_what_is_felt_and_does_not_go_away() -> None:
    now = msgspec.structs.replace(EXAMPLE, guard="bumper")
    assert status_line(now, needs_somebody=False).startswith("exploring: 3 vertices")
    assert status_line(now, needs_somebody=True).startswith("exploring: bumper; 3 vertices")


_LARGE_ARRAYS = """
import ctypes
import numpy as np
from gvgbot.service import give_back_large_arrays

class Statistics(ctypes.Structure):
    names = "arena ordblks smblks hblks hblkhd usmblks fsmblks uordblks fordblks keepcost"
    _fields_ = [(name, ctypes.c_size_t) for name in names.split()]

mallinfo2 = ctypes.CDLL(None).mallinfo2
mallinfo2.restype = Statistics
give_back_large_arrays()
np.ones(20_000_000, np.uint8)
before = mallinfo2().hblkhd  # bytes in arrays that malloc has got from the system one by one
array = np.ones(6_000_000, np.uint8)
print(mallinfo2().hblkhd - before >= len(array))
"""


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallinfo2"), reason="another C library")
def test_a_large_array_is_got_from_the_system_even_if_a_larger_one_has_been_freed() -> None:
    """In a process of its own: here the heap may have room for it."""
    ran = subprocess.run([sys.executable, "-c", _LARGE_ARRAYS], capture_output=True, check=True)
    assert ran.stdout == b"True\n"
