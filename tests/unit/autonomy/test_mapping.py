"""From sights of hand-drawn local GVGs to vertices and edges."""

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.autonomy.candidates import Mistake
from gvgbot.autonomy.events import (
    ClosureRevoked,
    DoubtSettled,
    EdgeJoined,
    Event,
    LoopClosed,
    PlaceDoubted,
    VertexAdded,
    VertexMoved,
    VertexRemoved,
)
from gvgbot.autonomy.evidence import MappingConfig
from gvgbot.autonomy.gvg.local import Branch, LocalGvg
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.recogniser import Match, Recognition
from gvgbot.autonomy.slam import ekf
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId, Vertex
from gvgbot.autonomy.slam.recognition import RecognitionConfig, Sighting
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.autonomy.views import Correspondence, View, touching
from gvgbot.geometry import Array, Pose
from tests.unit.autonomy.local_graphs import Point, drawn, resampled
from tests.unit.autonomy.sights import Rectangle, carved, looked, sweep
from tests.unit.autonomy.slam.beliefs import updated

CONFIG = MappingConfig()
NOTHING_SEEN = LocalMap(LocalMapConfig())

# A tee at x = 3 whose branch goes south to a dead end; the corridor goes on unseen at both ends.
TEE_POINTS = {1: (-2.0, 0.0), 2: (3.0, 0.0), 3: (6.0, 0.0), 4: (3.0, -4.0)}
TEE_LINES: dict[int, tuple[int, int, list[Point]]] = {
    10: (1, 2, []),
    11: (2, 3, []),
    12: (2, 4, []),
}
UNSEEN = {1: math.pi, 3: 0.0}
TEE = drawn(TEE_POINTS, TEE_LINES, unseen=UNSEEN)
PLAIN = drawn({1: (-2.0, 0.0), 3: (6.0, 0.0)}, {10: (1, 3, [])}, unseen=UNSEEN)
TWO_ENDS = drawn({1: (-1.0, 0.0), 2: (4.0, 0.0)}, {10: (1, 2, [])})
# The same way with a side door in its middle.
TEE_BETWEEN = drawn(
    {1: (-1.0, 0.0), 2: (4.0, 0.0), 3: (1.5, 0.0), 4: (1.5, -4.0)},
    {10: (1, 3, []), 11: (3, 2, []), 12: (3, 4, [])},
    unseen={4: -math.pi / 2},
)
NEAR = Pose(2.0, 0.0)


class Seen:
    """A mapper fed with views, one every ten centimetres or where the robot stands."""

    def __init__(self, *, drive_dead_ends: bool = False) -> None:
        self.mapper = Mapper(
            CONFIG, RecognitionConfig(), ScanMatchingConfig(), drive_dead_ends=drive_dead_ends
        )
        self.events: list[Event] = []
        self.known = Correspondence()
        self._count = 0
        self._is_near = False

    def look(
        self,
        gvg: LocalGvg,
        times: int = 1,
        at: Pose | None = None,
        *,
        doubtful: Array | None = None,
        local_map: LocalMap = NOTHING_SEEN,
    ) -> "Seen":
        for _ in range(times):
            view = View(
                self._count, float(self._count), 0.1 * self._count, at or Pose(), gvg, local_map
            )
            if doubtful is not None:
                view = replace(view, doubtful=doubtful, doubted=touching(gvg, doubtful))
            self.known, events = self.mapper.observe(view)
            self.events += events
            self._count += 1
        return self

    def look_near(self, gvg: LocalGvg, times: int = 1) -> "Seen":
        """Look from a metre before the tee; other looks are from three."""
        if not self._is_near:
            self.mapper.move(NEAR, np.zeros((3, 3)))
        self._is_near = True
        return self.look(gvg, times, at=NEAR)

    def drive_elsewhere(self, metres: float) -> None:
        """Let so much be driven without a look."""
        self._count += round(10 * metres)

    def places(self, kind: str) -> list[Point]:
        belief = self.mapper.belief
        found = [v.id for v in self.mapper.graph.vertices.values() if v.kind == kind]
        return [(belief.map_vertex(v).x, belief.map_vertex(v).y) for v in found]


def of_type(events: Iterable[Event], kind: type) -> list[Event]:
    return [event for event in events if isinstance(event, kind)]


def test_a_meetpoint_is_believed_after_some_sightings_and_not_before() -> None:
    seen = Seen().look(TEE, CONFIG.candidates.meetpoint_sightings - 1)
    assert seen.places("meetpoint") == []
    seen.look(TEE)
    assert seen.places("meetpoint") == [pytest.approx((3.0, 0.0), abs=1e-3)]
    (added,) = of_type(seen.events, VertexAdded)
    assert isinstance(added, VertexAdded)
    assert (added.x, added.y) == pytest.approx((3.0, 0.0))
    assert added.degree == 3


def test_a_dead_end_is_believed_later_than_a_meetpoint() -> None:
    assert CONFIG.candidates.endpoint_sightings > CONFIG.candidates.meetpoint_sightings
    seen = Seen().look(TEE, CONFIG.candidates.endpoint_sightings - 1)
    assert seen.places("endpoint") == []
    assert seen.look(TEE).places("endpoint") == [pytest.approx((3.0, -4.0), abs=1e-3)]


def test_an_end_of_sight_is_no_vertex() -> None:
    seen = Seen().look(TEE, 50)
    assert len(seen.mapper.graph.vertices) == 2
    assert not Seen().look(PLAIN, 50).mapper.graph.vertices


def test_what_is_too_far_to_be_trusted_is_not_believed() -> None:
    far = Pose(3.0 + CONFIG.trust_m + 0.5, 0.0)
    assert Seen().look(TEE, 50, at=far).places("meetpoint") == []


def test_departures_have_the_bearings_of_the_branches_and_are_frontiers() -> None:
    seen = Seen().look(TEE, CONFIG.candidates.meetpoint_sightings)
    (vertex,) = seen.mapper.graph.vertices.values()
    psi = seen.mapper.belief.map_vertex(vertex.id).theta
    bearings = sorted((h.bearing + psi) % math.tau for h in vertex.half_edges.values())
    assert bearings == pytest.approx([0.0, math.pi, 1.5 * math.pi], abs=1e-3)
    assert len(seen.mapper.graph.frontiers()) == 3


def test_an_edge_in_sight_from_end_to_end_is_joined_once() -> None:
    seen = Seen().look(TEE, 30)
    (edge,) = seen.mapper.graph.edges.values()
    assert edge.length == pytest.approx(4.0, abs=0.01)
    assert not edge.driven
    assert len(of_type(seen.events, EdgeJoined)) == 1
    assert len(seen.mapper.graph.frontiers()) == 2


