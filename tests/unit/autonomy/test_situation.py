"""The ways from where the robot is, on graphs drawn by hand."""

import math

import numpy as np
import pytest

from gvgbot.autonomy.destinations import foot_at, route_to_foot
from gvgbot.autonomy.exploration.access import Access
from gvgbot.autonomy.exploration.paths import first_arrival, shortest_paths
from gvgbot.autonomy.gvg.local import Branch
from gvgbot.autonomy.situation import Situation
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId, Vertex
from gvgbot.autonomy.views import Correspondence
from gvgbot.autonomy.whereabouts import Whereabouts
from gvgbot.geometry import Pose, length_of
from tests.unit.autonomy.corridors import (
    ALL_KNOWN,
    CORRIDOR,
    EAST,
    LOOP,
    WEST,
    Walk,
    known_as,
)
from tests.unit.autonomy.local_graphs import Point, drawn, resampled


def corridor_graph() -> GvgGraph:
    """Three vertices; the first edge is known, the second and the branch south are frontiers."""
    graph = GvgGraph()
    for name, x, keys in ((1, 0.0, 1), (2, 6.0, 3), (3, 12.0, 2)):
        graph.vertices[name] = Vertex(name, 1.0, Pose(x, 0.0), 0.0, 0.0)
        for _ in range(keys):
            graph.vertices[name].add_half_edge(0.0)
    line = np.array([[0.0, 0.0], [6.0, 0.0]])
    graph.serial = 3
    graph.join(HalfEdgeId(1, EAST), HalfEdgeId(2, WEST), line, 1.0, driven=True)
    return graph


def situation(x: float, known: Correspondence = ALL_KNOWN) -> Situation:
    place = CORRIDOR.place(np.array([x, 0.0]))
    assert place is not None
    where = Whereabouts(HalfEdgeId(1, EAST), [np.array([0.0, 0.0]), np.array([x, 0.0])])
    return Situation(CORRIDOR, known, corridor_graph(), where, Access(place), Pose(x, 0.0, 0.0))


def test_the_first_vertices_within_reach_are_the_ends_of_the_edge_with_their_distances() -> None:
    starts = {s.arrival: s.metres for s in situation(2.0).starts()}
    assert starts == pytest.approx({HalfEdgeId(1, EAST): 2.0, HalfEdgeId(2, WEST): 4.0})


def test_an_end_out_of_sight_is_as_far_as_the_trail_and_the_edge_say() -> None:
    only_first = known_as({Branch(10, forward=True): HalfEdgeId(1, EAST)}, {1: 1})
    starts = {s.arrival: s.metres for s in situation(2.0, only_first).starts()}
    assert starts[HalfEdgeId(2, WEST)] == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize("x", [1.0, 4.0])
@pytest.mark.parametrize(("key", "end"), [(EAST, (12.0, 0.0)), (2, (6.0, -3.0))])
def test_the_way_to_a_frontier_goes_into_it(x: float, key: int, end: Point) -> None:
    here = situation(x)
    path = here.path_to(HalfEdgeId(2, key))
    assert path is not None
    line, _ = CORRIDOR.line_from(here.place, path)
    assert line[0] == pytest.approx([x, 0.0], abs=0.11)
    assert line[-1] == pytest.approx(end)


def test_who_is_a_step_past_a_vertex_on_its_way_does_not_go_back_to_it() -> None:
    here = situation(6.2)
    path = here.path_to(HalfEdgeId(2, EAST))
    assert path is not None
    line, _ = CORRIDOR.line_from(here.place, path)
    assert np.all(np.diff(line[:, 0]) > 0.0)
    assert line[-1] == pytest.approx((12.0, 0.0))


def test_there_is_no_way_to_a_frontier_of_another_piece_of_the_graph() -> None:
    here = situation(2.0, known_as({Branch(10, forward=True): HalfEdgeId(1, EAST)}, {1: 1}))
    assert here.path_to(HalfEdgeId(3, 1)) is None


