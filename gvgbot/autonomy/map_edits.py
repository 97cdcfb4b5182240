"""How what is known of the building changes: vertices and edges that come, go and are parted."""

import math
from dataclasses import replace

import numpy as np

from gvgbot.autonomy.events import EdgeJoined, Event, VertexAdded, VertexRemoved
from gvgbot.autonomy.evidence import MappingConfig
from gvgbot.autonomy.knowledge import Knowledge
from gvgbot.autonomy.slam import ekf, trail
from gvgbot.autonomy.slam.graph import Edge, HalfEdgeId, Vertex
from gvgbot.autonomy.slam.recognition import RecognitionConfig, Sighting, sight_covariance
from gvgbot.autonomy.slam.trail import Laid
from gvgbot.autonomy.topology import (
    direction,
    loose_ends,
    split_edge_at,
    strays,
    take_out,
    tied_to,
)
from gvgbot.autonomy.unsettled import Unsettled
from gvgbot.autonomy.views import Observation, View
from gvgbot.geometry import Array, Pose

_TURN_VARIANCE = 1e-6  # rad^2; a new vertex's frame is turned as the local one is
_BEHIND_M = 2.5  # the nearest walls of a vertex, others tell what it looks like


class MapEdits(Knowledge):
    """What is known, and the ways to change it, in which belief, graph and doubts keep together."""

    def __init__(self, config: MappingConfig, recognition: RecognitionConfig) -> None:
        super().__init__()
        self._config, self._recognition = config, recognition
        self.unsettled = Unsettled(
            self,
            margin=config.novelty_margin,
            same_bearing=math.radians(recognition.bearing_deg),
        )
        # by half-edges of vertices that were taken out, until somebody clears it, as `loose_ends`,
        # but in the local frame
        self.came_from: dict[HalfEdgeId, tuple[HalfEdgeId, Array]] = {}
        self._events: list[Event] = []  # what was changed, since the latest view

    def move(self, motion: Pose, covariance: Array, laid: Laid | None = None) -> None:
        """Account for a motion of the base, with its covariance (3, 3), and how walls told it."""
        self.belief = trail.move(self.belief, motion, covariance, laid)
        self.unsettled.note_move(motion, covariance, laid)

    def establish(self) -> None:
        """As `Knowledge.establish`; no more of it goes because a closure is taken back."""
        super().establish()
        self.unsettled.take_for_granted()

    def forget_between(self, first: int, last: int) -> None:
        """Drop what was observed at keyframes from one on; the last one takes its number."""
        before = [seen for seen in self.observations if seen.keyframe < first]
        there = [
            replace(seen, keyframe=first) for seen in self.observations if seen.keyframe == last
        ]
        self.observations[:] = before + there
        self.unsettled.take_for_granted()  # what would be revoked counts on all of them

    # -- vertices ----------------------------------------------------------------------------

    def _add(self, view: View, sighting: Sighting) -> Vertex:
        """Make a vertex of a sighting."""
        local = Pose(float(sighting.position[0]), float(sighting.position[1]), 0.0)
        vertex = Vertex(
            self.graph.next_id(), sighting.clearance, local, view.travelled, view.travelled
        )
        vertex.settled = sighting.settled
        for bearing in sighting.bearings:
            vertex.add_half_edge(bearing)
        self.graph.vertices[vertex.id] = vertex
        self._believe(view, vertex)
        place = self.belief.map_vertex(vertex.id)
        self.part_edge_at(vertex)
        kind, degree = sighting.kind, vertex.degree
        self._events.append(
            VertexAdded(view.stamp, vertex.id, kind, place.x, place.y, degree, vertex.clearance)
        )
        return vertex

    def _believe(self, view: View, vertex: Vertex) -> None:
        """Take a vertex into the belief where it is seen, as one that was never seen before."""
        base_vertex = view.local_base.to(vertex.local)
        R = np.zeros((3, 3))
        away = math.hypot(base_vertex.x, base_vertex.y)
        R[:2, :2] = sight_covariance(away, self._recognition, settled=vertex.settled)
        R[2, 2] = _TURN_VARIANCE
        self.belief = ekf.add_vertex(self.belief, vertex.id, base_vertex, R)
        self.observations.append(Observation(view.keyframe, vertex.id, base_vertex, R))
        self._picture(view, vertex)

    def add_driven(self, view: View, place: Array, *bearings: float) -> Vertex:
        """Make a vertex of a place (2,) that was driven over, with departures; local frame."""
        clearance, _ = view.local_map.tree().query(place)
        return self._add(view, Sighting(place, float(clearance), bearings, meetpoint=True))

    def _picture(self, view: View, vertex: Vertex) -> None:
        """Keep the walls around a vertex, to know them again."""
        walls = view.local_map.points()
        reach = max(self._config.snapshot_m, vertex.clearance + _BEHIND_M)
        near = np.hypot(*(walls - vertex.local.position).T) < reach
        vertex.snapshot = vertex.local.inverse().transform(walls[near])
        vertex.sights = Pose(theta=-vertex.local.theta).transform(view.local_map.sights()[near])

    def part_edge_at(self, vertex: Vertex, driven: int | None = None) -> None:
        """Make two edges of one that passes a vertex, from which it was driven by a half-edge."""
        split_edge_at(
            self.graph,
            self.belief,
            vertex,
            reach=self._recognition.same_place_m,
            angle=math.radians(self._recognition.bearing_deg),
            driven=driven,
        )

    def remove(self, view: View, vertex: Vertex, reason: str, *, is_passed: bool = False) -> None:
        """Take a vertex out of the map; of two edges that met there one is made."""
        map_in_local = self.map_in_local(view.local_base)
        for end, (far, line) in loose_ends(self.graph, self.belief, vertex).items():
            self.came_from.pop(far, None)  # its vertex is back again
            self.came_from[end] = far, map_in_local.transform(line)
        take_out(self.graph, self.belief, vertex, is_passed=is_passed)
        self.belief = ekf.remove_vertex(self.belief, vertex.id)
        self.unsettled.forget(vertex.id)
        self._events.append(VertexRemoved(view.stamp, vertex.id, reason))

    def forget_strays(self, view: View) -> None:
        """Take out vertices that hang together with nothing, if there is anything to hang on to."""
        for vertex in strays(self.graph):
            self.remove(view, vertex, "nothing leads there")

    def forget_frontiers(self, view: View) -> None:
        """Take out departures without an edge, and vertices that have no others."""
        for end in [*self.graph.frontiers(), *self.graph.blocked()]:
            if self.graph.edge_at(end) is None:
                self.graph.remove_half_edge(end)
        for vertex in list(self.graph.vertices.values()):
            if not vertex.half_edges:
                self.remove(view, vertex, "it is on no edge")

    def forget_bends(self, view: View) -> None:
        """Take out meetpoints that have lost their other departures: one edge passes there."""
        for vertex in list(self.graph.vertices.values()):
            if vertex.is_bend:
                self.remove(view, vertex, "an edge passes here")

    # -- edges -------------------------------------------------------------------------------

    def join(
        self,
        view: View,
        a: HalfEdgeId,
        b: HalfEdgeId,
        local_line: Array,
        min_clearance: float,
        *,
        driven: bool,
    ) -> None:
        """Make an edge of two frontiers; polyline (N, 2) from a to b in the local frame."""
        line = self.graph.vertices[a.vertex].local.inverse().transform(local_line)
        edge = self.graph.join(a, b, line, min_clearance, driven=driven)
        start, end = (self.in_local_frame(view, one.vertex) for one in (a, b))
        tied = tied_to(local_line, start.position, end.position, self._room_at_ends(edge))
        edge.drawn = start.inverse().transform(tied)
        self._events.append(EdgeJoined(view.stamp, a.vertex, b.vertex, edge.length, driven))

    def _room_at_ends(self, edge: Edge) -> tuple[float, float]:
        a, b = (self.graph.vertices[end.vertex].clearance for end in (edge.a, edge.b))
        return a, b

    def redraw(self, vertex: Vertex, before: Pose, *, polylines: bool = False) -> None:
        """Let lines for maps end where a vertex is believed now, and else stay where they were.

        It was believed at a pose `before`, map frame, which it proved to be beside. So do the
        `polylines` of edges if that is far off.
        """
        edges = {edge.id: edge for edge in map(self.graph.edge_at, vertex.ends) if edge is not None}
        for edge in edges.values():
            if edge.drawn is not None:
                edge.drawn = self._tied(edge, edge.drawn, vertex, before)
            if polylines:
                edge.polyline = self._tied(edge, edge.polyline, vertex, before)

    def _tied(self, edge: Edge, drawn: Array, vertex: Vertex, before: Pose) -> Array:
        """A line of an edge (N, 2), in the frame of its first vertex, as `redraw` has it."""
        moved = self.belief.map_vertex(vertex.id).position - before.position
        frame = self.belief.map_vertex(edge.a.vertex)
        line = (before if edge.a.vertex == vertex.id else frame).transform(drawn)
        start, end = (
            place + moved * (half.vertex == vertex.id)
            for place, half in ((line[0], edge.a), (line[-1], edge.b))
        )
        return frame.inverse().transform(tied_to(line, start, end, self._room_at_ends(edge)))

    def close_ring(self, view: View, line: Array, min_clearance: float) -> None:
        """Make a vertex here on an edge without an end that has been driven round.

        The polyline (N, 2), local frame, begins and ends about where the robot is.
        """
        here = view.local_base.position
        line = np.concatenate([here[None], line, here[None]])
        ways = (line - here, line[::-1] - here)
        vertex = self.add_driven(view, here, *map(direction, ways))
        a, b = vertex.ends
        self.join(view, a, b, line, min_clearance, driven=True)
