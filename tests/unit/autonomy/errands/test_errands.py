"""What is answered to who asks for an errand."""

import math
from collections.abc import Iterable
from functools import partial

import numpy as np
import pytest

from gvgbot.autonomy.control.edge_follower import Track
from gvgbot.autonomy.control.orders import Drive, LookAround, Order, Stand
from gvgbot.autonomy.ending import Outcome
from gvgbot.autonomy.errands import Declined
from gvgbot.autonomy.errands.plans import Kept
from gvgbot.autonomy.events import ErrandEnded, Recovery
from gvgbot.autonomy.slam.graph import HalfEdgeId, Vertex
from gvgbot.geometry import Pose, Twist, wrap_angle
from tests.unit.autonomy.errands.test_own_tasks import Explorer
from tests.unit.autonomy.local_graphs import drawn
from tests.unit.autonomy.sights import Rectangle, carved, looked
from tests.unit.autonomy.test_mission import CLOSED, CONFIG, TEE


def test_a_coverage_promises_no_edge_that_no_known_way_leads_to() -> None:
    """The ways between two pieces of a map may be unknown."""
    robot = Explorer()
    graph = robot.mapper.graph
    while not graph.edges:
        robot.look(CLOSED)
    (edge,) = graph.edges.values()
    away = [Vertex(graph.next_id() + i, 1.0, Pose(), 0.0, 0.0) for i in range(2)]
    graph.vertices |= {vertex.id: vertex for vertex in away}
    a, b = (HalfEdgeId(vertex.id, vertex.add_half_edge(0.0)) for vertex in away)
    graph.join(a, b, np.array([[0.0, 0.0], [100.0, 0.0]]), 1.0, driven=True)
    answer = robot.errands.coverage(robot.stamp)
    assert f"over 1 of 2 edges, {edge.length:.0f} m" in answer


@pytest.mark.parametrize("is_vertex", [True, False])
def test_what_is_declined_opens_no_way_that_is_closed(is_vertex: bool) -> None:
    """A low battery calls the robot home every few seconds while it knows no way there."""
    robot = Explorer()
    graph = robot.mapper.graph
    while not graph.edges:
        robot.look(CLOSED)
    (edge,) = graph.edges.values()
    graph.vertices[edge.a.vertex].half_edges[edge.a.key].blocked = True  # while exploring
    robot.errands.closures.close(graph, [edge.b], until=1000.0)
    away = Vertex(graph.next_id(), 1.0, Pose(), 0.0, 0.0)
    graph.vertices[away.id] = away
    errands = robot.errands
    to_vertex, to_point = partial(errands.goto_vertex, away.id), partial(errands.goto_point, 30, 0)
    with pytest.raises(Declined):
        (to_vertex if is_vertex else to_point)(robot.stamp)
    assert set(graph.blocked()) == {edge.a, edge.b}
    robot.errands.closures.open_due(graph, 1000.0)
    assert graph.blocked() == [edge.a]


def test_who_knows_no_way_explores_towards_its_goal() -> None:
    """Furniture has moved: what is around the robot now hangs together with nothing it knows.

    It has come from the west end of a corridor, 20 m away; the new tee leads west, east and south.
    """
    robot, east = Explorer(), Pose(20.0)
    while not robot.mapper.graph.edges:
        robot.look(CLOSED)
    robot.mission.outcome = "explored"
    robot.mapper.move(east, np.eye(3) * 1e-6)
    robot.pose, robot.travelled = east, 20.0
    tee = drawn(
        {1: (17.0, 0.0), 2: (23.0, 0.0), 3: (28.0, 0.0), 4: (23.0, -4.0)},
        {10: (1, 2, []), 11: (2, 3, []), 12: (2, 4, [])},
        unseen={1: math.pi, 3: 0.0, 4: -math.pi / 2},
    )
    robot.stand(tee, 12)
    (edge,) = robot.mapper.graph.edges.values()
    assert len(robot.mapper.graph.frontiers()) == 3
    there = robot.mapper.belief.map_vertex(edge.a.vertex)
    answers = [
        robot.errands.goto_point(there.x, there.y, robot.stamp),
        robot.errands.goto_vertex(edge.a.vertex, robot.stamp),
    ]
    assert all("it explores until" in answer for answer in answers)
    order = robot.look(tee)
    assert isinstance(order, Drive)
    assert order.track.polyline[-1].tolist() == [17.0, 0.0]
    (said,) = robot.said(Recovery)
    assert "no known way leads there" in str(said)
    robot.errands.obstruct("something stands in the way")
    order = robot.look(tee)
    assert isinstance(order, Drive)
    assert order.track.polyline[-1].tolist() == [23.0, -4.0]  # nearer than the east end
    robot.drive(tee, (20.0, 0.0), (22.5, 0.0))
    robot.errands.obstruct("something stands in the way")
    order = robot.look(tee)
    assert isinstance(order, Drive)
    assert order.track.polyline[-1].tolist() == [28.0, 0.0]
    for end in robot.mapper.graph.frontiers():
        robot.mapper.graph.vertices[end.vertex].half_edges[end.key].blocked = True
    robot.look(tee)
    *_, ended = robot.said(ErrandEnded)
    assert isinstance(ended, ErrandEnded)
    assert ended.outcome == "given up"