def test_the_line_of_an_edge_for_maps_ends_where_its_vertex_proves_to_be() -> None:
    seen = Seen().look(TWO_ENDS, 30)
    end_beside = drawn({1: (-1.0, 0.0), 2: (4.0, 0.3)}, {10: (1, 2, [(3.5, 0.0)])})
    seen.look(end_beside, 60)
    (edge,) = seen.mapper.graph.edges.values()
    assert len(of_type(seen.events, EdgeJoined)) == 1
    start, end = (seen.mapper.belief.map_vertex(half.vertex) for half in (edge.a, edge.b))
    line = start.transform(edge.shown)
    np.testing.assert_allclose(line[[0, -1]], [start.position, end.position], atol=1e-9)
    assert max(start.y, end.y) > 0.1
    assert np.abs(line[len(line) // 2, 1]) < 0.01


def test_a_vertex_beside_which_somebody_stood_is_placed_where_it_is_seen_later() -> None:
    """What was seen of it before tells nothing, and the lines of its edges end where it is."""
    seen, first = Seen(), 30
    seen.look(TEE, first)
    aside = TEE_POINTS | {2: (3.5, 0.0), 4: (3.5, -4.0)}
    seen.look(drawn(aside, TEE_LINES, unseen=UNSEEN), 60)
    assert seen.places("meetpoint") == [pytest.approx((3.5, 0.0), abs=0.06)]
    assert seen.places("endpoint") == [pytest.approx((3.5, -4.0), abs=0.06)]
    moved = [event for event in seen.events if isinstance(event, VertexMoved)]
    assert len(moved) == 2
    assert all(0.3 < event.metres < 0.6 for event in moved)
    assert min(one.keyframe for one in seen.mapper.observations) > first
    (edge,) = seen.mapper.graph.edges.values()
    start, end = (seen.mapper.belief.map_vertex(half.vertex) for half in (edge.a, edge.b))
    for line in (edge.polyline, edge.shown):
        ends = start.transform(line)[[0, -1]]
        np.testing.assert_allclose(ends, [start.position, end.position], atol=0.06)


@pytest.mark.parametrize(
    ("room", "stays"),
    [
        ([(1.8, -1.2, 4.2, 1.2)], True),  # what is known of its floor now has its middle elsewhere
        ([(-2.0, -1.2, 3.4, 1.2), (3.4, -0.9, 8.0, 0.9)], False),  # nothing is between two walls
        ([(2.2, -0.8, 3.2, 0.8), (3.2, -1.2, 8.0, 1.2)], False),  # there is more room elsewhere
    ],
)
def test_a_vertex_stays_between_the_walls_it_was_found_between(
    room: list[Rectangle], stays: bool
) -> None:
    local_map = looked(carved(room), [Pose(3.0, 0.5), Pose(3.5, 0.0)])
    seen = Seen().look(TEE, 30)
    aside = drawn(TEE_POINTS | {2: (3.5, 0.0)}, TEE_LINES, unseen=UNSEEN)
    seen.look(aside, 400, local_map=local_map)
    assert (of_type(seen.events, VertexMoved) == []) == stays
    assert seen.places("meetpoint") == [pytest.approx((3.0 if stays else 3.5, 0.0), abs=0.03)]


def test_what_lies_on_an_edge_nearer_than_its_walls_lies_on_a_way() -> None:
    """The edge goes from (3, 0) to (3, -4), a metre away from its walls."""
    mapper = Seen().look(TEE, 30).mapper
    turned = Pose(10.0, 20.0, math.pi / 2)  # of the base, which is at the origin, in another frame
    for place, is_way in (((3.0, -2.0), True), ((3.9, -2.0), True), ((4.1, -2.0), False)):
        assert mapper.is_way(Pose(), np.array(place)) == is_way
        assert mapper.is_way(turned, turned.transform(np.array(place))) == is_way


class BesideGlass(LocalMap):
    """A local map that knows of a lone echo."""

    def __init__(self, x: float, y: float) -> None:
        super().__init__(LocalMapConfig())
        self._echo = np.array([[x, y]])

    def suspects(self) -> Array:
        return self._echo


@pytest.mark.parametrize(("y", "is_joined"), [(0.0, False), (1.1, False), (1.4, True)])
def test_an_edge_that_may_pass_through_glass_is_not_believed_at_sight(
    y: float, is_joined: bool
) -> None:
    """Its walls are a metre off: what is nearer than that and a rim would shape it."""
    seen = Seen().look(TWO_ENDS, 30, local_map=BesideGlass(1.5, y))
    assert len(seen.mapper.graph.vertices) == 2
    assert bool(of_type(seen.events, EdgeJoined)) == is_joined
    seen.look(TWO_ENDS)  # it was dust
    assert len(of_type(seen.events, EdgeJoined)) == 1


def test_two_dead_ends_in_sight_are_a_whole_map() -> None:
    seen = Seen().look(TWO_ENDS, 30)
    assert sorted(seen.places("endpoint")) == [
        pytest.approx((-1.0, 0.0), abs=1e-3),
        pytest.approx((4.0, 0.0), abs=1e-3),
    ]
    assert len(seen.mapper.graph.edges) == 1
    assert seen.mapper.graph.frontiers() == []


def test_two_dead_ends_that_face_each_other_in_a_gap_are_two() -> None:
    gap = drawn(
        {1: (-2.0, 0.0), 2: (2.0, 0.0), 3: (2.3, 0.0), 4: (6.0, 0.0)},
        {10: (1, 2, []), 11: (3, 4, [])},
        unseen={1: math.pi, 4: 0.0},
    )
    assert sorted(Seen().look(gap, 30).places("endpoint")) == [
        pytest.approx((2.0, 0.0), abs=1e-3),
        pytest.approx((2.3, 0.0), abs=1e-3),
    ]


def test_the_parts_of_a_view_are_named_after_the_vertices_and_half_edges() -> None:
    seen = Seen().look(TEE, 30)
    vertex = seen.known.vertex_of[2]
    assert seen.known.node_of[vertex] == 2
    for branch in (Branch(10, forward=False), Branch(11, forward=True), Branch(12, forward=True)):
        end = seen.known.half_edge_of[branch]
        assert end.vertex == vertex
        assert seen.known.branch_of[end] == branch
        half = seen.mapper.graph.half_edge(end)
        assert half is not None
        psi = seen.mapper.graph.vertices[vertex].local.theta
        assert math.cos(half.bearing + psi - TEE.bearing(branch, 1.0)) > 0.99


def test_a_vertex_is_found_again_where_it_was_and_not_added_twice() -> None:
    jittered = {k: (x + 0.1, y - 0.1) for k, (x, y) in TEE_POINTS.items()}
    other = drawn(jittered, TEE_LINES, unseen=UNSEEN)
    seen = Seen()
    for _ in range(20):
        seen.look(TEE).look(other)
    assert len(seen.mapper.graph.vertices) == 2
    (place,) = seen.places("meetpoint")
    assert place == pytest.approx((3.05, -0.05), abs=0.1)


def test_a_vertex_far_from_all_walls_is_known_again_by_them_from_afar() -> None:
    """In a hall 12 m wide, no wall is nearer to its middle than 6 m."""
    ends = {2: math.pi, 3: 0.0, 4: -math.pi / 2}
    fork = drawn(
        {1: (0.0, 0.0), 2: (-4.0, 0.0), 3: (4.0, 0.0), 4: (0.0, -4.0)},
        {10: (1, 2, []), 11: (1, 3, []), 12: (1, 4, [])},
        clearance=6.0,
        unseen=ends,
    )
    aside = Pose(3.0, 0.0)
    hall = looked(carved([(-9.0, -6.0, 9.0, 6.0)]), [Pose(), aside])
    seen = Seen()
    seen.mapper.move(aside, np.zeros((3, 3)))
    seen.look(fork, CONFIG.candidates.meetpoint_sightings, at=aside, local_map=hall)
    seen.drive_elsewhere(20.0)
    seen.mapper.move(Pose(), np.diag([0.04, 0.04, 1e-4]))
    seen.look(fork, at=aside, local_map=hall)
    (closed,) = of_type(seen.events, LoopClosed)
    assert isinstance(closed, LoopClosed)
    assert closed.agreement > 0.9
    assert len(seen.mapper.graph.vertices) == 1


def test_a_vertex_through_which_a_plain_edge_runs_is_taken_back() -> None:
    seen = Seen().look(TEE, CONFIG.candidates.meetpoint_sightings)
    seen.look_near(PLAIN, CONFIG.misses)
    assert len(seen.mapper.graph.vertices) == 1
    seen.look_near(PLAIN, 1)
    assert len(seen.mapper.graph.vertices) == 0
    assert seen.mapper.belief.ids == ()
    assert len(of_type(seen.events, VertexRemoved)) == 1


@pytest.mark.parametrize(("bend", "driven"), [((3.0, 0.0), [True]), ((3.0, -1.0), [False])])
def test_of_a_bend_that_looked_like_a_fork_two_edges_are_one_if_sight_shows_it(
    bend: Point, driven: list[bool]
) -> None:
    """The corridor turns north in the end; what was driven stays so if that is seen there.

    Who was about to go by the third departure is on one of the two edges then.
    """
    points = {1: (-1.0, 0.0), 2: (3.0, 0.0), 3: (3.0, 4.0), 4: (5.0, 2.0)}
    fork = drawn(points, {10: (1, 2, []), 11: (2, 3, []), 12: (2, 4, [])}, unseen={4: math.pi / 4})
    seen = Seen().look(fork, 20)
    for edge in seen.mapper.graph.edges.values():
        edge.driven = True
    assert len(seen.mapper.graph.edges) == 2
    (third,) = seen.mapper.graph.frontiers()
    plain, at_it = drawn({1: points[1], 3: points[3]}, {10: (1, 3, [bend])}), Pose(2.5)
    seen.mapper.move(at_it, np.zeros((3, 3)))
    seen.look(plain, CONFIG.misses + 1, at=at_it)
    assert seen.places("meetpoint") == []
    assert [edge.driven for edge in seen.mapper.graph.edges.values()] == driven
    far, line = seen.mapper.came_from[third]
    assert far.vertex in seen.mapper.graph.vertices
    assert line[-1] == pytest.approx(points[2], abs=0.1)


@pytest.mark.parametrize("walled", [True, False])
def test_what_is_out_of_sight_is_neither_taken_back_nor_gets_a_departure(*, walled: bool) -> None:
    """Behind a wall, a part of the walls of the other room is forgotten: it looks open there."""
    more = drawn({**TEE_POINTS, 5: (3.0, 4.0)}, {**TEE_LINES, 13: (2, 5, [])}, unseen=UNSEEN)
    room = looked(carved([(-2.0, -2.0, 2.5 if walled else 5.0, 2.0)]), [NEAR])
    for gvg in (PLAIN, more):
        seen = Seen().look(TEE, CONFIG.candidates.meetpoint_sightings)
        seen.mapper.move(NEAR, np.zeros((3, 3)))
        seen.look(gvg, 3 * CONFIG.misses, at=NEAR, local_map=room)
        tees = [v for v in seen.mapper.graph.vertices.values() if v.kind == "meetpoint"]
        degrees = [vertex.degree for vertex in tees]
        assert degrees == ([3] if walled else [] if gvg is PLAIN else [4])


def led_by(seen: Seen, *corners: Point, far: Point) -> None:
    """Make a driven edge, map frame, of the branch of the tee, to a vertex far off."""
    graph, belief = seen.mapper.graph, seen.mapper.belief
    (tee,) = graph.vertices.values()
    map_tee = belief.map_vertex(tee.id)
    (key,) = (k for k, h in tee.half_edges.items() if math.sin(h.bearing + map_tee.theta) < -0.5)
    other = Vertex(graph.next_id(), 1.0, Pose(*far, 0.0), 0.0, 0.0)
    graph.vertices[other.id] = other
    ends = HalfEdgeId(tee.id, key), HalfEdgeId(other.id, other.add_half_edge(0.0))
    line = map_tee.inverse().transform(resampled([(3.0, 0.0), *corners, far]))
    graph.join(*ends, line, 0.3, driven=True)
    R = np.diag([1e-4, 1e-4, 1e-4])
    base_far = belief.map_base.inverse().compose(Pose(*far, 0.0))
    seen.mapper.belief = ekf.add_vertex(belief, other.id, base_far, R)


def test_a_vertex_stays_whose_branch_was_driven_through_what_is_a_wall_now() -> None:
    """A door that is hard to see from the corridor, or shut behind the robot: it went through."""
    seen = Seen().look(TEE, CONFIG.candidates.meetpoint_sightings)
    led_by(seen, far=(3.0, -9.0))
    seen.look_near(PLAIN, 3 * CONFIG.misses)
    assert (3.0, 0.0) in [pytest.approx(place, abs=1e-3) for place in seen.places("meetpoint")]


def test_a_way_driven_round_somebody_in_a_corridor_keeps_no_vertex() -> None:
    """It leaves the corridor's middle by less than the walls are off it, and comes back."""
    seen = Seen().look(TEE, CONFIG.candidates.meetpoint_sightings)
    led_by(seen, (3.5, -0.7), (4.5, -0.7), far=(5.5, 0.0))
    seen.look_near(PLAIN, 3 * CONFIG.misses)
    assert seen.places("meetpoint") == []


def test_a_departure_that_a_clear_view_keeps_not_showing_is_dropped() -> None:
    lines = {**TEE_LINES, 13: (2, 5, [])}
    crossing = drawn({**TEE_POINTS, 5: (3.0, 4.0)}, lines, unseen={**UNSEEN, 5: math.pi / 2})
    seen = Seen().look(crossing, CONFIG.candidates.meetpoint_sightings)
    (vertex,) = seen.mapper.graph.vertices.values()
    assert vertex.degree == 4
    seen.look(TEE, CONFIG.misses + 1)
    assert vertex.degree == 3


def test_a_departure_that_is_missed_now_and_then_stays() -> None:
    """However often that is: half of the time it is there."""
    lines = {**TEE_LINES, 13: (2, 5, [])}
    crossing = drawn({**TEE_POINTS, 5: (3.0, 4.0)}, lines, unseen={**UNSEEN, 5: math.pi / 2})
    seen = Seen().look(crossing, CONFIG.candidates.meetpoint_sightings)
    (vertex,) = seen.mapper.graph.vertices.values()
    for _ in range(10):
        seen.look(TEE, CONFIG.misses - 1).look(crossing, CONFIG.misses - 1)
    assert vertex.degree == 4
    assert vertex.gone == []


@pytest.mark.parametrize(("beyond", "stays"), [("ways on", False), ("a dead end", True)])
def test_a_driven_edge_that_is_gone_stays_only_if_more_than_ways_on_hangs_on_it(
    beyond: str, *, stays: bool
) -> None:
    """North of the tee, 4 m off, the robot has met a fork, as there is round somebody."""
    points = {**TEE_POINTS, 5: (3.0, 4.0), 6: (1.0, 4.0), 7: (5.0, 4.0)}
    lines = {**TEE_LINES, 13: (2, 5, []), 14: (5, 6, []), 15: (5, 7, [])}
    unseen = {**UNSEEN, 6: math.pi}
    if beyond == "ways on":
        unseen[7] = 0.0
    seen = Seen().look(drawn(points, lines, unseen=unseen), 20)
    fork = seen.mapper.graph.vertices[seen.known.vertex_of[5]]
    edges = seen.mapper.graph.edges.values()
    (edge,) = (e for e in edges if {e.a.vertex, e.b.vertex} == {fork.id, seen.known.vertex_of[2]})
    edge.driven = True
    seen.look(TEE, 2 * CONFIG.misses)
    assert edge in seen.mapper.graph.edges.values()
    seen.look(TEE, 20 * CONFIG.misses)
    assert (edge in seen.mapper.graph.edges.values()) == stays


def test_a_departure_that_comes_and_goes_is_decided_upon_in_the_end() -> None:
    """A branch of which now and then enough can be seen: each time it would be a new frontier."""
    lines = {**TEE_LINES, 13: (2, 5, [])}
    crossing = drawn({**TEE_POINTS, 5: (3.0, 4.0)}, lines, unseen={**UNSEEN, 5: math.pi / 2})
    seen = Seen().look(TEE, 20)
    vertex = seen.mapper.graph.vertices[seen.known.vertex_of[2]]
    known = []
    for sight in [crossing, TEE] * 20:
        seen.look(sight, 10)
        known.append(tuple(vertex.half_edges))
    assert len(set(known[:10])) > 1
    assert len(set(known[10:])) == 1
    seen.look(TEE, 200)
    assert vertex.degree == 3


def test_a_departure_seen_only_later_is_added_and_an_edge_that_leaves_by_it_parted() -> None:
    """From (9, 0) past the tee to (3, 8) the robot drove when it did not see that there is one."""
    seen = Seen().look(TEE, 20)
    mapper = seen.mapper
    ends: list[HalfEdgeId] = []
    for x, y, bearing in ((9.0, 0.0, math.pi), (3.0, 8.0, -math.pi / 2)):
        far = Vertex(mapper.graph.next_id(), 1.0, Pose(x, y), 0.0, 0.0)
        mapper.graph.vertices[far.id] = far
        ends.append(HalfEdgeId(far.id, far.add_half_edge(bearing)))
        mapper.belief = ekf.add_vertex(mapper.belief, far.id, far.local, 1e-6 * np.eye(3))
    passing = resampled([(0.0, 0.0), (-6.0, 0.0), (-6.0, 8.0)])
    mapper.graph.join(ends[0], ends[1], passing, 1.0, driven=True)
    lines = {**TEE_LINES, 13: (2, 5, [])}
    crossing = drawn({**TEE_POINTS, 5: (3.0, 4.0)}, lines, unseen={**UNSEEN, 5: math.pi / 2})
    seen.look(crossing, 5)
    vertex = seen.mapper.graph.vertices[seen.known.vertex_of[2]]
    assert vertex.degree == 4
    joined = [{edge.a.vertex, edge.b.vertex} for edge in mapper.graph.edges.values()]
    assert [vertex.id in both for both in joined] == [True] * 3
    assert set.union(*joined) >= {end.vertex for end in ends}


def test_a_departure_that_stays_unclear_from_where_it_leaves_becomes_a_frontier() -> None:
    """A side way of which only the first decimetres can be seen, even from the vertex itself."""
    lines = {**TEE_LINES, 13: (2, 5, [])}
    stub = drawn({**TEE_POINTS, 5: (3.0, 0.3)}, lines, unseen={**UNSEEN, 5: math.pi / 2})
    node = stub.nodes[2]
    unclear = LocalGvg(
        {**stub.nodes, 2: replace(node, weak=frozenset({Branch(13, forward=True)}))}, stub.edges
    )
    seen = Seen().look(unclear, 20)
    vertex = seen.mapper.graph.vertices[seen.known.vertex_of[2]]
    assert vertex.degree == 3
    moved = Pose(2.6, 0.0)
    seen.mapper.move(moved, np.zeros((3, 3)))
    seen.look(unclear, CONFIG.candidates.meetpoint_sightings, at=moved)
    assert vertex.degree == 4


@pytest.mark.parametrize(("looked_at", "degree"), [(math.pi / 2, 3), (-math.pi / 2, 4)])
def test_an_unclear_departure_that_was_looked_at_and_was_none_comes_back_no_more(
    looked_at: float, degree: int
) -> None:
    """Where the robot has been to see what is in that direction, or in another one."""
    lines = {**TEE_LINES, 13: (2, 5, [])}
    stub = drawn({**TEE_POINTS, 5: (3.0, 0.3)}, lines, unseen={**UNSEEN, 5: math.pi / 2})
    weak = replace(stub.nodes[2], weak=frozenset({Branch(13, forward=True)}))
    seen = Seen().look(TEE, 20)
    seen.mapper._unbelieved.note_mistake(Mistake(np.array([3.0, 0.0]), (looked_at,), 0.0))
    moved = Pose(2.6, 0.0)
    seen.mapper.move(moved, np.zeros((3, 3)))
    seen.look(LocalGvg({**stub.nodes, 2: weak}, stub.edges), 20, at=moved)
    (vertex,) = (v for v in seen.mapper.graph.vertices.values() if v.kind == "meetpoint")
    assert vertex.degree == degree


def test_a_side_way_that_proved_to_be_none_makes_no_vertex_again() -> None:
    """Who drove into it came out by a known edge, so it went before its vertex did."""
    stub = drawn({**TEE_POINTS, 4: (3.0, -0.3)}, TEE_LINES, unseen={**UNSEEN, 4: -math.pi / 2})
    weak = replace(stub.nodes[2], weak=frozenset({Branch(12, forward=True)}))
    passing = LocalGvg({**stub.nodes, 2: weak}, stub.edges)
    here = Pose(2.6, 0.0)
    seen = Seen()
    seen.mapper.move(here, np.zeros((3, 3)))
    assert seen.look(passing, 20, at=here).places("meetpoint") == [pytest.approx((3.0, 0.0))]
    seen.mapper.graph.remove_half_edge(seen.known.half_edge_of[Branch(12, forward=True)])
    assert seen.look(PLAIN, 20, at=here).places("meetpoint") == []
    seen.drive_elsewhere(30.0)
    assert seen.look(passing, 20, at=here).places("meetpoint") == []


def test_of_a_vertex_on_a_ring_that_proves_to_be_none_the_ring_is_left() -> None:
    """Its third departure was none; the way round is known all the same."""
    seen = Seen().look(TEE, 20)
    graph = seen.mapper.graph
    (vertex,) = (v for v in graph.vertices.values() if v.kind == "meetpoint")
    psi = seen.mapper.belief.map_vertex(vertex.id).theta
    keys = {round(math.cos(h.bearing + psi)): key for key, h in vertex.half_edges.items()}
    east, west = HalfEdgeId(vertex.id, keys[1]), HalfEdgeId(vertex.id, keys[-1])
    for edge in list(graph.edges.values()):  # that to the dead end
        graph.unjoin(edge)
    line = np.array([(3.0, 0.0), (6.0, 0.0), (6.0, 9.0), (-2.0, 9.0), (-2.0, 0.0), (3.0, 0.0)])
    view = View(99, 99.0, 9.9, Pose(), TEE, NOTHING_SEEN)
    seen.mapper.join(view, east, west, line, 1.0, driven=True)
    seen.look_near(PLAIN, CONFIG.misses + 2)
    assert graph.rings() == [vertex]
    assert of_type(seen.events, VertexRemoved) == []


def test_a_departure_seen_once_between_clear_views_is_not_added() -> None:
    lines = {**TEE_LINES, 13: (2, 5, [])}
    crossing = drawn({**TEE_POINTS, 5: (3.0, 4.0)}, lines, unseen={**UNSEEN, 5: math.pi / 2})
    seen = Seen().look(TEE, 20)
    for _ in range(10):
        seen.look(crossing, CONFIG.surplus - 1).look(TEE, 1)
    assert seen.mapper.graph.vertices[seen.known.vertex_of[2]].degree == 3


def test_a_dead_end_whose_edge_proves_to_end_elsewhere_is_taken_back() -> None:
    """The branch goes south to (3, -4); later it is seen to turn east and to end at (5, -4)."""
    points = {**TEE_POINTS, 4: (5.0, -4.0)}
    bent = drawn(points, {**TEE_LINES, 12: (2, 4, [(3.0, -3.2)])}, unseen=UNSEEN)
    seen = Seen().look(TEE, 20)
    assert seen.places("endpoint") == [pytest.approx((3.0, -4.0))]
    seen.look(bent, 30)
    assert seen.places("endpoint") == [pytest.approx((5.0, -4.0))]
    assert len(seen.mapper.graph.edges) == 1
    assert {end.vertex for end in seen.mapper.graph.frontiers()} == {seen.known.vertex_of[2]}


def test_an_edge_that_is_seen_far_more_often_than_another_in_its_place_stays() -> None:
    points = {**TEE_POINTS, 4: (5.0, -4.0)}
    bent = drawn(points, {**TEE_LINES, 12: (2, 4, [(3.0, -3.2)])}, unseen=UNSEEN)
    seen = Seen().look(TEE, 20)
    seen.look(bent, 2)
    edges = set(seen.mapper.graph.edges)
    for _ in range(2 * CONFIG.conflicts):
        seen.look(TEE, 20).look(bent, 1)
    assert set(seen.mapper.graph.edges) == edges


def test_a_side_door_that_is_not_seen_from_afar_still_hangs_on_its_corridor() -> None:
    seen = Seen().look(TEE_BETWEEN, 20)
    frontiers = seen.mapper.graph.frontiers()
    assert (len(seen.mapper.graph.edges), len(frontiers)) == (2, 1)
    afar = Pose(5.9, 0.0)
    seen.mapper.move(afar, np.zeros((3, 3)))
    seen.look(TWO_ENDS, 3 * CONFIG.conflicts, at=afar)
    assert seen.mapper.graph.frontiers() == frontiers
    (door,) = frontiers
    ends = {v.id for v in seen.mapper.graph.vertices.values() if v.kind == "endpoint"}
    links = {frozenset((e.a.vertex, e.b.vertex)) for e in seen.mapper.graph.edges.values()}
    assert links == {frozenset((door.vertex, end)) for end in ends}


def test_a_fork_in_a_room_that_proves_to_be_its_end_becomes_a_dead_end() -> None:
    """Two short branches into corners are seen first, and none of them later."""
    corners = {**TEE_POINTS, 5: (2.0, -4.6), 6: (4.0, -4.6)}
    lines = {**TEE_LINES, 13: (4, 5, []), 14: (4, 6, [])}
    unseen = {**UNSEEN, 5: -2.4, 6: -0.7}
    seen = Seen().look(drawn(corners, lines, unseen=unseen), 20)
    assert len(seen.places("meetpoint")) == 2
    seen.look(TEE, CONFIG.misses + 2)
    assert len(seen.places("meetpoint")) == 1
    assert seen.places("endpoint") == [pytest.approx((3.0, -4.0), abs=0.01)]
    assert len(seen.mapper.graph.edges) == 1


def test_a_vertex_beside_the_one_that_is_seen_is_taken_back() -> None:
    """Two meetpoints half a metre apart were believed; sight shows one, at the first of them."""
    lines: dict[int, tuple[int, int, list[Point]]] = {
        10: (1, 2, []),
        11: (2, 5, []),
        12: (2, 4, []),
        13: (5, 3, []),
        14: (5, 6, []),
    }
    points = {**TEE_POINTS, 5: (3.6, 0.0), 6: (3.6, 4.0)}
    pair = drawn(points, lines, unseen={**UNSEEN, 6: math.pi / 2})
    seen = Seen().look(pair, 20)
    assert len(seen.places("meetpoint")) == 2
    seen.look_near(TEE, CONFIG.misses + 2)
    assert len(seen.places("meetpoint")) == 1


def test_a_dead_end_to_be_driven_is_joined_only_from_its_end() -> None:
    points = {**TEE_POINTS, 4: (3.0, -2.0)}
    far = drawn(points, TEE_LINES, unseen=UNSEEN)
    seen = Seen(drive_dead_ends=True).look(far, 20)
    assert len(seen.mapper.graph.vertices) == 2
    assert len(seen.mapper.graph.edges) == 0
    moved = Pose(3.0, -1.7)
    seen.mapper.move(moved, np.zeros((3, 3)))
    seen.look(far, 1, at=moved)
    assert len(seen.mapper.graph.edges) == 1


def test_of_two_dead_ends_to_be_driven_the_robot_has_been_at_both() -> None:
    seen = Seen(drive_dead_ends=True).look(TWO_ENDS, 20)
    assert len(seen.mapper.graph.vertices) == 2
    seen.mapper.move(Pose(-0.8), np.zeros((3, 3)))
    seen.look(TWO_ENDS, 2, at=Pose(-0.8))
    assert len(seen.mapper.graph.edges) == 0
    seen.mapper.move(Pose(4.6), np.zeros((3, 3)))
    seen.look(TWO_ENDS, 1, at=Pose(3.8))
    assert len(seen.mapper.graph.edges) == 1


PERSON = np.array([[3.0, 1.1], [3.2, 1.2], [2.8, 1.2]])  # beside the crossing of TEE


def test_what_somebody_stands_beside_is_not_believed() -> None:
    seen = Seen().look(TEE, 30, doubtful=PERSON)
    assert seen.places("meetpoint") == []


def test_a_known_vertex_learns_nothing_while_somebody_stands_beside_it() -> None:
    """The departure that seems to lead to the north is none, the one to the east is hidden."""
    seen = Seen().look(TEE, CONFIG.candidates.meetpoint_sightings)
    (vertex,) = seen.mapper.graph.vertices.values()
    before = {key: half.bearing for key, half in vertex.half_edges.items()}
    misled = drawn(
        {1: (-3.0, 0.0), 2: (3.0, 0.2), 4: (3.0, -4.0), 5: (3.0, 4.0)},
        {10: (1, 2, []), 12: (2, 4, []), 13: (2, 5, [])},
        unseen={1: math.pi, 4: -math.pi / 2, 5: math.pi / 2},
    )
    seen.look(misled, 30, doubtful=PERSON)
    assert {key: half.bearing for key, half in vertex.half_edges.items()} == before
    assert seen.places("meetpoint") == [pytest.approx((3.0, 0.0), abs=1e-3)]
    assert seen.known.vertex_of == {2: vertex.id}


def test_what_proves_to_be_a_plain_edge_on_coming_back_is_no_vertex() -> None:
    """The branch that nobody has driven into yet may be out of sight from three metres away."""
    seen = Seen().look(TEE, CONFIG.candidates.meetpoint_sightings)
    seen.drive_elsewhere(20.0)
    seen.look(PLAIN, CONFIG.misses + 1)
    assert len(seen.places("meetpoint")) == 1
    seen.look_near(PLAIN, CONFIG.misses + 1)
    assert seen.places("meetpoint") == []


def test_a_vertex_is_not_refuted_while_somebody_may_hide_its_branch() -> None:
    seen = Seen().look(TEE, 10)
    seen.look(PLAIN, 30, doubtful=np.array([[3.0, -1.5]]))
    assert len(seen.places("meetpoint")) == 1


@pytest.mark.parametrize(("room", "vertices"), [(4.0, 0), (1.0, 1)])
def test_a_vertex_whose_walls_have_gone_is_none_wherever_the_edges_are(
    room: float, vertices: int
) -> None:
    """The tee of clearance 1 m was between people: half the width of the hall is `room`."""
    seen = Seen().look(TEE, CONFIG.candidates.meetpoint_sightings)
    hall, hall_map = carved([(-4.0, -room, 8.0, room)]), LocalMap(LocalMapConfig())
    for _ in range(3):
        hall_map.insert(sweep(hall, Pose()), Pose(), 0.0)
    beside = drawn({1: (-2.0, 0.8), 3: (6.0, 0.8)}, {10: (1, 3, [])}, unseen=UNSEEN)
    seen.look(beside, CONFIG.misses + 1, local_map=hall_map)
    assert len(seen.places("meetpoint")) == vertices


def test_the_robot_s_uncertainty_is_in_the_place_of_a_vertex_seen_later() -> None:
    """A drive between the sights adds to the covariance of what is seen after it only."""
    seen = Seen().look(TEE, CONFIG.candidates.meetpoint_sightings)
    first = np.trace(seen.mapper.belief.vertex_covariance(seen.known.vertex_of[2]))
    seen.mapper.move(Pose(20.0, 0.0, 0.0), 0.5 * np.eye(3))
    seen.look(TWO_ENDS, CONFIG.candidates.endpoint_sightings)
    belief = seen.mapper.belief
    later = np.trace(belief.vertex_covariance(seen.known.vertex_of[2]))
    assert later > first + 0.9  # at least the 0.5 in x and in y


def test_a_vertex_that_moves_as_more_of_it_is_seen_takes_the_robot_nowhere() -> None:
    """Half a metre in the end, as a meetpoint that is seen through a door from ever farther."""
    seen = Seen().look(TEE, CONFIG.candidates.meetpoint_sightings)
    seen.mapper.move(Pose(), 0.02**2 * np.eye(3))
    before, vertex = seen.mapper.belief.x[:3].copy(), seen.known.vertex_of[2]
    for x in np.arange(3.0, 3.5, 0.02):
        seen.look(drawn({**TEE_POINTS, 2: (float(x), 0.0), 4: (float(x), -4.0)}, TEE_LINES), 3)
    belief = seen.mapper.belief
    assert vertex in belief.ids
    assert belief.map_vertex(vertex).x > 3.05
    assert np.array_equal(belief.x[:3], before)


def test_a_vertex_is_where_it_is_when_nothing_unseen_can_move_it_any_more() -> None:
    """Seen from afar, walls are out of sight that draw it by a quarter of a metre."""
    points = TEE_POINTS | {2: (2.8, 0.15)}
    afar = drawn(points, TEE_LINES, unseen={**UNSEEN, 2: math.pi / 4})
    seen = Seen().look(afar, 30)
    (place,) = seen.places("meetpoint")
    assert place == pytest.approx((2.8, 0.15), abs=0.01)
    seen.look(TEE, 15)
    (place,) = seen.places("meetpoint")
    assert place == pytest.approx((3.0, 0.0), abs=0.07)


def test_an_odd_sight_of_a_vertex_counts_less() -> None:
    """Seven times as far off, and once: a share of it, that is smaller."""
    shares = []
    for off in (0.1, 0.7):
        seen = Seen().look(TEE, CONFIG.candidates.meetpoint_sightings)
        vertex = seen.known.vertex_of[2]
        before = seen.mapper.belief.map_vertex(vertex).x
        moved = {**TEE_POINTS, 2: (3.0 + off, 0.0), 4: (3.0 + off, -4.0)}
        seen.look(drawn(moved, TEE_LINES, unseen=UNSEEN), 15)
        assert vertex in seen.known.node_of
        shares.append((seen.mapper.belief.map_vertex(vertex).x - before) / off)
    assert 0.0 < shares[1] < 0.7 * shares[0]


SIGHTS = [TEE, PLAIN, TWO_ENDS, LocalGvg()]


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(1, 9)), max_size=12))
def test_graph_and_belief_agree_after_any_sequence_of_contradicting_sights(
    looks: list[tuple[int, int]],
) -> None:
    seen = Seen()
    for sight, times in looks:
        seen.look(SIGHTS[sight], times)
    graph, belief = seen.mapper.graph, seen.mapper.belief
    assert set(belief.ids) == graph.vertices.keys()
    assert len(belief.x) == 3 + 3 * len(graph.vertices)
    degrees = sum(vertex.degree for vertex in graph.vertices.values())
    assert degrees == 2 * len(graph.edges) + len(graph.frontiers()) + len(graph.blocked())
    for edge in graph.edges.values():
        assert graph.edge_at(edge.a) is graph.edge_at(edge.b) is edge
    for end in seen.known.branch_of:
        assert end.vertex in graph.vertices
    assert np.linalg.eigvalsh(belief.P).min() > -1e-12


