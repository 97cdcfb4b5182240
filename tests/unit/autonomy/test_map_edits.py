"""Changes of the map that somebody asks for: vertices and edges that were driven, and strays."""

import math

import numpy as np
import pytest

from gvgbot.autonomy.events import EdgeJoined, VertexAdded
from gvgbot.autonomy.evidence import MappingConfig
from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.map_edits import MapEdits
from gvgbot.autonomy.recogniser import Recognition
from gvgbot.autonomy.slam.graph import Edge, HalfEdgeId
from gvgbot.autonomy.slam.recognition import RecognitionConfig
from gvgbot.autonomy.views import Observation, View
from gvgbot.geometry import Array, Pose, resampled
from tests.unit.autonomy.sights import carved, sweep


@pytest.fixture
def edits() -> MapEdits:
    return MapEdits(MappingConfig(), RecognitionConfig())


@pytest.fixture
def view() -> View:
    """From the middle of a corridor three metres wide."""
    walls = LocalMap(LocalMapConfig())
    walls.insert(sweep(carved([(-4.0, -1.5, 4.0, 1.5)]), Pose()), Pose(), 0.0)
    return View(0, 0.0, 9.9, Pose(), LocalGvg(), walls)


def joined(edits: MapEdits, view: View, line: Array) -> Edge:
    """The driven edge along a line, with vertices of its own, whose only departures it takes."""
    bearings = ((0.0, line[0]), (math.pi, line[-1]))
    ends = [edits.add_driven(view, place, bearing) for bearing, place in bearings]
    a, b = (HalfEdgeId(vertex.id, key) for vertex in ends for key in vertex.half_edges)
    edits.join(view, a, b, line, 0.5, driven=True)
    edge = edits.graph.edge_at(a)
    assert edge is not None
    assert edge is edits.graph.edge_at(b)
    return edge


def test_a_driven_edge_keeps_its_line_in_the_frame_of_its_first_vertex(
    edits: MapEdits, view: View
) -> None:
    line = np.array([[-1.0, 0.0], [2.0, 1.0], [4.0, 0.0]])
    edge = joined(edits, view, line)
    back = edits.graph.vertices[edge.a.vertex].local.transform(edge.polyline)
    assert back == pytest.approx(line)
    assert edge.driven


def test_what_was_changed_is_told_in_its_order(edits: MapEdits, view: View) -> None:
    joined(edits, view, np.array([[-1.0, 0.0], [2.0, 0.0]]))
    assert [type(event) for event in edits._events] == [VertexAdded, VertexAdded, EdgeJoined]


def test_strays_are_forgotten_only_beside_a_map_that_holds_together(
    edits: MapEdits, view: View
) -> None:
    lone = edits.add_driven(view, np.array([0.0, 0.0]), 0.0)  # one vertex, no edge yet
    edits.forget_strays(view)
    assert list(edits.graph.vertices) == [lone.id]
    edits.remove(view, lone, "it is in the way")
    joined(edits, view, np.array([[-1.0, 0.0], [2.0, 0.0]]))
    edits.close_ring(view, np.array([(9.0, 9.0), (9.0, 12.0), (12.0, 12.0)]), 1.0)
    assert len(edits.graph.edges) == 2
    ring = max(edits.graph.edges.values(), key=lambda edge: edge.id)
    edits.graph.unjoin(ring)
    stray = edits.graph.vertices[ring.a.vertex]
    stray.half_edges[ring.a.key].blocked = True  # tried in vain: it stays
    edits.forget_strays(view)
    assert stray.id in edits.graph.vertices
    stray.half_edges[ring.a.key].blocked = False
    edits.forget_strays(view)
    assert stray.id not in edits.graph.vertices
    assert len(edits.graph.vertices) == 2


def test_of_a_meetpoint_that_has_lost_its_third_departure_an_edge_is_left(
    edits: MapEdits, view: View
) -> None:
    """Two on a ring: of the second, the edge from and to the first is left, 8 m round a square."""
    south, north = (edits.add_driven(view, np.array([0.0, y]), 0.0, 3.1) for y in (-1.0, 1.0))
    (a, c), (b, d) = ([HalfEdgeId(v.id, key) for key in v.half_edges] for v in (south, north))
    side = south.add_half_edge(-1.6)
    for start, end, x in ((a, b, 1.0), (c, d, -1.0)):
        line = np.array([(0.0, -1.0), (x, -1.0), (x, 1.0), (0.0, 1.0)])
        edits.join(view, start, end, line, 0.5, driven=True)
    edits.forget_bends(view)
    assert list(edits.graph.vertices) == [south.id]
    edits.graph.remove_half_edge(HalfEdgeId(south.id, side))
    edits.forget_bends(view)
    (edge,) = edits.graph.edges.values()
    assert edge.a.vertex == edge.b.vertex == south.id
    assert edge.length == pytest.approx(8.0)


