"""Vertices that prove to be known ones, on a street that was entered twice."""

import math

import numpy as np
import pytest

from gvgbot.autonomy.errands.closures import Closures
from gvgbot.autonomy.events import DoubtSettled
from gvgbot.autonomy.exploration.obstructions import Obstructions
from gvgbot.autonomy.knowledge import Knowledge
from gvgbot.autonomy.recogniser import Recognition
from gvgbot.autonomy.slam import ekf
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId, Vertex
from gvgbot.autonomy.slam.names import Names
from gvgbot.autonomy.unsettled import Unsettled
from gvgbot.autonomy.views import Observation
from gvgbot.geometry import Pose
from tests.unit.autonomy.graphs import STREET, between, streets


def test_with_one_end_of_a_street_that_was_driven_twice_the_other_end_is_known_too() -> None:
    """Nobody asked whether the east is the east: the same departure leads there."""
    graph, ids = streets(2, 1)
    west, east = ids[0, 0], ids[1, 0]
    again = [Vertex(graph.next_id(), 1.0, Pose(), 0.0, 0.0) for _ in range(2)]
    ends = []
    for vertex, bearing in zip(again, (0.0, math.pi), strict=True):
        graph.vertices[vertex.id] = vertex
        ends.append(HalfEdgeId(vertex.id, vertex.add_half_edge(bearing)))
    here, there = ends
    graph.join(here, there, np.array([[0.0, 0.0], [STREET, 0.0]]), 1.0, driven=True)
    places = np.array([[0.0, 0.0], [STREET, 0.0], [0.1, 0.1], [STREET + 0.1, 0.1]])
    x = np.concatenate([np.zeros(3), np.pad(places, ((0, 0), (0, 1))).ravel()])
    names = (west, east, *(vertex.id for vertex in again))
    known = Knowledge(Belief(x, 0.01 * np.eye(15), names), graph)
    unsettled = Unsettled(known, margin=2.0, same_bearing=math.radians(40))
    unsettled.doubt(again[0], Recognition(None, (west,), (1.0,), 0.02, 9.0), 0.0)
    for stamp in (1.0, 2.0):
        unsettled.settle(stamp)
    assert sorted(graph.vertices) == sorted(known.belief.ids) == sorted((west, east))
    assert len(graph.edges) == 1
    assert graph.frontiers() == []


def test_what_may_be_a_vertex_in_doubt_is_the_known_one_that_this_proves_to_be() -> None:
    """Three visits of one place, of which the third looked like the second only, and came there."""
    graph, places = GvgGraph(), np.array([[0.0, 0.0], [0.1, 0.1], [0.1, -0.1]])
    known, second, third = (Vertex(graph.next_id(), 1.0, Pose(), 0.0, 0.0) for _ in places)
    graph.vertices |= {vertex.id: vertex for vertex in (known, second, third)}
    x = np.concatenate([np.zeros(3), np.pad(places, ((0, 0), (0, 1))).ravel()])
    knowledge = Knowledge(Belief(x, 0.01 * np.eye(12), tuple(graph.vertices)), graph)
    unsettled = Unsettled(knowledge, margin=2.0, same_bearing=math.radians(40))
    third.reached = True
    for vertex, rival in ((second, known), (third, second)):
        unsettled.doubt(vertex, Recognition(None, (rival.id,), (1.0,), 0.02, 9.0), 0.0)
    for stamp in (1.0, 2.0):
        unsettled.settle(stamp)
    assert list(graph.vertices) == list(knowledge.belief.ids) == [known.id]
    assert known.reached, "else a dead end is driven into once more"


def test_what_leaves_a_vertex_that_proves_to_be_a_known_one_turns_as_its_frame_was_turned() -> None:
    """A street to the east and back, between which the robot has turned by more than it knows.

    So it believes to be aside of where it began. Its frame is as wrong as that turn, and with it
    the way to the north that it has found there, and the edge that it has driven that way.
    """
    error, graph, sure = 0.1, GvgGraph(), 1e-8 * np.eye(3)
    west, again, north = (Vertex(graph.next_id(), 1.0, Pose(), 0.0, 0.0) for _ in range(3))
    graph.vertices |= {vertex.id: vertex for vertex in (west, again, north)}
    belief = ekf.add_vertex(Belief(), west.id, Pose(), sure)
    belief = ekf.predict(belief, Pose(STREET), sure)
    belief = ekf.predict(belief, Pose(theta=math.pi - error), sure + np.diag([0.0, 0.0, error**2]))
    belief = ekf.predict(belief, Pose(STREET), sure)
    belief = ekf.add_vertex(belief, again.id, Pose(theta=error - math.pi), sure)
    seen = math.pi / 2 - error  # where the north is in a frame that is turned by the error
    way = STREET * np.array([math.cos(seen), math.sin(seen)])
    map_base = belief.map_base
    to_north = map_base.to(belief.map_vertex(again.id).compose(Pose(float(way[0]), float(way[1]))))
    belief = ekf.add_vertex(belief, north.id, to_north, sure)
    ends = [
        HalfEdgeId(vertex.id, vertex.add_half_edge(bearing))
        for vertex, bearing in ((again, seen), (north, seen - math.pi))
    ]
    graph.join(ends[0], ends[1], np.array([[0.0, 0.0], way]), 1.0, driven=True)
    again.local, again.seen_at = belief.map_vertex(again.id), 2 * STREET
    known = Knowledge(belief, graph, [Observation(2, again.id, Pose(theta=error - math.pi), sure)])
    unsettled = Unsettled(known, margin=2.0, same_bearing=math.radians(40))
    unsettled.doubt(again, Recognition(None, (west.id,), (1.0,), 1e-4, 9.0), 0.0)
    assert unsettled.settle(1.0)
    (edge,) = graph.edges.values()
    (departure,) = west.half_edges.values()
    assert departure.bearing == pytest.approx(math.pi / 2, abs=0.02)
    assert edge.polyline[-1] == pytest.approx((0.0, STREET), abs=0.2)
    # the way to the north is still where it is seen, and its frame was not that of the first visit
    assert west.local.position == pytest.approx(again.local.position)
    assert west.local.theta + departure.bearing == pytest.approx(again.local.theta + seen)
    (sight,) = known.observations
    assert (sight.vertex, sight.R.shape) == (west.id, (2, 2))


