"""The graph keeps its books under any sequence of joins and removals."""

import copy
import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.autonomy.slam.graph import Edge, GvgGraph, HalfEdgeId, Vertex
from gvgbot.geometry import Pose
from tests.unit.autonomy.graphs import part_of_a_town

LINE = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])  # 7 m


def add_vertex(graph: GvgGraph, *bearings: float, at: tuple[float, float] = (0.0, 0.0)) -> Vertex:
    vertex = Vertex(graph.next_id(), 1.0, Pose(*at), 0.0, 0.0)
    for bearing in bearings:
        vertex.add_half_edge(bearing)
    graph.vertices[vertex.id] = vertex
    return vertex


def test_a_new_vertex_has_been_seen_once_and_nothing_speaks_against_it() -> None:
    vertex = Vertex(1, 1.0, Pose(), 0.0, 0.0)
    assert (vertex.sightings, vertex.visits) == (1, 1)
    assert (vertex.misses, vertex.surplus, vertex.unclear, vertex.doubted_since) == (0, 0, 0, None)
    assert vertex.snapshot.shape == vertex.sights.shape == (0, 2)


@pytest.mark.parametrize(
    ("degree", "kind"), [(1, "endpoint"), (2, "meetpoint"), (3, "meetpoint"), (5, "meetpoint")]
)
def test_a_vertex_with_one_way_only_is_an_endpoint(degree: int, kind: str) -> None:
    assert add_vertex(GvgGraph(), *range(degree)).kind == kind


def test_a_new_half_edge_leads_somewhere_and_an_edge_has_nothing_against_it() -> None:
    graph = GvgGraph()
    a, b = (add_vertex(graph, 0.0) for _ in range(2))
    assert (a.id, b.id) == (1, 2)
    assert a.half_edges[0].open
    assert a.half_edges[0].misses == 0
    edge = join(graph, HalfEdgeId(a.id, 0), HalfEdgeId(b.id, 0))
    assert (edge.conflicts, edge.established, edge.doubted_since) == (0, False, None)


def test_there_is_no_other_vertex_nearer_than_half_the_shortest_edge() -> None:
    graph = GvgGraph()
    vertex, a, b = add_vertex(graph, 0.0, 1.0, 2.0), add_vertex(graph, 0.0), add_vertex(graph, 0.0)
    assert graph.reach(vertex) == vertex.clearance
    for key, other, line in ((0, a, LINE), (2, b, 2 * LINE)):
        ends = HalfEdgeId(vertex.id, key), HalfEdgeId(other.id, 0)
        graph.join(*ends, line, 0.5, driven=True)
    assert (graph.reach(vertex), graph.reach(b)) == (3.5, 7.0)


def join(graph: GvgGraph, a: HalfEdgeId, b: HalfEdgeId) -> Edge:
    return graph.join(a, b, LINE, 0.5, driven=True)


def random_graph(rng: np.random.Generator, changes: int) -> GvgGraph:
    """Vertices of random degrees after random joins, blocks and removals."""
    graph = GvgGraph()
    for _ in range(int(rng.integers(1, 7))):
        add_vertex(graph, *rng.uniform(-3.0, 3.0, int(rng.integers(1, 6))))
    change(graph, rng, changes)
    return graph


def change(graph: GvgGraph, rng: np.random.Generator, changes: int) -> None:
    actions = [_join_two, _join_two, _block_one, _unjoin_one, _remove_half_edge, _remove_vertex]
    for _ in range(changes):
        actions[int(rng.integers(len(actions)))](graph, rng)


def _join_two(graph: GvgGraph, rng: np.random.Generator) -> None:
    open_ends = graph.frontiers()
    if len(open_ends) >= 2:
        i, j = rng.choice(len(open_ends), 2, replace=False)
        join(graph, open_ends[i], open_ends[j])


def _block_one(graph: GvgGraph, rng: np.random.Generator) -> None:
    if graph.frontiers():
        end = graph.frontiers()[int(rng.integers(len(graph.frontiers())))]
        graph.vertices[end.vertex].half_edges[end.key].blocked = True


def _unjoin_one(graph: GvgGraph, rng: np.random.Generator) -> None:
    if graph.edges:
        graph.unjoin(list(graph.edges.values())[int(rng.integers(len(graph.edges)))])


def _remove_half_edge(graph: GvgGraph, rng: np.random.Generator) -> None:
    ends = [HalfEdgeId(v.id, key) for v in graph.vertices.values() for key in v.half_edges]
    if ends:
        graph.remove_half_edge(ends[int(rng.integers(len(ends)))])


