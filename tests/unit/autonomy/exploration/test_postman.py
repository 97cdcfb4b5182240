"""The tour of the Chinese postman, its length compared with networkx."""

from collections import Counter

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.autonomy.exploration.postman import postman_tour
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId
from tests.unit.autonomy.graphs import STREET, random_multigraph, streets

seeds = st.integers(0, 2**32 - 1)


def drivable(graph: GvgGraph, start: int) -> nx.MultiGraph:
    """What hangs together with the start over edges that are not blocked."""
    town = nx.MultiGraph()
    town.add_nodes_from(graph.vertices)
    for edge in graph.edges.values():
        halves = graph.half_edge(edge.a), graph.half_edge(edge.b)
        if not any(half is None or half.blocked for half in halves):
            town.add_edge(edge.a.vertex, edge.b.vertex, edge.id, weight=edge.length)
    return town.subgraph(nx.node_connected_component(town, start))


def least_length(town: nx.MultiGraph, start: int) -> float:
    """Edmonds and Johnson: all edges, and the least matching of the odd vertices; one may stay."""
    odd = {vertex for vertex in town if town.degree(vertex) % 2} ^ {start}
    ways = nx.Graph()
    ways.add_weighted_edges_from(("anywhere", vertex, 0.0) for vertex in odd)
    for one in odd:
        metres = nx.single_source_dijkstra_path_length(town, one)
        ways.add_weighted_edges_from((one, other, metres[other]) for other in odd if other != one)
    repeated = sum(ways.edges[pair]["weight"] for pair in nx.min_weight_matching(ways))
    return float(town.size(weight="weight") + repeated)


def driven(graph: GvgGraph, start: int, tour: list[HalfEdgeId]) -> tuple[float, Counter[int]]:
    """Metres of a tour, and how often it drives each edge."""
    here, metres, times = start, 0.0, Counter[int]()
    for departure in tour:
        assert departure.vertex == here
        edge = graph.edge_at(departure)
        assert edge is not None
        here, metres = edge.other(departure).vertex, metres + edge.length
        times[edge.id] += 1
    return metres, times


@given(seeds)
def test_every_edge_is_driven_and_no_tour_is_shorter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    graph = random_multigraph(rng)
    start = int(rng.choice(list(graph.vertices)))
    town = drivable(graph, start)
    metres, times = driven(graph, start, postman_tour(graph, start))
    assert set(times) == {edge for _, _, edge in town.edges(keys=True)}
    assert metres == pytest.approx(least_length(town, start))


@pytest.mark.parametrize("size", [(4, 4), (7, 6)])
def test_a_town_of_streets_takes_as_long_as_it_must(size: tuple[int, int]) -> None:
    """With so many odd vertices not all pairs are tried any more."""
    graph, ids = streets(*size)
    start = ids[0, 0]
    metres, times = driven(graph, start, postman_tour(graph, start))
    assert set(times) == set(graph.edges)
    assert metres == pytest.approx(least_length(drivable(graph, start), start))
    assert metres % STREET == pytest.approx(0.0)


def test_a_street_that_a_virtual_wall_crosses_is_left_out() -> None:
    graph, ids = streets(3, 2)
    walled = min(graph.edges)
    graph.walled[walled] = (5.0,)
    _, times = driven(graph, ids[2, 1], postman_tour(graph, ids[2, 1]))
    assert set(times) == set(graph.edges) - {walled}