def test_what_comes_back_whenever_it_is_taken_out_is_left_alone_in_the_end() -> None:
    """Sight at a threshold: a branch that is worth a vertex now, and a corner then."""
    seen = Seen()
    for _ in range(10):
        seen.look_near(TEE, 20).look_near(PLAIN, 20)
    assert 1 < len(of_type(seen.events, VertexRemoved)) < 5
    assert seen.places("meetpoint") == [pytest.approx((3.0, 0.0), abs=1e-3)]


def test_a_door_that_is_shut_for_a_while_takes_no_vertex_out_of_a_finished_map() -> None:
    """The branch of the tee is out of sight, and what is left is a plain corridor."""
    seen = Seen().look(TEE, 20)
    vertices = set(seen.mapper.graph.vertices)
    seen.mapper.establish()
    seen.look(PLAIN, 100)
    assert set(seen.mapper.graph.vertices) == vertices
    assert of_type(seen.events, VertexRemoved) == []


@pytest.mark.parametrize("is_finished", [True, False])
def test_on_a_way_of_a_finished_map_or_a_dubious_one_a_meetpoint_must_be_seen_from_near(
    *, is_finished: bool
) -> None:
    """From afar a room may look so as long as some of its walls are out of sight, or of glass."""
    seen = Seen().look(TWO_ENDS, 30)
    if is_finished:
        seen.mapper.establish()
    else:
        (edge,) = seen.mapper.graph.edges.values()
        edge.traversals = 1
        seen.mapper._unbelieved.note_mistake(Mistake(np.array([3.5, 0.0]), (), 0.0))
    assert seen.look(TEE_BETWEEN, 50).places("meetpoint") == []
    near = Pose(1.5 - CONFIG.passed_m + 0.1, 0.0)
    seen.mapper.move(near, np.zeros((3, 3)))
    seen.look(TEE_BETWEEN, CONFIG.candidates.meetpoint_sightings, at=near)
    assert seen.places("meetpoint") == [pytest.approx((1.5, 0.0), abs=1e-3)]
    assert [e.established for e in seen.mapper.graph.edges.values()] == 2 * [is_finished]


