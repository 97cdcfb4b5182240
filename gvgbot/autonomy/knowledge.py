"""What is known of the building: the belief and the graph, and what they say of a place."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.gvg.reduction import KnownVertices
from gvgbot.autonomy.slam import ekf
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.graph import Edge, GvgGraph, Vertex
from gvgbot.autonomy.views import Observation, View
from gvgbot.autonomy.virtual_walls import crossings
from gvgbot.geometry import Array, Pose

ON_EDGE_M = 0.5  # what is nearer to an edge stands on it


@dataclass(slots=True, eq=False)
class Knowledge:
    """What is known: the belief, the graph, and the observations of its vertices.

    `driven_parts` are lines (N, 2), map frame, along edges that were driven, not yet to their ends.
    """

    belief: Belief = field(default_factory=Belief)
    graph: GvgGraph = field(default_factory=GvgGraph)
    observations: list[Observation] = field(default_factory=list)
    driven_parts: list[Array] = field(default_factory=list)
    virtual_walls: Array = field(default_factory=lambda: np.empty((0, 2)))  # points, map frame

    def map_in_local(self, local_base: Pose) -> Pose:
        """The pose of the map frame in the local one; the name `local_map` is that of a grid."""
        return local_base.compose(self.belief.map_base.inverse())

    def positions_from(self, local_base: Pose) -> Array:
        """Where the vertices are (N, 2), local frame, in the order of the belief's ids."""
        return self.map_in_local(local_base).transform(self.belief.positions)

    def in_local_frame(self, view: View, vertex: int) -> Pose:
        """Where a vertex, seen lately or not, stands in the local frame."""
        return view.local_base.compose(ekf.expected(self.belief, vertex)[0])

    def known_around(self, local_base: Pose, within_m: float) -> KnownVertices:
        """The vertices around the base, seen lately or not, in the local frame."""
        positions = self.positions_from(local_base)
        near = np.hypot(*(positions - local_base.position).T) < within_m
        degrees = np.array(
            [self.graph.vertices[self.belief.ids[i]].degree for i in np.flatnonzero(near)], int
        )
        return KnownVertices(positions[near], degrees)

    def marked(self, gvg: LocalGvg, local_base: Pose) -> tuple[LocalGvg, dict[int, Vertex]]:
        """A local GVG with nodes where vertices should be that are nothing to see, and these.

        That is the vertex of a ring, and one at a door that a virtual wall shuts.
        """
        marks = {}
        for vertex in [*self.graph.rings(), *self.graph.walled_up()]:
            vertex.local = local_base.compose(ekf.expected(self.belief, vertex.id)[0])
            place = gvg.place(vertex.local.position)
            if place is None or place.distance > vertex.clearance:
                continue
            if vertex.degree > 2 and gvg.is_meetpoint_near(vertex.local.position, vertex.clearance):
                continue
            if gvg.may_divide(place):
                gvg, node = gvg.divided(place)
                marks[node] = vertex
        return gvg, marks

    def is_way(self, local_base: Pose, place: Array) -> bool:
        """Whether a known edge passes a place (2,), local frame, nearer than any wall of its."""
        edges = self.edges_near(self.graph.edges.values(), local_base, place)
        return any(gap < edge.min_clearance for edge, gap in edges)

    def edges_near(
        self, edges: Iterable[Edge], local_base: Pose, place: Array
    ) -> Iterator[tuple[Edge, float]]:
        """Those edges that may pass a place (2,), local frame, and how near to it they do, m."""
        x, y = self.belief.map_base.transform(local_base.inverse().transform(place))
        starts = dict(zip(self.belief.ids, self.belief.positions.tolist(), strict=True))
        for edge in edges:
            within = edge.length + max(edge.min_clearance, ON_EDGE_M)
            if math.dist(starts[edge.a.vertex], (x, y)) < within:
                line = self.belief.map_vertex(edge.a.vertex).transform(edge.polyline)
                yield edge, float(np.hypot(*(line - [x, y]).T).min())

    def heed(self, virtual_walls: Array) -> None:
        """Note over which of its edges virtual walls lie now, as points (N, 2), map frame."""
        self.virtual_walls, self.graph.walled = virtual_walls, {}
        if not len(virtual_walls):
            return
        edges = self.graph.edges.values()
        lines = [self.belief.map_vertex(e.a.vertex).transform(e.polyline) for e in edges]
        for edge, at in zip(edges, crossings(virtual_walls, lines), strict=True):
            if at:
                self.graph.walled[edge.id] = at

    def establish(self) -> None:
        """Take the map for the building: what speaks against it must do so for long, from now on.

        Otherwise every door that is shut for an hour would take vertices along.
        """
        for vertex in self.graph.vertices.values():
            vertex.established = True
        for edge in self.graph.edges.values():
            edge.established = True
