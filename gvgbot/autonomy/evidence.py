"""What sight says for and against parts of the map, counted until it is enough to change them."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.autonomy.candidates import Candidates, CandidatesConfig
from gvgbot.autonomy.gvg.local import Branch, LocalNode, Place
from gvgbot.autonomy.knowledge import ON_EDGE_M, Knowledge
from gvgbot.autonomy.slam import ekf
from gvgbot.autonomy.slam.graph import Edge, HalfEdgeId, Vertex
from gvgbot.autonomy.slam.recognition import RecognitionConfig, Sighting, match_bearings
from gvgbot.autonomy.topology import outwards
from gvgbot.autonomy.views import IN_FULL_VIEW_M, Correspondence, View
from gvgbot.geometry import Array, Pose, stations_of
from gvgbot.ranges import Range

_MADE_BY_M = 0.15  # beyond its disc: what made a vertex is nearer, wherever exactly that is
_HIDES_M = 1.0  # what stands so near to a vertex's disc may close a branch
_FRESH_M = 6.0  # driven since a vertex was seen: the local frame still tells its place
_IN_CLEAR_M = 2.0  # and from so near, that it has no departure where one was seen
_WELL_KNOWN_M = 0.2  # the uncertainty of its place with which that can be told
_PASSES_M = 0.3  # so near to a vertex's place, an edge that is seen passes through it
_ASIDE_M = 2.0  # beyond a vertex's disc: a driven way that leaves by a door is beyond the walls
_DRIVEN = 5  # times as often must a driven edge be missed


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


class Evidence:
    """Adds and drops departures of vertices, and says what is refuted and what is out of place."""

    def __init__(
        self,
        known: Knowledge,
        unbelieved: Candidates,
        config: MappingConfig,
        recognition: RecognitionConfig,
    ) -> None:
        self._known, self._unbelieved = known, unbelieved
        self._config, self._recognition = config, recognition
        self._same_bearing = math.radians(recognition.bearing_deg)

    # -- departures --------------------------------------------------------------------------

    def pair_departures(
        self,
        view: View,
        node: LocalNode,
        vertex: Vertex,
        known: Correspondence,
        *,
        is_mark: bool = False,
    ) -> tuple[list[Branch], tuple[float, ...], dict[int, int]]:
        """Note which branches of a node are which half-edges of its vertex.

        The branches, weak ones last; their bearings, rad, local frame; and by index of the branch
        the key of its half-edge. At a mark that two ways leave they are the two of its vertex,
        however they turn: it may have been put beyond a bend.
        """
        branches = sorted(node.branches, key=lambda branch: branch in node.weak)
        bearings = tuple(view.gvg.bearing(b, node.clearance) for b in branches)
        limit = math.pi if is_mark and len(branches) == vertex.degree == 2 else self._same_bearing
        matched = _matched(bearings, vertex, vertex.local.theta, limit)
        for i, key in matched.items():
            known.pair_branch(branches[i], HalfEdgeId(vertex.id, key))
        return branches, bearings, matched

    def weigh_departures(
        self, view: View, node: LocalNode, vertex: Vertex, known: Correspondence
    ) -> None:
        """Pair branches of a node with half-edges of its vertex; add sure new ones in sight."""
        branches, bearings, matched = self.pair_departures(view, node, vertex, known)
        place = vertex.local.position
        new = [
            i
            for i, branch in enumerate(branches)
            if i not in matched
            and not (branch in node.weak and self._unbelieved.was_looked_at(place, bearings[i]))
        ]
        if new and not view.sees(place):
            new = []
        certain = [i for i in new if branches[i] not in node.weak]
        for i in self._believed(view, vertex, new, certain):
            matched[i] = vertex.add_half_edge(bearings[i] - vertex.local.theta)
            known.pair_branch(branches[i], HalfEdgeId(vertex.id, matched[i]))
        for key in matched.values():
            vertex.half_edges[key].misses = 0
        if node.lead is None and len(matched) == len(branches):
            self._doubt_departures(view, vertex, set(matched.values()))

    def _believed(
        self, view: View, vertex: Vertex, new: list[int], certain: list[int]
    ) -> list[int]:
        """Which branches that are no known departure, some of them for certain, become one now.

        What stays unclear although the robot is there must be driven to: it becomes a frontier.
        """
        vertex.surplus = vertex.surplus + 1 if certain else 0
        base = view.local_base.position
        at_it = math.dist(vertex.local.position, base) < self._config.passed_m
        vertex.unclear = vertex.unclear + at_it if new else 0
        if vertex.unclear >= self._config.candidates.meetpoint_sightings * vertex.hesitation:
            believed = new
        elif vertex.surplus >= self._config.surplus * vertex.hesitation:
            believed = certain
        else:
            return []
        vertex.surplus = vertex.unclear = 0
        return believed

    def _doubt_departures(self, view: View, vertex: Vertex, seen: set[int]) -> None:
        """Drop departures that a clear view keeps not showing."""
        graph, misses = self._known.graph, self._config.misses * vertex.hesitation
        for key, half in list(vertex.half_edges.items()):
            if key in seen:
                continue
            half.misses += 1
            end = HalfEdgeId(vertex.id, key)
            edge = graph.edge_at(end)
            if half.misses <= misses * self._weight(edge, end):
                continue
            if edge is None or self._has_changed(edge, view.stamp):
                graph.remove_half_edge(end)

    def _weight(self, edge: Edge | None, end: HalfEdgeId) -> float:
        """How many times as often as others a departure must be missed before it is dropped."""
        if edge is None or not edge.driven:
            return 1.0
        return _DRIVEN if self._is_left_open(edge.other(end)) else math.inf

    def _is_left_open(self, end: HalfEdgeId) -> bool:
        """Whether nothing is known beyond a vertex, and there are ways on.

        What the robot drove round, and took for a vertex on the way, may have gone since.
        """
        halves = self._known.graph.vertices[end.vertex].half_edges
        beyond = [half for key, half in halves.items() if key != end.key]
        return all(half.edge is None for half in beyond) and any(half.open for half in beyond)

    # -- vertices ----------------------------------------------------------------------------

    def refuted(self, view: View, known: Correspondence) -> Iterator[tuple[Vertex, str]]:
        """The vertices that sight has spoken against often enough, each with the reason.

        Whoever takes one out does so before the next is judged: that may have a way on then.
        """
        for vertex, place in self._in_full_view(view):
            reason = self._objection(view, vertex, place, known)
            if reason is None:
                continue
            vertex.misses += 1
            if vertex.misses > self._config.misses and self._has_changed(vertex, view.stamp):
                yield vertex, reason

    def _in_full_view(self, view: View) -> list[tuple[Vertex, Array]]:
        """The vertices that should be seen near by, and where (2,), local frame, for certain."""
        known, found = self._known, []
        places = known.positions_from(view.local_base)
        for vertex_id, believed in zip(known.belief.ids, places, strict=True):
            vertex = known.graph.vertices[vertex_id]
            is_fresh = view.travelled - vertex.seen_at < _FRESH_M
            place = vertex.local.position if is_fresh else believed
            away = math.hypot(place[0] - view.local_base.x, place[1] - view.local_base.y)
            if away <= IN_FULL_VIEW_M and (is_fresh or self.is_well_known(vertex)):
                found.append((vertex, place))
        return found

    def _objection(
        self, view: View, vertex: Vertex, place: Array, known: Correspondence
    ) -> str | None:
        """Why no vertex can be at its place (2,), local frame; None if it may, or is hidden.

        A door is easily missed from along the wall; the robot will come where one was seen.
        """
        if vertex.id in known.node_of or view.is_doubtful(place, vertex.clearance + _HIDES_M):
            return None
        if view.stands_free(place, vertex.clearance + _MADE_BY_M):
            return "the walls about it have gone"
        is_promising = any(half.open for half in vertex.half_edges.values())
        if is_promising and math.dist(place, view.local_base.position) >= _IN_CLEAR_M:
            return None
        passing = self._passing(view, place, known)
        if passing is None or not view.sees(place) or self._was_left(view, vertex, place, passing):
            return None
        return None if self._unbelieved.is_stubborn(place) else "an edge passes here"

    def _was_left(self, view: View, vertex: Vertex, point: Array, passing: Place) -> bool:
        """Whether the robot drove between a vertex at a point (2,) and where now walls are seen.

        There is a way, then, such as a door that is hard to see or shut now.
        """
        ways = list(self._driven_ways(vertex))
        if not ways:
            return False
        clearance = view.gvg.edges[passing.edge].clearance_at(passing.station)
        lines = cKDTree(np.concatenate([edge.polyline for edge in view.gvg.edges.values()]))
        map_in_local = self._known.map_in_local(view.local_base)
        for way in ways:
            turned = map_in_local.transform(way)
            gaps = np.asarray(lines.query(turned + (point - turned[0]))[0])
            if gaps.max() > clearance:
                return True
        return False

    def _driven_ways(self, vertex: Vertex) -> Iterator[Array]:
        """The first metres of edges that were driven from or to a vertex (N, 2), map frame."""
        for end in vertex.ends:
            edge = self._known.graph.edge_at(end)
            if edge is not None and self._weight(edge, end) == math.inf:
                line = outwards(self._known.belief, edge, end)
                yield line[stations_of(line) < vertex.clearance + _ASIDE_M]

    def _passing(self, view: View, point: Array, known: Correspondence) -> Place | None:
        """Where an edge is seen at the place of a vertex, or at its end there another vertex."""
        place = view.gvg.place(point)
        if place is None or place.distance > _PASSES_M:
            return None
        edge = view.gvg.edges[place.edge]
        reach = self._recognition.same_place_m
        from_end = min(place.station, edge.length - place.station)
        end = edge.a if place.station < edge.length / 2 else edge.b
        return place if from_end > reach or end in known.vertex_of else None

    def passed_along(self, view: View, vertex: Vertex) -> list[HalfEdgeId]:
        """The half-edges of a vertex along which an edge is seen to pass its place."""
        pose = self._known.in_local_frame(view, vertex.id)
        place = view.gvg.place(pose.position)
        if place is None or place.distance > _PASSES_M or not view.gvg.may_divide(place):
            return []
        gvg, node = view.gvg.divided(place)
        bearings = tuple(gvg.bearing(b, vertex.clearance) for b in gvg.nodes[node].branches)
        matched = _matched(bearings, vertex, pose.theta, self._same_bearing)
        return [HalfEdgeId(vertex.id, key) for key in matched.values()]

    def is_well_known(self, vertex: Vertex) -> bool:
        """Whether it is certain where a vertex stands as seen from the robot."""
        _, S, _ = ekf.innovation(self._known.belief, vertex.id, Pose(), np.zeros((2, 2)))
        return bool(np.trace(S) < _WELL_KNOWN_M**2)

    # -- edges -------------------------------------------------------------------------------

    def is_overruled(self, edge: Edge, stamp: float) -> bool:
        """Count that another edge is seen in the place of one; whether that was often enough."""
        edge.conflicts += 1
        return edge.conflicts > self._config.conflicts and self._has_changed(edge, stamp)

    # -- what was finished once --------------------------------------------------------------

    def _has_changed(self, part: Vertex | Edge, stamp: float) -> bool:
        """Whether a part of the map may go that sight speaks against: of a finished one, later."""
        if not part.established:
            return True
        if part.doubted_since is None:
            part.doubted_since = stamp
        return stamp - part.doubted_since >= self._config.changed_after_s

    def back_again(self, view: View, sighting: Sighting, known: Correspondence) -> Vertex | None:
        """The vertex of the finished map that a sighting stands beside: a door was shut there."""
        for vertex in self._known.graph.vertices.values():
            is_away = vertex.id not in known.node_of and vertex.doubted_since is not None
            if not is_away or sighting.kind != vertex.kind:
                continue
            place = self._known.in_local_frame(view, vertex.id)
            off = float(np.hypot(*(place.position - sighting.position)))
            if off < self._recognition.same_place_m and self.is_well_known(vertex):
                x, y = sighting.position
                vertex.local = Pose(float(x), float(y), place.theta)
                vertex.seen_at = vertex.updated_at = view.travelled
                return vertex
        return None

    # -- what is out of place ----------------------------------------------------------------

    def misplaced(
        self, view: View, sightings: dict[int, Sighting], known: Correspondence
    ) -> set[int]:
        """Nodes that are out of place, and the dead ends that no way led to without these."""
        base = view.local_base.position
        found = {
            node
            for node, sighting in sightings.items()
            if node not in known.vertex_of
            if self._is_out_of_place(view, sighting, math.dist(sighting.position, base))
        }
        for edge in view.gvg.edges.values():
            ends = {edge.a, edge.b}
            if ends & found:
                found |= {end for end in ends if view.gvg.nodes[end].is_endpoint}
        return found

    def _is_out_of_place(self, view: View, sighting: Sighting, away: float) -> bool:
        """Whether a vertex is seen `away` metres off, on an edge that is finished, or was driven.

        A dead end on a finished one is a door that is shut. A meetpoint may be none as long as a
        part of the walls is out of sight: in passing the robot will see. On an edge that was driven
        it has seen already, and where it erred before, that counts.
        """
        if sighting.meetpoint and away < self._config.passed_m:
            return False
        place = sighting.position
        is_dubious = sighting.meetpoint and self._unbelieved.was_mistaken_near(place)
        edges = [
            edge
            for edge in self._known.graph.edges.values()
            if edge.established or (is_dubious and edge.traversals > 0)
        ]
        near = self._known.edges_near(edges, view.local_base, place) if edges else ()
        gaps = [gap for _, gap in near]
        if is_dubious:
            at = self._known.belief.map_base.transform(view.local_base.inverse().transform(place))
            gaps += [float(np.hypot(*(line - at).T).min()) for line in self._known.driven_parts]
        return any(gap < ON_EDGE_M for gap in gaps)


def _matched(
    bearings: tuple[float, ...], vertex: Vertex, theta: float, limit: float
) -> dict[int, int]:
    """By index of a bearing, rad, the key of the half-edge of a vertex turned by theta, rad."""
    turned = {key: half.bearing + theta for key, half in vertex.half_edges.items()}
    return match_bearings(bearings, turned, limit)
