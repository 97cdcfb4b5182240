import math
from dataclasses import replace
from itertools import permutations

import networkx as nx
import numpy as np
import pytest

from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.geometry import Pose, resampled
from gvgbot.team.chart import Chart, ChartEdge, ChartWay
from gvgbot.team.site import Site, _Edges
from gvgbot.team.ways import BESIDE_M
from tests.unit.team.building import Building, irregular, lattice

HERE = Pose()


def driven(chart: Chart) -> Chart:
    """The chart of a robot that has driven all that it has seen followed."""
    return replace(chart, edges={k: replace(e, traversed=True) for k, e in chart.edges.items()})


def test_what_another_robot_has_followed_is_no_frontier() -> None:
    row = lattice(np.array([0.0, 5.0, 11.0, 18.0]), np.array([0.0, 6.0]))
    ours, theirs = {0, 1, 4, 5}, {1, 2, 5, 6}
    site = Site([row.chart(ours, HERE), row.chart(theirs, HERE)])
    places = {(round(f.x), round(f.y)) for many in site.open.values() for f in many}
    assert places == {(11, 0), (11, 6)}  # only beyond what either has seen
    assert {end.vertex for end in site.onward} == {1, 5}
    assert not site.own


def test_alone_every_departure_without_an_edge_is_open() -> None:
    building = irregular(3)
    chart = building.chart({0, 1, 5, 6}, HERE)
    expected = {
        (v.id, d.key) for v in chart.vertices.values() for d in v.departures if d.edge is None
    }
    assert {tuple(end) for end in Site([chart]).own} == expected


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_ways_to_frontiers_are_shortest_over_what_all_know(seed: int) -> None:
    building = irregular(seed)
    left, right = {0, 1, 2, 5, 6, 7, 10, 11, 12}, {2, 3, 7, 8, 12, 13}
    site = Site([building.chart(left, HERE), building.chart(right, HERE)])
    graph = nx.Graph()
    for a, b in building.corridors:
        if {a, b} <= left or {a, b} <= right:
            graph.add_edge(a, b, weight=math.dist(building.places[a], building.places[b]))
    start = 6
    known_alone = graph.edge_subgraph([e for e in graph.edges if set(e) <= left])
    reached = nx.single_source_dijkstra_path_length(known_alone, start)
    everywhere = nx.single_source_dijkstra_path_length(graph, start)
    costs = site.costs(reached)
    assert site.open
    for many in site.open.values():
        for frontier in many:
            place = int(np.argmin(np.hypot(*(building.places - (frontier.x, frontier.y)).T)))
            if place in everywhere:
                assert costs[frontier][0] == pytest.approx(everywhere[place], abs=1e-6)
            else:
                assert frontier not in costs


@pytest.mark.parametrize("followed", [{1, 3}, {1}])
def test_what_others_have_seen_to_leave_from_an_own_vertex_is_as_far_as_that(
    followed: set[int],
) -> None:
    """From afar only two ways were to be seen there; the other one is no dead end and back away."""
    places = np.array([(0.0, 0.0), (6.0, 0.0), (12.0, 0.0), (6.0, 5.0)])
    ours = Building(places, ((0, 1), (1, 3))).chart({0, 1}, HERE)
    theirs = Building(places, ((0, 1), (1, 2), (1, 3))).chart(followed, HERE)
    costs = Site([ours, theirs]).costs({0: 4.0, 1: 2.0})
    ((metres, end),) = (cost for frontier, cost in costs.items() if abs(frontier.bearing) < 0.1)
    assert (metres, end.vertex) == (2.0, 1)


def test_a_vertex_that_only_one_robot_knows_lies_on_the_edge_of_the_other() -> None:
    """One has seen a side way in the middle of what the other knows as one corridor."""
    places = np.array([(0.0, 0.0), (6.0, 0.0), (12.0, 0.0), (6.0, 5.0)])
    with_side = Building(places, ((0, 1), (1, 2), (1, 3)))
    straight = Building(places, ((0, 2),))
    site = Site([with_side.chart({1}, HERE), straight.chart({0, 2}, HERE)])
    (frontier,) = (f for many in site.open.values() for f in many)
    assert frontier.bearing == pytest.approx(math.pi / 2)
    assert sorted(onward.metres for onward in site.onward.values()) == pytest.approx(
        [6.0, 6.0], abs=0.2
    )


def test_a_vertex_where_another_robot_drove_and_found_none_is_no_frontier() -> None:
    """Seen from afar, half a room may look like a junction; who has been there knows better."""
    places = np.array([(0.0, 0.0), (6.0, 0.0), (12.0, 0.0), (6.0, 5.0)])
    with_side = Building(places, ((0, 1), (1, 2), (1, 3))).chart({1}, HERE)
    straight = Building(places, ((0, 2),)).chart({0, 2}, HERE)
    for charts in permutations([with_side, driven(straight)]):
        assert not Site(list(charts)).open


def test_a_vertex_that_a_robot_has_been_at_is_one_for_it_though_another_one_drove_past() -> None:
    """The other one, which found none there, does not go to look again."""
    places = np.array([(0.0, 0.0), (6.0, 0.0), (12.0, 0.0), (6.0, 5.0)])
    with_side = driven(Building(places, ((0, 1), (1, 2), (1, 3))).chart({0, 1}, HERE))
    straight = driven(Building(places, ((0, 2),)).chart({0, 2}, HERE))
    nowhere = Chart()
    for charts in ([with_side, straight], [nowhere, with_side, straight]):
        (frontier,) = (f for many in Site(charts).open.values() for f in many)
        assert frontier.bearing == pytest.approx(math.pi / 2)
    assert not Site([straight, with_side]).open


