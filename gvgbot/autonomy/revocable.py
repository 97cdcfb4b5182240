"""What was believed before a closure, in case the next vertices contradict it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from gvgbot.autonomy.slam import trail
from gvgbot.autonomy.slam.doubts import Doubt
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId
from gvgbot.autonomy.slam.trail import Laid
from gvgbot.autonomy.views import Observation
from gvgbot.geometry import Array, Pose


@dataclass(slots=True, eq=False)
class Revocable:
    """A closure at a vertex, and what there was before it; the belief moves on with the robot."""

    vertex: int
    belief: Belief
    graph: GvgGraph
    doubts: list[Doubt]
    observations: list[Observation]
    names: Mapping[HalfEdgeId, HalfEdgeId]  # what half-edges were called, by their first names
    is_contradicted: bool = False  # by a way that led elsewhere
    witnesses: set[int] = field(default_factory=set)  # vertices that contradict it if they are new

    @classmethod
    def before(
        cls,
        vertex: int,
        belief: Belief,
        graph: GvgGraph,
        doubts: Sequence[Doubt],
        observations: Sequence[Observation],
        names: Mapping[HalfEdgeId, HalfEdgeId],
    ) -> "Revocable":
        """As things are, just before a closure."""
        own = replace(belief, P=belief.P.copy())
        return cls(vertex, own, graph.copied(), list(doubts), list(observations), names)

    def move(self, motion: Pose, covariance: Array, laid: Laid | None) -> None:
        """Believe what would be believed without the closure, and without what is seen since."""
        self.belief = trail.move(self.belief, motion, covariance, laid)

    def regained(self, now: GvgGraph) -> GvgGraph:
        """The graph of then, with what has nothing to do with the closure as it is now.

        That is which ways are closed, of those that are left, and which names have been given.
        """
        graph = self.graph
        graph.serial = now.serial
        for vertex in graph.vertices.values():
            if vertex.id in now.vertices:
                vertex.serial = max(vertex.serial, now.vertices[vertex.id].serial)
            for key, half in vertex.half_edges.items():
                present = now.half_edge(HalfEdgeId(vertex.id, key))
                half.blocked = present is not None and present.blocked
        return graph
