"""Two vertices made one, on a regular town."""

import math

import numpy as np
import pytest

from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId, Vertex
from gvgbot.autonomy.topology import (
    clearance_between,
    fuse,
    loose_ends,
    piece_of,
    split_edge_at,
    strays,
    take_out,
    tied_to,
)
from gvgbot.geometry import Pose, wrap_angle
from tests.unit.autonomy.graphs import (
    STREET,
    between,
    networkx_distances,
    random_multigraph,
    streets,
)

TURN = 0.3  # rad, of the doubled vertex' frame
ANGLE = math.radians(40)


def doubled(graph: GvgGraph, *bearings: float) -> Vertex:
    """A vertex entered a second time, with departures at bearings in the town's frame."""
    vertex = Vertex(graph.next_id(), 1.0, Pose(), 0.0, 0.0)
    for bearing in bearings:
        vertex.add_half_edge(bearing - TURN)
    graph.vertices[vertex.id] = vertex
    return vertex


def is_sound(graph: GvgGraph) -> bool:
    degrees = sum(vertex.degree for vertex in graph.vertices.values())
    ends = [end for edge in graph.edges.values() for end in (edge.a, edge.b)]
    paired = all(
        graph.edge_at(edge.a) is graph.edge_at(edge.b) is edge for edge in graph.edges.values()
    )
    return paired and degrees == len(ends) + len(graph.frontiers()) and len(set(ends)) == len(ends)


def with_vertex_in_street(
    sigma: float, *bearings: float
) -> tuple[GvgGraph, Belief, Vertex, dict[tuple[int, int], int]]:
    """A street with a vertex a decimetre beside its middle, and departures of that at bearings."""
    graph, ids = streets(2, 1)
    (street,) = graph.edges.values()
    street.polyline = np.linspace(street.polyline[0], street.polyline[-1], 11)
    middle = doubled(graph, *(TURN + bearing for bearing in bearings))
    places = np.array([[0.0, 0.0], [STREET, 0.0], [STREET / 2, 0.1]])
    P = np.zeros((12, 12))
    P[9:11, 9:11] = sigma**2 / 2 * np.eye(2)
    x = np.hstack([np.zeros(3), np.pad(places, ((0, 0), (0, 1))).ravel()])
    return graph, Belief(x, P, (ids[0, 0], ids[1, 0], middle.id)), middle, ids


@pytest.mark.parametrize(("sigma", "edges"), [(0.1, 2), (2.0, 1)])
def test_a_vertex_parts_an_edge_only_if_it_surely_stands_there(sigma: float, edges: int) -> None:
    graph, belief, middle, _ = with_vertex_in_street(sigma, 0.0, math.pi)
    split_edge_at(graph, belief, middle, reach=0.8, angle=ANGLE)
    assert len(graph.edges) == edges
    assert [edge.is_part for edge in graph.edges.values()] == [edges == 2] * edges
    lines = [belief.map_vertex(e.a.vertex).transform(e.polyline) for e in graph.edges.values()]
    places = {tuple(point) for line in lines for point in line.round(6).tolist()}
    assert places >= {(float(x), 0.0) for x in range(11)}  # all that it led over
    assert is_sound(graph)


@pytest.mark.parametrize("bearing", [0.0, math.pi])
@pytest.mark.parametrize("is_driven", [True, False])
def test_who_drove_all_along_an_edge_from_a_vertex_on_it_knows_that_it_leaves_both_ways(
    bearing: float, *, is_driven: bool
) -> None:
    graph, belief, middle, ids = with_vertex_in_street(0.1, bearing)
    driven = 0 if is_driven else None
    split_edge_at(graph, belief, middle, reach=0.8, angle=ANGLE, driven=driven)
    assert len(graph.edges) == 1 + is_driven
    assert middle.degree == 1 + is_driven
    if is_driven:
        assert abs(wrap_angle(middle.half_edges[1].bearing - bearing)) > 3.0
        for neighbour in ids.values():
            assert between(graph, middle.id, neighbour)
    assert is_sound(graph)


