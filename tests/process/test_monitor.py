"""`gvgbot monitor` on a pseudo-terminal, read by a terminal emulator that is not ours.

With GVGBOT_PICTURES=docs/images a test leaves monitor.png there.
"""

import fcntl
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from select import select

import msgspec
import pyte
import pytest
from rich.console import Console
from rich.text import Text

from benchmarks.rigs.addresses import free_endpoint, router
from gvgbot import client
from gvgbot.telemetry import Telemetry
from gvgbot.telemetry_config import TelemetryConfig
from gvgbot.topics import (
    Event,
    Events,
    Plan,
)
from tests.process.browser import browser, chromium
from tests.unit.monitor.maps import a_grid, a_map, vertex
from tests.unit.test_telemetry import EXAMPLE

pytestmark = pytest.mark.slow

PATIENCE = 30.0  # s, for a busy machine
ALTERNATE_ON, ALTERNATE_OFF = "\x1b[?1049h", "\x1b[?1049l"
AT_A_TERMINAL = """
import fcntl, runpy, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)  # so that Ctrl-C is for it
runpy.run_module("gvgbot", run_name="__main__")
"""
SHOW_CURSOR = "\x1b[?25h"


@dataclass
class Seat:
    """A person at a terminal of 80 x 24 that runs the monitor."""

    process: "subprocess.Popen[bytes]"
    terminal: int
    before: list[object]
    screen: pyte.Screen = field(default_factory=lambda: pyte.Screen(80, 24))
    received: str = ""

    def __post_init__(self) -> None:
        self._stream = pyte.ByteStream(self.screen)

    def read(self, wait_s: float = 0.1) -> None:
        while select([self.terminal], [], [], wait_s)[0]:
            try:
                data = os.read(self.terminal, 65536)
            except OSError:  # nobody has the other end open any more
                return
            self._stream.feed(data)
            self.received += data.decode(errors="replace")  # a sign may be cut in two
            wait_s = 0.0

    def until(self, is_so: Callable[[str], bool]) -> str:
        """The text of the screen as soon as it is as wanted."""
        end = time.perf_counter() + PATIENCE
        while not is_so(text := "\n".join(self.screen.display)):
            assert time.perf_counter() < end, text
            self.read()
        return text

    def until_shown(self, words: str) -> str:
        return self.until(lambda text: words in text)

    def resize(self, width: int, height: int) -> None:
        self.screen.resize(height, width)
        set_size(self.terminal, width, height)
        self.process.send_signal(signal.SIGWINCH)

    def left(self) -> int:
        """The exit status; the terminal is as it was before."""
        end = time.perf_counter() + PATIENCE
        while self.process.poll() is None and time.perf_counter() < end:
            self.read()
        self.read()
        assert self.received.rindex(ALTERNATE_OFF) > self.received.rindex(ALTERNATE_ON)
        assert SHOW_CURSOR in self.received[self.received.rindex(ALTERNATE_ON) :]
        assert termios.tcgetattr(self.terminal) == self.before
        assert self.process.returncode is not None
        return self.process.returncode


def set_size(terminal: int, width: int, height: int) -> None:
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", height, width, 0, 0))


@contextmanager
def monitor(*arguments: str) -> Iterator[Seat]:
    ours, theirs = pty.openpty()
    set_size(ours, 80, 24)
    environment = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "LINES")}
    with subprocess.Popen(
        [sys.executable, "-c", AT_A_TERMINAL, "monitor", *arguments],
        start_new_session=True,
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        env=environment | {"TERM": "xterm-256color", "LC_ALL": "C.UTF-8"},
    ) as process:
        seat = Seat(process, ours, termios.tcgetattr(ours))
        try:
            yield seat
        finally:
            process.kill()
            os.close(ours)
            os.close(theirs)


def a_robot(endpoint: str, name: str = "karl") -> Telemetry:
    robot = Telemetry(TelemetryConfig(listen=(endpoint,)), name)
    robot.publish(msgspec.structs.replace(EXAMPLE, reason="", pose=(3.0, 2.0, 0.0)))
    drawing = "\n".join(["#" * 20, *["#" + "." * 18 + "#"] * 8, "#" * 20])
    robot.publish(a_grid(drawing, resolution=0.5))
    robot.publish(a_map((vertex((6.0, 2.0)),)))
    plan = Plan(stamp=3.0, vertex=1, bearing=0.0, reason="ear", track=b"", route=b"")
    robot.publish(plan)
    decision = Event(
        number=0,
        stamp=3.0,
        kind="decision",
        details={"vertex": 1, "bearing": 0.0, "reason": "ear"},
    )
    robot.publish(Events(events=(decision,)))
    return robot