@pytest.mark.parametrize(("heading", "end"), [(0.0, (6.0, 0.0)), (math.pi, (0.0, 0.0))])
def test_without_a_trail_ahead_is_where_the_robot_faces(heading: float, end: Point) -> None:
    place = CORRIDOR.place(np.array([3.0, 0.0]))
    assert place is not None
    here = Situation(
        CORRIDOR, ALL_KNOWN, corridor_graph(), Whereabouts(), Access(place), Pose(3.0, 0.0, heading)
    )
    line, _ = CORRIDOR.line_from(place, here.ahead())
    assert line[-1] == pytest.approx(end)


@pytest.mark.parametrize("heading", [0.0, math.pi])
def test_with_a_trail_ahead_is_away_from_where_the_robot_came_from(heading: float) -> None:
    walk = Walk().along(CORRIDOR, ALL_KNOWN, (1.0, 0.0), (3.0, 0.0))
    place = CORRIDOR.place(np.array([3.0, 0.0]))
    assert place is not None
    pose = Pose(3.0, 0.0, heading)
    here = Situation(CORRIDOR, ALL_KNOWN, corridor_graph(), walk.where, Access(place), pose)
    line, _ = CORRIDOR.line_from(place, here.ahead())
    assert line[-1] == pytest.approx([6.0, 0.0])


def test_the_way_leads_round_another_robot_once_and_then_on_though_it_turns_more() -> None:
    """It stands in a room; the way out of it turns back more than that round the body."""
    gvg = drawn(
        {1: (0.0, 0.0), 2: (4.0, 0.0), 3: (7.0, 0.0), 4: (7.0, -5.0)},
        {
            10: (1, 2, []),
            11: (2, 3, [(4.0, -1.5), (7.0, -1.5)]),
            12: (2, 3, [(4.0, 1.5), (7.0, 1.5)]),
            13: (3, 4, [(5.8, -1.0), (5.8, -5.0)]),
        },
    )
    known = known_as({Branch(10, forward=True): HalfEdgeId(1, EAST)}, {1: 1})
    walk = Walk().along(gvg, known, (0.5, 0.0), (4.0, 0.0), (4.0, -1.0))
    place = gvg.place(np.array([4.0, -1.0]))
    assert place is not None
    pose, doubted = Pose(4.0, -1.0, -math.pi / 2), frozenset({2, 3})
    here = Situation(
        gvg, known, corridor_graph(), walk.where, Access(place), pose, doubted, in_team=True
    )
    line, _ = gvg.line_from(place, here.ahead())
    assert line[-1] == pytest.approx([7.0, -5.0])


@pytest.mark.parametrize(("station", "is_ahead"), [(2.6, False), (3.4, True)])
def test_to_a_place_a_step_ahead_or_behind_on_its_edge_it_goes_straight(
    station: float, *, is_ahead: bool
) -> None:
    here = situation(3.0)
    foot = foot_at(here.graph, HalfEdgeId(1, EAST), station)
    assert foot is not None
    route = route_to_foot(here, here.starts(), foot)
    assert route is not None
    assert route.ahead is is_ahead
    assert route.metres == pytest.approx(0.4)


@pytest.mark.parametrize(
    ("west", "is_ahead"), [(0.0, True), (-8.0, False)], ids=["10 of 24 m", "26 of 40 m"]
)
def test_round_an_edge_that_comes_back_to_its_vertex_it_goes_on_if_that_is_nearer(
    west: float, *, is_ahead: bool
) -> None:
    """It has driven fourteen metres from the vertex, which is out of sight both ways."""
    ring: list[Point] = [(0.0, 0.0), (8.0, 0.0), (8.0, 4.0), (west, 4.0), (west, 0.0), (0.0, 0.0)]
    graph, vertex = GvgGraph(), Vertex(1, 1.0, Pose(), 0.0, 0.0)
    graph.vertices[1] = vertex
    a, b = (HalfEdgeId(1, vertex.add_half_edge(bearing)) for bearing in (0.0, math.pi))
    graph.join(a, b, np.array(resampled(ring)), 0.8, driven=True)
    piece = drawn({1: (2.0, 4.0), 2: (8.0, 4.0)}, {10: (1, 2, [])})
    place = piece.place(np.array([6.0, 4.0]))
    assert place is not None
    where = Whereabouts(a, list(resampled([*ring[:3], (6.0, 4.0)])))
    base = Pose(6.0, 4.0, math.pi)
    here = Situation(piece, Correspondence(), graph, where, Access(place), base)
    (approach,) = shortest_paths(graph, here.starts()).values()
    first = first_arrival(here.starts(), approach)
    assert here.path_over(first, ()) == (Branch(10, forward=not is_ahead),)


