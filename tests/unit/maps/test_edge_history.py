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


UNSEEN = OccupancyGrid(np.full((1, 1), -1, np.int8), 1.0, (0.0, 0.0))


def run_of(graph: RouteGraph, *joined: Happening, grid: OccupancyGrid = UNSEEN) -> SavedRun:
    nothing = Trajectory(np.empty(0), np.empty((0, 3)))
    return SavedRun("hall", graph, grid, nothing, nothing, joined, None)


def found(length: float, others: float = 9.0) -> dict[tuple[int, int], float]:
    """When each edge of the lattice was found, if vertices 0 and 2 were joined after a second.

    These were known from the beginning, and all others at a time.
    """
    graph = lattice()
    run = run_of(graph, Happening("edge_joined", 1.0, start=0, end=2, length=length))
    times = edges_found(run, {v.id: others * (v.id not in (0, 2)) for v in graph.vertices}, 0.0)
    return {(e.start, e.end): time for e, time in zip(graph.edges, times, strict=True)}


def test_the_trail_that_is_as_long_as_the_edge_was_is_found_among_many() -> None:
    early = {ends for ends, time in found(2 * CELL_M + 0.1).items() if time == 1.0}
    assert early == {(0, 1), (1, 2)}


def test_a_trail_that_is_much_longer_is_another_one() -> None:
    assert set(found(CELL_M).values()) == {9.0}


def test_a_trail_past_a_vertex_that_was_known_by_then_is_another_one() -> None:
    """The edge that was found would have ended there."""
    assert set(found(2 * CELL_M + 0.1, others=0.5).values()) == {0.5}


@pytest.mark.parametrize("lengths", [(10.2, 24.5), (24.5, 10.2)])
def test_of_parallel_edges_each_is_found_with_its_own_length(lengths: tuple[float, float]) -> None:
    """One is 10 m long, and the way round 25 m."""
    straight = edge(0, 1, (0.0, 0.0), (10.0, 0.0))
    round_about = edge(0, 1, (0.0, 0.0), (0.0, 7.5), (10.0, 7.5), (10.0, 0.0))
    vertices = tuple(vertex(n, 10.0 * n, 0.0, (0.0, 1.0)) for n in (0, 1))
    joined = [
        Happening("edge_joined", stamp, start=1, end=0, length=length)
        for stamp, length in zip((3.0, 7.0), lengths, strict=True)
    ]
    run = run_of(RouteGraph(vertices, (straight, round_about)), *joined)
    times = edges_found(run, {0: 0.0, 1: 1.0}, 0.0)
    assert times == ((3.0, 7.0) if lengths[0] < lengths[1] else (7.0, 3.0))


def test_an_edge_of_which_no_event_tells_is_there_once_all_of_it_was_seen() -> None:
    """Its middle was seen last; what was never seen is not waited for."""
    seen_s = np.array([[1.0, 6.0, 2.0, np.inf]], np.float32)
    grid = OccupancyGrid(np.zeros((1, 4), np.int8), 1.0, (-1.0, -0.5), seen_s)
    graph = RouteGraph(
        (vertex(0, -0.5, 0.0, (0.0, 1.0)), vertex(1, 2.5, 0.0, (0.0, 1.0))),
        (edge(0, 1, *((x, 0.0) for x in (-0.5, 0.5, 1.5, 2.5))),),
    )
    assert edges_found(run_of(graph, grid=grid), {0: 0.0, 1: 3.0}, 0.0) == (6.0,)