def test_an_edge_of_the_doubled_vertex_goes_to_the_known_one() -> None:
    """Found from the east, the corner gets the street that nobody knew there."""
    graph, ids = streets(2, 1)
    west, east = (graph.vertices[ids[x, 0]] for x in (0, 1))
    graph.unjoin(next(iter(graph.edges.values())))
    again = doubled(graph, 0.0)
    line = STREET * np.array([[0.0, 0.0], [math.cos(-TURN), math.sin(-TURN)]])
    graph.join(HalfEdgeId(again.id, 0), HalfEdgeId(east.id, 0), line, 0.8, driven=True)
    renamed, _ = fuse(graph, west, again, Pose(theta=TURN), ANGLE)
    assert renamed == {HalfEdgeId(again.id, 0): HalfEdgeId(west.id, 0)}
    (edge,) = graph.edges.values()
    assert {edge.a.vertex, edge.b.vertex} == {west.id, east.id}
    assert edge.polyline[-1] == pytest.approx((STREET, 0.0))
    assert again.id not in graph.vertices
    assert is_sound(graph)


def test_an_edge_that_both_have_is_kept_once() -> None:
    """A street driven twice, both its ends doubled; uniting the one leaves the other open."""
    graph, ids = streets(2, 1)
    west, east = (graph.vertices[ids[x, 0]] for x in (0, 1))
    west_again, east_again = doubled(graph, 0.0), doubled(graph, math.pi)
    ends = HalfEdgeId(west_again.id, 0), HalfEdgeId(east_again.id, 0)
    graph.join(*ends, np.array([[0.0, 0.0], [STREET, 0.0]]), 1.0, driven=True)
    fuse(graph, west, west_again, Pose(theta=TURN), ANGLE)
    assert graph.frontiers() == [ends[1]]
    fuse(graph, east, east_again, Pose(theta=TURN), ANGLE)
    assert graph.frontiers() == []
    assert between(graph, west.id, east.id)
    assert len(graph.edges) == 1
    assert is_sound(graph)


def test_vertices_to_which_the_same_departure_leads_may_be_one() -> None:
    """The street to the east was driven twice, and its end was taken for a new one the second time.

    To the north only the second drive went: that tells nothing.
    """
    graph, ids = streets(2, 1)
    west, east = (graph.vertices[ids[x, 0]] for x in (0, 1))
    west_again, east_again = doubled(graph, 0.0, math.pi / 2), doubled(graph, math.pi)
    north = doubled(graph, -math.pi / 2)
    for key, end in ((0, east_again), (1, north)):
        ends = HalfEdgeId(west_again.id, key), HalfEdgeId(end.id, 0)
        graph.join(*ends, np.array([[0.0, 0.0], [STREET, 0.0]]), 1.0, driven=True)
    _, twins = fuse(graph, west, west_again, Pose(theta=TURN), ANGLE)
    assert twins == [(east.id, east_again.id)]
    assert is_sound(graph)


def test_a_departure_that_only_the_doubled_vertex_has_is_a_frontier() -> None:
    graph, ids = streets(2, 1)
    west = graph.vertices[ids[0, 0]]
    fuse(graph, west, doubled(graph, 0.0, math.pi / 2), Pose(theta=TURN), ANGLE)
    (frontier,) = graph.frontiers()
    assert frontier.vertex == west.id
    assert west.half_edges[frontier.key].bearing == pytest.approx(math.pi / 2)
    assert is_sound(graph)


@pytest.mark.parametrize(
    ("known_is", "doubled_is", "stays"),
    [
        ("closed", "closed", True),
        ("closed", "open", False),
        ("open", "closed", False),
        (None, "closed", True),
        (None, "open", False),
    ],
)
def test_a_departure_stays_given_up_where_no_other_visit_found_it_open(
    known_is: str | None, doubled_is: str, *, stays: bool
) -> None:
    """Known or not, the way to the north had been closed, or not, under either name."""
    graph, ids = streets(2, 1)
    west = graph.vertices[ids[0, 0]]
    if known_is is not None:
        west.half_edges[west.add_half_edge(math.pi / 2)].blocked = known_is == "closed"
    again = doubled(graph, 0.0, math.pi / 2)
    again.half_edges[1].blocked = doubled_is == "closed"
    renamed, _ = fuse(graph, west, again, Pose(theta=TURN), ANGLE)
    north = renamed[HalfEdgeId(again.id, 1)]
    assert (graph.blocked(), graph.frontiers()) == (([north], []) if stays else ([], [north]))