@pytest.mark.parametrize("passes", [True, False])
def test_a_way_that_was_driven_is_dubious_before_its_end_is_known(*, passes: bool) -> None:
    """Near a mistake, what is seen from afar on it is none; beside it, it may be one."""
    seen = Seen().look(TWO_ENDS, 30)
    aside = 0.0 if passes else 2.0
    way = np.array([(0.0, aside), (1.5, aside), (3.0, aside)])
    seen.mapper.driven_parts = [way]
    seen.mapper._unbelieved.note_mistake(Mistake(np.array([3.5, 0.0]), (), 0.0))
    assert (seen.look(TEE_BETWEEN, 50).places("meetpoint") == []) == passes


def test_where_a_meetpoint_must_be_seen_from_near_the_dead_end_behind_it_must_too() -> None:
    """Without the meetpoint no way would lead there."""
    seen = Seen()
    seen.mapper.driven_parts = [np.array([(0.0, 0.0), (3.0, 0.0), (6.0, 0.0)])]
    seen.mapper._unbelieved.note_mistake(Mistake(np.array([3.5, 0.0]), (), 0.0))
    assert seen.look(TEE, 50).mapper.graph.vertices == {}
    near = Pose(3.0 - CONFIG.passed_m + 0.1, 0.0)
    seen.mapper.move(near, np.zeros((3, 3)))
    seen.look(TEE, CONFIG.candidates.endpoint_sightings, at=near)
    assert seen.places("meetpoint") == [pytest.approx((3.0, 0.0), abs=1e-3)]
    assert seen.places("endpoint") == [pytest.approx((3.0, -4.0), abs=1e-3)]


