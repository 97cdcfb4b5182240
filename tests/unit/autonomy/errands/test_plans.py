"""Which stops a patrol and a coverage make, driven by somebody who takes the shortest ways."""

import math

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.autonomy.errands.driving import Ended
from gvgbot.autonomy.errands.kinds import Coverage, Patrol, Rest, ToVertex, Waypoint
from gvgbot.autonomy.errands.plans import AllEdges, Here, Kept, Plan, Rounds, plan_for, recalled
from gvgbot.autonomy.events import Recovery, RoundEnded
from gvgbot.autonomy.exploration.paths import Approach
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId, Vertex
from gvgbot.autonomy.slam.names import Names
from gvgbot.autonomy.topology import fuse
from gvgbot.geometry import Pose
from tests.unit.autonomy.graphs import STREET, random_multigraph, streets

ARRIVED, GIVEN_UP = Ended("arrived", ""), Ended("given up", "a door is shut")
STEP = 0.25  # m
Point = int | tuple[int, int]  # a vertex, or an edge and the number of a step on it


def here(graph: GvgGraph, vertex: int, travelled: float = 0.0, names: Names | None = None) -> Here:
    starts = [Approach(0.0, HalfEdgeId(vertex, -1))]
    return Here(0.0, graph, starts, travelled, names or Names())


def in_steps(graph: GvgGraph) -> nx.Graph:
    """The graph with a node for each step on an edge."""
    town = nx.Graph()
    town.add_nodes_from(graph.vertices)
    for edge in graph.edges.values():
        steps = round(edge.length / STEP)
        line: list[Point] = [edge.a.vertex]
        line += [(edge.id, i) for i in range(1, steps)] + [edge.b.vertex]
        nx.add_path(town, line)
    return town


def point_of(graph: GvgGraph, stop: Waypoint | ToVertex) -> Point:
    if isinstance(stop, ToVertex):
        return stop.vertex
    edge = graph.edge_at(stop.end)
    assert edge is not None
    station = stop.station if stop.end == edge.a else edge.length - stop.station
    step = round(station / STEP)
    ends = {0: edge.a.vertex, round(edge.length / STEP): edge.b.vertex}
    return ends.get(step, (edge.id, step))


def drive(graph: GvgGraph, plan: Plan, start: int) -> list[Point]:
    """All points on the way, until the plan ends."""
    town, at, way = in_steps(graph), start, list[Point]()
    place: Point = at
    while not isinstance(stop := plan.next(here(graph, at)), Ended):
        assert isinstance(stop, Waypoint | ToVertex)
        goal = point_of(graph, stop)
        way += nx.shortest_path(town, place, goal)
        place = goal
        plan.note(here(graph, at), ARRIVED)
    assert stop.outcome == "arrived"
    return way


@given(st.integers(0, 2**32 - 1))
def test_who_drives_to_all_stops_of_a_coverage_has_driven_all_edges(seed: int) -> None:
    rng = np.random.default_rng(seed)
    graph = random_multigraph(rng)
    for vertex in graph.vertices.values():
        for half in vertex.half_edges.values():
            half.blocked = False
    start = int(rng.choice(list(graph.vertices)))
    way = set(drive(graph, AllEdges(Coverage()), start))
    connected = nx.node_connected_component(in_steps(graph), start)
    margin = round(0.5 / STEP) + 1
    for edge in graph.edges.values():
        steps = round(edge.length / STEP)
        inner = {(edge.id, i) for i in range(margin, steps - margin + 1)}
        assert inner <= way or edge.a.vertex not in connected
        ends = {end.vertex for end in (edge.a, edge.b) if graph.vertices[end.vertex].degree == 1}
        assert ends <= way or edge.a.vertex not in connected


def test_a_coverage_goes_on_after_a_restart_where_it_was() -> None:
    graph, ids = streets(3, 3)
    plan: Plan = AllEdges(Coverage())
    for _ in range(13):  # three edges, with four stops each, and a bit
        plan.next(here(graph, ids[0, 0]))
        plan.note(here(graph, ids[0, 0]), ARRIVED)
    assert str(plan) == "coverage, 3 of 12 edges"
    kept = plan.kept()
    assert kept is not None
    again = recalled(kept)
    assert (str(again), again.kept()) == (str(plan), kept)
    assert isinstance(again.next(here(graph, ids[0, 0])), Waypoint)


def test_an_edge_that_cannot_be_driven_is_tried_once_more_at_the_end_and_told_of() -> None:
    graph, ids = streets(2, 2)
    plan, refused = AllEdges(Coverage()), list[HalfEdgeId]()
    shut = next(iter(graph.edges.values()))
    while not isinstance(stop := plan.next(here(graph, ids[0, 0])), Ended):
        is_shut = isinstance(stop, Waypoint) and stop.end in (shut.a, shut.b)
        if is_shut and isinstance(stop, Waypoint):
            refused.append(stop.end)
        plan.note(here(graph, ids[0, 0]), GIVEN_UP if is_shut else ARRIVED)
    assert len(refused) == 2
    assert stop == Ended("given up", "3 of 4 edges driven")
    assert [event.action for event in plan.happened if isinstance(event, Recovery)] == [
        "leave out an edge"
    ] * 2


def visits(plan: Plan, graph: GvgGraph, at: int, count: int) -> list[int]:
    """The first vertices of a patrol."""
    found = []
    for i in range(count):
        stop = plan.next(here(graph, at, travelled=10.0 * i))
        assert isinstance(stop, ToVertex)
        found.append(stop.vertex)
        at = stop.vertex
        plan.note(here(graph, at, travelled=10.0 * i), ARRIVED)
    return found