def test_who_drives_to_a_vertex_that_proves_to_be_a_known_one_drives_on_to_that() -> None:
    robot, gone = Explorer(), 99
    while not robot.mapper.graph.edges:
        robot.look(CLOSED)
    (edge,) = robot.mapper.graph.edges.values()
    ends = sorted((edge.a, edge.b), key=lambda end: robot.mapper.belief.map_vertex(end.vertex).x)
    robot.errands.recall(Kept("vertex", vertices=(gone,)))
    robot.mapper.unsettled.names.change({HalfEdgeId(gone, 0): ends[-1]})
    order = robot.look(CLOSED)
    assert isinstance(order, Drive)
    assert order.track.polyline[-1].tolist() == [4.0, 0.0]
    assert robot.errands.kept() == Kept("vertex", vertices=(ends[-1].vertex,))
    assert not robot.said(ErrandEnded)


@pytest.mark.parametrize("is_walled", [True, False])
def test_a_virtual_wall_is_blamed_for_what_it_is_in_the_way_of_and_nothing_else(
    *, is_walled: bool
) -> None:
    """It lies over the edge to where the robot is sent by an old name, or else somebody stands."""
    robot, gone = Explorer(), 99
    while not robot.mapper.graph.edges:
        robot.look(CLOSED)
    graph = robot.mapper.graph
    (edge,) = graph.edges.values()
    ends = sorted((edge.a, edge.b), key=lambda end: robot.mapper.belief.map_vertex(end.vertex).x)
    robot.errands.recall(Kept("vertex", vertices=(gone,)))
    robot.mapper.unsettled.names.change({HalfEdgeId(gone, 0): ends[-1]})
    if is_walled:
        graph.walled = {edge.id: (3.7 if edge.a == ends[0] else edge.length - 3.7,)}
        robot.look(drawn({1: (-1.0, 0.0), 3: (2.5, 0.0)}, {10: (1, 3, [])}, unseen={3: 0.0}))
    else:
        graph.walled = {edge.id + 1: (1.0,)}
        robot.look(CLOSED)
        robot.errands.obstruct("something stands in the way")
        robot.look(CLOSED)
    (ended,) = robot.said(ErrandEnded)
    assert isinstance(ended, ErrandEnded)
    assert ended.reason.endswith("but over a virtual wall") == is_walled


@pytest.mark.parametrize("is_sent", [True, False])
def test_who_drives_the_robot_ends_its_errand_and_it_waits_where_it_is_left(is_sent: bool) -> None:
    robot, twist = Explorer(), Twist(0.0, 0.4)
    while not robot.mapper.graph.edges:
        robot.look(CLOSED)
    (edge,) = robot.mapper.graph.edges.values()
    far = max((edge.a, edge.b), key=lambda end: robot.mapper.belief.map_vertex(end.vertex).x)
    if is_sent:
        robot.errands.goto_vertex(far.vertex, robot.stamp)
        assert isinstance(robot.look(CLOSED), Drive)
    assert robot.errands.drive(twist, robot.stamp)
    assert not robot.errands.drive(twist, robot.stamp)
    assert robot.errands.progress == "driven by somebody"
    told = ErrandEnded(robot.stamp, f"goto {far.vertex}", "replaced", "by somebody who drives")
    assert robot.errands.take_events() == [told] * is_sent
    assert isinstance(robot.look(CLOSED), Stand)
    assert not robot.errands.is_resting
    robot.errands.pause()
    robot.errands.resume()
    assert robot.errands.is_resting


def test_who_waits_after_an_errand_goes_on_exploring_when_it_is_asked_to() -> None:
    robot = Explorer()
    robot.stand(TEE, 8)
    robot.errands.goto_point(0.0, 0.0, robot.stamp)
    robot.look(TEE)
    assert robot.errands.is_resting
    assert "it explores" in robot.errands.explore(robot.stamp)
    assert robot.errands.is_exploring
    assert isinstance(robot.look(TEE), Drive)


@pytest.mark.parametrize("outcome", [None, "explored", "stopped"])
def test_who_lifts_a_robot_that_stands_by_wants_it_somewhere_else(outcome: Outcome | None) -> None:
    """It would go back out of the way of others; one that explores goes on where it is put."""
    robot = Explorer()
    robot.stand(TEE, 8)
    robot.mission.outcome = outcome
    robot.errands.note_lifted()
    assert robot.errands.is_waiting == (outcome == "explored")