def test_on_a_driven_way_where_nothing_proved_to_be_none_a_meetpoint_is_believed_from_afar() -> (
    None
):
    """Somebody may have stood before a door as the robot passed."""
    seen = Seen().look(TWO_ENDS, 30)
    (edge,) = seen.mapper.graph.edges.values()
    edge.traversals = 1
    assert seen.look(TEE_BETWEEN, 50).places("meetpoint") == [pytest.approx((1.5, 0.0), abs=1e-3)]


def test_what_stays_away_for_longer_than_a_day_was_walled_up() -> None:
    seen = Seen().look(TEE, 20)
    seen.mapper.establish()
    seen.look_near(PLAIN, 20)
    seen.drive_elsewhere(CONFIG.changed_after_s / 10.0)  # a second for each 0.1 m
    seen.look_near(PLAIN, 20)
    assert len(of_type(seen.events, VertexRemoved)) >= 1
    assert seen.places("meetpoint") == []


def test_what_is_shut_every_day_and_open_in_between_was_not_walled_up() -> None:
    """Sight must have spoken against it all that time; now and then it is where it was."""
    seen = Seen().look(TEE, 20)
    seen.mapper.establish()
    for _ in range(3):
        seen.look_near(PLAIN, 20)
        seen.look_near(TEE, 20)
        seen.drive_elsewhere(CONFIG.changed_after_s / 10.0)
    assert of_type(seen.events, VertexRemoved) == []
    assert seen.places("meetpoint") == [pytest.approx((3.0, 0.0), abs=0.1)]


