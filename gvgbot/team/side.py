"""A chart as it is compared with another one."""

from collections import defaultdict
from functools import cached_property
from itertools import chain

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.geometry import Array, resampled, thinned
from gvgbot.team.chart import WALL_CELL_M, Chart
from gvgbot.team.stretches import Stretches

SPACING_M = 0.2  # of points along an edge, where it is tested for walls


class Side:
    """A chart as alignment needs it; made once, used for many transforms."""

    def __init__(self, chart: Chart) -> None:
        self.chart = chart
        self.ids = list(chart.vertices)
        self.vertices = list(chart.vertices.values())
        self.points = np.array([v.position for v in self.vertices]).reshape(-1, 2)
        self.is_meetpoint = np.array([v.is_meetpoint for v in self.vertices], bool)

    @cached_property
    def walls(self) -> cKDTree:
        """All walls that are told."""
        around = [vertex.walls for vertex in self.vertices]
        return cKDTree(thinned(np.concatenate([np.empty((0, 2)), *around]), WALL_CELL_M))

    @cached_property
    def sights(self) -> Array:
        """From each of the walls (N, 2) the way to the vertex that tells of it: seen there."""
        told = [vertex.walls for vertex in self.vertices]
        teller = np.repeat(np.arange(len(told)), [len(walls) for walls in told])
        _, nearest = cKDTree(np.concatenate(told)).query(self.walls.data)
        sights: Array = self.points[teller[nearest]] - self.walls.data
        return sights

    @cached_property
    def ways(self) -> tuple[Array, Array]:
        """Points (N, 2) along all edges, and how far (N,) there is surely no wall."""
        lines = [
            (resampled(e.polyline, SPACING_M), e.min_clearance) for e in self.chart.edges.values()
        ]
        points = np.concatenate([np.empty((0, 2)), *(line for line, _ in lines)])
        free = np.concatenate([np.empty(0), *(np.full(len(line), c) for line, c in lines)])
        return points, free

    @cached_property
    def way_tree(self) -> cKDTree:
        """Points along all edges."""
        return cKDTree(self.ways[0])

    @cached_property
    def stretches(self) -> Stretches:
        """Those over one edge or two."""
        index = {key: i for i, key in enumerate(self.ids)}
        one = [(index[e.a.vertex], index[e.b.vertex], e.length) for e in self.chart.edges.values()]
        both = one + [(b, a, metres) for a, b, metres in one]
        beyond = defaultdict[int, list[tuple[int, float]]](list)
        for a, b, metres in both:
            beyond[a].append((b, metres))
        two = [(a, d, m + n) for a, b, m in both for d, n in beyond[b] if a < d]
        rows = [(a, b, m) for a, b, m in chain(one, two) if a != b]
        ends = np.array([(a, b) for a, b, _ in rows], np.intp).reshape(-1, 2)
        clearance = np.array([vertex.clearance for vertex in self.vertices])
        return Stretches(
            ends,
            (self.points[:, 0] + 1j * self.points[:, 1])[ends],
            np.array([m for _, _, m in rows], np.float64),
            self.is_meetpoint[ends],
            clearance[ends],
        )