@pytest.mark.parametrize("way_out", ["q", "Q", "\x03"])
def test_a_person_watches_a_robot_and_leaves(endpoint: str, way_out: str) -> None:
    with a_robot(endpoint), monitor("karl", "--connect", endpoint) as seat:
        wanted = ("go to vertex 1", "pose      3.00 2.00 m  0°", "⣿⣿", "●")
        text = seat.until(lambda text: all(words in text for words in wanted))
        (row,) = [
            line[:48] for line in text.split("\n") if "→" in line[:48] and "robot" not in line
        ]
        assert row.index("→") < row.index("●")  # it looks at the vertex, which is ahead
        os.write(seat.terminal, b"x")  # means nothing
        os.write(seat.terminal, way_out.encode())
        assert seat.left() == 0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_leaves_the_terminal_as_it_was(endpoint: str, number: signal.Signals) -> None:
    with monitor("--connect", endpoint) as seat:
        seat.until_shown(f"nobody answers at {endpoint}")
        seat.process.send_signal(number)
        assert seat.left() == 0


def test_the_only_robot_need_not_be_named_and_its_end_is_said(endpoint: str) -> None:
    with monitor("--connect", endpoint) as seat:
        seat.until_shown("nobody answers")
        robot = a_robot(endpoint)
        with robot:
            seat.until_shown(" karl  exploring")
            seat.until_shown("quiet for")
        text = seat.until_shown("robot gone for")
        assert "driven    31.5 m" in text  # what was known last remains
        with a_robot(endpoint):
            seat.until_shown(" karl  exploring")
        os.write(seat.terminal, b"q")
        assert seat.left() == 0


def test_a_robot_that_is_not_there_is_told_from_those_that_are(endpoint: str) -> None:
    with a_robot(endpoint, "otto"), monitor("karl", "--connect", endpoint) as seat:
        seat.until_shown("no robot named karl here; there is otto")
        os.write(seat.terminal, b"q")
        assert seat.left() == 0


def test_of_several_robots_one_has_to_be_named(endpoint: str) -> None:
    def joining(name: str) -> Telemetry:
        return Telemetry(TelemetryConfig(listen=(free_endpoint(),), connect=(endpoint,)), name)

    with (
        router(endpoint),
        joining("karl"),
        joining("otto"),
        client.connect("otto", endpoint) as seen,
    ):
        while seen.others() != ["karl", "otto"]:
            pass
        with monitor("--connect", endpoint) as seat:
            assert seat.left() == 2
            seat.until_shown("there are several robots: karl, otto")


def test_the_picture_fits_the_terminal_as_it_changes_its_size(endpoint: str) -> None:
    with a_robot(endpoint), monitor("karl", "--connect", endpoint) as seat:
        seat.until_shown("battery")
        for width, height in [(120, 40), (60, 16), (40, 10), (80, 24)]:
            seat.resize(width, height)
            seat.until(lambda text: text.startswith(" karl  ") and text.rstrip().endswith("q quit"))
        seat.until_shown("battery")
        os.write(seat.terminal, b"q")
        assert seat.left() == 0


def run(*arguments: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    """The monitor without a terminal."""
    return subprocess.run(
        [sys.executable, "-m", "gvgbot", "monitor", *arguments],
        check=False,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        env=os.environ | environment,
    )


def test_without_a_terminal_it_says_so_in_one_line() -> None:
    done = run()
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert "terminal" in line


@pytest.mark.parametrize("arguments", [("a/b",), ("karl", "--connect", "here")])
def test_a_name_or_an_address_that_cannot_be_is_one_line(arguments: tuple[str, ...]) -> None:
    done = run(*arguments)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert arguments[-1] in line


# -- a picture -------------------------------------------------------------------------------------


def styled(screen: pyte.Screen) -> Text:
    """What is on the screen, with its colours."""

    def colour(name: str) -> str:
        return name if name.isalpha() else f"#{name}"

    text = Text()
    for row in range(screen.lines):
        for column in range(screen.columns):
            sign = screen.buffer[row][column]
            words = ["bold"] * sign.bold + ["reverse"] * sign.reverse
            text.append(sign.data, " ".join([*words, f"{colour(sign.fg)} on {colour(sign.bg)}"]))
        text.append("\n")
    return text


def drawn(screen: pyte.Screen) -> str:
    """An SVG of the screen."""
    console = Console(record=True, width=screen.columns, file=StringIO(), color_system="truecolor")
    console.print(styled(screen), end="")
    return console.export_svg(title="gvgbot monitor")


@pytest.mark.skipif("GVGBOT_PICTURES" not in os.environ, reason="no pictures are asked for")
@pytest.mark.timeout(1200)
def test_a_picture_for_the_guide(endpoint: str, tmp_path: Path) -> None:
    """Takes some minutes: the robot has to have something to show."""
    program, folder = chromium(), Path(os.environ["GVGBOT_PICTURES"])
    assert program is not None
    settings = ["--set", f"telemetry.listen=[{endpoint}]", "--out", str(tmp_path / "run")]
    with (
        subprocess.Popen([sys.executable, "-m", "gvgbot", "run", *settings]) as robot,
        monitor("--connect", endpoint) as seat,
    ):
        seat.resize(100, 30)
        while not re.search(r"vertices +(9|\d\d)", "\n".join(seat.screen.display)):
            seat.read(1.0)
        picture = tmp_path / "monitor.svg"
        picture.write_text(drawn(seat.screen), encoding="utf-8")
        robot.terminate()
    with browser(program, tmp_path / "browser") as page:
        page.open(picture.as_uri(), 1000, 640, phone=False, dark=True)
        (folder / "monitor.png").write_bytes(page.png())