def test_who_goes_on_from_a_vertex_that_is_none_came_from_the_one_before() -> None:
    """Turned about the origin, the town has its west corner in the south."""
    graph, ids = streets(2, 1)
    west, east = (graph.vertices[ids[x, 0]] for x in (0, 1))
    arrival, onward = HalfEdgeId(east.id, next(iter(east.half_edges))), east.add_half_edge(0.5)
    x = np.array([0.0, 0.0, 0.0, 1.0, -STREET, math.pi / 2, 1.0, 0.0, math.pi / 2])
    belief = Belief(x, np.eye(9), (west.id, east.id))
    found = loose_ends(graph, belief, east)
    assert found.keys() == {arrival, HalfEdgeId(east.id, onward)}
    for far, line in found.values():
        assert far.vertex == west.id
        assert line[[0, -1]] == pytest.approx(np.array([[1.0, -STREET], [1.0, 0.0]]))


@pytest.mark.parametrize("away", [0.5, 3.0])
def test_beside_two_edges_only_who_has_not_gone_on_is_known_to_be_on_one(away: float) -> None:
    """Who has gone on may have come over either, or over none: there may be a way after all."""
    graph, ids = streets(3, 1)
    middle = graph.vertices[ids[1, 0]]
    onward = HalfEdgeId(middle.id, middle.add_half_edge(1.5))
    places = np.array([(k * STREET, 0.0, 0.0) for k in range(3)])
    x = np.hstack([(STREET, away, 0.0), places.ravel()])
    found = loose_ends(graph, Belief(x, np.eye(12), tuple(ids[k, 0] for k in range(3))), middle)
    assert (onward in found) is (away < 1.0)
    assert {far.vertex for far, _ in found.values()} == {ids[0, 0], ids[2, 0]}


@pytest.mark.parametrize(("size", "strange"), [(1, 1), (3, 3), (4, 0)])
def test_a_few_vertices_that_nothing_leads_to_are_strays(size: int, strange: int) -> None:
    """A street of ten crossings is parted after some; what was tried in vain stays."""
    graph, ids = streets(10, 1)
    assert strays(graph) == []
    first, other = ids[size - 1, 0], ids[size, 0]
    cut = between(graph, first, other)
    edge = graph.edge_at(cut)
    assert edge is not None
    graph.unjoin(edge)
    assert {vertex.id for vertex in strays(graph)} == {ids[x, 0] for x in range(strange)}
    graph.vertices[first].half_edges[cut.key].blocked = True
    assert strays(graph) == []


@pytest.mark.parametrize(("size", "driven", "strange"), [(4, 0, 4), (4, 1, 0), (6, 0, 6)])
def test_what_was_only_seen_is_strange_however_large_it_is(
    size: int, driven: int, strange: int
) -> None:
    """A room behind glass, and what the robot has driven through, which may be the smaller part."""
    graph, ids = streets(10, 1)
    edge = graph.edge_at(between(graph, ids[size - 1, 0], ids[size, 0]))
    assert edge is not None
    graph.unjoin(edge)
    seen = [e for e in graph.edges.values() if e.a.vertex in {ids[x, 0] for x in range(size)}]
    for edge in seen[driven:]:
        edge.traversals = 0
    assert {vertex.id for vertex in strays(graph)} == {ids[x, 0] for x in range(strange)}


