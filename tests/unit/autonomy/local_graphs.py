"""Local GVGs drawn by hand."""

from itertools import pairwise

import numpy as np

from gvgbot.autonomy.gvg.local import Branch, LocalEdge, LocalGvg, LocalNode
from gvgbot.geometry import Array

Point = tuple[float, float]


def drawn(
    points: dict[int, Point],
    lines: dict[int, tuple[int, int, list[Point]]],
    *,
    clearance: float = 1.0,
    unseen: dict[int, float] | None = None,
) -> LocalGvg:
    """Nodes at points, edges by way of corners; `unseen`: where the graph goes on, and whither."""
    edges = {
        key: _edge(a, b, [points[a], *corners, points[b]], clearance)
        for key, (a, b, corners) in lines.items()
    }
    nodes = {
        node: LocalNode(
            np.array(point),
            clearance,
            (unseen or {}).get(node),
            _branches(node, edges),
            frozenset(),
        )
        for node, point in points.items()
    }
    return LocalGvg(nodes, edges)


def _branches(node: int, edges: dict[int, LocalEdge]) -> tuple[Branch, ...]:
    starts = [Branch(key, forward=True) for key, edge in edges.items() if edge.a == node]
    return (*starts, *(Branch(key, forward=False) for key, e in edges.items() if e.b == node))


def _edge(a: int, b: int, corners: list[Point], clearance: float) -> LocalEdge:
    line = resampled(corners)
    stations = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    return LocalEdge(a, b, line, np.full(len(line), clearance), stations)


def resampled(corners: list[Point]) -> Array:
    """Points (N, 2) along straight lines between corners, a decimetre apart or a little less."""
    pieces = [np.array(corners[:1])]
    for one, other in pairwise(corners):
        step = np.subtract(other, one)
        count = int(np.ceil(np.hypot(*step) / 0.1 - 1e-9))
        pieces.append(np.array(one) + np.arange(1, count + 1)[:, None] / count * step)
    return np.concatenate(pieces)