def test_what_is_closed_for_a_while_is_opened_again_though_its_vertex_has_another_name() -> None:
    """The place was entered three times, and the way to the north was closed the third time."""
    graph, places = GvgGraph(), np.array([[0.0, 0.0], [0.1, 0.1], [0.1, -0.1]])
    known, second, third = (Vertex(graph.next_id(), 1.0, Pose(), 0.0, 0.0) for _ in places)
    graph.vertices |= {vertex.id: vertex for vertex in (known, second, third)}
    closed = HalfEdgeId(third.id, third.add_half_edge(math.pi / 2))
    x = np.concatenate([np.zeros(3), np.pad(places, ((0, 0), (0, 1))).ravel()])
    knowledge = Knowledge(Belief(x, 0.01 * np.eye(12), tuple(graph.vertices)), graph)
    unsettled = Unsettled(knowledge, margin=2.0, same_bearing=math.radians(40))
    for vertex, rival in ((third, second), (second, known)):
        unsettled.doubt(vertex, Recognition(None, (rival.id,), (1.0,), 0.02, 9.0), 0.0)
    obstructions = Obstructions(retries=3, retry_after=20.0, names=unsettled.names)
    obstructions.close(graph, [closed], 0.0)
    for stamp in (1.0, 2.0):
        assert unsettled.settle(stamp)
    assert list(graph.vertices) == [known.id]
    (north,) = graph.blocked()
    assert unsettled.current(closed) == north
    assert obstructions.open(graph, 30.0)
    assert graph.frontiers() == [north]


def entered_twice() -> tuple[Knowledge, Unsettled, list[HalfEdgeId]]:
    """A street, and a vertex that may be its west end: a frontier of each of the two."""
    graph, ids = streets(2, 1)
    west, again = graph.vertices[ids[0, 0]], Vertex(graph.next_id(), 1.0, Pose(), 0.0, 0.0)
    graph.vertices[again.id] = again
    ends = [HalfEdgeId(vertex.id, vertex.add_half_edge(2.0)) for vertex in (west, again)]
    places = np.array([[0.0, 0.0], [STREET, 0.0], [0.1, 0.1]])
    x = np.concatenate([np.zeros(3), np.pad(places, ((0, 0), (0, 1))).ravel()])
    known = Knowledge(Belief(x, 0.01 * np.eye(12), (*ids.values(), again.id)), graph)
    unsettled = Unsettled(known, margin=2.0, same_bearing=math.radians(40))
    unsettled.doubt(again, Recognition(None, (west.id,), (1.0,), 0.02, 9.0), 0.0)
    return known, unsettled, ends


def test_who_has_been_tried_often_stays_so_when_it_proves_to_be_another_one_after_all() -> None:
    """A closure makes the second entry of a street's west end one with the first; it is revoked."""
    known, unsettled, ends = entered_twice()
    obstructions = Obstructions(retries=1, retry_after=20.0, names=unsettled.names)
    obstructions.close(known.graph, ends[1:], 0.0)
    assert obstructions.open(known.graph, 30.0)
    assert unsettled.settle(31.0)
    assert unsettled.current(ends[1]) == ends[0]
    obstructions.close(known.graph, ends[:1], 32.0)
    assert not obstructions.waiting, "it is the one that has been tried"
    (edge,) = known.graph.edges.values()
    unsettled.note_way(edge, arrived=99)  # not at its far end
    assert unsettled.revoke(33.0)
    obstructions.close(known.graph, ends[1:], 34.0)
    assert not obstructions.waiting


