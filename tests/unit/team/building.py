"""Buildings of straight corridors whose charts are known by construction."""

import math
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.geometry import Array, Pose
from gvgbot.team.chart import Chart, ChartEdge, ChartVertex, Departure, moved

HALF_WIDTH = 0.8  # m, of every corridor
SEEN_M = 3.3  # walls so near to a vertex are told


@dataclass(frozen=True, eq=False)
class Building:
    """Places (N, 2) of junctions and corridors between them, as pairs of indices."""

    places: Array
    corridors: tuple[tuple[int, int], ...]

    def chart(self, seen: set[int], start: Pose, rng: np.random.Generator | None = None) -> Chart:
        """What a robot tells that began at `start` (world frame) and has seen some junctions.

        Corridors between two of them are followed, others are frontiers; `rng` blurs all places.
        """
        vertices, edges = {}, {}
        keys = {v: [c for c, ends in enumerate(self.corridors) if v in ends] for v in seen}
        walls = self.walls
        for v in sorted(seen):
            x, y = self.places[v]
            near = walls[np.hypot(*(walls - (x, y)).T) < SEEN_M]
            if rng is not None:
                near = near + rng.normal(0.0, 0.01, near.shape)
            departures = []
            for c in keys[v]:
                a, b = self.corridors[c]
                far = b if a == v else a
                dx, dy = self.places[far] - self.places[v]
                followed = c if far in seen else None
                departures.append(Departure(c, math.atan2(dy, dx), followed))
            blur = np.zeros(2) if rng is None else rng.normal(0.0, 0.03, 2)
            vertices[v] = ChartVertex(
                v, np.array([x, y]) + blur, 0.001 * np.eye(2), HALF_WIDTH, tuple(departures), near
            )
        for c, (a, b) in enumerate(self.corridors):
            if a in seen and b in seen:
                count = 2 + int(math.dist(self.places[a], self.places[b]) / 0.2)
                line = np.linspace(vertices[a].position, vertices[b].position, count)
                length = math.dist(line[0], line[-1])
                ends = HalfEdgeId(a, c), HalfEdgeId(b, c)
                edges[c] = ChartEdge(c, *ends, length, HALF_WIDTH, line)
        return moved(Chart(vertices, edges), start.inverse())

    @cached_property
    def walls(self) -> Array:
        """Points (M, 2) on the walls: as far as a half width from the nearest middle line."""
        middles = [
            np.linspace(
                self.places[a], self.places[b], 1 + int(math.dist(*self.places[[a, b]]) / 0.05)
            )
            for a, b in self.corridors
        ]
        around = HALF_WIDTH * np.stack(
            [f(np.linspace(-math.pi, math.pi, 40)) for f in (np.cos, np.sin)], axis=1
        )
        rims = np.concatenate([(line[:, None] + around).reshape(-1, 2) for line in middles])
        rims = np.unique(np.round(rims, 2), axis=0)
        off = np.full(len(rims), np.inf)
        for a, b in self.corridors:
            p, way = self.places[a], self.places[b] - self.places[a]
            share = np.clip((rims - p) @ way / (way @ way), 0.0, 1.0)
            off = np.minimum(off, np.hypot(*(rims - p - share[:, None] * way).T))
        walls: Array = rims[off > HALF_WIDTH - 0.01]
        return walls


def lattice(
    columns: NDArray[np.floating], rows: NDArray[np.floating], without: set[int] | None = None
) -> Building:
    """Corridors along lines at these x and y, m; `without` some of them, by number."""
    places = np.array([(x, y) for y in rows for x in columns])
    n = len(columns)
    corridors = [(r * n + c, r * n + c + 1) for r in range(len(rows)) for c in range(n - 1)]
    corridors += [(r * n + c, r * n + c + n) for r in range(len(rows) - 1) for c in range(n)]
    kept = [c for k, c in enumerate(corridors) if k not in (without or set())]
    return Building(places, tuple(kept))


@cache
def irregular(seed: int) -> Building:
    """Five by four junctions at uneven distances, all connected, with some corridors walled up."""
    rng = np.random.default_rng(seed)
    columns = np.cumsum(rng.uniform(4.0, 8.0, 5))
    rows = np.cumsum(rng.uniform(4.0, 8.0, 4))
    while True:
        walled_up = set(rng.choice(31, 7, replace=False).tolist())
        building = lattice(columns, rows, walled_up)
        links = coo_array((np.ones(24), np.array(building.corridors).T), shape=(20, 20))
        if connected_components(links, directed=False)[0] == 1:
            return building
