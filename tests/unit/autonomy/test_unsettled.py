"""Vertices that prove to be known ones, on a street that was entered twice."""

import math

import numpy as np

from gvgbot.autonomy.knowledge import Knowledge
from gvgbot.autonomy.recogniser import Recognition
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId, Vertex
from gvgbot.autonomy.unsettled import Unsettled
from gvgbot.geometry import Pose
from tests.unit.autonomy.graphs import STREET, streets


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
    """Three visits of one place, of which the third looked like the second only."""
    graph, places = GvgGraph(), np.array([[0.0, 0.0], [0.1, 0.1], [0.1, -0.1]])
    known, second, third = (Vertex(graph.next_id(), 1.0, Pose(), 0.0, 0.0) for _ in places)
    graph.vertices |= {vertex.id: vertex for vertex in (known, second, third)}
    x = np.concatenate([np.zeros(3), np.pad(places, ((0, 0), (0, 1))).ravel()])
    knowledge = Knowledge(Belief(x, 0.01 * np.eye(12), tuple(graph.vertices)), graph)
    unsettled = Unsettled(knowledge, margin=2.0, same_bearing=math.radians(40))
    for vertex, rival in ((second, known), (third, second)):
        unsettled.doubt(vertex, Recognition(None, (rival.id,), (1.0,), 0.02, 9.0), 0.0)
    for stamp in (1.0, 2.0):
        unsettled.settle(stamp)
    assert list(graph.vertices) == list(knowledge.belief.ids) == [known.id]
