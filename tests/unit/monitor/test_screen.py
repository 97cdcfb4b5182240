"""What a terminal shows, as a terminal emulator that is not ours makes it of our output."""

import io
from dataclasses import replace

import msgspec
import numpy as np
import pyte
import pytest
from rich.console import Console

from gvgbot.client import Event
from gvgbot.monitor.chart import Scene
from gvgbot.monitor.facts import Fact
from gvgbot.monitor.screen import Picture, Screen
from gvgbot.topics import Mate
from tests.unit.monitor.maps import a_floor, a_map, vertex
from tests.unit.test_telemetry import EXAMPLE

ALIVE = Fact("karl", "alive", "good")
CORRIDOR = Scene(
    a_map((vertex((5.0, 5.0)),)),
    a_floor("\n".join(["#" * 40, *["." * 40] * 8, "#" * 40]), resolution=0.5),
    [np.array([[1.0, -2.0]])],
    pose=EXAMPLE.pose,
)
EVENTS = tuple(
    Event(number=n, stamp=float(n), kind="recovery", details={"action": f"try {n}", "reason": "?"})
    for n in range(12)
)
PICTURE = Picture(ALIVE, EXAMPLE, CORRIDOR, EVENTS)


class Terminal:
    """Our output, and what it looks like."""

    def __init__(self, width: int, height: int) -> None:
        self.written = io.StringIO()
        self.console = Console(
            file=self.written,
            force_terminal=True,
            color_system="256",
            width=width,
            height=height,
            legacy_windows=False,
            _environ={},
        )
        self.screen = Screen(self.console)
        self.emulator = pyte.Screen(width, height)
        self.stream = pyte.Stream(self.emulator)

    def show(self, picture: Picture) -> list[str]:
        """The lines on the screen; what was written for them is in `sent`."""
        self.written.seek(0)
        self.written.truncate()
        self.screen.show(picture)
        self.sent = self.written.getvalue()
        self.stream.feed(self.sent)
        return list(self.emulator.display)

    def resize(self, width: int, height: int) -> None:
        self.console.size = (width, height)
        self.emulator.resize(height, width)


SIZES = [(80, 24), (160, 50), (200, 60), (60, 15), (45, 12), (30, 8), (20, 4), (10, 2), (1, 1)]


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_a_picture_fills_a_terminal_of_any_size_and_never_scrolls_it(
    width: int, height: int
) -> None:
    lines = PICTURE.lines(width, height)
    assert len(lines) == height
    assert {line.cell_len for line in lines} == {width}
    shown = Terminal(width, height).show(PICTURE)
    assert shown == [line.plain for line in lines]


def test_the_usual_terminal_shows_everything() -> None:
    shown = Terminal(80, 24).show(PICTURE)
    text = "\n".join(shown)
    assert shown[0].startswith(" karl  alive")
    assert shown[-1].rstrip().endswith("q quit")
    for fact in (
        "phase",
        "going to",
        "why",
        "pose",
        "sigma",
        "battery",
        "laser",
        "base",
        "control",
        "program",
    ):
        assert any(line[49:].startswith(fact) for line in shown), fact
    assert "try 11: ?" in text
    assert "●" in "".join(line[:48] for line in shown[1:17])


def test_the_usual_terminal_shows_where_the_others_of_a_team_are() -> None:
    team = tuple(Mate(name=name, pose=(3.0, -4.0, 0.0)) for name in ("anna", "bert", "carl"))
    ended = msgspec.structs.replace(EXAMPLE, team=team, phase="finished", outcome="explored")
    shown = Terminal(80, 24).show(replace(PICTURE, state=ended))
    for fact in ("outcome", "frontiers", "anna", "bert", "carl", "laser", "base", "control"):
        assert any(line[49:].startswith(fact) for line in shown), fact


def test_a_small_terminal_shows_what_matters_most() -> None:
    shown = Terminal(40, 12).show(PICTURE)
    for fact in ("phase", "going to", "why", "frontiers", "battery", "guard"):
        assert any(line.startswith(fact) for line in shown), fact


def test_a_long_name_leaves_room_for_what_the_robot_does() -> None:
    headline = Fact("turtlebot2-of-the-third-floor-in-the-east-wing", "robot gone", "bad")
    head = Terminal(40, 12).show(replace(PICTURE, headline=headline))[0]
    assert head.startswith(" turtlebot2")
    assert head.rstrip().endswith("robot gone")


def test_a_terminal_that_is_too_narrow_for_the_map_says_so() -> None:
    told = "the map needs 52 columns"
    assert Terminal(40, 12).show(PICTURE)[-1] == told.ljust(34) + "q quit"
    assert Terminal(20, 12).show(PICTURE)[-1] == "the map need… q quit"
    for width, is_told in ((51, True), (52, False)):
        lines = Terminal(width, 12).show(PICTURE)
        assert (told in lines[-1]) == is_told
        assert ("●" in "".join(lines[1:9])) == (not is_told)


def test_the_place_of_a_robot_with_a_long_name_is_there_whole() -> None:
    team = (Mate(name="a-robot-with-a-very-long-name", pose=(-123.45, -67.89, 0.0)),)
    picture = replace(PICTURE, state=msgspec.structs.replace(EXAMPLE, team=team))
    assert any(" -123.45 -67.89 m" in line for line in Terminal(80, 50).show(picture))


def test_the_newest_events_are_those_that_are_shown() -> None:
    text = "\n".join(Terminal(80, 24).show(PICTURE))
    assert [n for n in range(12) if f"try {n}: " in text] == [7, 8, 9, 10, 11]


def test_only_lines_that_have_changed_are_sent_again() -> None:
    terminal = Terminal(80, 24)
    first = terminal.show(PICTURE)
    whole = len(terminal.sent)
    assert terminal.show(PICTURE) == first
    assert terminal.sent == ""
    farther = replace(PICTURE, state=msgspec.structs.replace(EXAMPLE, distance=31.6))
    then = terminal.show(farther)
    changed = [row for row in range(24) if then[row] != first[row]]
    assert [then[row][49:].split() for row in changed] == [["driven", "31.6", "m"]]
    assert len(terminal.sent) < whole / 10


def test_a_resized_terminal_is_drawn_anew() -> None:
    terminal = Terminal(80, 24)
    terminal.show(PICTURE)
    terminal.resize(100, 30)
    assert terminal.show(PICTURE) == Terminal(100, 30).show(PICTURE)
    terminal.resize(50, 14)
    assert terminal.show(PICTURE) == Terminal(50, 14).show(PICTURE)


def test_old_values_are_faint() -> None:
    terminal = Terminal(80, 24)
    terminal.show(replace(PICTURE, is_fresh=False))
    row = next(n for n, line in enumerate(terminal.emulator.display) if "contacts" in line)
    fresh = Terminal(80, 24)
    fresh.show(PICTURE)
    assert fresh.emulator.buffer[row][59].fg == "brown"  # as yellow is called there: one contact
    assert terminal.emulator.buffer[row][59].fg != "brown"


def test_before_anything_is_known_there_is_a_headline_and_the_way_out() -> None:
    shown = Terminal(80, 24).show(Picture(Fact("gvgbot", "nobody answers", "bad")))
    assert shown[0].startswith(" gvgbot  nobody answers")
    assert "q quit" in shown[-1]
