"""How a map grew: which of its parts had been found by when."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from gvgbot.geometry import Array, direction_of, wrap_angle
from gvgbot.maps.edge_history import edges_found
from gvgbot.maps.occupancy import UNKNOWN, OccupancyGrid
from gvgbot.maps.route_graph import RouteEdge, RouteNode, lines_from
from gvgbot.maps.saved_run import SavedRun
from gvgbot.maps.trajectory import Trajectory

_DEPARTURE_M = 0.5  # how far along an edge its bearing at the vertex shows


@dataclass(frozen=True, slots=True, eq=False)
class Growth:
    """The parts of a run's last map, each with the time (s after the first row of the estimate).

    What the robot believed in between and gave up again is not in it.
    """

    run: SavedRun
    vertex_found: dict[int, float]
    edge_found: tuple[float, ...]  # in the order of the graph's edges

    @classmethod
    def of(cls, run: SavedRun) -> Self:
        """The growth of a run whose estimate has a row at least."""
        begin = float(run.estimate.stamps[0])
        added = {e.vertex: e.stamp - begin for e in run.events[::-1] if e.event == "vertex_added"}
        vertices = {vertex.id: added.get(vertex.id, 0.0) for vertex in run.graph.vertices}
        return cls(run, vertices, edges_found(run, vertices, begin))

    @property
    def duration(self) -> float:
        """From the first row of the estimate to the last, s."""
        return float(self.run.estimate.stamps[-1] - self.run.estimate.stamps[0])

    def path(self, time: float) -> Trajectory:
        """The way so far; the last row is where the robot is."""
        estimate = self.run.estimate
        rows = max(1, self._rows(estimate.stamps, time))
        return Trajectory(estimate.stamps[:rows], estimate.poses[:rows])

    def driven(self, time: float) -> float:
        """Metres driven by then, as odometry has it: at the end those of the summary.

        What odometry does not tell was driven in its holes.
        """
        odometry, summary = self.run.odometry, self.run.summary
        steps = np.hypot(*np.diff(odometry.positions, axis=0).T)
        if summary is not None:
            spans = np.diff(odometry.stamps) * odometry.holes
            steps[odometry.holes] = 0.0
            share = spans if spans.any() else steps
            untold = summary.distance_m - steps.sum()
            steps += untold * share / max(1e-9, float(share.sum()))
        rows = self._rows(odometry.stamps, time)
        return max(0.0, float(steps[: max(0, rows - 1)].sum()))

    def _rows(self, stamps: Array, time: float) -> int:
        """How many of these stamps there were by then."""
        begin = self.run.estimate.stamps[0]
        return int(np.searchsorted(stamps - begin, time, side="right"))

    def grid(self, time: float) -> OccupancyGrid:
        """The last grid, as far as it had been seen."""
        grid = self.run.grid
        if grid.seen_s is None or time >= self.duration:
            return grid
        cells = np.where(grid.seen_s <= time, grid.cells, UNKNOWN).astype(np.int8)
        return OccupancyGrid(cells, grid.resolution_m, grid.origin)

    def graph(self, time: float) -> tuple[list[RouteNode], list[RouteEdge]]:
        """The vertices and edges found by then; at the end also what came after the last row."""
        if time >= self.duration:
            return list(self.run.graph.vertices), list(self.run.graph.edges)
        vertices = [v for v in self.run.graph.vertices if self.vertex_found[v.id] <= time]
        found = zip(self.run.graph.edges, self.edge_found, strict=True)
        return vertices, [edge for edge, since in found if since <= time]


def frontiers(vertex: RouteNode, edges: Sequence[RouteEdge]) -> list[float]:
    """The bearings (rad, map frame) of a vertex that none of these edges leaves along."""
    left = list(vertex.bearings)
    for line in lines_from(vertex.id, edges):
        direction = direction_of(line, _DEPARTURE_M)
        if left:
            left.remove(min(left, key=lambda bearing: abs(wrap_angle(bearing - direction))))
    return left
