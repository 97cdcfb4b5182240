"""From what is seen of the GVG to what is known of it: vertices matched, added and joined."""

import math
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np

from gvgbot.autonomy.candidates import Candidates, CandidatesConfig
from gvgbot.autonomy.events import (
    EdgeJoined,
    Event,
    LoopClosed,
    VertexAdded,
    VertexRemoved,
)
from gvgbot.autonomy.gvg.local import Branch, LocalEdge, LocalGvg, LocalNode
from gvgbot.autonomy.gvg.reduction import KnownVertices
from gvgbot.autonomy.recogniser import CLOSE_M, Match, Recogniser, Recognition
from gvgbot.autonomy.slam import ekf
from gvgbot.autonomy.slam.graph import Edge, HalfEdgeId, Kind, Vertex
from gvgbot.autonomy.slam.recognition import (
    RecognitionConfig,
    Sighting,
    detection_covariance,
    match_bearings,
)
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.autonomy.topology import loose_ends, split_edge_at, strays, take_out
from gvgbot.autonomy.unsettled import Knowledge, Unsettled
from gvgbot.autonomy.views import Correspondence, Observation, View
from gvgbot.geometry import Array, Pose
from gvgbot.ranges import Range

_MADE_BY_M = 0.15  # beyond its disc: what made a vertex is nearer, wherever exactly that is
_BEHIND_M = 2.5  # the nearest walls of a vertex, others tell what it looks like
_HIDES_M = 1.0  # what stands so near to a vertex's disc may close a branch
_FRESH_M = 6.0  # driven since a vertex was seen: the local frame still tells its place
_IN_FULL_VIEW_M = 4.0  # from so near, it would be seen that a vertex is none
_IN_CLEAR_M = 2.0  # and from so near, that it has no departure where one was seen
_WELL_KNOWN_M = 0.2  # the uncertainty of its place with which that can be told
_DRIVEN = 5  # times as often must a driven edge be missed
_DOOR_M = 0.5  # from an edge, a dead end is what stands on it
_AT_END_M = 0.5  # so near to the end of a dead end, it has been driven


@dataclass(frozen=True, slots=True, kw_only=True)
class MappingConfig:
    """How much must be seen before it is believed."""

    candidates: CandidatesConfig = field(default_factory=CandidatesConfig)
    trust_m: Annotated[float, Range(1.0, 30.0)] = 7.0  # vertices farther away are not yet believed
    # for so long must sight speak against a part of a finished map: doors close, and open again
    changed_after_s: Annotated[float, Range(0.0, 1e7)] = 86_400.0
    misses: Annotated[int, Range(1, 50)] = 6  # sightings of a plain edge that refute a vertex
    conflicts: Annotated[int, Range(1, 50)] = 4  # sightings that overrule an edge
    surplus: Annotated[int, Range(1, 50)] = 3  # sightings in a row that add a departure to a vertex
    passed_m: Annotated[float, Range(0.3, 5.0)] = 1.0  # from so near, what there is to see is seen
    # driven between two corrections by the same vertex
    update_every_m: Annotated[float, Range(0.1, 10.0)] = 1.0
    # vertices farther away are not looked up
    recognise_within_m: Annotated[float, Range(1.0, 20.0)] = 5.0
    min_inliers: Annotated[float, Range(0.1, 1.0)] = 0.7  # share of a vertex's walls found again
    min_inliers_far: Annotated[float, Range(0.1, 1.0)] = (
        0.9  # of one that is not where it should be
    )
    margin: Annotated[float, Range(0.0, 50.0)] = 9.0  # in squared Mahalanobis distance, to the next
    # by which a place must be likelier a known one than a new one, or two that may be one be so:
    # minus twice the log likelihood
    novelty_margin: Annotated[float, Range(0.0, 50.0)] = 10.0
    # around a vertex, walls are kept to know it again; farther where the nearest are so far off
    snapshot_m: Annotated[float, Range(1.0, 20.0)] = 6.0