def test_a_closure_that_is_revoked_takes_no_earlier_one_with_it() -> None:
    """What was closed by a name that an earlier closure changed is opened when its time comes."""
    known, unsettled, (frontier, then) = entered_twice()
    obstructions = Obstructions(retries=3, retry_after=20.0, names=unsettled.names)
    obstructions.close(known.graph, [then], 0.0)
    others = Obstructions(retries=0, retry_after=20.0, names=unsettled.names)
    others.close(known.graph, [frontier], 0.0)  # else it would be open as one of the two is
    assert unsettled.settle(1.0)
    unsettled.take_for_granted()
    unsettled.note_closure(known.graph.vertices[frontier.vertex], is_surprising=True)
    (edge,) = known.graph.edges.values()
    unsettled.note_way(edge, arrived=99)  # not at its far end
    assert unsettled.revoke(2.0)
    assert known.graph.blocked() == [frontier]
    assert obstructions.open(known.graph, 30.0)
    assert known.graph.blocked() == []


def test_what_proved_not_to_be_one_is_not_taken_for_one_again() -> None:
    """By the same reading as before: it would be closed and taken back for ever."""
    known, unsettled, (_, then) = entered_twice()
    assert unsettled.settle(1.0)
    assert then.vertex not in known.graph.vertices
    (edge,) = known.graph.edges.values()
    unsettled.note_way(edge, arrived=99)  # not at its far end
    assert unsettled.revoke(2.0)
    assert not unsettled.settle(3.0)
    assert then.vertex in known.graph.vertices


def test_who_took_a_closure_back_is_wary_until_something_is_certain_again() -> None:
    known, unsettled, (frontier, then) = entered_twice()
    assert unsettled.settle(1.0)
    (edge,) = known.graph.edges.values()
    unsettled.note_way(edge, arrived=99)  # not at its far end
    assert unsettled.revoke(2.0)
    assert unsettled.is_wary
    (far,) = {edge.a.vertex, edge.b.vertex} - {frontier.vertex}  # a street away: it is not that
    rival = Recognition(None, (far,), (1.0,), 0.02, 9.0)
    unsettled.doubt(known.graph.vertices[then.vertex], rival, 3.0)
    (settled,) = unsettled.settle(3.0)
    assert isinstance(settled, DoubtSettled)
    assert settled.known is None
    assert not unsettled.is_wary


class Contradicted:
    """A town in which the latest closure is about to prove wrong."""

    def __init__(self) -> None:
        graph, self.ids = streets(2, 1)
        x = np.zeros(3 + 3 * len(graph.vertices))
        self.known = Knowledge(Belief(x, np.eye(len(x)), tuple(graph.vertices)), graph)
        self._unsettled = Unsettled(self.known, margin=2.0, same_bearing=math.radians(40))

    def close_a_loop(self) -> None:
        west = self.known.graph.vertices[self.ids[0, 0]]
        self._unsettled.note_closure(west, is_surprising=True)

    def take_it_back(self) -> None:
        (edge,) = self.known.graph.edges.values()
        self._unsettled.note_way(edge, arrived=99)  # not at its far end
        assert self._unsettled.revoke(1.0)


@pytest.mark.parametrize("opened", [False, True])
def test_what_was_closed_before_a_closure_that_is_taken_back_is_opened_when_its_time_comes(
    *, opened: bool
) -> None:
    """Before, or after that; nobody opens it again whose time is over already."""
    town = Contradicted()
    places = town.ids[0, 0], town.ids[1, 0]
    end = between(town.known.graph, *places)
    obstructions = Obstructions(retries=3, retry_after=20.0, names=Names())
    errands = Closures(Names())
    obstructions.close(town.known.graph, [end], 0.0)
    errands.close(town.known.graph, [between(town.known.graph, *places[::-1])], until=20.0)
    town.close_a_loop()
    if opened:
        obstructions.open(town.known.graph, 30.0)
        errands.open_due(town.known.graph, 30.0)
    town.take_it_back()
    assert bool(town.known.graph.blocked()) != opened
    obstructions.open(town.known.graph, 30.0)
    errands.open_due(town.known.graph, 30.0)
    assert town.known.graph.blocked() == []


def test_what_is_closed_after_a_closure_that_is_taken_back_stays_closed_until_its_time_comes() -> (
    None
):
    town = Contradicted()
    end = between(town.known.graph, town.ids[0, 0], town.ids[1, 0])
    town.close_a_loop()
    obstructions = Obstructions(retries=3, retry_after=20.0, names=Names())
    obstructions.close(town.known.graph, [end], 0.0)
    town.take_it_back()
    assert town.known.graph.blocked() == [end]
    obstructions.open(town.known.graph, 30.0)
    assert town.known.graph.blocked() == []


def test_nothing_gets_the_name_of_what_went_with_a_closure() -> None:
    """Who has closed that, or goes there, would mean the other one."""
    town = Contradicted()
    town.close_a_loop()
    west = town.ids[0, 0]
    gone = town.known.graph.vertices[west].add_half_edge(1.0)
    vertex = town.known.graph.next_id()
    town.take_it_back()
    assert town.known.graph.next_id() > vertex
    assert gone not in town.known.graph.vertices[west].half_edges
    assert town.known.graph.vertices[west].add_half_edge(2.0) != gone