def test_a_patrol_keeps_to_the_order_that_was_asked_for_over_and_over() -> None:
    graph, ids = streets(3, 1)
    a, b, c = ids[0, 0], ids[1, 0], ids[2, 0]
    assert visits(Rounds(Patrol((a, c, b))), graph, b, 7) == [a, c, b, a, c, b, a]


def test_a_patrol_of_all_takes_the_nearest_first() -> None:
    graph, ids = streets(4, 1)
    plan = Rounds(Patrol())
    assert visits(plan, graph, ids[1, 0], 4) == [ids[x, 0] for x in (1, 0, 2, 3)]
    plan.next(here(graph, ids[3, 0], travelled=50.0))
    assert [event for event in plan.happened if isinstance(event, RoundEnded)] == [
        RoundEnded(0.0, 1, reached=4, missed=0)
    ]


def test_a_patrol_leaves_out_what_it_cannot_reach_and_comes_again() -> None:
    graph, ids = streets(3, 1)
    plan = Rounds(Patrol((ids[0, 0], ids[2, 0])))
    for ended in (ARRIVED, GIVEN_UP):
        plan.next(here(graph, ids[0, 0]))
        plan.note(here(graph, ids[0, 0], travelled=5.0), ended)
    assert plan.next(here(graph, ids[0, 0], travelled=9.0)) == ToVertex(ids[0, 0])
    assert plan.happened[-1] == RoundEnded(0.0, 1, reached=1, missed=1)


def test_a_patrol_that_leads_nowhere_rests_before_it_tries_again() -> None:
    graph, ids = streets(2, 1)
    plan = Rounds(Patrol())
    stops = []
    for _ in range(6):
        stops.append(type(plan.next(here(graph, ids[0, 0]))))
        plan.note(here(graph, ids[0, 0]), GIVEN_UP if stops[-1] is ToVertex else ARRIVED)
    assert stops == [ToVertex, ToVertex, Rest] * 2


def test_a_patrol_goes_on_after_a_restart_with_what_is_left_of_its_round() -> None:
    graph, ids = streets(3, 1)
    plan = Rounds(Patrol(tuple(ids.values())))
    visits(plan, graph, ids[0, 0], 4)
    kept = plan.kept()
    assert kept is not None
    rest = visits(recalled(kept), graph, ids[0, 0], 3)
    assert rest == [ids[1, 0], ids[2, 0], ids[0, 0]]


def test_vertices_that_are_not_in_the_map_any_more_are_no_stops() -> None:
    graph, ids = streets(3, 1)
    plan = Rounds(Patrol((ids[0, 0], 99, ids[2, 0])))
    assert visits(plan, graph, ids[0, 0], 2) == [ids[0, 0], ids[2, 0]]
    assert isinstance(Rounds(Patrol((98, 99))).next(here(graph, ids[0, 0])), Ended)


def entered_twice() -> tuple[GvgGraph, dict[tuple[int, int], int], Vertex, HalfEdgeId]:
    """A street of three crossings, another vertex where the first is, and a dead end there."""
    graph, ids = streets(3, 1)
    again, end = (Vertex(graph.next_id(), 1.0, Pose(), 0.0, 0.0) for _ in range(2))
    graph.vertices |= {vertex.id: vertex for vertex in (again, end)}
    out = HalfEdgeId(again.id, again.add_half_edge(2.0))
    line = STREET * np.array([[0.0, 0.0], [math.cos(2.0), math.sin(2.0)]])
    graph.join(out, HalfEdgeId(end.id, end.add_half_edge(-1.0)), line, 1.0, driven=True)
    return graph, ids, again, out


def test_a_patrol_goes_on_to_the_known_vertex_that_one_of_its_own_proves_to_be() -> None:
    graph, ids, again, _ = entered_twice()
    plan, names = Rounds(Patrol((again.id, ids[2, 0]))), Names()
    names.change(fuse(graph, graph.vertices[ids[0, 0]], again, Pose(), 0.5).renamed)
    for i, vertex in enumerate((again.id, ids[2, 0]) * 2):
        assert plan.next(here(graph, ids[1, 0], 10.0 * i, names)) == ToVertex(vertex)
        plan.note(here(graph, ids[1, 0], 10.0 * i, names), ARRIVED)
    kept = plan.kept()
    assert kept is not None
    assert kept.renamed(names).vertices == (ids[0, 0], ids[2, 0])


def test_a_coverage_drives_the_edge_of_a_vertex_that_proves_to_be_a_known_one() -> None:
    graph, ids, again, out = entered_twice()
    plan, names = AllEdges(Coverage(), Kept("coverage", departures=(out,))), Names()
    names.change(fuse(graph, graph.vertices[ids[0, 0]], again, Pose(), 0.5).renamed)
    stops = []
    while not isinstance(stop := plan.next(here(graph, ids[0, 0], names=names)), Ended):
        stops.append(stop)
        plan.note(here(graph, ids[0, 0], names=names), ARRIVED)
    assert len(stops) == 5
    assert Kept("coverage", departures=(out,)).renamed(names).departures == (names.half_edge(out),)


@pytest.mark.parametrize("errand", [ToVertex(3), Patrol((1, 2)), Coverage()])
def test_what_is_kept_becomes_the_same_errand(errand: ToVertex | Patrol | Coverage) -> None:
    kept = plan_for(errand).kept()
    assert kept is not None
    assert recalled(kept).errand == errand
