"""What later vertices decide: which new ones are known ones, and whether a closure was right."""

from dataclasses import replace

import numpy as np

from gvgbot.autonomy.events import (
    ClosureRevoked,
    DoubtSettled,
    Event,
    PlaceDoubted,
    VertexRemoved,
)
from gvgbot.autonomy.knowledge import Knowledge
from gvgbot.autonomy.recogniser import Recognition
from gvgbot.autonomy.revocable import Revocable
from gvgbot.autonomy.slam import ekf
from gvgbot.autonomy.slam.doubts import NEW_PER_M2, SAME, Doubt, Doubts, habit_density
from gvgbot.autonomy.slam.graph import Edge, HalfEdgeId, Vertex
from gvgbot.autonomy.slam.names import Names
from gvgbot.autonomy.slam.trail import Laid
from gvgbot.autonomy.topology import fuse
from gvgbot.geometry import Array, Pose, wrap_angle


class Unsettled:
    """Decides, and corrects what is known by it.

    A reading of the latest vertices must cost less than any other by a margin (minus twice the log
    likelihood); departures within `same_bearing`, rad, are the same.
    """

    def __init__(self, known: Knowledge, *, margin: float, same_bearing: float) -> None:
        self._known, self._margin, self._same_bearing = known, margin, same_bearing
        self._doubts = Doubts()
        self._has_news = False  # on what is in doubt
        self._revocable: Revocable | None = None
        self.is_wary = False  # no closure without the next vertices
        self.names = Names()

    # -- what happens meanwhile ----------------------------------------------------------------

    def note_move(self, motion: Pose, covariance: Array, laid: Laid | None) -> None:
        """Learn of a motion of the base, as `trail.move` does."""
        if self._revocable is not None:
            self._revocable.move(motion, covariance, laid)

    def note_closure(self, vertex: Vertex, *, is_surprising: bool) -> None:
        """Learn that a vertex is about to close a loop; it may be revoked if that moves much."""
        self._has_news = True
        if self._revocable is None and is_surprising:
            self._be_ready_to_revoke(vertex)

    def note_way(self, edge: Edge, arrived: int) -> None:
        """Learn to which vertex an edge that was known has led the robot.

        It speaks for the latest closure, or against it if the edge was known before. What may be
        an end of the edge speaks only when it proves to be none.
        """
        if self._revocable is None or edge.id not in self._revocable.graph.edges:
            return
        ends = {edge.a.vertex, edge.b.vertex}
        if arrived in ends:
            self._revocable = None
        elif ends & set(self._doubts.rivals(arrived)):
            self._revocable.witnesses.add(arrived)
        else:
            self._revocable.is_contradicted = True

    def doubt(self, vertex: Vertex, found: Recognition, stamp: float) -> list[Event]:
        """Keep in mind which known vertices a new one may be."""
        self._doubts.note(Doubt(vertex.id, found.rivals, found.density))
        self._has_news = True
        return [
            PlaceDoubted(stamp, vertex.id, known, cost, found.novelty)
            for known, cost in zip(found.rivals, found.costs, strict=True)
        ]

    def forget(self, vertex: int) -> None:
        """A vertex is no more."""
        self._doubts.forget(vertex)

    def take_for_granted(self) -> None:
        """Revoke the latest closure no more."""
        self._revocable = None

    def current(self, end: HalfEdgeId | None) -> HalfEdgeId | None:
        """What a half-edge is called now: its vertex may have proved to be a known one."""
        return None if end is None else self.names.half_edge(end)

    # -- which of the known ones it is after all -----------------------------------------------

    def settle(self, stamp: float) -> list[Event]:
        """Take for one what proves to be one, by all that was found since; what happened."""
        if not self._has_news or not self._doubts.recent:
            return []
        self._has_news = False
        known, graph = self._known, self._known.graph
        self._doubts.recent = [
            replace(doubt, habit=self._habit(doubt.vertex)) for doubt in self._doubts.recent
        ]
        reach = {v.id: graph.reach(v) for v in graph.vertices.values()}
        verdict = self._doubts.weigh(known.belief, reach, self._margin)
        if verdict is None:
            return []
        self._has_news = True  # the others may be certain now
        self.is_wary = False
        settled = DoubtSettled(stamp, verdict.vertex, verdict.known, verdict.margin, None)
        if verdict.known is None:
            self._doubts.believe(verdict.vertex)
            if self._revocable is not None and verdict.vertex in self._revocable.witnesses:
                self._revocable.is_contradicted = True
            return [settled]
        kept, gone = (graph.vertices[v] for v in (verdict.known, verdict.vertex))
        off = known.belief.map_vertex(kept.id).distance(known.belief.map_vertex(gone.id))
        self._be_ready_to_revoke(kept)
        self._unite(kept, gone)
        removed = VertexRemoved(stamp, gone.id, f"it is vertex {kept.id}")
        return [removed, replace(settled, offset_m=off)]

    def _habit(self, vertex: int) -> float:
        """How dense, 1/m^2, new vertices are where this one is, by the edges of the map."""
        doubted = {doubt.vertex for doubt in self._doubts.recent}
        belief, ways, own = self._known.belief, list[Array](), list[Array]()
        for edge in self._known.graph.edges.values():
            a, b = edge.a.vertex, edge.b.vertex
            way = belief.map_vertex(b).position - belief.map_vertex(a).position
            if vertex in (a, b):
                own.append(way if vertex == b else -way)
            elif not {a, b} & doubted:
                ways += [way, -way]
        known = np.array(ways).reshape(-1, 2)
        return max((habit_density(way, known) for way in own), default=0.0)

    def _unite(self, kept: Vertex, gone: Vertex) -> None:
        """Make one vertex of two.

        That they are one tells how their frames are turned better than anything before.
        """
        known = self._known
        both = ekf.coincide(known.belief, kept.id, gone.id, SAME)
        turn = wrap_angle(both.map_vertex(gone.id).theta - both.map_vertex(kept.id).theta)
        known.belief = ekf.remove_vertex(both, gone.id)
        if gone.seen_at > kept.seen_at:
            kept.local = gone.local.compose(Pose(theta=-turn))
            kept.seen_at, kept.updated_at = gone.seen_at, gone.updated_at
        kept.visits += gone.visits
        kept.reached |= gone.reached
        fused = fuse(known.graph, kept, gone, Pose(theta=turn), self._same_bearing)
        self.names.change(fused.renamed)
        known.observations[:] = [
            replace(seen, vertex=kept.id, R=seen.R[:2, :2]) if seen.vertex == gone.id else seen
            for seen in known.observations
        ]
        self._doubts.unite(kept.id, gone.id)
        for twins in fused.twins:
            older, newer = sorted(twins)
            self._doubts.note(Doubt(newer, (older,), NEW_PER_M2))

    # -- whether a closure was right -----------------------------------------------------------

    def _be_ready_to_revoke(self, vertex: Vertex) -> None:
        """Keep what is believed, before it is corrected by a closure at a vertex."""
        known = self._known
        doubts, names = self._doubts.recent, self.names.now
        self._revocable = Revocable.before(
            vertex.id, known.belief, known.graph, doubts, known.observations, names
        )

    def revoke(self, stamp: float) -> list[Event]:
        """Go back to before the latest closure, if it is contradicted; what happened."""
        was, known = self._revocable, self._known
        if was is None or not was.is_contradicted:
            return []
        added = sorted(known.graph.vertices.keys() - was.graph.vertices.keys())
        known.graph, known.belief = was.regained(known.graph), was.belief
        known.observations[:] = was.observations
        self._doubts.recent = was.doubts
        self._doubts.refute(was.vertex)
        self._revocable, self.is_wary = None, True
        self.names.now = was.names
        gone = [VertexRemoved(stamp, vertex, "a closure was revoked") for vertex in added]
        return [ClosureRevoked(stamp, was.vertex), *gone]
