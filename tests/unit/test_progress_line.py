"""The line that says how far an exploration is keeps to the terminal that it is drawn on."""

import fcntl
import os
import struct
import sys
import termios
import time

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
    monkeypatch.setattr(time, "perf_counter", iter((0.0, 1.0)).__next__)
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    here, there = os.openpty()
    fcntl.ioctl(there, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    with os.fdopen(there, "w") as terminal:
        monkeypatch.setattr(sys, "stderr", terminal)
        Progress().show(pipeline, 0.0)
        drawn = os.read(here, 1000).decode().removeprefix("\r\x1b[K")
        os.close(here)
    assert drawn.startswith(shown)
    assert columns == 0 or len(drawn) < columns