def in_a_hall(width: float = 4.0, walls: Iterable[Rectangle] = ()) -> Explorer:
    """A robot at one end of an edge of 5 m that has a wide space on its left."""
    robot = Explorer()
    robot.walls = looked(carved([(-2.0, -2.0, 5.0, width)], walls), [Pose()])
    robot.pose = Pose(-1.0, 0.0)
    robot.mapper.move(robot.pose, np.zeros((3, 3)))
    while not robot.mapper.graph.edges:
        robot.look(CLOSED)
    return robot


def creep(robot: Explorer, track: Track) -> Order:
    """The next order, after a decimetre along a track in a second."""
    here = int(np.hypot(*(track.polyline - robot.pose.position).T).argmin())
    station = track.stations[here] + 0.1
    x, y = (float(np.interp(station, track.stations, line)) for line in track.polyline.T)
    robot.stamp += 0.5
    return robot.drive(CLOSED, (robot.pose.x, robot.pose.y), (x, y))


def test_it_turns_to_a_place_behind_it_before_it_says_that_the_way_there_is_not_free() -> None:
    """Who stood there may have gone since it saw him."""
    robot = in_a_hall(10.0, [(1.2, 2.5, 1.4, 2.7)])
    robot.mission.survey = None
    robot.field_of_view = (-1.0, 1.0)
    robot.errands.recall(Kept("point", x=0.5, y=5.0))
    order = robot.drive(CLOSED, (-1.0, 0.0), (0.5, 0.0))
    assert isinstance(order, LookAround)
    assert math.pi / 2 < 1.0 + order.angle < math.pi
    assert not robot.said(ErrandEnded)
    turned = Pose(0.5, 0.0, order.angle)
    robot.mapper.move(robot.pose.to(turned), np.zeros((3, 3)))
    robot.pose = turned
    robot.look(CLOSED)
    (ended,) = robot.said(ErrandEnded)
    assert "the way is not free" in str(ended)


def test_a_slow_robot_leaves_its_edge_for_a_point_far_beside_it() -> None:
    """It may be told to be slow; the way straight on is longer than what is left of the edge."""
    robot, goal = in_a_hall(), (3.0, 2.4)
    robot.errands.goto_point(*goal, robot.stamp)
    order = robot.look(CLOSED)
    while isinstance(order, Drive):
        order = creep(robot, order.track)
    (ended,) = robot.said(ErrandEnded)
    assert isinstance(ended, ErrandEnded)
    assert ended.outcome == "arrived", ended.reason
    assert math.dist((robot.pose.x, robot.pose.y), goal) < 0.2
    assert robot.travelled < math.hypot(4.0, 2.4) + 0.5


@pytest.mark.parametrize(
    ("x", "y", "goes"), [(-1.0, 5.0, True), (0.5, 5.0, False), (-1.0, 8.5, False)]
)
def test_across_an_open_hall_it_drives_straight_to_what_it_goes_to_see(
    x: float, y: float, *, goes: bool
) -> None:
    """From where its edge is nearest to that; not beside a post, nor beyond all measure."""
    robot = in_a_hall(10.0, [(1.2, 2.5, 1.4, 2.7)])
    robot.mission.survey = None
    robot.errands.recall(Kept("point", x=x, y=y))
    robot.drive(CLOSED, (-1.0, 0.0), (x, 0.0))
    order = robot.look(CLOSED)
    if not goes:
        (ended,) = robot.said(ErrandEnded)
        assert "the way is not free" in str(ended)
        return
    assert isinstance(order, Drive)
    assert order.track.polyline[-1] == pytest.approx((x, y))
    halfway = creep(robot, order.track)
    assert isinstance(halfway, Drive)
    assert halfway.track.polyline[-1] == pytest.approx((x, y))


def test_who_stands_on_a_point_has_as_long_to_go_as_in_any_other_way() -> None:
    robot = in_a_hall()
    robot.drive(CLOSED, (-1.0, 0.0), (2.0, 0.0))
    robot.errands.goto_point(2.0, 0.4, robot.stamp)
    since, patience = robot.stamp, CONFIG.in_the_way_s
    while not robot.said(ErrandEnded):
        robot.look(CLOSED)
    assert since + patience < robot.stamp < since + patience + 2.0


@pytest.mark.parametrize("x", [0.0, 3.5])
def test_a_time_without_a_view_is_no_time_that_it_stood_in_vain(x: float) -> None:
    """Whoever paused the robot, half a metre before its goal or on the way, did not hold it up."""
    robot = Explorer()
    while not robot.mapper.graph.edges:
        robot.look(CLOSED)
    (edge,) = robot.mapper.graph.edges.values()
    far = max((edge.a, edge.b), key=lambda end: robot.mapper.belief.map_vertex(end.vertex).x)
    robot.errands.goto_vertex(far.vertex, robot.stamp)
    robot.drive(CLOSED, (-0.25, 0.0), (x, 0.0))
    robot.stamp += 10 * CONFIG.in_the_way_s
    order = robot.look(CLOSED)
    assert isinstance(order, Drive)
    assert order.track.polyline[-1].tolist() == [4.0, 0.0]
    assert not robot.said(ErrandEnded)
    assert not robot.said(Recovery)