def _remove_vertex(graph: GvgGraph, rng: np.random.Generator) -> None:
    if len(graph.vertices) > 1:
        graph.remove_vertex(list(graph.vertices)[int(rng.integers(len(graph.vertices)))])


@given(st.integers(0, 2**32 - 1), st.integers(0, 40))
def test_every_half_edge_is_half_of_an_edge_or_a_frontier_or_blocked(seed: int, n: int) -> None:
    graph = random_graph(np.random.default_rng(seed), n)
    degrees = sum(vertex.degree for vertex in graph.vertices.values())
    assert degrees == 2 * len(graph.edges) + len(graph.frontiers()) + len(graph.blocked())


@given(st.integers(0, 2**32 - 1), st.integers(0, 40))
def test_edges_and_half_edges_always_point_at_each_other(seed: int, n: int) -> None:
    graph = random_graph(np.random.default_rng(seed), n)
    for edge in graph.edges.values():
        assert edge.a != edge.b
        assert graph.edge_at(edge.a) is edge
        assert graph.edge_at(edge.b) is edge
        assert edge.other(edge.a) == edge.b
        assert edge.other(edge.b) == edge.a
    used = [h.edge for v in graph.vertices.values() for h in v.half_edges.values()]
    assert {edge for edge in used if edge is not None} == graph.edges.keys()


@given(st.integers(0, 2**32 - 1), st.integers(0, 40))
def test_ids_are_unique_over_vertices_and_edges(seed: int, n: int) -> None:
    graph = random_graph(np.random.default_rng(seed), n)
    ids = [*graph.vertices, *graph.edges]
    assert len(ids) == len(set(ids))
    assert graph.next_id() not in ids


@given(st.integers(0, 2**32 - 1), st.integers(0, 20), st.integers(0, 20))
def test_a_copy_stays_as_the_graph_was_and_shares_its_lines(seed: int, n: int, more: int) -> None:
    rng = np.random.default_rng(seed)
    graph = random_graph(rng, n)
    copied, as_it_was = graph.copied(), copy.deepcopy(graph)
    assert all(edge.polyline is copied.edges[i].polyline for i, edge in graph.edges.items())
    change(graph, rng, more)
    graph.next_id()
    assert repr(copied) == repr(as_it_was)


def test_a_self_loop_takes_two_half_edges_of_one_vertex() -> None:
    graph = GvgGraph()
    vertex = add_vertex(graph, 0.0, 2.0, 4.0)
    loop = join(graph, HalfEdgeId(vertex.id, 0), HalfEdgeId(vertex.id, 1))
    assert graph.frontiers() == [HalfEdgeId(vertex.id, 2)]
    assert loop.other(HalfEdgeId(vertex.id, 0)) == HalfEdgeId(vertex.id, 1)
    graph.remove_half_edge(HalfEdgeId(vertex.id, 0))
    assert graph.frontiers() == [HalfEdgeId(vertex.id, 1), HalfEdgeId(vertex.id, 2)]


def test_a_ring_s_vertex_without_its_other_departures_is_one_of_the_ring_only() -> None:
    graph = GvgGraph()
    vertex = add_vertex(graph, 0.0, 2.0, 4.0)
    assert not graph.leave_ring(vertex)
    join(graph, HalfEdgeId(vertex.id, 0), HalfEdgeId(vertex.id, 1))
    assert graph.leave_ring(vertex)
    assert graph.rings() == [vertex]
    assert not graph.leave_ring(vertex)  # nothing else is left


def test_a_vertex_between_two_edges_is_on_no_ring() -> None:
    graph = GvgGraph()
    one, other = add_vertex(graph, 0.0, 2.0, 4.0), add_vertex(graph, 0.0, 2.0)
    join(graph, HalfEdgeId(one.id, 0), HalfEdgeId(other.id, 0))
    join(graph, HalfEdgeId(one.id, 1), HalfEdgeId(other.id, 1))
    assert not graph.leave_ring(one)
    assert one.degree == 3


def test_parallel_edges_stay_apart() -> None:
    graph = GvgGraph()
    one, other = add_vertex(graph, 0.0, 1.0), add_vertex(graph, 2.0, 3.0)
    edges = [join(graph, HalfEdgeId(one.id, k), HalfEdgeId(other.id, k)) for k in (0, 1)]
    graph.unjoin(edges[0])
    assert graph.edge_at(HalfEdgeId(one.id, 0)) is None
    assert graph.edge_at(HalfEdgeId(one.id, 1)) is edges[1]


