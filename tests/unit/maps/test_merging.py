"""Halves of a known map make the whole; fused places are never surer than they may be."""

import math
from dataclasses import replace
from itertools import pairwise, permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.geometry import Array, Pose
from gvgbot.maps.merging import covariance_intersection, merged, settled
from gvgbot.maps.moved import moved_graph
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode

PLACES = {
    0: (0.0, 0.0),
    1: (6.0, 0.0),
    2: (13.0, 0.0),
    3: (0.0, 5.0),
    4: (6.0, 5.0),
    5: (13.0, 5.0),
}
CORRIDORS = ((0, 1), (1, 2), (3, 4), (4, 5), (0, 3), (1, 4), (2, 5))
FRAME = Pose(4.0, -3.0, 2.0)


def seen(vertices: set[int], shift: int = 0) -> RouteGraph:
    """What a robot knows that has been at some places; ids moved by `shift`."""
    edges = [(a, b) for a, b in CORRIDORS if a in vertices and b in vertices]
    return RouteGraph(
        tuple(vertex(v, vertices, shift) for v in sorted(vertices)),
        tuple(
            RouteEdge(
                start=a + shift,
                end=b + shift,
                polyline=np.linspace(PLACES[a], PLACES[b], 30),
                min_clearance=0.8,
            )
            for a, b in edges
        ),
    )


def vertex(v: int, vertices: set[int], shift: int) -> RouteNode:
    far = [b if a == v else a for a, b in CORRIDORS if v in (a, b)]
    bearing = {f: math.atan2(PLACES[f][1] - PLACES[v][1], PLACES[f][0] - PLACES[v][0]) for f in far}
    return RouteNode(
        id=v + shift,
        kind="meetpoint",
        position=PLACES[v],
        degree=len(far),
        bearings=tuple(bearing.values()),
        clearance=0.8,
        covariance=(0.01, 0.0, 0.0, 0.01),
        frontiers=tuple(b for f, b in bearing.items() if f not in vertices),
    )


@pytest.mark.parametrize(("off", "within"), [(Pose(), 1e-6), (Pose(0.2, -0.1, 0.01), 0.4)])
def test_two_halves_that_overlap_make_the_whole(off: Pose, within: float) -> None:
    left, right = seen({0, 1, 3, 4}), seen({1, 2, 4, 5}, shift=40)
    told = moved_graph(right, FRAME.inverse())
    whole = merged(left, told, off.compose(FRAME))
    assert len(whole.vertices) == 6
    assert len(whole.edges) == len(CORRIDORS)
    assert not any(v.frontiers for v in whole.vertices)
    assert sorted(v.degree for v in whole.vertices) == [2, 2, 2, 2, 3, 3]
    places = np.array([v.position for v in whole.vertices])
    for true in PLACES.values():
        assert np.hypot(*(places - true).T).min() < within


@pytest.mark.parametrize("is_first", [True, False])
def test_an_edge_of_both_has_been_driven_as_often_as_by_both_and_is_as_narrow_as_either_felt(
    is_first: bool,
) -> None:
    saw, drove = seen({0, 1, 3, 4}), seen({0, 1, 3, 4}, shift=40)
    edges = (replace(e, traversals=3, min_clearance=0.6) for e in drove.edges)
    drove = replace(
        drove, edges=tuple(edges), vertices=tuple(replace(v, visits=2) for v in drove.vertices)
    )
    saw = replace(saw, edges=tuple(replace(e, traversals=1) for e in saw.edges))
    both = merged(saw, drove, Pose()) if is_first else merged(drove, saw, Pose())
    assert [(e.traversals, e.min_clearance) for e in both.edges] == 4 * [(4, 0.6)]
    assert [v.visits for v in both.vertices] == [v.visits + 2 for v in saw.vertices]


def positions(graph: RouteGraph) -> set[tuple[float, float]]:
    return {(round(v.position[0], 6), round(v.position[1], 6)) for v in graph.vertices}


def way(start: int, end: int, line: Array) -> RouteEdge:
    """An edge that was driven."""
    return RouteEdge(start=start, end=end, polyline=line, min_clearance=0.4, traversals=1)


