"""Which edge the robot is on, drawn by hand: passing vertices, turning back, loops, late sight."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.gvg.local import Branch, LocalGvg
from gvgbot.autonomy.slam.graph import HalfEdgeId
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


def test_who_has_not_been_away_from_a_meetpoint_comes_by_where_it_left() -> None:
    walk = Walk().along(CORRIDOR, ALL_KNOWN, (6.4, 0.0), (6.1, 0.0), (6.0, -0.3), (6.0, -2.0))
    assert walk.passages[-1].left == walk.passages[-1].arrived == HalfEdgeId(2, EAST)
    assert walk.where.on_edge == HalfEdgeId(2, 2)


@pytest.mark.parametrize("is_vertex", [True, False])
def test_by_which_half_edge_it_came_is_not_known_of_who_was_last_seen_before_another_vertex(
    *, is_vertex: bool
) -> None:
    """From x = 5 on nothing is seen until it is at the far end; between them is a meetpoint."""
    ends = {Branch(10, forward=True): HalfEdgeId(1, EAST)}
    ends[Branch(11, forward=False)] = HalfEdgeId(3, WEST)
    known = known_as(ends, {1: 1, 3: 3} | ({2: 2} if is_vertex else {}))
    walk = Walk().along(CORRIDOR, known, (1.0, 0.0), (5.0, 0.0))
    walk.along(CORRIDOR, known, (11.5, 0.0))
    passed = walk.passages[-1]
    arrived = None if is_vertex else HalfEdgeId(3, WEST)
    assert (passed.left, passed.arrived) == (HalfEdgeId(1, EAST), arrived)


def narrowed(x: float) -> LocalGvg:
    """The corridor, with 0.4 m to the walls instead of a metre at so many metres from its end."""
    edge = CORRIDOR.edges[10]
    clearance = np.where(np.abs(edge.polyline[:, 0] - x) < 0.25, 0.4, edge.clearance)
    return LocalGvg(CORRIDOR.nodes, CORRIDOR.edges | {10: replace(edge, clearance=clearance)})


@pytest.mark.parametrize(
    ("before", "there", "least"),
    [(0.4, 99.0, 0.4), (99.0, 3.0, 0.4), (4.0, 99.0, 1.0), (99.0, 99.0, 1.0)],
    ids=["behind the robot at first", "seen when it is there", "ahead, but was none", "nowhere"],
)
def test_an_edge_is_as_narrow_as_its_narrowest_place(
    before: float, there: float, least: float
) -> None:
    walk = Walk().along(narrowed(before), ALL_KNOWN, (1.0, 0.0), (2.0, 0.0))
    walk.along(narrowed(there), ALL_KNOWN, (2.0, 0.0), (5.0, 0.0))
    walk.along(CORRIDOR, ALL_KNOWN, (5.0, 0.0), (11.0, 0.0))
    assert walk.passages[-1].narrowest == pytest.approx(least)
    assert walk.where.narrowest == pytest.approx(1.0)  # of the next edge


def test_the_way_back_leads_over_where_the_robot_came_from_to_its_vertex() -> None:
    trail = list(resampled([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0)]))
    where = Whereabouts(HalfEdgeId(1, EAST), trail)
    way = where.way_back(np.array([3.2, 0.5]))
    assert way[0] == pytest.approx([3.0, 0.5])
    assert way[-1] == pytest.approx([0.0, 0.0])
    assert length_of(way) == pytest.approx(3.5)
    assert not len(Whereabouts().way_back(np.zeros(2)))


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