def test_the_length_of_an_edge_is_that_of_its_polyline() -> None:
    graph = GvgGraph()
    vertex = add_vertex(graph, 0.0, 1.0)
    assert join(graph, HalfEdgeId(vertex.id, 0), HalfEdgeId(vertex.id, 1)).length == 7.0


def test_an_edge_that_was_driven_has_been_traversed_once() -> None:
    graph = GvgGraph()
    one, other = add_vertex(graph, 0.0, 1.0), add_vertex(graph, 2.0, 3.0)
    for key, driven in enumerate((True, False)):
        ends = HalfEdgeId(one.id, key), HalfEdgeId(other.id, key)
        assert graph.join(*ends, LINE, 0.5, driven=driven).traversals == driven


EAST, NORTH, WEST, SOUTH = 0, 1, 2, 3  # keys in the order they were added


@pytest.mark.parametrize(
    ("arrival", "order"),
    [
        (SOUTH, [WEST, NORTH, EAST, SOUTH]),  # driving north: left, straight on, right, back
        (WEST, [NORTH, EAST, SOUTH, WEST]),
        (NORTH, [EAST, SOUTH, WEST, NORTH]),
        (EAST, [SOUTH, WEST, NORTH, EAST]),
    ],
)
@pytest.mark.parametrize("turned", [0.0, 1.0, -2.5, math.pi])
def test_clockwise_at_a_crossing_is_left_straight_right_back(
    arrival: int, order: list[int], turned: float
) -> None:
    vertex = add_vertex(GvgGraph(), *(turned + k * math.pi / 2 for k in range(4)))
    assert vertex.clockwise_from(arrival) == order


def test_removing_a_vertex_reopens_the_far_ends_of_its_edges() -> None:
    graph = GvgGraph()
    hub = add_vertex(graph, 0.0, 1.0, 2.0, 3.0)
    rim = [add_vertex(graph, 0.0, 2.0) for _ in range(2)]
    for key, vertex in enumerate(rim):
        join(graph, HalfEdgeId(hub.id, key), HalfEdgeId(vertex.id, 0))
    kept = join(graph, HalfEdgeId(rim[0].id, 1), HalfEdgeId(rim[1].id, 1))
    join(graph, HalfEdgeId(hub.id, 2), HalfEdgeId(hub.id, 3))
    graph.remove_vertex(hub.id)
    assert list(graph.edges.values()) == [kept]
    assert graph.frontiers() == [HalfEdgeId(vertex.id, 0) for vertex in rim]
    assert graph.half_edge(HalfEdgeId(hub.id, 0)) is None
    assert graph.edge_at(HalfEdgeId(hub.id, 0)) is None


# -- rotation order ------------------------------------------------------------------------------


def faces(graph: GvgGraph, following: Callable[[Vertex, int], int]) -> int:
    """How many closed walks there are that turn the same way at every vertex."""
    walks, left = 0, [HalfEdgeId(v.id, k) for v in graph.vertices.values() for k in v.half_edges]
    while left:
        walks += 1
        here = start = left[0]
        while True:
            left.remove(here)
            edge = graph.edge_at(here)
            assert edge is not None
            there = edge.other(here)
            here = HalfEdgeId(there.vertex, following(graph.vertices[there.vertex], there.key))
            if here == start:
                break
    return walks


def planar_graph(rng: np.random.Generator) -> tuple[GvgGraph, int]:
    """A part of a town as a graph, and its number of vertices."""
    crossings, ways = part_of_a_town(rng)
    graph = GvgGraph()
    ids = {
        place: add_vertex(graph, at=(float(place[0]), float(place[1]))).id for place in crossings
    }
    for a, b in ways:
        out = math.atan2(b[1] - a[1], b[0] - a[0])
        ends = [
            HalfEdgeId(ids[n], graph.vertices[ids[n]].add_half_edge(out + back))
            for n, back in ((a, 0.0), (b, math.pi))
        ]
        join(graph, ends[0], ends[1])
    return graph, len(ids)


@given(st.integers(0, 2**32 - 1))
def test_turning_clockwise_at_every_vertex_traces_the_faces_that_euler_counts(seed: int) -> None:
    graph, vertices = planar_graph(np.random.default_rng(seed))
    if graph.edges:
        traced = faces(graph, lambda vertex, key: vertex.clockwise_from(key)[0])
        assert vertices - len(graph.edges) + traced == 2