def test_who_meets_something_on_the_straight_way_to_a_point_comes_by_the_edge() -> None:
    """Half way up to the left; the way round is along the edge, and a right angle to the left."""
    robot, goal, corner = in_a_hall(), (2.0, 2.4), (2.0, 0.0)
    robot.errands.goto_point(*goal, robot.stamp)
    order, off_corner = robot.look(CLOSED), math.inf
    while isinstance(order, Drive):
        if robot.pose.x > 0.5 and not robot.said(Recovery):
            robot.errands.obstruct("bumper again and again")
        order = creep(robot, order.track)
        off_corner = min(off_corner, math.dist((robot.pose.x, robot.pose.y), corner))
    (ended,) = robot.said(ErrandEnded)
    assert isinstance(ended, ErrandEnded)
    assert ended.outcome == "arrived", ended.reason
    assert off_corner < 0.2


ROUND = drawn(  # a straight way of 6 m, and one of 12 m beside it from the one end to the other
    {1: (-3.0, 0.0), 2: (3.0, 0.0), 3: (-5.0, 0.0), 4: (5.0, 0.0)},
    {10: (1, 2, []), 11: (1, 2, [(-3.0, 3.0), (3.0, 3.0)]), 12: (3, 1, []), 13: (2, 4, [])},
)


def on_a_round(x: float) -> Explorer:
    """A robot on the straight way, sent to its east end, of which it is told that it is shut."""
    robot = Explorer()
    robot.mission.survey = None
    robot.stand(ROUND, 12)
    belief = robot.mapper.belief
    ends = {belief.map_vertex(v).x: v for v, one in robot.mapper.graph.vertices.items()}
    robot.drive(ROUND, (0.0, 0.0), (-2.75, 0.0), (x, 0.0))
    robot.errands.goto_vertex(ends[3.0], robot.stamp)
    order = robot.look(ROUND)
    assert isinstance(order, Drive)
    assert order.track.polyline[-1].tolist() == [3.0, 0.0]
    robot.errands.obstruct("bumper again and again")
    return robot


def test_who_goes_a_long_way_round_is_not_said_to_come_no_nearer() -> None:
    """It has 2 m to go, and then 16 m, at a decimetre a second."""
    robot = on_a_round(1.0)
    robot.look(ROUND)
    for x in np.arange(1.0, -2.0, -0.1):
        robot.stamp += 0.5
        robot.drive(ROUND, (float(x), 0.0), (float(x) - 0.1, 0.0))
    assert not robot.said(ErrandEnded)
    (said,) = robot.said(Recovery)
    assert "try another way" in str(said)


def test_who_is_shut_in_between_both_ends_of_its_edge_gives_up() -> None:
    """It would go to and fro between them."""
    robot = on_a_round(1.0)
    order = robot.look(ROUND)
    assert isinstance(order, Drive)
    assert order.track.polyline[:, 0].min() == -3.0  # by the west end
    robot.drive(ROUND, (1.0, 0.0), (-1.0, 0.0))
    robot.errands.obstruct("bumper again and again")
    robot.look(ROUND)
    (ended,) = robot.said(ErrandEnded)
    assert isinstance(ended, ErrandEnded)
    assert (ended.outcome, ended.reason) == ("given up", "something stands in the way")


def turned(robot: Explorer, headings: Iterable[float]) -> bool:
    """Whether its errand ends while it turns so, a heading each half second."""
    for heading in headings:
        turn = Pose(0.0, 0.0, wrap_angle(heading - robot.pose.theta))
        robot.mapper.move(turn, np.zeros((3, 3)))
        robot.pose = robot.pose.compose(turn)
        robot.look(CLOSED)
        if robot.said(ErrandEnded):
            return True
    return False


def test_who_is_told_to_turn_slowly_comes_nearer_by_turning_to_its_way_but_not_to_and_fro() -> None:
    patience = 2 * CONFIG.in_the_way_s  # looks
    robot = in_a_hall()
    robot.errands.goto_point(3.0, 0.0, robot.stamp)
    assert not turned(robot, np.linspace(math.pi, 0.1, round(3 * patience)))
    assert turned(robot, 0.1 * (-1.0) ** np.arange(round(patience) + 2))
    robot = in_a_hall()
    robot.errands.goto_point(3.0, 0.0, robot.stamp)
    assert turned(robot, np.tile([2.0, 1.0], round(patience) + 2))
