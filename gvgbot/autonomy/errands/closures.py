"""Ways that something was found to stand in: not to be driven for a while."""

from collections.abc import Iterable, Mapping

from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId
from gvgbot.autonomy.slam.names import Names


class Closures:
    """Blocks half-edges, and unblocks them when their time is over.

    It knows them by what they were called when they were closed.
    """

    def __init__(self, names: Names) -> None:
        self._names = names
        self.until: dict[HalfEdgeId, float] = {}  # stamps

    def close(self, graph: GvgGraph, ends: Iterable[HalfEdgeId], until: float) -> None:
        """Block those of the ends that are not blocked yet, up to a stamp."""
        for end in ends:
            half = graph.half_edge(end)
            if half is not None and not half.blocked:
                half.blocked = True
                self.until[end] = until

    def open_due(self, graph: GvgGraph, stamp: float) -> None:
        """Unblock what was closed long enough ago."""
        for end in [end for end, until in self.until.items() if until <= stamp]:
            self._open(graph, end)

    def open_all(self, graph: GvgGraph) -> dict[HalfEdgeId, float | None]:
        """Unblock everything, and edges that were closed while exploring; what, and up to when."""
        edges = (end for end in graph.blocked() if graph.edge_at(end) is not None)
        closed = {end: self.until.get(end) for end in (*self.until, *edges)}
        for end in closed:
            self._open(graph, end)
        return closed

    def close_again(self, graph: GvgGraph, opened: Mapping[HalfEdgeId, float | None]) -> None:
        """Block what has just been opened: that was of no use."""
        for end, until in opened.items():
            half = graph.half_edge(self._names.half_edge(end))
            if half is not None:
                half.blocked = True
            if until is not None:
                self.until[end] = until

    def _open(self, graph: GvgGraph, end: HalfEdgeId) -> None:
        self.until.pop(end, None)
        half = graph.half_edge(self._names.half_edge(end))
        if half is not None:
            half.blocked = False
