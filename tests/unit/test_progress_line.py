"""The line that says how far an exploration is keeps to the terminal that it is drawn on."""

import fcntl
import os
import struct
import sys
import termios
import time
from types import SimpleNamespace
from typing import Any

import pytest

from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.config import load_config
from gvgbot.progress import Progress

BEGINNING = "[....................] 0 vertices, 0 frontiers, 0 m"


@pytest.mark.parametrize(
    ("columns", "shown"), [(40, BEGINNING[:39]), (80, BEGINNING), (0, BEGINNING)]
)
def test_the_line_never_wraps(columns: int, shown: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """What has wrapped cannot be drawn over: one line more would stay each time."""
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    line = drawn(pipeline, columns, monkeypatch)
    assert line.startswith(shown)
    assert columns == 0 or len(line) < columns


def test_the_bar_is_the_share_of_ways_out_of_vertices_that_are_explored(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    vertices = {0: SimpleNamespace(degree=3), 1: SimpleNamespace(degree=1)}
    graph = SimpleNamespace(vertices=vertices, frontiers=lambda: ["one of four"])
    past = SimpleNamespace(travelled=12.4)
    line = drawn(SimpleNamespace(mapper=SimpleNamespace(graph=graph), past=past), 80, monkeypatch)
    assert line.startswith(f"[{15 * '#'}{5 * '.'}] 2 vertices, 1 frontier, 12 m")


def drawn(pipeline: Any, columns: int, monkeypatch: pytest.MonkeyPatch) -> str:
    """What a terminal of so many columns is sent."""
    monkeypatch.setattr(time, "perf_counter", iter((0.0, 1.0)).__next__)
    here, there = os.openpty()
    fcntl.ioctl(there, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    with os.fdopen(there, "w") as terminal:
        monkeypatch.setattr(sys, "stderr", terminal)
        Progress().show(pipeline, 0.0)
        line = os.read(here, 1000).decode().removeprefix("\r\x1b[K")
        os.close(here)
    return line
