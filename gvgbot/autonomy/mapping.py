"""From what is seen of the GVG to what is known of it: vertices matched, added and joined."""

import math

import numpy as np

from gvgbot.autonomy.association import is_crowded, pair_tracked, sightings_of
from gvgbot.autonomy.candidates import Candidates, Mistake
from gvgbot.autonomy.events import Event, LoopClosed, VertexMoved
from gvgbot.autonomy.evidence import Evidence, MappingConfig
from gvgbot.autonomy.gvg.between import between
from gvgbot.autonomy.gvg.local import Branch, LocalEdge, LocalNode
from gvgbot.autonomy.map_edits import MapEdits
from gvgbot.autonomy.recogniser import CLOSE_M, Match, Recogniser, Recognition
from gvgbot.autonomy.slam import ekf
from gvgbot.autonomy.slam.graph import Edge, HalfEdgeId, Vertex
from gvgbot.autonomy.slam.recognition import (
    RecognitionConfig,
    Sighting,
    detection_covariance,
    sight_covariance,
)
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.autonomy.views import Correspondence, Observation, View, touches
from gvgbot.geometry import Array, Pose

_ODD = 9.0  # squared Mahalanobis distance, 2 degrees of freedom, of a sight that counts less
_WALLS = 3  # that a meetpoint or an endpoint lies between
_ROOMIER_M = 0.05  # by which one place beats another
_ELSEWHERE, _IN_A_ROW = 18.0, 3  # the same of sights that show, so many, that it stands elsewhere
_TOGETHER = 1.6  # times the sigma of each, as the sights of one visit err together
_MEAN_OF = 10  # sightings, about, of which the place of a vertex is the mean
_BESIDE_M = 1.0  # from so near, the walls around a vertex are seen well
_AT_END_M = 0.5  # so near to the end of a dead end, it has been driven


