"""Edges that vertices found later have cut, among many others."""

import itertools

import numpy as np
import pytest

from gvgbot.maps.edge_history import edges_found
from gvgbot.maps.occupancy import OccupancyGrid
from gvgbot.maps.route_graph import RouteGraph
from gvgbot.maps.saved_run import Happening, SavedRun
from gvgbot.maps.trajectory import Trajectory
from tests.unit.maps.small_run import edge, vertex

SIDE, CELL_M = 6, 5.0


def lattice() -> RouteGraph:
    """Corridors of a large hall with a pillar in each cell; row after row, from vertex 0."""
    at = {n: (CELL_M * (n % SIDE), CELL_M * (n // SIDE)) for n in range(SIDE * SIDE)}
    pairs = itertools.combinations(at, 2)
    lines = [(a, b) for a, b in pairs if np.hypot(*np.subtract(at[a], at[b])) < 1.1 * CELL_M]
    vertices = tuple(vertex(n, *place, (0.0, 1.0, 2.0)) for n, place in at.items())
    return RouteGraph(vertices, tuple(edge(a, b, at[a], at[b]) for a, b in lines))


def found(length: float) -> dict[tuple[int, int], float]:
    """When each edge of the lattice was found, if vertices 0 and 2 were joined after a second."""
    graph, nowhere = lattice(), np.empty((0, 3))
    joined = Happening("edge_joined", 1.0, start=0, end=2, length=length)
    grid = OccupancyGrid(np.zeros((1, 1), np.int8), 1.0, (0.0, 0.0))
    nothing = Trajectory(np.empty(0), nowhere)
    run = SavedRun("hall", graph, grid, nothing, nothing, (joined,), None)
    times = edges_found(run, {v.id: 9.0 * (v.id not in (0, 2)) for v in graph.vertices}, 0.0)
    return {(e.start, e.end): time for e, time in zip(graph.edges, times, strict=True)}


@pytest.mark.timeout(10)
def test_the_trail_that_is_as_long_as_the_edge_was_is_found_among_many() -> None:
    early = {ends for ends, time in found(2 * CELL_M + 0.1).items() if time == 1.0}
    assert early == {(0, 1), (1, 2)}


def test_a_trail_that_is_much_longer_is_another_one() -> None:
    assert set(found(CELL_M).values()) == {9.0}