@pytest.mark.parametrize(("third", "edges"), [(None, 1), (math.pi / 2, 0), (math.pi, 1)])
def test_two_edges_of_what_is_none_become_one_unless_a_third_way_goes_straight_on(
    third: float | None, edges: int
) -> None:
    """At the corner of two streets nothing else led on, or it did: past the corner, or not."""
    graph, ids = streets(2, 2)
    corner, east, north = ids[0, 0], ids[1, 0], ids[0, 1]
    far = ids[1, 1]
    graph.remove_vertex(far)
    if third == math.pi:  # the edges lead east and west, as if the second street bent elsewhere
        graph.vertices[corner].half_edges[between(graph, corner, north).key].bearing = math.pi
        third = math.pi / 2
    if third is not None:
        graph.vertices[corner].add_half_edge(third)
    places = np.array([[0.0, 0.0], [STREET, 0.0], [0.0, STREET]])
    x = np.hstack([np.zeros(3), np.pad(places, ((0, 0), (0, 1))).ravel()])
    belief = Belief(x, np.zeros((12, 12)), (corner, east, north))
    take_out(graph, belief, graph.vertices[corner])
    assert len(graph.edges) == edges
    assert len(graph.frontiers()) == 2 * (2 - edges)  # to the far corner, and what was lost
    assert is_sound(graph)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_what_was_made_of_two_edges_is_of_the_finished_map_if_both_were(count: int) -> None:
    """And it is a part of another edge if both were: then it may have more room than it says."""
    graph, ids = streets(3, 1)
    for edge in list(graph.edges.values())[:count]:
        edge.established = edge.is_part = True
    places = np.array([[x * STREET, 0.0, 0.0] for x in range(3)])
    belief = Belief(
        np.hstack([np.zeros(3), places.ravel()]), np.zeros((12, 12)), tuple(ids.values())
    )
    take_out(graph, belief, graph.vertices[ids[1, 0]])
    (edge,) = graph.edges.values()
    assert edge.established == edge.is_part == (count == 2)
    assert edge.length == pytest.approx(2 * STREET)


@pytest.mark.parametrize("narrow", [0, 1])
def test_what_was_made_of_two_edges_is_as_narrow_as_the_narrower_one(narrow: int) -> None:
    graph, ids = streets(3, 1)
    list(graph.edges.values())[narrow].min_clearance = 0.3
    places = np.array([[x * STREET, 0.0, 0.0] for x in range(3)])
    x = np.hstack([np.zeros(3), places.ravel()])
    take_out(graph, Belief(x, np.zeros((12, 12)), tuple(ids.values())), graph.vertices[ids[1, 0]])
    (edge,) = graph.edges.values()
    assert edge.min_clearance == 0.3


@pytest.mark.parametrize("seed", range(20))
def test_what_hangs_together_with_a_vertex_is_what_edges_lead_to(seed: int) -> None:
    graph = random_multigraph(np.random.default_rng(seed))
    for edge in graph.edges.values():
        graph.vertices[edge.a.vertex].half_edges[edge.a.key].blocked = seed % 2 == 1
    for vertex in graph.vertices:
        assert piece_of(graph, vertex) == {vertex, *networkx_distances(graph, [(vertex, 0.0)])}
    assert piece_of(graph, 99) == set()


def test_a_line_is_bent_to_its_vertices_only_near_to_them() -> None:
    line = np.linspace((0.0, 0.0), (10.0, 0.0), 101)
    tied = tied_to(line, np.array([0.0, 0.4]), np.array([10.2, 0.0]), (1.0, 2.0))
    assert tied[[0, -1]].tolist() == [[0.0, 0.4], [10.2, 0.0]]
    assert np.array_equal(tied[11:80], line[11:80])
    assert np.abs(np.diff(tied[:, 1])).max() <= 0.4 / 10 + 1e-9  # evenly over a metre
    short = tied_to(line[:5], np.array([0.0, 3.0]), line[4], (1.0, 1.0))
    assert short[[0, -1]].tolist() == [[0.0, 3.0], line[4].tolist()]


def test_between_two_wide_places_near_to_each_other_it_is_wide() -> None:
    line = np.linspace((0.0, 0.0), (1.2, 0.0), 121)
    assert clearance_between(line, 1.5, 1.3) == pytest.approx(0.8, abs=0.01)
    assert clearance_between(np.linspace((0.0, 0.0), (9.0, 0.0), 91), 1.5, 1.3) < 0.0