def test_a_departure_that_most_who_were_there_did_not_see_is_none() -> None:
    places = np.array([(0.0, 0.0), (6.0, 0.0), (12.0, 0.0), (6.0, 5.0)])
    with_side = Building(places, ((0, 1), (1, 2), (1, 3))).chart({0, 1, 2}, HERE)
    without = driven(Building(places, ((0, 1), (1, 2))).chart({0, 1, 2}, HERE))
    was_there = driven(with_side)
    for charts in permutations([with_side, without]):  # one has only seen it from afar
        assert not Site(list(charts)).open
    for charts in permutations([was_there, without, without]):
        assert not Site(list(charts)).open
    for charts in permutations([was_there, was_there, without]):
        is_seen = charts[0] is was_there
        assert bool(Site(list(charts)).own) == bool(Site(list(charts)).open) == is_seen


def test_of_two_who_were_there_the_one_that_saw_a_departure_takes_it() -> None:
    places = np.array([(0.0, 0.0), (6.0, 0.0), (12.0, 0.0), (6.0, 5.0)])
    with_side = driven(Building(places, ((0, 1), (1, 2), (1, 3))).chart({0, 1, 2}, HERE))
    without = driven(Building(places, ((0, 1), (1, 2))).chart({0, 1, 2}, HERE))
    (frontier,) = Site([with_side, without]).own.values()
    assert frontier.bearing == pytest.approx(math.pi / 2)
    assert not Site([without, with_side]).open


def way(*corners: tuple[float, float]) -> ChartWay:
    return ChartWay(resampled(np.array(corners), 0.2), 0.5)


def test_what_two_have_driven_from_both_ends_is_no_frontier() -> None:
    places = np.array([(0.0, 0.0), (10.0, 0.0), (0.0, 6.0), (10.0, 6.0)])
    building = Building(places, ((0, 1), (0, 2), (1, 3)))
    west, east = building.chart({0, 2}, HERE), building.chart({1, 3}, HERE)
    assert len(Site([west, east]).own) == 1
    site = Site(
        [
            replace(west, ways=(way((0.0, 0.0), (4.7, 0.0)),)),
            replace(east, ways=(way((10.0, 0.0), (5.3, 0.0)),)),
        ]
    )
    assert not site.open
    (onward,) = site.onward.values()
    assert onward.metres == pytest.approx(10.0, abs=0.1)


def test_an_edge_that_sets_out_towards_a_frontier_leads_not_behind_it() -> None:
    """It bends: at a vertex that was seen from afar only, lines begin beside their bearings."""
    places = np.array([(0.0, 0.0), (6.0, -6.0), (8.0, 0.0), (-6.0, 0.0)])
    building = Building(places, ((0, 1), (0, 2), (0, 3)))
    chart = building.chart({0, 1}, HERE)
    (known,) = chart.edges.values()
    bent = replace(known, polyline=way((0.0, 0.0), (1.0, -0.2), (6.0, -6.0)).polyline)
    west = building.chart({3}, HERE)
    told = replace(west, ways=(way((-6.0, 0.0), (-0.2, 0.0)),))
    site = Site([replace(chart, edges={known.id: bent}), told])
    assert [round(f.bearing, 2) for many in site.open.values() for f in many] == [0.0]


@pytest.mark.parametrize(("beyond", "is_left"), [(2.0, True), (4.0, False)])
def test_who_drove_well_past_a_vertex_that_one_robot_alone_has_seen_refutes_it(
    beyond: float, is_left: bool
) -> None:
    places = np.array([(0.0, 0.0), (6.0, 0.0), (12.0, 0.0), (6.0, 5.0)])
    with_side = Building(places, ((0, 1), (1, 2), (1, 3))).chart({1}, HERE)
    passing = replace(
        Building(places, ((0, 2),)).chart({0}, HERE), ways=(way((0.0, 0.0), (6.0 + beyond, 0.0)),)
    )
    site = Site([with_side, passing])
    upwards = [f for many in site.open.values() for f in many if abs(f.bearing - 1.57) < 0.1]
    assert bool(upwards) == is_left


def test_what_two_have_seen_is_not_refuted_by_one() -> None:
    places = np.array([(0.0, 0.0), (6.0, 0.0), (12.0, 0.0), (6.0, 5.0)])
    with_side = Building(places, ((0, 1), (1, 2), (1, 3))).chart({1}, HERE)
    passing = replace(
        Building(places, ((0, 2),)).chart({0}, HERE), ways=(way((0.0, 0.0), (10.0, 0.0)),)
    )
    site = Site([with_side, with_side, passing])
    assert any(abs(f.bearing - 1.57) < 0.1 for many in site.open.values() for f in many)


@pytest.mark.parametrize("y", [0.0, 49.0, 49.7, 50.0, 50.7])
def test_of_a_large_building_only_the_edges_beside_a_place_are_looked_at(y: float) -> None:
    """A street of 1,500 corridors along y = 50: three at most come near a place on it."""
    edges = {
        i: ChartEdge(
            *(i, HalfEdgeId(i, 1), HalfEdgeId(i + 1, 0), 9.0, 0.8),
            *(np.linspace((9.0 * i, 50.0), (9.0 * i + 9.0, 50.0), 90), True),
        )
        for i in range(1500)
    }
    about = _Edges(Chart({}, edges)).about
    for x in np.linspace(0.0, 90.0, 61):
        found = {edge.a.vertex for edge in about(np.array([x, y]))}
        is_beside = abs(y - 50.0) <= BESIDE_M
        beside = {i for i in range(11) if 9.0 * i <= x <= 9.0 * (i + 1)} if is_beside else set()
        assert beside <= found
        assert len(found) <= 3 * is_beside