def test_who_was_elsewhere_believes_nothing_by_what_it_saw_there() -> None:
    """It has been pushed: it knows no vertex by its place alone, and counts its sights anew."""
    seen = Seen().look(TEE, CONFIG.candidates.meetpoint_sightings)
    (vertex,) = seen.mapper.graph.vertices.values()
    seen.mapper.lose_sight(-1.0)
    assert vertex.seen_at == -1.0
    seen.look(TEE, CONFIG.candidates.endpoint_sightings - CONFIG.candidates.meetpoint_sightings)
    assert seen.places("endpoint") == []


def test_before_it_is_finished_a_map_learns_as_fast_as_ever() -> None:
    seen = Seen().look(TEE, 20).look_near(PLAIN, 20)
    assert len(of_type(seen.events, VertexRemoved)) >= 1


class Believing:
    """Recognises one vertex whenever something is seen for which no vertex is in sight.

    As a rival for so many looks only.
    """

    def __init__(self, known: int, *, as_rival: bool, looks: float = math.inf) -> None:
        self._known, self._as_rival, self._looks = known, as_rival, looks

    def gated(self, *_: object) -> list[object]:
        return []

    def find(
        self,
        belief: Belief,
        graph: GvgGraph,
        vertices: list[Vertex],
        view: View,
        sighting: Sighting,
        *,
        wary: bool,
    ) -> Recognition:
        if not sighting.meetpoint or self._known not in {vertex.id for vertex in vertices}:
            return Recognition()
        if self._as_rival or wary:
            self._looks -= 1
            if self._looks < 0:
                return Recognition()
            return Recognition(None, (self._known,), (5.0,), 0.01, 9.0)
        local = Pose(float(sighting.position[0]), float(sighting.position[1]), 0.0)
        foreseen, _ = ekf.expected(belief, self._known)
        off = foreseen.distance(view.local_base.to(local))
        vertex = graph.vertices[self._known]
        return Recognition(Match(vertex, local, 0.01 * np.eye(3), 1.0, 1.0, off))