class Mapper(Knowledge):
    """Keeps the belief and the graph; both are corrected by every view."""

    def __init__(
        self,
        config: MappingConfig,
        recognition: RecognitionConfig,
        matching: ScanMatchingConfig,
        *,
        drive_dead_ends: bool = False,
        by_position: bool = False,
    ) -> None:
        super().__init__()
        self._config, self._recognition = config, recognition
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
        self.unsettled = Unsettled(
            self,
            margin=config.novelty_margin,
            same_bearing=math.radians(recognition.bearing_deg),
        )
        self._unbelieved = Candidates(config.candidates)
        self._rivals: dict[int, Recognition] = {}  # by nodes of this view that may be known ones
        # by half-edges of vertices that this view took out, as `loose_ends`, but in the local frame
        self.came_from: dict[HalfEdgeId, tuple[HalfEdgeId, Array]] = {}
        self._events: list[Event] = []

    def move(self, motion: Pose, covariance: Array) -> None:
        """Account for a motion of the base, with its covariance (3, 3)."""
        self.belief = ekf.advance(self.belief, motion, covariance)
        self.unsettled.note_move(motion, covariance)

    def known_around(self, local_base: Pose, within_m: float) -> KnownVertices:
        """The vertices around the base, seen lately or not, in the local frame."""
        positions = self._vertices_from(local_base)
        near = np.hypot(*(positions - local_base.position).T) < within_m
        degrees = np.array(
            [self.graph.vertices[self.belief.ids[i]].degree for i in np.flatnonzero(near)], int
        )
        return KnownVertices(positions[near], degrees)

    def _vertices_from(self, local_base: Pose) -> Array:
        """Where the vertices are (N, 2), local frame, in the order of the belief's ids."""
        local_map = local_base.compose(self.belief.map_base.inverse())
        return local_map.transform(self.belief.x[3:].reshape(-1, 3)[:, :2])

    def is_way(self, local_base: Pose, place: Array) -> bool:
        """Whether a known edge passes a place (2,), local frame, nearer than any wall of its."""
        x, y = self.belief.map_base.transform(local_base.inverse().transform(place))
        for edge in self.graph.edges.values():
            map_vertex = self.belief.map_vertex(edge.a.vertex)
            gaps = np.hypot(*(map_vertex.transform(edge.polyline) - [x, y]).T)
            if gaps.min() < edge.min_clearance:
                return True
        return False

    def observe(self, view: View) -> tuple[Correspondence, list[Event]]:
        """Match a view with the map and learn from it.

        The list of what happened grows with what is joined or removed before the next view.
        """
        self._events, self._rivals, self.came_from = [], {}, {}
        self._events += self.unsettled.revoke(view.stamp) + self.unsettled.settle(view.stamp)
        known = Correspondence()
        sightings = self._sightings(view)
        self._track(view, sightings, known)
        self._recognise(view, sightings, known)
        self._consider(view, sightings, known)
        for node, key in list(known.vertex_of.items()):
            vertex = self.graph.vertices[key]
            if node in view.doubted:
                self._find_half_edges(view, view.gvg.nodes[node], vertex, known)
            else:
                self._refresh(view, sightings[node], view.gvg.nodes[node], vertex, known)
        self._refute(view, known)
        self._join(view, known)
        return known, self._events

    # -- which vertex is it ------------------------------------------------------------------

    def _sightings(self, view: View) -> dict[int, Sighting]:
        base = view.local_base.position
        return {
            key: _sighting(view.gvg, node)
            for key, node in view.gvg.nodes.items()
            if node.may_be_vertex and np.hypot(*(node.position - base)) < self._config.trust_m
        }

    def _track(self, view: View, sightings: dict[int, Sighting], known: Correspondence) -> None:
        """Vertices seen moments ago are told by their place in the local map.

        What was taken for a fork in a room may prove to be its end, and the other way round.
        """
        pairs = sorted(
            (
                sighting.meetpoint != (vertex.kind == "meetpoint"),
                float(np.hypot(*(sighting.position - vertex.local.position))),
                node,
                vertex.id,
            )
            for vertex in self.graph.vertices.values()
            if view.travelled - vertex.seen_at < self._recognition.tracked_m
            for node, sighting in sightings.items()
        )
        for changed, metres, node, vertex_id in pairs:
            reach = self._recognition.same_place_m * (0.5 if changed else 1.0)
            if metres < reach and node not in known.vertex_of and vertex_id not in known.node_of:
                known.pair(node, vertex_id)

    def _recognise(self, view: View, sightings: dict[int, Sighting], known: Correspondence) -> None:
        """Vertices that were out of sight for long must pass all the tests.

        Two that pass are too many: the next view decides.
        """
        for node, sighting in sightings.items():
            away = float(np.hypot(*(sighting.position - view.local_base.position)))
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
                view.travelled - vertex.seen_at,
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
        for node, sighting in sightings.items():
            if node in known.vertex_of or node in view.doubted or self._is_door(view, sighting):
                continue
            away = float(np.hypot(*(sighting.position - view.local_base.position)))
            candidate = self._unbelieved.note(sighting, away, view.travelled)
            if not self._unbelieved.is_believable(candidate, view.gvg.nodes[node], away):
                continue
            examined = away < CLOSE_M and self._unbelieved.is_examined(candidate)
            if self._crowded(view, sighting) or (
                not examined and self._may_be_known(view, sighting)
            ):
                continue  # it may be a known one: look at it from closer
            self._unbelieved.drop(candidate)
            old = self._back_again(view, sighting, known)
            if old is None:
                old = self._add(view, sighting)
                found = self._rivals.get(node, Recognition())
                self._events += self.unsettled.doubt(old, found, view.stamp)
            known.pair(node, old.id)

    def _may_be_known(self, view: View, sighting: Sighting) -> bool:
        vertices = self.graph.vertices.values()
        return bool(self._recogniser.candidates(self.belief, vertices, view, sighting))

    def _crowded(self, view: View, sighting: Sighting) -> bool:
        """Whether a vertex of this kind that is in sight stands here already."""
        return any(
            np.hypot(*(vertex.local.position - sighting.position))
            < 0.5 * self._recognition.same_place_m
            for vertex in self.graph.vertices.values()
            if view.travelled - vertex.seen_at < self._recognition.tracked_m
            and sighting.meetpoint == (vertex.kind == "meetpoint")
        )

    def _add(self, view: View, sighting: Sighting) -> Vertex:
        kind: Kind = "meetpoint" if sighting.meetpoint else "endpoint"
        local = Pose(float(sighting.position[0]), float(sighting.position[1]), 0.0)
        vertex = Vertex(
            self.graph.next_id(), sighting.clearance, local, view.travelled, view.travelled
        )
        for bearing in sighting.bearings:
            vertex.add_half_edge(bearing)
        self.graph.vertices[vertex.id] = vertex
        base_vertex = view.local_base.to(local)
        R = np.zeros((3, 3))
        R[:2, :2] = detection_covariance(
            math.hypot(base_vertex.x, base_vertex.y), self._recognition
        )
        R[2, 2] = 1e-6
        self.belief = ekf.add_vertex(self.belief, vertex.id, base_vertex, R)
        self.observations.append(Observation(view.keyframe, vertex.id, base_vertex, R))
        self._picture(view, vertex)
        place = self.belief.map_vertex(vertex.id)
        split_edge_at(
            self.graph,
            self.belief,
            vertex,
            reach=self._recognition.same_place_m,
            angle=math.radians(self._recognition.bearing_deg),
        )
        self._events.append(
            VertexAdded(
                view.stamp, vertex.id, kind, place.x, place.y, vertex.degree, vertex.clearance
            )
        )
        return vertex

    def _picture(self, view: View, vertex: Vertex) -> None:
        """Keep the walls around a vertex, to know them again."""
        walls = view.local_map.points()
        reach = max(self._config.snapshot_m, vertex.clearance + _BEHIND_M)
        near = np.hypot(*(walls - vertex.local.position).T) < reach
        vertex.snapshot = vertex.local.inverse().transform(walls[near])
        vertex.sights = Pose(theta=-vertex.local.theta).transform(view.local_map.sights()[near])

    # -- what is known better ----------------------------------------------------------------

    def _refresh(
        self, view: View, sighting: Sighting, node: LocalNode, vertex: Vertex, known: Correspondence
    ) -> None:
        """Sharpen a vertex by a further sighting."""
        share = 1.0 / min(vertex.sightings + 1, 10)
        position = (1 - share) * vertex.local.position + share * sighting.position
        vertex.local = Pose(float(position[0]), float(position[1]), vertex.local.theta)
        vertex.sightings += 1
        vertex.misses, vertex.doubted_since = 0, None
        vertex.seen_at = view.travelled
        near = np.hypot(*(position - view.local_base.position)) < 1.0
        if node.settled:
            vertex.clearance += share * (sighting.clearance - vertex.clearance)
        if near and vertex.visits == 1 and node.settled:
            self._picture(view, vertex)
        self._match_half_edges(view, node, vertex, known)
        if view.travelled - vertex.updated_at > self._config.update_every_m:
            vertex.updated_at = view.travelled
            base_vertex = view.local_base.to(vertex.local)
            R = detection_covariance(math.hypot(base_vertex.x, base_vertex.y), self._recognition)
            self._measure(view, vertex, base_vertex, R)

    def _measure(self, view: View, vertex: Vertex, base_vertex: Pose, R: Array) -> None:
        """Correct the belief by a vertex seen again."""
        self.belief = ekf.correct(self.belief, vertex.id, base_vertex, R)
        self.observations.append(Observation(view.keyframe, vertex.id, base_vertex, R))

    def _find_half_edges(
        self, view: View, node: LocalNode, vertex: Vertex, known: Correspondence
    ) -> tuple[list[Branch], tuple[float, ...], dict[int, int]]:
        """A node's branches, their bearings, and which are the known half-edges of its vertex."""
        branches = sorted(node.branches, key=lambda branch: branch in node.weak)
        bearings = tuple(view.gvg.bearing(b, node.clearance) for b in branches)
        turned = {k: h.bearing + vertex.local.theta for k, h in vertex.half_edges.items()}
        limit = math.radians(self._recognition.bearing_deg)
        matched = match_bearings(bearings, turned, limit)
        for i, key in matched.items():
            known.pair_branch(branches[i], HalfEdgeId(vertex.id, key))
        return branches, bearings, matched

    def _match_half_edges(
        self, view: View, node: LocalNode, vertex: Vertex, known: Correspondence
    ) -> None:
        """Pair a node's branches with the half-edges of its vertex; add certain new ones."""
        branches, bearings, matched = self._find_half_edges(view, node, vertex, known)
        new = [i for i in range(len(branches)) if i not in matched]
        certain = [i for i in new if branches[i] not in node.weak]
        vertex.surplus = vertex.surplus + 1 if certain else 0
        base = view.local_base.position
        at_it = np.hypot(*(vertex.local.position - base)) < self._config.passed_m
        vertex.unclear = vertex.unclear + at_it if new else 0
        # What stays unclear although the robot is there must be driven to: it becomes a frontier.
        if vertex.unclear >= self._config.candidates.meetpoint_sightings * vertex.hesitation:
            certain = new
        elif vertex.surplus < self._config.surplus * vertex.hesitation:
            certain = []
        if certain:
            vertex.surplus = vertex.unclear = 0
        for i in certain:
            matched[i] = vertex.add_half_edge(bearings[i] - vertex.local.theta)
            known.pair_branch(branches[i], HalfEdgeId(vertex.id, matched[i]))
        for key in matched.values():
            vertex.half_edges[key].misses = 0
        if node.lead is None and len(matched) == len(branches):
            self._doubt_half_edges(view, vertex, set(matched.values()), len(branches))

    def _doubt_half_edges(self, view: View, vertex: Vertex, seen: set[int], degree: int) -> None:
        """Drop departures that a clear view keeps not showing."""
        misses = self._config.misses * vertex.hesitation
        for key, half in list(vertex.half_edges.items()):
            if key in seen or vertex.degree <= degree:
                continue
            half.misses += 1
            end = HalfEdgeId(vertex.id, key)
            edge = self.graph.edge_at(end)
            if half.misses <= misses * self._weight(edge, end):
                continue
            if edge is None or self._has_changed(edge, view.stamp):
                self.graph.remove_half_edge(end)

    def _weight(self, edge: Edge | None, end: HalfEdgeId) -> float:
        """How many times as often as others a departure must be missed before it is dropped."""
        if edge is None or not edge.driven:
            return 1.0
        return _DRIVEN if self._is_left_open(edge.other(end)) else math.inf

    def _is_left_open(self, end: HalfEdgeId) -> bool:
        """Whether nothing is known beyond a vertex, and there are ways on.

        What the robot drove round, and took for a vertex on the way, may have gone since.
        """
        halves = self.graph.vertices[end.vertex].half_edges
        beyond = [half for key, half in halves.items() if key != end.key]
        return all(half.edge is None for half in beyond) and any(half.open for half in beyond)

    def _refute(self, view: View, known: Correspondence) -> None:
        """Remove vertices where a plain edge is seen to pass through, or no wall that made them."""
        for vertex, place in self._in_full_view(view):
            near_by = vertex.clearance + _HIDES_M
            if vertex.id in known.node_of or view.is_doubtful(place, near_by):
                continue
            stands_free = view.stands_free(place, vertex.clearance + _MADE_BY_M)
            # A door is easily missed from along the wall; the robot will come where one was seen.
            is_promising = any(half.open for half in vertex.half_edges.values())
            is_clear = not is_promising or math.dist(place, view.local_base.position) < _IN_CLEAR_M
            if stands_free or (is_clear and self._passes_through(view, place, known)):
                vertex.misses += 1
                refuted = vertex.misses > self._config.misses
                if refuted and self._has_changed(vertex, view.stamp):
                    gone = "the walls about it have gone" if stands_free else "an edge passes here"
                    self.remove(view, vertex, gone)

    def _in_full_view(self, view: View) -> list[tuple[Vertex, Array]]:
        """The vertices that should be seen near by, and where (2,), local frame, for certain."""
        found = []
        for vertex_id, believed in zip(
            self.belief.ids, self._vertices_from(view.local_base), strict=True
        ):
            vertex = self.graph.vertices[vertex_id]
            is_fresh = view.travelled - vertex.seen_at < _FRESH_M
            place = vertex.local.position if is_fresh else believed
            away = math.hypot(place[0] - view.local_base.x, place[1] - view.local_base.y)
            if away <= _IN_FULL_VIEW_M and (is_fresh or self._is_well_known(vertex)):
                found.append((vertex, place))
        return found

    def _is_well_known(self, vertex: Vertex) -> bool:
        """Whether it is certain where a vertex stands as seen from the robot."""
        _, S, _ = ekf.innovation(self.belief, vertex.id, Pose(), np.zeros((2, 2)))
        return bool(np.trace(S) < _WELL_KNOWN_M**2)

    def _passes_through(self, view: View, point: Array, known: Correspondence) -> bool:
        """Whether an edge is seen where a vertex should be, or another vertex at its end there."""
        place = view.gvg.place(point)
        if place is None or place.distance > 0.3:
            return False
        edge = view.gvg.edges[place.edge]
        reach = self._recognition.same_place_m
        from_end = min(place.station, edge.length - place.station)
        end = edge.a if place.station < edge.length / 2 else edge.b
        return from_end > reach or end in known.vertex_of

    # -- what was finished once --------------------------------------------------------------

    def settle(self) -> None:
        """Take the map for the building: what speaks against it must do so for long, from now on.

        Otherwise every door that is shut for an hour would take vertices along.
        """
        for vertex in self.graph.vertices.values():
            vertex.established = True
        for edge in self.graph.edges.values():
            edge.established = True

    def _has_changed(self, part: Vertex | Edge, stamp: float) -> bool:
        """Whether a part of the map may go that sight speaks against."""
        if not part.established:
            return True
        if part.doubted_since is None:
            part.doubted_since = stamp
        return stamp - part.doubted_since >= self._config.changed_after_s

    def _back_again(self, view: View, sighting: Sighting, known: Correspondence) -> Vertex | None:
        """The vertex of the finished map that a sighting stands beside: a door was shut there."""
        for vertex in self.graph.vertices.values():
            is_away = vertex.id not in known.node_of and vertex.doubted_since is not None
            if not is_away or sighting.meetpoint != (vertex.kind == "meetpoint"):
                continue
            place = self.in_local_frame(view, vertex.id)
            off = float(np.hypot(*(place.position - sighting.position)))
            if off < self._recognition.same_place_m and self._is_well_known(vertex):
                x, y = sighting.position
                vertex.local = Pose(float(x), float(y), place.theta)
                vertex.seen_at = vertex.updated_at = view.travelled
                return vertex
        return None

    def _is_door(self, view: View, sighting: Sighting) -> bool:
        """Whether a dead end is seen in the middle of an edge of the finished map."""
        if sighting.meetpoint:
            return False
        for edge in self.graph.edges.values():
            if edge.established:
                line = self.in_local_frame(view, edge.a.vertex).transform(edge.polyline)
                if np.hypot(*(line - sighting.position).T).min() < _DOOR_M:
                    return True
        return False

    # -- what hangs together -----------------------------------------------------------------

    def _join(self, view: View, known: Correspondence) -> None:
        """Make edges of those that are in sight from end to end."""
        for key, edge in view.gvg.edges.items():
            a = known.half_edge_of.get(Branch(key, forward=True))
            b = known.half_edge_of.get(Branch(key, forward=False))
            if a is None or b is None or a == b:
                continue
            here, there = self.graph.edge_at(a), self.graph.edge_at(b)
            if self._drive_dead_ends and self._is_far_end(view, edge):
                continue
            if here is None and there is None:
                self.join(view, a, b, edge.polyline, float(edge.clearance.min()), driven=False)
            elif here is not there:
                self._dispute(view, known, here, there)
            elif here is not None:
                here.doubted_since = None

    def _is_far_end(self, view: View, edge: LocalEdge) -> bool:
        """Whether an edge ends in a dead end where the robot is not."""
        ends = (view.gvg.nodes[edge.a], view.gvg.nodes[edge.b])
        base = view.local_base.position
        return any(n.is_endpoint and np.hypot(*(n.position - base)) > _AT_END_M for n in ends)

    def _dispute(self, view: View, known: Correspondence, *disputed: Edge | None) -> None:
        """Sight speaks against edges believed so far; after a few times it wins."""
        for edge in disputed:
            if edge is None:
                continue
            edge.conflicts += 1
            if edge.conflicts > self._config.conflicts and self._has_changed(edge, view.stamp):
                self.graph.unjoin(edge)
                for end in (edge.a, edge.b):
                    vertex = self.graph.vertices[end.vertex]
                    if vertex.kind == "endpoint" and vertex.id not in known.node_of:
                        self.remove(view, vertex, "its edge ends elsewhere")

    def forget_strays(self, view: View) -> None:
        """Take out vertices that hang together with nothing, if there is anything to hang on to."""
        for vertex in strays(self.graph):
            self.remove(view, vertex, "nothing leads there")

    def remove(self, view: View, vertex: Vertex, reason: str) -> None:
        """Take a vertex out of the map; of two edges that met there one is made."""
        local_map = view.local_base.compose(self.belief.map_base.inverse())
        for end, (far, line) in loose_ends(self.graph, self.belief, vertex).items():
            self.came_from[end] = far, local_map.transform(line)
        take_out(self.graph, self.belief, vertex)
        self.belief = ekf.remove_vertex(self.belief, vertex.id)
        self.unsettled.forget(vertex.id)
        self._events.append(VertexRemoved(view.stamp, vertex.id, reason))

    def close_ring(self, view: View, line: Array, min_clearance: float) -> None:
        """Make a vertex here on an edge without an end that has been driven round.

        The polyline (N, 2), local frame, begins and ends about where the robot is.
        """
        here = view.local_base.position
        line = np.concatenate([here[None], line, here[None]])
        way_out, way_in = line[len(line) // 8] - here, line[-len(line) // 8] - here
        bearings = (math.atan2(way_out[1], way_out[0]), math.atan2(way_in[1], way_in[0]))
        vertex = self._add(view, Sighting(here, min_clearance, bearings, meetpoint=True))
        ends = [HalfEdgeId(vertex.id, key) for key in vertex.half_edges]
        self.join(view, ends[0], ends[1], line, min_clearance, driven=True)

    def forget_between(self, first: int, last: int) -> None:
        """Drop what was observed at keyframes from one on; the last one takes its number."""
        before = [seen for seen in self.observations if seen.keyframe < first]
        there = [
            replace(seen, keyframe=first) for seen in self.observations if seen.keyframe == last
        ]
        self.observations[:] = before + there
        self.unsettled.take_for_granted()  # what would be revoked counts on all of them

    def in_local_frame(self, view: View, vertex: int) -> Pose:
        """Where a vertex, seen lately or not, stands in the local frame."""
        return view.local_base.compose(ekf.expected(self.belief, vertex)[0])

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
        self._events.append(EdgeJoined(view.stamp, a.vertex, b.vertex, edge.length, driven))


def _sighting(gvg: LocalGvg, node: LocalNode) -> Sighting:
    branches = (
        node.branches if node.is_suspect else [b for b in node.branches if b not in node.weak]
    )
    bearings = [gvg.bearing(branch, node.clearance) for branch in branches]
    if node.is_suspect and node.lead is not None:
        bearings.append(node.lead)
    return Sighting(node.position, node.clearance, tuple(bearings), not node.is_endpoint)