def driven(graph: RouteGraph) -> RouteGraph:
    return replace(graph, edges=tuple(replace(edge, traversals=1) for edge in graph.edges))


def passage(*places: int) -> RouteGraph:
    """What a robot knows that drove past some places, and saw none but the first and the last."""
    known = [replace(v, frontiers=()) for v in seen({places[0], places[-1]}).vertices]
    line = np.concatenate([np.linspace(PLACES[a], PLACES[b], 30) for a, b in pairwise(places)])
    return RouteGraph(tuple(known), (way(places[0], places[-1], line),))


def test_a_vertex_from_which_a_way_leads_that_the_other_lacks_stays() -> None:
    """The other one drove past, and did not see the way: somebody may have stood in it."""
    past, round_about = passage(0, 1, 2), passage(0, 3, 4)
    other = RouteGraph((*past.vertices, round_about.vertices[1]), (*past.edges, *round_about.edges))
    for one, two in permutations([driven(seen({0, 1, 2, 4})), other]):
        whole = merged(one, two, Pose())
        assert positions(whole) == {PLACES[v] for v in (0, 1, 2, 4)}


def test_a_vertex_beside_somebody_who_stood_there_goes_with_both_ways_round_him() -> None:
    body = [(6.0, 0.5), (6.0, -0.5)]
    points = {0: PLACES[0], 1: (5.2, 0.0), 2: (6.8, 0.0), 3: PLACES[2]}
    lines = [(0, 1, []), (1, 2, body[:1]), (1, 2, body[1:]), (2, 3, [])]
    edges = tuple(way(a, b, np.array([points[a], *by, points[b]])) for a, b, by in lines)
    template = seen({0}).vertices[0]
    vertices = tuple(replace(template, id=i, position=p, frontiers=()) for i, p in points.items())
    past, theirs = passage(0, 1, 2), RouteGraph(vertices, edges)
    only_seen = replace(past, edges=tuple(replace(edge, traversals=0) for edge in past.edges))
    for one, other in permutations([past, theirs]):
        assert positions(merged(one, other, Pose())) == {PLACES[0], PLACES[2]}
    for one, other in permutations([only_seen, theirs]):
        assert positions(merged(one, other, Pose())) == set(points.values())


@pytest.mark.parametrize("is_first", [True, False])
def test_both_ways_round_a_post_stay_though_they_are_close(is_first: bool) -> None:
    known = seen({0, 1, 2})
    (here,) = (replace(v, frontiers=()) for v in known.vertices if v.id == 1)
    there = replace(here, id=7, position=(6.0, 3.0))
    lines = [np.array([here.position, (6.0 + x, 1.5), there.position]) for x in (0.4, -0.4)]
    post = RouteGraph((here, there), tuple(way(1, 7, line) for line in lines))
    whole = merged(*((post, known) if is_first else (known, post)), Pose())
    assert len(whole.edges) == len(known.edges) + 2
    again = merged(whole, post, Pose())
    assert sorted(e.traversals for e in again.edges) == [0, 0, 2, 2]


@pytest.mark.parametrize("is_first", [True, False])
def test_who_knows_one_way_round_a_post_learns_of_the_other_one(is_first: bool) -> None:
    here, there = (replace(v, frontiers=()) for v in seen({0, 2}).vertices)
    lines = [np.array([here.position, (6.5, y), there.position]) for y in (0.4, -0.4)]
    ways = [way(here.id, there.id, line) for line in lines]
    both, one = RouteGraph((here, there), tuple(ways)), RouteGraph((here, there), (ways[1],))
    whole = merged(*((both, one) if is_first else (one, both)), Pose())
    assert sorted(e.traversals for e in whole.edges) == [1, 2]


def ring(at: float) -> RouteGraph:
    """A way round 4 m off the origin, whose vertex is at an angle, rad."""
    angles = at + np.linspace(0.0, math.tau, 100)
    line = 4.0 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    x, y = line[0].tolist()
    template = seen({0}).vertices[0]
    return RouteGraph((replace(template, position=(x, y), frontiers=()),), (way(0, 0, line),))


