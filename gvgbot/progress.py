"""One line on a terminal that says how far an exploration is; silent when nobody watches."""

import os
import sys
import time

from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.words import counted

_BAR = 20  # characters
_EVERY = 0.1  # s of wall time between two drawings


class Progress:
    """Draws the line on stderr if that is a terminal."""

    def __init__(self) -> None:
        self._shown = sys.stderr.isatty()
        self._start = time.perf_counter()
        self._drawn = 0.0
        self._first_stamp: float | None = None

    def show(self, pipeline: Pipeline, stamp: float) -> None:
        """Redraw the line at a stamp of the robot's clock, s, unless that was done just now."""
        if not self._shown:
            return
        if self._first_stamp is None:
            self._first_stamp = stamp
        wall = time.perf_counter() - self._start
        if wall - self._drawn > _EVERY:
            self._drawn = wall
            self._write(_line(pipeline, stamp - self._first_stamp, wall))

    def clear(self) -> None:
        """Leave the line empty for what is printed next."""
        if self._shown:
            self._write("")

    @staticmethod
    def _write(text: str) -> None:
        columns = os.get_terminal_size(sys.stderr.fileno()).columns or len(text) + 1  # 0: unknown
        sys.stderr.write(f"\r\x1b[K{text[: columns - 1]}")  # a line that wraps stays for good
        sys.stderr.flush()


def _line(pipeline: Pipeline, simulated: float, wall: float) -> str:
    graph = pipeline.mapper.graph
    ends = sum(vertex.degree for vertex in graph.vertices.values())
    frontiers = len(graph.frontiers())
    full = round(_BAR * (1 - frontiers / ends)) if ends else 0
    return (
        f"[{'#' * full}{'.' * (_BAR - full)}] "
        f"{counted(len(graph.vertices), 'vertex', 'vertices')}, {counted(frontiers, 'frontier')}, "
        f"{pipeline.past.travelled:.0f} m, {simulated:.0f} s, {simulated / max(wall, 1e-3):.0f}x"
    )