def test_the_vertex_of_a_ring_has_the_room_that_is_around_it(edits: MapEdits, view: View) -> None:
    """More than where the ring is narrowest; or its walls would seem to have gone."""
    edits.close_ring(view, np.array([(3.0, 0.0), (9.0, 12.0), (-3.0, 0.0)]), 1.0)
    (vertex,) = edits.graph.vertices.values()
    assert vertex.clearance == pytest.approx(1.5, abs=0.03)
    (edge,) = edits.graph.edges.values()
    assert edge.min_clearance == 1.0


def test_the_ways_round_a_ring_set_out_as_they_are_seen_from_its_vertex(
    edits: MapEdits, view: View
) -> None:
    """Two metres before a corner of a ring of 80 m: the one way is not that round the corner."""
    corners = [(0.0, 0.0), (2.0, 0.0), (2.0, 20.0), (-18.0, 20.0), (-18.0, 0.0), (0.0, 0.0)]
    edits.close_ring(view, resampled(np.array(corners), 0.5), 1.0)
    (vertex,) = edits.graph.vertices.values()
    assert sorted(vertex.bearings(vertex.local.theta)) == pytest.approx([0.0, math.pi])


@pytest.mark.parametrize("is_end", [False, True])
def test_a_line_for_maps_follows_a_vertex_only_near_to_it(
    edits: MapEdits, view: View, is_end: bool
) -> None:
    edge = joined(edits, view, np.linspace((-1.0, 0.0), (7.0, 0.0), 81))

    def drawn() -> Array:
        assert edge.drawn is not None
        return edits.belief.map_vertex(edge.a.vertex).transform(edge.drawn)

    vertex = edits.graph.vertices[(edge.b if is_end else edge.a).vertex]
    line, before = drawn(), edits.belief.map_vertex(vertex.id)
    at = 3 * (1 + edits.belief.ids.index(vertex.id))
    edits.belief.x[at : at + 2] += (0.2, 0.3)
    edits.redraw(vertex, before)
    moved = np.hypot(*(drawn() - line).T)[:: -1 if is_end else 1]
    assert moved[0] == pytest.approx(math.hypot(0.2, 0.3))
    near = max(vertex.clearance, 2 * moved[0])
    assert moved[np.arange(81) * 0.1 > near] == pytest.approx(0.0, abs=1e-9)


def test_what_was_seen_on_a_way_that_is_forgotten_goes_with_it_but_for_the_last_look(
    edits: MapEdits,
) -> None:
    sights = [Observation(number, 1, Pose(), np.eye(2)) for number in (2, 3, 4, 9, 10, 10)]
    edits.observations.extend(sights)
    edits.forget_between(4, 10)
    assert [seen.keyframe for seen in edits.observations] == [2, 3, 4, 4]


def test_who_takes_a_closure_back_is_where_it_has_driven_since(edits: MapEdits, view: View) -> None:
    edge = joined(edits, view, np.array([[-1.0, 0.0], [2.0, 0.0]]))
    edits.unsettled.note_closure(edits.graph.vertices[edge.a.vertex], is_surprising=True)
    edits.move(Pose(2.0, 1.0, 0.5), 1e-6 * np.eye(3))
    edits.unsettled.note_way(edge, arrived=99)  # not at its far end
    assert edits.unsettled.revoke(1.0)
    here = edits.belief.map_base
    assert (here.x, here.y, here.theta) == pytest.approx((2.0, 1.0, 0.5))


def test_a_vertex_that_is_no_more_is_in_no_doubt(edits: MapEdits, view: View) -> None:
    known, new = (edits.add_driven(view, np.array([x, 0.0]), 0.0) for x in (0.0, 0.5))
    rival = Recognition(None, (known.id,), (1.0,), 0.02, 9.0)
    edits.unsettled.doubt(new, rival, 0.0)
    edits.remove(view, new, "an edge passes here")
    assert edits.unsettled.settle(1.0) == []
    assert list(edits.graph.vertices) == [known.id]


def test_the_ways_back_to_where_one_comes_from_lead_round_in_no_circle(
    edits: MapEdits, view: View
) -> None:
    """A vertex may be taken out, and come back with a closure that is taken back."""
    line = np.array([[-1.0, 0.0], [2.0, 0.0]])
    edge = joined(edits, view, line)
    edits.came_from[edge.b] = edge.a, line
    edits.remove(view, edits.graph.vertices[edge.a.vertex], "an edge passes here")
    assert [(end, far) for end, (far, _) in edits.came_from.items()] == [(edge.a, edge.b)]
