"""What `gvgbot map diff` says and draws of two maps."""

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from gvgbot.atomic_files import write_files
from gvgbot.errors import UsageError
from gvgbot.maps.alignment import Comparison, Pair, compare
from gvgbot.maps.diff_picture import Grids, Titles, draw_diff
from gvgbot.maps.outputs import check_output
from gvgbot.maps.picture_files import PICTURES, Paint
from gvgbot.maps.saved_run import SavedRun
from gvgbot.maps.surface import S


def diff(a: Path, b: Path, out: Path | None, *, tolerance: float) -> tuple[bool, list[str]]:
    """Whether two runs left the same map, within the tolerance (m), and how they differ, in lines.

    With `out` a picture of both goes there. Raises UsageError if a run cannot be read, if both maps
    are empty, or no picture can go to `out`, GvgbotError if it cannot be written.
    """
    if out is not None and out.suffix.lower() not in PICTURES:
        raise UsageError(f"{out}: let its name end in {' or '.join(PICTURES)}")
    if out is not None:
        check_output(out)
    runs = (SavedRun.read(a), SavedRun.read(b))
    if not any(run.graph.vertices for run in runs):
        raise UsageError(f"neither {a} nor {b} has a vertex: there is nothing to compare")
    found = compare(runs[0].graph, runs[1].graph, tolerance)
    verdict = f"{'equal' if found.is_equal else 'different'} within {tolerance:g} m"
    names = (str(a), str(b))
    if out is not None:
        paint = _picture_of(found, (runs[0].grid, runs[1].grid), names, verdict)
        write_files(out.parent, {out.name: PICTURES[out.suffix.lower()](paint)})
    return found.is_equal, [*_lines(found, names), verdict]


def _picture_of(found: Comparison, grids: Grids, names: Titles, verdict: str) -> Paint:
    def paint(sheet: Callable[[int, int], S], /) -> S:
        return draw_diff(sheet, found, grids, names, verdict)

    return paint


def _lines(found: Comparison, names: tuple[str, str]) -> Iterator[str]:
    if found.vertices or found.edges:
        turn, shift = math.degrees(found.a_b.theta), math.hypot(found.a_b.x, found.a_b.y)
        yield f"aligned    {names[1]} was turned by {turn:z.1f} deg and moved by {shift:.2f} m"
    else:
        yield "aligned    not at all: they have nothing in common"
    yield f"vertices   {_shared(found.vertices)}"
    yield f"edges      {_shared(found.edges)}"
    for which, name in enumerate(names):
        for vertex in found.lone_vertices(which):
            x, y = vertex.position
            yield f"only in {name}: {vertex.kind} {vertex.id} at {x:.2f} {y:.2f} m"
        for edge in found.lone_edges(which):
            ends = f"from {edge.start} to {edge.end}"
            yield f"only in {name}: edge {ends} of {edge.length:.2f} m"


def _shared(pairs: Sequence[Pair]) -> str:
    if not pairs:
        return "none in both"
    apart = [distance for _, _, distance in pairs]
    return (
        f"{len(pairs)} in both, {np.median(apart):.3f} m apart (median), {max(apart):.3f} at most"
    )
