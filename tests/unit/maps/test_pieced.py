"""Maps with frontiers that ways lead between, drawn by hand."""

import math

import numpy as np
import pytest

from gvgbot.geometry import Array
from gvgbot.maps.pieced import pieced
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode


def vertex(number: int, x: float, *frontiers: float) -> RouteNode:
    return RouteNode(
        id=number,
        kind="meetpoint",
        position=(x, 0.0),
        degree=3,
        bearings=(0.0, math.pi / 2, math.pi),
        clearance=1.0,
        covariance=(1e-4, 0.0, 0.0, 1e-4),
        frontiers=frontiers,
    )


def line(start: float, end: float, y: float = 0.0) -> Array:
    x = np.linspace(start, end, 60)
    return np.stack([x, np.full(60, y)], axis=1)


GRAPH = RouteGraph((vertex(4, 0.0, 0.0, math.pi / 2), vertex(7, 10.0, math.pi)))
HALVES = [(line(0.0, 5.0, 0.1), 0.8), (line(10.0, 5.5), 0.5)]


def test_what_two_have_driven_from_both_ends_is_an_edge_and_no_frontier() -> None:
    joined = pieced(GRAPH, HALVES)
    (edge,) = joined.edges
    assert {edge.start, edge.end} == {4, 7}
    assert edge.length == pytest.approx(10.0, abs=0.1)
    assert edge.min_clearance == 0.5
    assert edge.traversals > 0
    turns = np.diff(np.unwrap(np.arctan2(*np.diff(edge.polyline, axis=0).T[::-1])))
    assert np.abs(turns).max() < 0.1  # the two halves are 0.1 m beside each other
    places = {v.id: v.position for v in GRAPH.vertices}
    assert tuple(edge.polyline[0]) == pytest.approx(places[edge.start])
    assert tuple(edge.polyline[-1]) == pytest.approx(places[edge.end])
    assert {v.id: v.frontiers for v in joined.vertices} == {4: (math.pi / 2,), 7: ()}


@pytest.mark.parametrize(("x", "is_left"), [(5.0, False), (1.5, True)])
def test_a_vertex_without_edges_over_which_somebody_drove_on_is_none(
    x: float, *, is_left: bool
) -> None:
    seen = vertex(9, x, 0.0, math.pi / 2, math.pi)
    joined = pieced(RouteGraph((*GRAPH.vertices, seen)), [(line(0.0, 10.0), 0.8)])
    assert (9 in {v.id for v in joined.vertices}) == is_left


def test_a_way_that_leads_nowhere_changes_nothing() -> None:
    assert pieced(GRAPH, HALVES[:1]).edges == ()
    assert [v.frontiers for v in pieced(GRAPH, HALVES[:1]).vertices] == [
        v.frontiers for v in GRAPH.vertices
    ]
    assert pieced(GRAPH, []) is GRAPH


def test_an_edge_that_is_known_is_not_there_twice() -> None:
    known = RouteEdge(start=4, end=7, polyline=line(0.0, 10.0), min_clearance=0.5, traversals=1)
    joined = pieced(RouteGraph(GRAPH.vertices, (known,)), HALVES)
    assert [(edge.start, edge.end) for edge in joined.edges] == [(4, 7)]


def test_a_way_to_a_vertex_that_has_an_edge_there_already_is_none() -> None:
    closed = RouteGraph((vertex(4, 0.0, 0.0), vertex(7, 10.0)))
    assert pieced(closed, HALVES).edges == ()
