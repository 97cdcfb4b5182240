"""Shortest paths on multigraphs, compared with networkx."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.autonomy.exploration.paths import Approach, shortest_path, shortest_paths
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId
from tests.unit.autonomy.graphs import (
    STREET,
    between,
    networkx_distances,
    random_multigraph,
    streets,
)

seeds = st.integers(0, 2**32 - 1)


def walked(graph: GvgGraph, start: int, approach: Approach) -> tuple[float, HalfEdgeId | None]:
    """Metres and last arrival of the departures of an approach, driven one after another."""
    here, metres = start, 0.0
    arrival = None
    for departure in approach.departures:
        assert departure.vertex == here
        edge = graph.edge_at(departure)
        assert edge is not None
        arrival = edge.other(departure)
        here, metres = arrival.vertex, metres + edge.length
    return metres, arrival


@given(seeds)
def test_lengths_from_one_vertex_are_those_of_networkx(seed: int) -> None:
    rng = np.random.default_rng(seed)
    graph = random_multigraph(rng)
    start = int(rng.choice(list(graph.vertices)))
    found = shortest_paths(graph, [Approach(0.0, HalfEdgeId(start, -1))])
    lengths = networkx_distances(graph, [(start, 0.0)])
    assert {v: approach.metres for v, approach in found.items()} == pytest.approx(lengths)


@given(seeds)
def test_the_departures_lead_to_the_vertex_in_as_many_metres(seed: int) -> None:
    rng = np.random.default_rng(seed)
    graph = random_multigraph(rng)
    start = int(rng.choice(list(graph.vertices)))
    found = shortest_paths(graph, [Approach(0.0, HalfEdgeId(start, -1))])
    assert start in found
    for vertex, approach in found.items():
        metres, arrival = walked(graph, start, approach)
        assert metres == pytest.approx(approach.metres)
        assert vertex == approach.arrival.vertex
        assert arrival in (None, approach.arrival)


@given(seeds)
def test_several_starts_are_a_choice_between_them(seed: int) -> None:
    rng = np.random.default_rng(seed)
    graph = random_multigraph(rng)
    starts = [
        Approach(float(rng.uniform(0, 9)), HalfEdgeId(int(v), -1))
        for v in rng.choice(list(graph.vertices), 2)
    ]
    lengths = networkx_distances(graph, [(s.arrival.vertex, s.metres) for s in starts])
    found = shortest_paths(graph, starts)
    assert {v: approach.metres for v, approach in found.items()} == pytest.approx(lengths)


@given(seeds)
def test_the_path_to_one_vertex_is_as_long_as_that_of_networkx(seed: int) -> None:
    rng = np.random.default_rng(seed)
    graph = random_multigraph(rng)
    start, end = (int(vertex) for vertex in rng.choice(list(graph.vertices), 2))
    found = shortest_path(graph, [Approach(0.0, HalfEdgeId(start, -1))], end)
    length = networkx_distances(graph, [(start, 0.0)]).get(end)
    assert (found and found.metres) == (length and pytest.approx(length))


def test_of_parallel_edges_the_shorter_one_is_taken() -> None:
    graph, ids = streets(2, 1)
    a, b = (graph.vertices[v] for v in ids.values())
    ends = HalfEdgeId(a.id, a.add_half_edge(1.0)), HalfEdgeId(b.id, b.add_half_edge(2.0))
    graph.join(*ends, np.array([[0.0, 0.0], [1.0, 0.0]]), 1.0, driven=True)
    found = shortest_paths(graph, [Approach(0.0, HalfEdgeId(a.id, -1))])[b.id]
    assert found == Approach(1.0, ends[1], (ends[0],))


@pytest.mark.parametrize("why", ["blocked", "a virtual wall"])
def test_a_street_that_is_closed_is_driven_around(why: str) -> None:
    graph, ids = streets(2, 2)
    out = between(graph, ids[0, 0], ids[1, 0])
    half = graph.vertices[out.vertex].half_edges[out.key]
    if why == "blocked":
        half.blocked = True
    else:
        assert half.edge is not None
        graph.walled[half.edge] = (5.0,)
    found = shortest_paths(graph, [Approach(0.0, HalfEdgeId(ids[0, 0], -1))])
    assert found[ids[1, 0]].metres == 3 * STREET


def test_a_start_at_a_vertex_that_is_no_more_leads_nowhere() -> None:
    assert shortest_paths(GvgGraph(), [Approach(0.0, HalfEdgeId(7, 0))]) == {}
