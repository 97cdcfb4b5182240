"""What is answered to who asks for an errand."""

from functools import partial

import numpy as np
import pytest

from gvgbot.autonomy.control.orders import Drive, Stand
from gvgbot.autonomy.errands import Declined
from gvgbot.autonomy.errands.plans import Kept
from gvgbot.autonomy.events import ErrandEnded
from gvgbot.autonomy.slam.graph import HalfEdgeId, Vertex
from gvgbot.geometry import Pose, Twist
from tests.unit.autonomy.errands.test_own_tasks import Explorer
from tests.unit.autonomy.test_mission import CLOSED


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