class Mapper(MapEdits):
    """Learns the map from views, by each of which belief and graph are corrected."""

    def __init__(
        self,
        config: MappingConfig,
        recognition: RecognitionConfig,
        matching: ScanMatchingConfig,
        *,
        drive_dead_ends: bool = False,
        by_position: bool = False,
    ) -> None:
        super().__init__(config, recognition)
        self._recogniser = Recogniser(
            recognition,
            matching,
            min_inliers=config.min_inliers,
            min_inliers_far=config.min_inliers_far,
            margin=config.margin,
            novelty_margin=config.novelty_margin,
        )
        self._drive_dead_ends = drive_dead_ends
        self._by_position = by_position
        self._unbelieved = Candidates(config.candidates)
        self._evidence = Evidence(self, self._unbelieved, config, recognition)
        self._rivals: dict[int, Recognition] = {}  # by nodes of this view that may be known ones
        self._reopened: set[frozenset[int]] = set()  # ends of edges

    def explains(self, view: View, known: Correspondence, place: Array) -> bool:
        """Whether a vertex should stand at a place (2,), local frame, and is seen nowhere else."""
        gaps = np.hypot(*(self.positions_from(view.local_base) - place).T)
        near = np.flatnonzero(gaps < self._recognition.same_place_m)
        return any(self.belief.ids[i] not in known.node_of for i in near)

    def lose_sight(self, seen_at: float) -> None:
        """Know all vertices from afar: none was seen after so many metres, and nothing else was."""
        for vertex in self.graph.vertices.values():
            vertex.seen_at = min(vertex.seen_at, seen_at)
        self._unbelieved.forget()

    def reopen(self, edge: Edge) -> bool:
        """Take an edge for a frontier, until it is driven; only once, and whether it has done so.

        Sight may go through glass.
        """
        ends = frozenset((edge.a.vertex, edge.b.vertex))
        is_new = ends not in self._reopened
        if is_new:
            self._reopened.add(ends)
            self.graph.unjoin(edge)
        return is_new

    def is_reopened(self, a: HalfEdgeId, b: HalfEdgeId) -> bool:
        """Whether sight was not to be trusted between the vertices of two half-edges."""
        return frozenset((a.vertex, b.vertex)) in self._reopened

    def observe(self, view: View) -> tuple[Correspondence, list[Event]]:
        """Match a view with the map and learn from it.

        The list of what happened grows with what is joined or removed before the next view.
        """
        self._events, self._rivals = [], {}
        self._events += self.unsettled.revoke(view.stamp) + self.unsettled.settle(view.stamp)
        known = Correspondence()
        sightings = sightings_of(view, self._config.trust_m)
        pair_tracked(self.graph, view, sightings, known, self._recognition)
        self._recognise(view, sightings, known)
        self._consider(view, sightings, known)
        for node, key in list(known.vertex_of.items()):
            vertex = self.graph.vertices[key]
            if node in view.doubted:
                self._evidence.pair_departures(view, view.gvg.nodes[node], vertex, known)
            else:
                self._refresh(view, sightings[node], view.gvg.nodes[node], vertex, known)
        for node, marked in view.marks.items():  # as the map was before this look
            present = self.graph.vertices.get(self.unsettled.names.vertex(marked.id))
            if present is not None and present.id not in known.node_of:
                known.pair(node, present.id)
                there = view.gvg.nodes[node]
                self._evidence.pair_departures(view, there, present, known, is_mark=True)
        for vertex, reason in self._evidence.refuted(view, known):
            self._refute(view, vertex, reason)
        self._join(view, known)
        return known, self._events

    # -- which vertex is it ------------------------------------------------------------------

    def _recognise(self, view: View, sightings: dict[int, Sighting], known: Correspondence) -> None:
        """Vertices that were out of sight for long must pass all the tests.

        Two that pass are too many: the next view decides.
        """
        for node, sighting in sightings.items():
            away = math.dist(sighting.position, view.local_base.position)
            unclear = view.gvg.nodes[node].is_suspect and away > CLOSE_M
            if node in known.vertex_of or unclear or away > self._config.recognise_within_m:
                continue
            vertices = [v for key, v in self.graph.vertices.items() if key not in known.node_of]
            found = self._recogniser.find(
                self.belief, self.graph, vertices, view, sighting, wary=self.unsettled.is_wary
            )
            if found.match is not None:
                self._close_loop(view, found.match)
                known.pair(node, found.match.vertex.id)
            elif found.rivals:
                self._rivals[node] = found

    def _close_loop(self, view: View, match: Match) -> None:
        """Correct the belief by a vertex that has been recognised."""
        vertex = match.vertex
        self.unsettled.note_closure(
            vertex, is_surprising=match.metres > self._recognition.same_place_m
        )
        self._events.append(
            LoopClosed(
                view.stamp,
                vertex.id,
                view.travelled - vertex.seen_at if vertex.seen_at >= 0.0 else None,
                match.distance,
                match.metres,
                match.agreement,
            )
        )
        R = match.covariance[:2, :2] if self._by_position else match.covariance
        vertex.local = match.local
        vertex.seen_at = vertex.updated_at = view.travelled
        vertex.visits += 1
        self._measure(view, vertex, view.local_base.to(match.local), R)

    # -- what is new -------------------------------------------------------------------------

    def _consider(self, view: View, sightings: dict[int, Sighting], known: Correspondence) -> None:
        """Count sightings of what is not known yet, and believe what has been seen often enough."""
        misplaced = self._evidence.misplaced(view, sightings, known)
        for node, sighting in sightings.items():
            if node in known.vertex_of or node in view.doubted or node in misplaced:
                continue
            away = math.dist(sighting.position, view.local_base.position)
            candidate = self._unbelieved.note(sighting, away, view.travelled)
            candidate.may_be = self._rivals.get(node, candidate.may_be)
            if not self._unbelieved.is_believable(candidate, view.gvg.nodes[node], away):
                continue
            examined = away < CLOSE_M and self._unbelieved.is_examined(candidate)
            if is_crowded(self.graph, view, sighting, known, self._recognition) or (
                not examined and self._may_be_known(view, sighting)
            ):
                continue  # it may be a known one: look at it from closer
            self._unbelieved.drop(candidate)
            old = self._evidence.back_again(view, sighting, known)
            if old is None:
                old = self._add(view, sighting)
                self._events += self.unsettled.doubt(old, candidate.may_be, view.stamp)
            known.pair(node, old.id)

    def _may_be_known(self, view: View, sighting: Sighting) -> bool:
        vertices = self.graph.vertices.values()
        return bool(self._recogniser.gated(self.belief, vertices, view, sighting))

    # -- what is known better ----------------------------------------------------------------

    def _refresh(
        self, view: View, sighting: Sighting, node: LocalNode, vertex: Vertex, known: Correspondence
    ) -> None:
        """Sharpen a vertex by a further sighting."""
        if sighting.settled and not vertex.settled:  # what was seen of it before was too little
            vertex.settled, vertex.sightings = True, 0
        share = 1.0 / min(vertex.sightings + 1, _MEAN_OF)
        position = (1 - share) * vertex.local.position + share * sighting.position
        vertex.local = Pose(float(position[0]), float(position[1]), vertex.local.theta)
        vertex.sightings += 1
        vertex.misses, vertex.doubted_since = 0, None
        vertex.seen_at = view.travelled
        away = math.dist(position, view.local_base.position)
        is_beside = away < _BESIDE_M
        vertex.reached = vertex.reached or away < _AT_END_M
        if node.settled:
            vertex.clearance += share * (sighting.clearance - vertex.clearance)
        if is_beside and vertex.visits == 1 and node.settled:
            self._picture(view, vertex)
        departures = len(vertex.half_edges)
        self._evidence.weigh_departures(view, node, vertex, known)
        if len(vertex.half_edges) > departures:  # an edge that was known before may leave by it
            self.part_edge_at(vertex)
        if view.travelled - vertex.updated_at > self._config.update_every_m:
            vertex.updated_at = view.travelled
            self._look_again(view, vertex, view.local_base.to(vertex.local))

    def _look_again(self, view: View, vertex: Vertex, base_vertex: Pose) -> None:
        """Correct the belief by a vertex that is still in sight.

        Such sights err alike, and together where more of the room comes into view: they tell of the
        vertex and, where walls tell where the robot is, not of that. Where all is solved at once
        they move it, too, so each counts less there. So does an odd one everywhere.
        """
        away = math.hypot(base_vertex.x, base_vertex.y)
        if self._by_position:
            self._measure(view, vertex, base_vertex, detection_covariance(away, self._recognition))
            return
        own = sight_covariance(away, self._recognition, settled=vertex.settled)
        r, S, _ = ekf.innovation(self.belief, vertex.id, base_vertex, own)
        off = ekf.mahalanobis(r, S)
        if vertex.settled and away < self._config.trust_m:
            if off > _ELSEWHERE and self._is_still_there(view, vertex):
                vertex.elsewhere = 0
                return
            vertex.elsewhere = vertex.elsewhere + 1 if off > _ELSEWHERE else 0
        if vertex.elsewhere >= _IN_A_ROW:
            self._place_anew(view, vertex)
            return
        odd = max(1.0, off / _ODD)
        before = self.belief.map_vertex(vertex.id)
        self.belief = ekf.update_vertex_in_place(self.belief, vertex.id, base_vertex, odd * own)
        self.redraw(vertex, before)
        R = odd * _TOGETHER**2 * own
        self.observations.append(Observation(view.keyframe, vertex.id, base_vertex, R))

    def _is_still_there(self, view: View, vertex: Vertex) -> bool:
        """Whether it lies between three walls as before, and has more room than where it is seen.

        What has been forgotten of the floor around it moves the GVG towards what is known.
        """
        place = self.belief.map_vertex(vertex.id).position
        before = between(view.local_map, self.map_in_local(view.local_base).transform(place))
        now = between(view.local_map, vertex.local.position)
        return before.walls >= _WALLS and before.clearance > now.clearance + _ROOMIER_M

    def _place_anew(self, view: View, vertex: Vertex) -> None:
        """Believe a vertex where it is seen now, and forget what was seen of it before.

        Somebody stood near by when it was found: what it lay between was not the building.
        """
        before, vertex.elsewhere = self.belief.map_vertex(vertex.id), 0
        self.belief = ekf.remove_vertex(self.belief, vertex.id)
        self.observations[:] = [seen for seen in self.observations if seen.vertex != vertex.id]
        self._believe(view, vertex)
        self.redraw(vertex, before, polylines=True)
        metres = before.distance(self.belief.map_vertex(vertex.id))
        self._events.append(VertexMoved(view.stamp, vertex.id, metres))

    def _measure(self, view: View, vertex: Vertex, base_vertex: Pose, R: Array) -> None:
        """Correct the belief by a vertex seen again."""
        self.belief = ekf.update_in_place(self.belief, vertex.id, base_vertex, R)
        self.observations.append(Observation(view.keyframe, vertex.id, base_vertex, R))

    # -- what hangs together -----------------------------------------------------------------

    def _join(self, view: View, known: Correspondence) -> None:
        """Make edges of those that are in sight from end to end.

        What sends lone echoes may be glass: an edge beside that is believed when it was driven.
        """
        for key, edge in view.gvg.edges.items():
            a = known.half_edge_of.get(Branch(key, forward=True))
            b = known.half_edge_of.get(Branch(key, forward=False))
            if a is None or b is None or a == b:
                continue
            here, there = self.graph.edge_at(a), self.graph.edge_at(b)
            if self._drive_dead_ends and self._is_end_left(view, edge, a, b):
                continue
            if here is None and there is None:
                if not (self.is_reopened(a, b) or touches(edge, view.local_map.suspects())):
                    self.join(view, a, b, edge.polyline, float(edge.clearance.min()), driven=False)
            elif here is there or self._is_one_between(known, a, b):
                for edge_seen in filter(None, (here, there)):
                    edge_seen.conflicts = max(0, edge_seen.conflicts - 1)
                    edge_seen.doubted_since = None
            else:
                self._dispute(view, known, here, there)

    def _is_one_between(self, known: Correspondence, a: HalfEdgeId, b: HalfEdgeId) -> bool:
        """Whether the edges of two ends that are seen to be one meet at a vertex out of sight.

        Then that is what is disputed: from near it will be seen whether there is a side door.
        """
        here, there = self.graph.edge_at(a), self.graph.edge_at(b)
        if here is None or there is None:
            return False
        middle = here.other(a).vertex
        return middle == there.other(b).vertex and middle not in known.node_of

    def _is_end_left(self, view: View, edge: LocalEdge, a: HalfEdgeId, b: HalfEdgeId) -> bool:
        """Whether an edge ends in a dead end where the robot has not been; both its ends may be."""
        return any(
            view.gvg.nodes[node].is_endpoint and not self.graph.vertices[end.vertex].reached
            for node, end in ((edge.a, a), (edge.b, b))
        )

    def _dispute(self, view: View, known: Correspondence, *disputed: Edge | None) -> None:
        """Sight speaks against edges believed so far; after a few times it wins."""
        for edge in disputed:
            if edge is not None and self._evidence.is_overruled(edge, view.stamp):
                self.graph.unjoin(edge)
                for end in (edge.a, edge.b):
                    vertex = self.graph.vertices[end.vertex]
                    if vertex.kind == "endpoint" and vertex.id not in known.node_of:
                        self.remove(view, vertex, "its edge ends elsewhere")

    def driven_past(self, view: View, vertex: Vertex) -> None:
        """Take out a vertex over whose place the robot drove and found none."""
        place = self.in_local_frame(view, vertex.id).position
        if not vertex.established and not self._unbelieved.is_stubborn(place):
            self._refute(view, vertex, "it was driven past")

    def _refute(self, view: View, vertex: Vertex, reason: str) -> None:
        """Take a vertex out for a mistake, which it would be once more if it is seen again.

        What made it one may be a departure that was taken out before.
        """
        place = self.in_local_frame(view, vertex.id)
        bearings = [*(half.bearing for half in vertex.half_edges.values()), *vertex.gone]
        turned = tuple(bearing + place.theta for bearing in bearings)
        self._unbelieved.note_mistake(Mistake(place.position, turned, view.travelled))
        if not self.graph.leave_ring(vertex):
            is_passed = self._is_passed(view, vertex)
            self.remove(view, vertex, reason, is_passed=is_passed)

    def _is_passed(self, view: View, vertex: Vertex) -> bool:
        """Whether sight shows that the two edges of a vertex are one, whatever else leaves it."""
        followed = {end for end in vertex.ends if self.graph.edge_at(end) is not None}
        return len(followed) == 2 and followed == set(self._evidence.passed_along(view, vertex))
