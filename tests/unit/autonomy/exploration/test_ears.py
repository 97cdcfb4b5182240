"""The ear rule on a town of two by two blocks, traced by hand, and the nearest frontier."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.autonomy.exploration.ears import ear_next, nearest_frontier
from gvgbot.autonomy.exploration.paths import Approach
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId
from tests.unit.autonomy.graphs import between, networkx_distances, random_multigraph, streets

#   c1 -- c2 -- c3
#   |     |     |
#   b1 -- b2 -- b3     two by two blocks: a street around each
#   |     |     |
#   a1 -- a2 -- a3
NAMES = {(x, y): "abc"[y] + "123"[x] for x in range(3) for y in range(3)}


def explore(start: tuple[int, int], heading: tuple[int, int]) -> list[str]:
    """The vertices that the ear rule visits until it finds no frontier where it is."""
    truth, ids = streets(3, 3)
    names = {vertex: NAMES[place] for place, vertex in ids.items()}
    known = GvgGraph(dict(truth.vertices), {}, truth.serial)
    departure = between(truth, ids[start], ids[heading])
    visited = [names[departure.vertex]]
    ways = {end: edge.other(end) for edge in truth.edges.values() for end in (edge.a, edge.b)}
    for edge in list(truth.edges.values()):
        truth.unjoin(edge)
    while True:
        arrival = ways[departure]
        known.join(departure, arrival, np.array([[0.0, 0.0], [10.0, 0.0]]), 1.0, driven=True)
        visited.append(names[arrival.vertex])
        onwards = ear_next(known, arrival)
        if onwards is None:
            return visited
        departure = onwards


def test_the_first_ear_goes_round_the_block_on_the_left() -> None:
    """Eastwards from a1, anticlockwise round a block, until a1 has no frontier left."""
    assert explore((0, 0), (1, 0)) == ["a1", "a2", "b2", "b1", "a1"]


def test_the_trace_from_the_side_is_the_one_found_by_hand() -> None:
    """From a2 northwards: round the lower left block, on to a3 as the only frontier of a2, b3, then
    left to b2, whose first open street clockwise from the east is ... north: c2, c1, b1.
    """
    trace = ["a2", "b2", "b1", "a1", "a2", "a3", "b3", "b2", "c2", "c1", "b1"]
    assert explore((1, 0), (1, 1)) == trace


def test_a_trace_clockwise_about_the_outside_keeps_no_block_on_the_left() -> None:
    """From a1 northwards the left is the outer wall: up to c1, over to c3, down to a3 and back."""
    outside = ["a1", "b1", "c1", "c2", "c3", "b3", "a3", "a2", "a1"]
    assert explore((0, 0), (0, 1)) == outside


def test_the_street_one_came_by_is_the_last_resort() -> None:
    graph, ids = streets(3, 3)
    for edge in list(graph.edges.values()):
        graph.unjoin(edge)
    middle = ids[1, 1]
    arrival = HalfEdgeId(middle, 0)
    order = []
    while (found := ear_next(graph, arrival)) is not None:
        order.append(found.key)
        graph.vertices[middle].half_edges[found.key].blocked = True
    assert len(order) == 4
    assert order[-1] == arrival.key


def test_an_arrival_by_a_departure_no_longer_there_still_finds_a_frontier() -> None:
    graph, ids = streets(2, 2)
    edge = graph.edge_at(between(graph, ids[0, 0], ids[1, 0]))
    assert edge is not None
    graph.unjoin(edge)
    assert ear_next(graph, HalfEdgeId(edge.a.vertex, -1)) == edge.a


@given(st.integers(0, 2**32 - 1))
def test_the_nearest_frontier_is_at_the_vertex_that_dijkstra_finds_nearest(seed: int) -> None:
    rng = np.random.default_rng(seed)
    graph = random_multigraph(rng)
    start = int(rng.choice(list(graph.vertices)))
    found = nearest_frontier(graph, [Approach(0.0, HalfEdgeId(start, -1))])
    metres = networkx_distances(graph, [(start, 0.0)])
    open_at = {end.vertex for end in graph.frontiers()} & metres.keys()
    if not open_at:
        assert found is None
        return
    assert found is not None
    frontier, approach = found
    half = graph.half_edge(frontier)
    assert half is not None
    assert half.open
    assert approach.metres == pytest.approx(min(metres[v] for v in open_at))
    assert metres[frontier.vertex] == pytest.approx(approach.metres)


def test_at_the_nearest_vertex_the_ear_rule_decides_which_frontier() -> None:
    """Arriving northbound at a crossing with west and east open, west comes first."""
    graph, ids = streets(3, 3)
    middle = ids[1, 1]
    for side in ((0, 1), (2, 1)):
        edge = graph.edge_at(between(graph, middle, ids[side]))
        assert edge is not None
        graph.unjoin(edge)
    south = between(graph, middle, ids[1, 0])
    found = nearest_frontier(graph, [Approach(1.0, south)])
    assert found is not None
    bearing = graph.vertices[middle].half_edges[found[0].key].bearing
    assert math.cos(bearing) == pytest.approx(-1.0)


def test_a_handicap_is_worth_so_many_metres() -> None:
    """Seen from b1: a1 is one block away, c3 three; a1 is handicapped by a little less, or more."""
    graph, ids = streets(3, 3)
    near, far = ids[0, 0], ids[2, 2]
    for a, b in (((0, 0), (1, 0)), ((2, 2), (1, 2))):
        edge = graph.edge_at(between(graph, ids[a], ids[b]))
        assert edge is not None
        graph.unjoin(edge)
        other = edge.b if edge.a.vertex == ids[a] else edge.a
        graph.remove_half_edge(other)
    block = next(iter(graph.edges.values())).length
    start = [Approach(0.0, HalfEdgeId(ids[0, 1], -1))]
    for metres, expected in ((1.9 * block, near), (2.1 * block, far)):
        handicaps = dict.fromkeys(graph.vertices, 0.0) | {near: metres}
        found = nearest_frontier(graph, start, handicaps.__getitem__)
        assert found is not None
        assert found[0].vertex == expected