@pytest.mark.parametrize("at", [0.05, 1.0, 3.0, 5.5])
def test_a_ring_stays_one_wherever_each_has_put_its_vertex(at: float) -> None:
    whole = merged(ring(0.0), ring(at), Pose())
    assert len(whole.vertices) == 1
    (edge,) = whole.edges
    assert edge.length == pytest.approx(8.0 * math.pi, rel=0.01)


def test_a_corridor_stays_though_each_saw_somebody_elsewhere_in_it() -> None:
    def through(x: float) -> RouteGraph:
        ends = [replace(v, frontiers=()) for v in seen({0, 2}).vertices]
        points = {0: PLACES[0], 1: (x, 0.0), 2: PLACES[2]}
        lines = [np.linspace(points[a], points[b], 30) for a, b in ((0, 1), (1, 2))]
        ways = (way(0, 1, lines[0]), way(1, 2, lines[1]))
        return RouteGraph((*ends, replace(ends[0], id=1, position=points[1])), ways)

    for one, other in permutations([through(4.0), through(9.0)]):
        whole = merged(one, other, Pose())
        assert {PLACES[0], PLACES[2]} <= positions(whole)
        assert sum(edge.length for edge in whole.edges) == pytest.approx(13.0)


def doubled(one: RouteGraph, apart: float) -> RouteGraph:
    """The same, but place 1 has its ways to 0 and 2, and so far on there is the one to 4."""
    off = (PLACES[1][0], apart)
    beside = replace(
        vertex(1, set(PLACES), 0), id=9, position=off, bearings=(math.pi / 2, -math.pi / 2)
    )
    others = tuple(edge for edge in one.edges if {edge.start, edge.end} != {1, 4})
    ways = (way(1, 9, np.linspace(PLACES[1], off)), way(9, 4, np.linspace(off, PLACES[4])))
    return RouteGraph((*one.vertices, beside), (*others, *ways))


@pytest.mark.parametrize("is_first", [True, False])
def test_a_crossing_that_one_has_as_two_close_meetpoints_is_one(is_first: bool) -> None:
    one = seen({0, 1, 2, 4})
    two = doubled(one, 0.5)
    whole = merged(*((two, one) if is_first else (one, two)), Pose())
    assert len(whole.vertices) == len(one.vertices)
    assert len(whole.edges) == len(one.edges)
    (crossing,) = (v for v in whole.vertices if math.dist(v.position, PLACES[1]) < 1.0)
    assert (crossing.degree, crossing.frontiers) == (3, ())


def test_two_meetpoints_that_are_not_that_close_stay_two() -> None:
    one = seen({0, 1, 2, 4})
    whole = merged(one, doubled(one, 0.7), Pose())
    assert len(whole.vertices) == len(one.vertices) + 1


def test_what_nobody_followed_stays_a_frontier() -> None:
    whole = merged(seen({0, 1, 3}), seen({1, 3, 4}, shift=10), Pose())
    at = {v.position: v for v in whole.vertices}
    assert len(at[6.0, 0.0].frontiers) == 1  # to place 2
    assert len(at[6.0, 5.0].frontiers) == 1  # to place 5
    assert not at[0.0, 0.0].frontiers
    assert len(whole.edges) == 4


@pytest.mark.parametrize("is_first", [True, False])
def test_what_one_saw_twice_from_afar_is_the_one_departure_by_which_the_other_left(
    is_first: bool,
) -> None:
    known, guessed = seen({0, 1, 2, 4}), seen({0, 1})
    afar = replace(
        guessed.vertices[1], degree=3, bearings=(math.pi, 0.4, -0.4), frontiers=(0.4, -0.4)
    )
    guessed = replace(guessed, vertices=(guessed.vertices[0], afar))
    both = merged(*((guessed, known) if is_first else (known, guessed)), Pose())
    crossing = next(v for v in both.vertices if math.dist(v.position, PLACES[1]) < 0.1)
    assert crossing.degree == len(crossing.bearings) == 3
    assert not crossing.frontiers