def crossed(*, as_rival: bool, looks: float = math.inf) -> Seen:
    """A tee, and after a long way another place of which it is said to be the same."""
    seen = Seen().look(TEE, CONFIG.candidates.endpoint_sightings)
    tee = seen.known.vertex_of[2]
    seen.mapper._recogniser = Believing(tee, as_rival=as_rival, looks=looks)  # type: ignore[assignment]
    seen.drive_elsewhere(20.0)
    seen.mapper.move(Pose(4.0, 3.0, 0.0), np.diag([9.0, 9.0, 0.01]))
    return seen.look(TEE, CONFIG.candidates.meetpoint_sightings)


def test_a_closure_that_the_next_vertices_contradict_is_taken_back() -> None:
    seen = crossed(as_rival=False)
    mapper = seen.mapper
    assert len(of_type(seen.events, LoopClosed)) == 1
    (edge,) = mapper.graph.edges.values()
    mapper.unsettled.note_way(edge, arrived=99)  # not at its far end
    seen.look(TEE)
    assert len(of_type(seen.events, ClosureRevoked)) == 1
    assert (mapper.belief.map_base.x, mapper.belief.map_base.y) == pytest.approx((4.0, 3.0))
    assert np.trace(mapper.belief.P[:2, :2]) > 17.9  # as uncertain as the way there has left it
    assert not mapper.belief.ids or max(s.vertex for s in mapper.observations) in mapper.belief.ids


def test_a_closure_that_leads_on_over_a_known_edge_stays() -> None:
    seen = crossed(as_rival=False)
    (edge,) = seen.mapper.graph.edges.values()
    seen.mapper.unsettled.note_way(edge, arrived=edge.b.vertex)
    seen.mapper.unsettled.note_way(edge, arrived=99)
    seen.look(TEE)
    assert of_type(seen.events, ClosureRevoked) == []


def test_a_closure_of_a_finished_map_stays_whatever_a_single_way_says() -> None:
    """Somebody may stand there; if it is wrong, that will be seen for long."""
    seen = crossed(as_rival=False)
    (edge,) = seen.mapper.graph.edges.values()
    known = set(seen.mapper.graph.vertices)
    seen.mapper.establish()
    seen.mapper.unsettled.note_way(edge, arrived=99)  # not at its far end
    seen.look(TEE)
    assert of_type(seen.events, ClosureRevoked) == []
    assert seen.mapper.graph.vertices.keys() == known


def test_a_vertex_in_doubt_becomes_part_of_the_known_one_as_soon_as_that_is_certain() -> None:
    seen = crossed(as_rival=True)
    mapper = seen.mapper
    (doubt,) = of_type(seen.events, PlaceDoubted)
    assert isinstance(doubt, PlaceDoubted)
    tee = doubt.known
    assert {tee, doubt.vertex} <= mapper.graph.vertices.keys()
    # walls tell where the robot truly is: three metres before the tee
    mapper.belief = updated(mapper.belief, tee, Pose(3.0, 0.0), 0.01 * np.eye(3))
    mapper.unsettled._has_news = True
    seen.look(TEE)
    (settled,) = of_type(seen.events, DoubtSettled)
    assert isinstance(settled, DoubtSettled)
    assert (settled.vertex, settled.known) == (doubt.vertex, tee)
    assert doubt.vertex not in mapper.graph.vertices
    assert seen.known.vertex_of[2] == tee
    assert {s.vertex for s in mapper.observations} <= set(mapper.belief.ids)


@pytest.mark.parametrize(("looks", "doubts"), [(1, 1), (0, 0)])
def test_what_one_of_the_looks_has_shown_is_in_doubt_though_the_last_one_did_not(
    looks: int, doubts: int
) -> None:
    seen = crossed(as_rival=True, looks=looks)
    assert len(of_type(seen.events, PlaceDoubted)) == doubts