def test_behind_what_hides_the_way_the_vertex_is_not_gone_to_by_another_way_in_sight() -> None:
    """Between two meetpoints 5 m apart somebody stands; both are in sight, around the side, too."""
    side: list[Point] = [(0.0, 0.0), (4.0, 0.0), (4.0, 5.0), (0.0, 5.0)]
    graph = GvgGraph()
    for name, y in ((1, 0.0), (2, 5.0)):
        graph.vertices[name] = Vertex(name, 1.0, Pose(0.0, y), 0.0, 0.0)
    between, around = (
        [HalfEdgeId(name, graph.vertices[name].add_half_edge(0.0)) for name in (1, 2)]
        for _ in range(2)
    )
    graph.join(between[0], between[1], np.array(resampled([side[0], side[3]])), 0.5, driven=True)
    graph.join(around[0], around[1], np.array(resampled(side)), 0.5, driven=True)
    seen = drawn(
        {1: side[0], 2: side[3], 3: (0.0, 2.3), 4: (0.0, 3.7)},
        {10: (1, 3, []), 11: (2, 4, []), 12: (1, 2, side[1:3])},
    )
    branches = [Branch(edge, forward=True) for edge in (10, 11, 12)] + [Branch(12, forward=False)]
    known = known_as(dict(zip(branches, between + around, strict=True)), {1: 1, 2: 2})
    place = seen.place(np.array([0.0, 1.0]))
    assert place is not None
    where = Whereabouts(between[0], list(resampled([side[0], (0.0, 1.0)])))
    here = Situation(seen, known, graph, where, Access(place), Pose(0.0, 1.0, math.pi / 2))
    assert here.path_over(between[1], ()) == (branches[0],)


def blocked_corridor() -> Situation:
    """Four metres from vertex 1, which is in sight; the edge is closed for a while."""
    only_first = known_as({Branch(10, forward=True): HalfEdgeId(1, EAST)}, {1: 1})
    here = situation(4.0, only_first)
    for end in (HalfEdgeId(1, EAST), HalfEdgeId(2, WEST)):
        here.graph.vertices[end.vertex].half_edges[end.key].blocked = True
    return here


@pytest.mark.parametrize(
    ("closed", "left"),
    [(HalfEdgeId(1, EAST), HalfEdgeId(2, WEST)), (HalfEdgeId(2, WEST), HalfEdgeId(1, EAST))],
)
def test_who_meets_something_can_go_to_the_other_end_of_its_edge_in_sight_or_not(
    closed: HalfEdgeId, left: HalfEdgeId
) -> None:
    assert [start.arrival for start in blocked_corridor().starts(closed)] == [left]


@pytest.mark.parametrize(
    ("wall", "ends"), [(2.0, {1: 4.0, 2: 2.0}), (5.0, {1: 4.0}), (None, {1: 4.0, 2: 2.0})]
)
def test_no_way_leads_over_a_virtual_wall_ahead(wall: float | None, ends: dict[int, float]) -> None:
    """An end that is in sight is reached: what is in sight ends at virtual walls."""
    here = situation(4.0, known_as({Branch(10, forward=True): HalfEdgeId(1, EAST)}, {1: 1}))
    edge = here.graph.edge_at(HalfEdgeId(1, EAST))
    assert edge is not None
    here.graph.walled[edge.id] = () if wall is None else (wall,)
    found = {start.arrival.vertex: start.metres for start in here.starts()}
    assert found == pytest.approx(ends, abs=0.2)