def test_a_vertex_that_one_map_lacks_splits_its_edge() -> None:
    without = RouteGraph(
        tuple(v for v in seen(set(PLACES)).vertices if v.id in (0, 2)),
        (
            RouteEdge(
                start=0,
                end=2,
                polyline=np.linspace(PLACES[0], PLACES[2], 60),
                min_clearance=0.8,
            ),
        ),
    )
    whole = merged(without, seen({0, 1, 4, 2}, shift=10), Pose())
    ends = {frozenset((e.start, e.end)) for e in whole.edges}
    place = {v.id: (round(v.position[0], 6), round(v.position[1], 6)) for v in whole.vertices}
    assert {frozenset(place[i] for i in pair) for pair in ends} == {
        frozenset({PLACES[0], PLACES[1]}),
        frozenset({PLACES[1], PLACES[2]}),
        frozenset({PLACES[1], PLACES[4]}),
    }
    assert sum(e.length for e in whole.edges) == pytest.approx(13.0 + 5.0, abs=0.3)


def test_two_vertices_beside_one_point_of_an_edge_split_it_once() -> None:
    """It has a point but each 1.3 m, and they are as near to the same one as may be."""
    ends = tuple(replace(v, frontiers=()) for v in seen({0, 2}).vertices)
    line = np.linspace(PLACES[0], PLACES[2], 11)
    coarse = RouteGraph(ends, (replace(way(0, 2, line), traversals=0),))
    places = [(6.25, 0.3), (6.75, -0.3)]
    pair = tuple(
        replace(ends[0], id=n, position=place, bearings=(side,), frontiers=(side,), degree=1)
        for n, (place, side) in enumerate(zip(places, (math.pi / 2, -math.pi / 2), strict=True))
    )
    whole = merged(coarse, RouteGraph(pair, ()), Pose())
    assert positions(whole) == {PLACES[0], PLACES[2], *places}
    assert all(edge.start != edge.end for edge in whole.edges)
    assert len(whole.edges) == 2


@given(seed=st.integers(0, 2**32 - 1))
def test_an_intersection_is_consistent_whatever_both_have_in_common(seed: int) -> None:
    """For two estimates with any cross covariance, the fused error is no larger than it says."""
    rng = np.random.default_rng(seed)
    joint = rng.normal(size=(4, 4))
    joint = joint @ joint.T + 0.01 * np.eye(4)
    of_a, of_b, cross = joint[:2, :2], joint[2:, 2:], joint[:2, 2:]
    a, b = rng.normal(size=2), rng.normal(size=2)
    mean, covariance = covariance_intersection(a, of_a, b, of_b)
    zero, _ = covariance_intersection(np.zeros(2), of_a, np.zeros(2), of_b)
    np.testing.assert_allclose(zero, 0.0, atol=1e-9)
    gain_a = np.stack(
        [covariance_intersection(e, of_a, np.zeros(2), of_b)[0] for e in np.eye(2)], axis=1
    )
    gain_b = np.stack(
        [covariance_intersection(np.zeros(2), of_a, e, of_b)[0] for e in np.eye(2)], axis=1
    )
    np.testing.assert_allclose(gain_a @ a + gain_b @ b, mean, atol=1e-6)
    np.testing.assert_allclose(gain_a + gain_b, np.eye(2), atol=1e-6)  # unbiased
    true = (
        gain_a @ of_a @ gain_a.T
        + gain_b @ of_b @ gain_b.T
        + gain_a @ cross @ gain_b.T
        + gain_b @ cross.T @ gain_a.T
    )
    assert np.linalg.eigvalsh(covariance - true).min() > -1e-4


def test_an_edge_that_sets_out_towards_a_frontier_does_not_follow_it() -> None:
    """It bends: at a vertex that was seen from afar only, lines begin beside their bearings."""
    bearings = (math.pi, -math.pi / 4, 0.0)
    seen_from_afar = replace(
        seen({0}).vertices[0], bearings=bearings, degree=3, frontiers=bearings[::2]
    )
    far = replace(seen({1}).vertices[0], position=(6.0, -6.0), bearings=(2.36,), frontiers=())
    bent = np.concatenate([np.linspace((0, 0), (1, -0.2), 10), np.linspace((1, -0.2), (6, -6), 50)])
    graph = settled((seen_from_afar, far), [way(0, 1, bent)])
    assert graph.vertices[0].frontiers == (math.pi, 0.0)
    assert graph.vertices[0].bearings == bearings
