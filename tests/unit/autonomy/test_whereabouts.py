"""Which edge the robot is on, drawn by hand: passing vertices, turning back, loops, late sight."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from gvgbot.autonomy.destinations import foot_at, route_to_foot
from gvgbot.autonomy.exploration.access import Access
from gvgbot.autonomy.exploration.paths import first_arrival, shortest_paths
from gvgbot.autonomy.gvg.local import Branch, LocalGvg
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId, Vertex
from gvgbot.autonomy.views import Correspondence
from gvgbot.autonomy.whereabouts import Passage, Situation, Whereabouts
from gvgbot.geometry import Pose, length_of
from tests.unit.autonomy.local_graphs import Point, drawn, resampled

EAST, WEST = 0, 1  # keys of the half-edges of each vertex along the corridor


def known_as(pairs: dict[Branch, HalfEdgeId], nodes: dict[int, int]) -> Correspondence:
    known = Correspondence()
    for node, vertex in nodes.items():
        known.pair(node, vertex)
    for branch, end in pairs.items():
        known.pair_branch(branch, end)
    return known


@dataclass
class Walk:
    """Whereabouts on the way along points, in sight of one local GVG after another."""

    where: Whereabouts = field(default_factory=Whereabouts)
    passages: list[Passage] = field(default_factory=list)

    def along(self, gvg: LocalGvg, known: Correspondence, *corners: Point) -> "Walk":
        for point in resampled(list(corners)):
            place = gvg.place(point)
            assert place is not None
            passage = self.where.follow(gvg, place, known, point)
            if passage is not None:
                self.passages.append(passage)
        return self


# A corridor from an end at x = 0 (vertex 1) by a meetpoint at x = 6 (vertex 2, its branch south)
# to an end at x = 12 (vertex 3), all in sight.
CORRIDOR = drawn(
    {1: (0.0, 0.0), 2: (6.0, 0.0), 3: (12.0, 0.0), 4: (6.0, -3.0)},
    {10: (1, 2, []), 11: (2, 3, []), 12: (2, 4, [])},
)
ENDS = {
    Branch(10, forward=True): HalfEdgeId(1, EAST),
    Branch(10, forward=False): HalfEdgeId(2, WEST),
    Branch(11, forward=True): HalfEdgeId(2, EAST),
    Branch(11, forward=False): HalfEdgeId(3, WEST),
    Branch(12, forward=True): HalfEdgeId(2, 2),
}
ALL_KNOWN = known_as(ENDS, {1: 1, 2: 2, 3: 3})


@pytest.mark.parametrize(("onwards", "length"), [(2.0, 8.0), (-2.0, 4.0)])
def test_a_vertex_that_is_none_is_left_out_of_the_way(onwards: float, length: float) -> None:
    """Six metres from the end to what is none, and two metres on from there, or back."""
    where = Whereabouts(HalfEdgeId(2, EAST), list(resampled([(6.0, 0.0), (6.0 + onwards, 0.0)])))
    where.rejoin(HalfEdgeId(1, EAST), np.array(resampled([(0.0, 0.0), (6.0, 0.0)])))
    assert where.on_edge == HalfEdgeId(1, EAST)
    assert where.trail_length == pytest.approx(length, abs=0.4)


@pytest.mark.parametrize(
    ("base", "is_on_it"),
    [((6.4, 0.1), True), ((5.7, 0.0), False), ((6.4, 0.6), False), ((9.0, 0.0), False)],
)
def test_past_a_vertex_that_is_out_of_sight_the_robot_is_on_the_edge_that_leaves_it(
    base: Point, is_on_it: bool
) -> None:
    """The vertex is at x = 6, and the edge leaves it to the east."""
    where = Whereabouts(HalfEdgeId(2, WEST), list(resampled([(6.0, 0.0), (5.0, 0.0)])))
    where.depart(HalfEdgeId(2, EAST), np.array([6.0, 0.0]), 0.0, np.array(base))
    assert (where.on_edge == HalfEdgeId(2, EAST)) is is_on_it
    if is_on_it:
        place = CORRIDOR.place(np.array(base))
        assert place is not None
        known = known_as({}, {})
        back = where.backwards(CORRIDOR, place, known, Pose(*base, theta=math.pi))
        assert back == Branch(11, forward=False)


def test_passing_a_meetpoint_is_a_passage_from_the_edge_before_it() -> None:
    walk = Walk().along(CORRIDOR, ALL_KNOWN, (1.0, 0.0), (11.0, 0.0))
    first, passed = walk.passages
    assert first.left is None
    assert first.arrived == HalfEdgeId(1, EAST)
    assert (passed.left, passed.arrived) == (HalfEdgeId(1, EAST), HalfEdgeId(2, WEST))
    assert passed.line[0] == pytest.approx([0.0, 0.0])
    assert passed.line[-1] == pytest.approx([6.0, 0.0])
    assert passed.driven == pytest.approx(6.0, abs=0.3)
    assert walk.where.on_edge == HalfEdgeId(2, EAST)


def test_turning_at_a_meetpoint_is_a_passage_too() -> None:
    walk = Walk().along(CORRIDOR, ALL_KNOWN, (1.0, 0.0), (6.0, 0.0), (6.0, -2.0))
    assert [p.arrived for p in walk.passages[1:]] == [HalfEdgeId(2, WEST)]
    assert walk.where.on_edge == HalfEdgeId(2, 2)


def test_going_to_a_dead_end_and_back_is_no_passage() -> None:
    walk = Walk().along(CORRIDOR, ALL_KNOWN, (5.0, 0.0), (0.3, 0.0), (5.0, 0.0))
    assert len(walk.passages) == 1  # the first sight of the edge
    assert walk.where.on_edge == HalfEdgeId(2, WEST)


def test_a_way_back_is_taken_off_the_trail() -> None:
    walk = Walk().along(CORRIDOR, ALL_KNOWN, (5.0, 0.0), (1.0, 0.0))
    assert walk.where.trail_length == pytest.approx(5.0, abs=0.3)  # from the meetpoint at 6 m
    walk.along(CORRIDOR, ALL_KNOWN, (1.0, 0.0), (5.0, 0.0))
    assert walk.where.trail_length < 1.7


def test_a_way_back_beside_the_edge_is_taken_off_the_trail_too() -> None:
    walk = Walk().along(CORRIDOR, ALL_KNOWN, (0.0, 0.0), (5.0, 0.0))
    walk.along(CORRIDOR, ALL_KNOWN, (5.0, 0.0), (5.0, 0.6), (2.0, 0.6))
    assert walk.where.trail_length == pytest.approx(2.0, abs=0.5)  # _LOOP_M, and a step


@pytest.mark.parametrize(("stub", "arrived"), [((5.97, 0.01), HalfEdgeId(2, WEST)), (None, None)])
def test_who_has_passed_a_meetpoint_came_from_behind_it_though_no_way_is_seen_there(
    stub: Point | None, arrived: HalfEdgeId | None
) -> None:
    """Half a metre past it there is but the beginning of the way behind, or not even that."""
    unknown = known_as({Branch(10, forward=True): HalfEdgeId(1, EAST)}, {1: 1})
    walk = Walk().along(CORRIDOR, unknown, (1.05, 0.0), (6.45, 0.0))
    points: dict[int, Point] = {2: (6.0, 0.0), 3: (12.0, 0.0)}
    lines: dict[int, tuple[int, int, list[Point]]] = {11: (2, 3, [])}
    ends = {Branch(11, forward=True): HalfEdgeId(2, EAST)}
    if stub is not None:
        points[5], lines[13] = stub, (2, 5, [])
        ends[Branch(13, forward=True)] = HalfEdgeId(2, WEST)
    walk.along(drawn(points, lines), known_as(ends, {2: 2}), (6.5, 0.0), (6.6, 0.0))
    (passed,) = walk.passages[1:]
    assert (passed.left, passed.arrived) == (HalfEdgeId(1, EAST), arrived)
    assert walk.where.on_edge == HalfEdgeId(2, EAST)


def test_a_meetpoint_seen_only_after_it_was_passed_is_still_passed_by_the_edge_before() -> None:
    """The vertex enters the map when the robot is already a metre beyond it."""
    unknown = known_as({Branch(10, forward=True): HalfEdgeId(1, EAST)}, {1: 1})
    walk = Walk().along(CORRIDOR, unknown, (1.0, 0.0), (7.0, 0.0))
    assert len(walk.passages) == 1
    walk.along(CORRIDOR, ALL_KNOWN, (7.1, 0.0), (8.0, 0.0))
    (passed,) = walk.passages[1:]
    assert (passed.left, passed.arrived) == (HalfEdgeId(1, EAST), HalfEdgeId(2, WEST))
    assert passed.line[-1] == pytest.approx([6.0, 0.0])
    assert passed.driven == pytest.approx(6.0, abs=0.3)


# A loop of 28 m that leaves vertex 1 at the origin to the east and comes back from the north, in
# three sights: the beginning, the far side, and the end.
LOOP: list[Point] = [(0.0, 0.0), (8.0, 0.0), (8.0, 6.0), (0.0, 6.0), (0.0, 0.0)]
STEM = {1: (0.0, 0.0), 2: (-4.0, 0.0)}
BEGIN = drawn(
    {**STEM, 3: (5.0, 0.0), 4: (0.0, 2.0)},
    {20: (1, 3, []), 21: (1, 4, []), 22: (1, 2, [])},
    unseen={3: 0.0, 4: math.pi / 2},
)
FAR = drawn({5: (8.0, 2.0), 6: (2.0, 6.0)}, {30: (5, 6, [(8.0, 6.0)])}, unseen={5: -1.6, 6: 3.1})
KNOWN_AT_1 = {
    Branch(20, forward=True): HalfEdgeId(1, 0),
    Branch(21, forward=True): HalfEdgeId(1, 1),
    Branch(22, forward=True): HalfEdgeId(1, 2),
}
RETURN = drawn(
    {**STEM, 3: (5.0, 0.0), 4: (3.0, 6.0)},
    {20: (1, 3, []), 21: (1, 4, [(0.0, 6.0)]), 22: (1, 2, [])},
    unseen={3: 0.0, 4: 0.0},
)


def test_a_loop_leaves_by_one_half_edge_and_arrives_by_the_other() -> None:
    walk = Walk().along(BEGIN, known_as(KNOWN_AT_1, {1: 1}), (1.0, 0.0), (4.5, 0.0))
    assert walk.where.on_edge == HalfEdgeId(1, 0)
    walk.along(FAR, known_as({}, {}), (5.0, 0.0), (8.0, 0.0), (8.0, 6.0), (3.0, 6.0))
    walk.along(RETURN, known_as(KNOWN_AT_1, {1: 1}), (3.0, 6.0), (0.0, 6.0), (0.0, 1.0))
    (closed,) = walk.passages[1:]
    assert (closed.left, closed.arrived) == (HalfEdgeId(1, 0), HalfEdgeId(1, 1))
    length = float(np.hypot(*np.diff(closed.line, axis=0).T).sum())
    assert length == pytest.approx(28.0, abs=1.0)
    assert closed.line[0] == pytest.approx([0.0, 0.0])
    assert closed.line[-1] == pytest.approx([0.0, 0.0])


def test_the_whole_of_a_loop_in_sight_is_one_edge_without_a_passage() -> None:
    ring = drawn(STEM, {20: (1, 1, LOOP[1:-1]), 22: (1, 2, [])})
    known = known_as(
        {
            Branch(20, forward=True): HalfEdgeId(1, 0),
            Branch(20, forward=False): HalfEdgeId(1, 1),
            Branch(22, forward=True): HalfEdgeId(1, 2),
        },
        {1: 1},
    )
    walk = Walk().along(ring, known, (1.0, 0.0), *LOOP[1:-1], (0.0, 1.0))
    assert len(walk.passages) == 1


# -- ways -------------------------------------------------------------------------------------


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


@pytest.mark.parametrize("came_from", [-0.3, 0.3])
def test_who_came_from_beside_its_edge_goes_back_the_same_way_however_it_turns(
    came_from: float,
) -> None:
    """Else it would turn to and fro for ever: whither it turns, the way back is behind it."""
    trail = [np.array([3.0 + came_from * share, 2.0 * share]) for share in (1.0, 0.5, 0.0)]
    place = CORRIDOR.place(np.array([3.0, 0.0]))
    assert place is not None
    where, unknown = Whereabouts(None, trail), Correspondence()
    for heading in (0.0, 1.5, 3.1, -1.5):
        back = where.backwards(CORRIDOR, place, unknown, Pose(3.0, 0.0, heading))
        assert back == Branch(10, forward=came_from > 0.0)


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


def test_an_edge_that_is_recognised_late_has_been_driven_round_its_bend() -> None:
    """Vertex 1 is 10 m back, 6 of them before a right angle; then it is out of sight."""
    bend = drawn(
        {1: (0.0, 0.0), 2: (6.0, 8.0)}, {10: (1, 2, [(6.0, 0.0)])}, unseen={2: math.pi / 2}
    )
    known = known_as({Branch(10, forward=True): HalfEdgeId(1, EAST)}, {1: 1})
    walk = Walk().along(bend, known, (6.0, 4.0))
    assert walk.where.trail_length == pytest.approx(10.0, abs=0.2)
    later = drawn({5: (6.0, 2.0), 6: (6.0, 8.0)}, {20: (5, 6, [])})
    here = Pose(6.0, 4.3, math.pi / 2)
    walk.along(later, Correspondence(), (here.x, here.y))
    place = later.place(here.position)
    assert place is not None
    back = walk.where.backwards(later, place, Correspondence(), Pose(here.x, here.y, -math.pi / 2))
    assert back == Branch(20, forward=False)  # towards the south


RING = [(1.0 + math.cos(a), math.sin(a)) for a in np.arange(math.pi, 3.0 * math.pi, 0.2)]


@pytest.mark.parametrize(
    ("way", "here", "found"),
    [
        ([(-1.0, 0.0), (-0.5, 0.0), *RING], (0.0, 0.1), 2),
        ([(0.25 * i, 0.0) for i in range(20)], (4.9, 0.0), None),
        ([(0.25 * i, 0.0) for i in range(20)], (0.5, 0.1), None),
    ],
    ids=["round", "straight on", "back by another way"],
)
def test_the_robot_has_come_round_where_it_is_on_its_way_once_more(
    way: list[tuple[float, float]], here: tuple[float, float], found: int | None
) -> None:
    """A circle of radius 1 after a straight way onto it."""
    where = Whereabouts(trail=[np.array(point) for point in way])
    assert where.round_from(np.array(here)) == found


# The two long sides of what is farther than the coast from all walls of a hall.
COASTS = drawn(
    {1: (-6.0, -1.0), 2: (6.0, -1.0), 3: (-6.0, 1.0), 4: (6.0, 1.0)},
    {10: (1, 2, []), 11: (3, 4, [])},
)


def test_between_two_edges_of_which_now_one_is_nearer_and_now_the_other_nothing_is_round() -> None:
    walk = Walk()
    for x in np.arange(0.0, 0.8, 0.1):
        for y in (-0.01, 0.01):
            walk.along(COASTS, known_as({}, {}), (x, y))
    assert walk.where.trail_length < 1.0  # the robot has driven less
    assert walk.where.round_from(np.array([0.7, 0.01])) is None


def test_who_came_onto_another_edge_has_driven_round_from_there() -> None:
    """Along the lower one to the west, and then round a square that begins at the upper one."""
    square: list[Point] = [(0.0, 1.0), (-4.0, 1.0), (-4.0, 5.0), (0.0, 5.0), (0.0, 1.5)]
    sights = drawn(
        {1: (3.0, -1.0), 2: (-3.0, -1.0), 3: (0.0, 1.0), 4: (0.0, 1.1)},
        {10: (1, 2, []), 11: (3, 4, square[1:4])},
    )
    walk = Walk().along(sights, known_as({}, {}), (1.0, -1.0), (0.0, -1.0), *square)
    start = walk.where.round_from(np.array([0.0, 1.3]))
    assert start is not None
    assert walk.where.trail[start] == pytest.approx([0.0, 1.0], abs=0.5)
    assert walk.where.trail_length < 16.0


def test_who_knows_no_vertex_and_turns_round_has_behind_it_what_was_ahead() -> None:
    nothing = Correspondence()
    where = Walk().along(CORRIDOR, nothing, (2.0, 0.0), (4.0, 0.0)).where
    place, base = CORRIDOR.place(np.array([4.0, 0.0])), Pose(4.0, 0.0, 0.0)
    assert place is not None
    towards_west = where.backwards(CORRIDOR, place, nothing, base)
    assert where.turn_round()
    assert where.backwards(CORRIDOR, place, nothing, base) == Branch(
        towards_west.edge, not towards_west.forward
    )
    where.on_edge = HalfEdgeId(1, EAST)
    before = list(where.trail)
    assert not where.turn_round()
    assert where.trail == before  # on an edge of a vertex it is known where that is


@pytest.mark.parametrize("heading", [0.1, 3.0])
def test_who_has_not_driven_yet_turns_round_by_its_heading(heading: float) -> None:
    nothing = Correspondence()
    where = Walk().along(CORRIDOR, nothing, (4.0, 0.0)).where
    place, base = CORRIDOR.place(np.array([4.0, 0.0])), Pose(4.0, 0.0, heading)
    assert place is not None
    behind = where.backwards(CORRIDOR, place, nothing, base)
    assert not where.turn_round()
    assert where.turn_round(heading)
    assert where.backwards(CORRIDOR, place, nothing, base) == Branch(
        behind.edge, not behind.forward
    )


def test_a_vertex_that_is_believed_long_after_the_robot_passed_it_ends_the_edge_there() -> None:
    """It came from x = 4, and is 2.8 m past the meetpoint when that becomes known."""
    where = Whereabouts(HalfEdgeId(1, EAST), list(resampled([(4.0, 0.0), (8.8, 0.0)])))
    (passage,) = Walk(where).along(CORRIDOR, ALL_KNOWN, (8.8, 0.0), (8.9, 0.0)).passages
    assert passage.arrived == HalfEdgeId(2, WEST)
    assert passage.driven == pytest.approx(2.0, abs=0.3)
    assert length_of(passage.line) == pytest.approx(2.0, abs=0.3)
    assert passage.line[-1] == pytest.approx([6.0, 0.0])


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