@pytest.mark.parametrize("wall", [1.0, 2.2, 3.5, 5.0])
def test_which_end_of_an_edge_is_its_first_makes_no_difference_to_virtual_walls(
    wall: float,
) -> None:
    """3 m along an edge of 6 m, of which no end is in sight; the wall is so far along it, too."""
    found = []
    for is_turned in (False, True):
        here = situation(3.0, known_as({}, {}))
        (edge,) = here.graph.edges.values()
        if is_turned:
            edge.a, edge.b, edge.polyline = edge.b, edge.a, edge.polyline[::-1]
        here.graph.walled[edge.id] = (6.0 - wall if is_turned else wall,)
        starts = here.starts()
        ways = [{start.arrival.vertex: round(start.metres, 6) for start in starts}]
        for x in (0.5, 2.0, 4.0, 5.5):
            foot = foot_at(here.graph, HalfEdgeId(1, EAST), x)
            assert foot is not None
            route = route_to_foot(here, starts, foot)
            ways.append({} if route is None else {route.first.vertex: round(route.metres, 6)})
            is_between = min(3.0, x) < wall < max(3.0, x)
            assert (route is None) == is_between
        found.append(ways)
    assert found[0] == found[1]


@pytest.mark.parametrize(("wall", "metres"), [(2.0, 26.0), (4.0, 2.0), (14.0, 2.0), (0.5, 2.0)])
def test_the_way_to_a_point_is_the_one_without_a_virtual_wall(wall: float, metres: float) -> None:
    here = on_a_ring(is_in_sight=False)
    here.graph.walled[next(iter(here.graph.edges))] = (wall,)
    foot = foot_at(here.graph, HalfEdgeId(1, 0), 1.0)
    assert foot is not None
    route = route_to_foot(here, here.starts(), foot)
    assert (None if route is None else route.metres) == pytest.approx(metres, abs=0.2)


def on_a_ring(*, is_in_sight: bool) -> Situation:
    """Three metres past the only vertex of a ring of 28 m, all of which may be in sight."""
    graph, vertex = GvgGraph(), Vertex(1, 1.0, Pose(), 0.0, 0.0)
    graph.vertices[1] = vertex
    a, b = (HalfEdgeId(1, vertex.add_half_edge(bearing)) for bearing in (0.0, math.pi / 2))
    graph.join(a, b, np.array(resampled(LOOP)), 0.8, driven=True)
    known = known_as({}, {})
    if is_in_sight:
        ends = {Branch(10, forward=True): a, Branch(10, forward=False): b}
        known = known_as(ends, {1: 1})
    ring = drawn({1: (0.0, 0.0)}, {10: (1, 1, LOOP[1:-1])})
    place = ring.place(np.array([3.0, 0.0]))
    assert place is not None
    where = Whereabouts(a, list(resampled([(0.0, 0.0), (3.0, 0.0)])))
    return Situation(ring, known, graph, where, Access(place), Pose(3.0, 0.0, 0.0))


@pytest.mark.parametrize("is_in_sight", [True, False])
@pytest.mark.parametrize(("key", "metres"), [(0, 3.0), (1, 25.0)])
def test_round_a_ring_one_comes_to_its_vertex_either_way(
    key: int, metres: float, *, is_in_sight: bool
) -> None:
    here, closed = on_a_ring(is_in_sight=is_in_sight), HalfEdgeId(1, 1 - key)
    (start,) = here.starts(closed)
    assert start.arrival == HalfEdgeId(1, key)
    assert start.metres == pytest.approx(metres, abs=0.2)
    path = here.path_over(start.arrival, ())
    assert path is not None
    line, _ = here.gvg.line_from(here.place, path)
    assert length_of(line) == pytest.approx(metres, abs=0.2)


@pytest.mark.parametrize(("station", "key"), [(1.0, 0), (5.0, 1)])
def test_the_way_to_a_point_of_a_ring_is_the_shorter_one_and_the_other_one_if_that_is_closed(
    station: float, key: int
) -> None:
    """To a point behind the robot, and to one ahead of it; the way tells where it leads."""
    here = on_a_ring(is_in_sight=True)
    foot = foot_at(here.graph, HalfEdgeId(1, 0), station)
    assert foot is not None
    towards = HalfEdgeId(1, key)
    route = route_to_foot(here, here.starts(), foot)
    assert route is not None
    assert route.metres == pytest.approx(abs(station - 3.0), abs=0.2)
    assert route.first == towards
    for half in here.graph.vertices[1].half_edges.values():
        half.blocked = True
    around = route_to_foot(here, here.starts(towards), foot, towards)
    assert around is not None
    assert around.metres == pytest.approx(28.0 - abs(station - 3.0), abs=0.2)
    assert (around.first, around.departures) == (HalfEdgeId(1, 1 - key), (towards,))