def test_who_takes_a_settled_doubt_back_knows_again_what_was_seen_of_both_places() -> None:
    seen = crossed(as_rival=True)
    mapper = seen.mapper
    (doubt,) = of_type(seen.events, PlaceDoubted)
    assert isinstance(doubt, PlaceDoubted)
    before = list(mapper.observations)
    mapper.belief = updated(mapper.belief, doubt.known, Pose(3.0, 0.0), 0.01 * np.eye(3))
    mapper.unsettled._has_news = True
    seen.look(TEE)
    assert len(of_type(seen.events, DoubtSettled)) == 1
    (edge,) = mapper.graph.edges.values()
    mapper.unsettled.note_way(edge, arrived=99)  # not at its far end
    mapper.unsettled.revoke(100.0)
    assert doubt.vertex in mapper.graph.vertices
    assert mapper.observations == before


def crossing(turn: float) -> LocalGvg:
    """Two corridors that cross in the origin, in a local frame that is turned."""
    ways = Pose(theta=turn).transform(4.0 * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]]))
    points = {1: (0.0, 0.0)} | {2 + i: (float(x), float(y)) for i, (x, y) in enumerate(ways)}
    lines: dict[int, tuple[int, int, list[Point]]] = {10 + i: (1, i, []) for i in range(2, 6)}
    unseen = {2 + i: math.atan2(y, x) for i, (x, y) in enumerate(ways)}
    return drawn(points, lines, unseen=unseen)


@pytest.mark.parametrize("turn", [0.05, 0.25, -0.25])
def test_a_crossing_is_known_again_however_odometry_has_turned(turn: float) -> None:
    """Walls three metres off are beyond the reach of their pairs then; the ways tell the turn."""
    world = carved([(-8.0, -1.0, 8.0, 1.0), (-1.0, -8.0, 1.0, 8.0)])
    seen = Seen().look(
        crossing(0.0), CONFIG.candidates.meetpoint_sightings, local_map=looked(world, [Pose()])
    )
    seen.drive_elsewhere(20.0)
    seen.mapper.move(Pose(), np.diag([0.04, 0.04, 0.2**2]))
    turned = looked(world, [Pose()], local_world=Pose(theta=turn))
    seen.look(crossing(turn), local_map=turned)
    (closed,) = of_type(seen.events, LoopClosed)
    assert isinstance(closed, LoopClosed)
    assert closed.agreement > 0.9
    assert len(seen.mapper.graph.vertices) == 1


def test_a_meetpoint_at_a_door_that_a_virtual_wall_shuts_is_where_it_was() -> None:
    """Nothing of it is to be seen any more, but ways over the map lead to it and on."""
    seen = Seen().look_near(TEE, 30)
    (tee,) = [v for v in seen.mapper.graph.vertices.values() if v.kind == "meetpoint"]
    assert seen.mapper.marked(PLAIN, NEAR) == (PLAIN, {})
    door = np.linspace([2.0, -1.0], [4.0, -1.0], 21)
    seen.mapper.heed(seen.mapper.belief.map_base.transform(NEAR.inverse().transform(door)))
    gvg, marks = seen.mapper.marked(PLAIN, NEAR)
    ((node, marked),) = marks.items()
    assert marked is tee
    assert gvg.nodes[node].position == pytest.approx((3.0, 0.0), abs=0.06)
    view = View(1000, 1000.0, 4.0, NEAR, gvg, NOTHING_SEEN, marks=marks)
    known, _ = seen.mapper.observe(view)
    bearings = {round(tee.half_edges[end.key].bearing, 1) for end in known.branch_of}
    assert bearings == {0.0, round(math.pi, 1)}
    assert seen.mapper.marked(TEE, NEAR) == (TEE, {})  # where the wall does not hide it


def test_the_ways_from_a_ring_s_vertex_are_known_where_it_is_taken_to_be_at_a_corner() -> None:
    """It was put onto the ring before the corner, whose one way is straight on there."""
    seen = Seen()
    ring = Vertex(seen.mapper.graph.next_id(), 1.0, Pose(3.0), 0.0, 0.0)
    seen.mapper.graph.vertices[ring.id] = ring
    seen.mapper.belief = ekf.add_vertex(seen.mapper.belief, ring.id, ring.local, 1e-4 * np.eye(3))
    on, back = (HalfEdgeId(ring.id, ring.add_half_edge(bearing)) for bearing in (0.0, math.pi))
    seen.mapper.graph.join(
        on, back, np.array([[0.0, 0.0], [9.0, 9.0], [0.0, 0.0]]), 1.0, driven=True
    )
    gvg = drawn({1: (-3.0, 0.0), 2: (3.0, 0.0), 3: (3.0, 4.0)}, {10: (1, 2, []), 11: (2, 3, [])})
    view = View(1, 1.0, 0.1, Pose(), gvg, NOTHING_SEEN, marks={2: ring})
    known, _ = seen.mapper.observe(view)
    assert known.branch_of[back].edge == 10
    assert known.branch_of[on].edge == 11


def test_a_meetpoint_that_a_virtual_wall_moves_along_is_there_once() -> None:
    tight = drawn(TEE_POINTS, TEE_LINES, clearance=0.5, unseen=UNSEEN)
    moved = drawn(
        TEE_POINTS | {2: (3.7, 0.0), 4: (3.7, -4.0)}, TEE_LINES, clearance=0.5, unseen=UNSEEN
    )
    seen = Seen().look_near(tight, 30)
    (tee,) = [v for v in seen.mapper.graph.vertices.values() if v.kind == "meetpoint"]
    door = np.linspace([2.0, -1.0], [4.0, -1.0], 21)
    seen.mapper.heed(seen.mapper.belief.map_base.transform(NEAR.inverse().transform(door)))
    gvg, marks = seen.mapper.marked(moved, NEAR)
    assert list(marks.values()) == [tee]
    view = View(30, 30.0, 3.0, NEAR, gvg, NOTHING_SEEN, marks=marks)
    known, _ = seen.mapper.observe(view)
    assert [node for node, vertex in known.vertex_of.items() if vertex == tee.id] == [2]


def test_a_meetpoint_behind_a_virtual_wall_may_prove_to_be_a_known_one() -> None:
    """It was to be drawn where it is before this look told that; the edge beside it is joined."""
    seen = Seen()
    mapper, graph = seen.mapper, seen.mapper.graph
    known, again, end = (Vertex(graph.next_id(), 1.0, Pose(x), 0.0, 0.0) for x in (0.0, 0.1, 3.0))
    for vertex, bearings in ((known, ()), (again, (0.0, math.pi, 1.5)), (end, (math.pi,))):
        graph.vertices[vertex.id] = vertex
        mapper.belief = ekf.add_vertex(mapper.belief, vertex.id, vertex.local, 1e-4 * np.eye(3))
        for bearing in bearings:
            vertex.add_half_edge(bearing)
    mapper.unsettled.doubt(again, Recognition(None, (known.id,), (1.0,), 0.02, 9.0), 0.0)
    gvg = drawn({1: (-3.0, 0.0), 2: (0.1, 0.0), 3: (3.0, 0.0)}, {10: (1, 2, []), 11: (2, 3, [])})
    view = View(1, 1.0, 0.1, Pose(1.5), gvg, NOTHING_SEEN, marks={2: again})
    here, _ = mapper.observe(view)
    assert list(graph.vertices) == [known.id, end.id]
    assert here.vertex_of[2] == known.id
    (edge,) = graph.edges.values()
    assert {edge.a.vertex, edge.b.vertex} == {known.id, end.id}
