"""When each edge of a saved map was found: events name edges that later ones may have replaced."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from gvgbot.maps.occupancy import OccupancyGrid
from gvgbot.maps.route_graph import RouteEdge
from gvgbot.maps.saved_run import Happening, SavedRun

_LONGER_M = 2.5  # than an edge was when it was found, the way along it may be, past new vertices


def edges_found(
    run: SavedRun, vertex_found: Mapping[int, float], begin: float
) -> tuple[float, ...]:
    """When (s after `begin`) each edge was joined, or the longer edge that it was cut from.

    If no event tells, for a vertex was taken out of it, it is there once all of it has been seen
    and both its ends are known.
    """
    history = _History(run.graph.edges, vertex_found)
    joined = [(e.stamp - begin, e) for e in run.events if e.event == "edge_joined"]
    left = [(time, event) for time, event in joined if not history.explain(time, event)]
    for time, event in left:
        history.explain_cut(time, event)
    for index, edge in enumerate(run.graph.edges):
        known = max(vertex_found[edge.start], vertex_found[edge.end])
        history.found.setdefault(index, max(known, _seen_whole(edge, run.grid)))
    return tuple(history.found[index] for index in range(len(run.graph.edges)))


@dataclass(frozen=True, slots=True)
class _History:
    """The edges, and when (s) those were found, by index, that an event explains."""

    edges: Sequence[RouteEdge]
    vertex_found: Mapping[int, float]
    found: dict[int, float] = field(default_factory=dict)

    def explain(self, time: float, event: Happening) -> bool:
        """Whether the event is about an edge that has the same ends, and none before it was."""
        ends = {event.start, event.end}
        same = [i for i in self._open() if {self.edges[i].start, self.edges[i].end} == ends]
        if same:
            self.found[min(same, key=lambda i: abs(self.edges[i].length - event.length))] = time
        return bool(same)

    def explain_cut(self, time: float, event: Happening) -> None:
        """Take the event for the edges of a trail that vertices found later have cut."""
        if event.start is None or event.end is None:
            return
        most = event.length + _LONGER_M
        trails = list(self._trails(self._open(), event.start, event.end, time, most))
        if trails:
            trail = min(trails, key=lambda trail: abs(self._length(trail) - event.length))
            self.found.update(dict.fromkeys(trail, time))

    def _open(self) -> list[int]:
        return [index for index in range(len(self.edges)) if index not in self.found]

    def _length(self, trail: Sequence[int]) -> float:
        return sum(self.edges[index].length for index in trail)

    def _trails(
        self, unused: list[int], here: int, goal: int, time: float, most: float
    ) -> Iterator[tuple[int, ...]]:
        """Ways by unused edges, `most` m long at most, past vertices found after a time only."""
        for index in unused:
            edge, rest = self.edges[index], [i for i in unused if i != index]
            left = most - edge.length
            for start, end in {(edge.start, edge.end), (edge.end, edge.start)}:
                if start != here or left < 0.0:
                    continue
                if end == goal:
                    yield (index,)
                elif self.vertex_found[end] > time:
                    ways = self._trails(rest, end, goal, time, left)
                    yield from ((index, *way) for way in ways)


def _seen_whole(edge: RouteEdge, grid: OccupancyGrid) -> float:
    """When (s) the last point of an edge was first seen; 0 if nobody took that down."""
    if grid.seen_s is None:
        return 0.0
    cells = np.floor((edge.polyline - grid.origin) / grid.resolution_m).astype(np.int64)
    rows, columns = np.array(grid.seen_s.shape) - 1
    seen = grid.seen_s[cells[:, 1].clip(0, rows), cells[:, 0].clip(0, columns)]
    return float(seen[np.isfinite(seen)].max(initial=0.0))
