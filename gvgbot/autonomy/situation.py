"""The robot on what it sees and on what it knows, and the ways from there."""

import math
from dataclasses import dataclass

import numpy as np

from gvgbot.autonomy.exploration.access import Access
from gvgbot.autonomy.exploration.paths import Approach, first_arrival, shortest_path
from gvgbot.autonomy.gvg.local import Branch, LocalGvg, LocalNode, Place
from gvgbot.autonomy.slam.graph import Edge, GvgGraph, HalfEdgeId
from gvgbot.autonomy.views import Correspondence
from gvgbot.autonomy.whereabouts import Whereabouts
from gvgbot.geometry import Array, Pose, wrap_angle

_PAST_M = 0.5  # a vertex: to turn back to it would be in vain


@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """The robot on the local GVG and on the graph at one keyframe."""

    gvg: LocalGvg
    known: Correspondence
    graph: GvgGraph
    where: Whereabouts
    access: Access
    local_base: Pose
    doubted: frozenset[int] = frozenset()  # nodes that may be there for a while only
    in_team: bool = False  # who stands in a room may be a robot that has nothing left to do

    @property
    def place(self) -> Place:
        """Where on the local GVG the robot is."""
        return self.access.place

    def starts(self, closed: HalfEdgeId | None = None) -> list[Approach]:
        """The first vertices that the robot can reach along the edge it is on.

        Not those that it would arrive at by a half-edge before which something stands.
        """
        routes = self.gvg.routes(self.place)
        found = []
        for node, vertex in self.known.vertex_of.items():
            if node not in routes:
                continue
            metres, path = routes[node]
            passed = {self.gvg.end_of(branch) for branch in path[:-1]}
            if not passed & self.known.vertex_of.keys():
                arrival = self.known.half_edge_of.get(Branch(path[-1].edge, not path[-1].forward))
                found.append(Approach(metres, arrival or HalfEdgeId(vertex, -1)))
        found += self._out_of_sight({a.arrival for a in found}, closed)
        shut = () if closed is None else (closed, HalfEdgeId(closed.vertex, -1))
        return [a for a in found if a.arrival not in shut]

    def _out_of_sight(self, in_sight: set[HalfEdgeId], closed: HalfEdgeId | None) -> list[Approach]:
        """The ends of the robot's edge that the local map no longer, or not yet, shows."""
        end = self.where.on_edge
        half = None if end is None else self.graph.half_edge(end)
        if end is None or half is None:
            return []
        driven, edge = self.where.trail_length, self.graph.edge_at(end)
        found = (
            []
            if self._is_walled(edge, end, 0.0, max(0.0, driven - _PAST_M))
            else [Approach(driven, end)]
        )
        is_shut = closed != end and half.blocked
        if edge is not None and not is_shut and not self._is_walled(edge, end, driven, math.inf):
            found.append(Approach(max(0.0, edge.length - driven), edge.other(end)))
        if self._loop_ends():
            return [a for a in found if a.arrival not in in_sight]
        vertices = {arrival.vertex for arrival in in_sight}
        return [a for a in found if a.arrival.vertex not in vertices]

    def _is_walled(self, edge: Edge | None, end: HalfEdgeId, begin: float, to: float) -> bool:
        """Whether a virtual wall crosses an edge between two places, m from one of its ends."""
        if edge is None:
            return False
        if end == edge.b:
            begin, to = edge.length - begin, edge.length - to
        return self.graph.is_walled(edge, begin, to)

    def _loop_ends(self) -> tuple[HalfEdgeId, ...]:
        """The half-edges of the robot's edge if that comes back to its vertex."""
        edge = None if self.where.on_edge is None else self.graph.edge_at(self.where.on_edge)
        return (edge.a, edge.b) if edge is not None and edge.a.vertex == edge.b.vertex else ()

    def path_to(self, target: HalfEdgeId) -> tuple[Branch, ...] | None:
        """Branches to drive, as far as they are in sight, towards and into a frontier."""
        if self.where.on_edge == target:
            return self._extended((self._away_from(target),))
        starts = self.starts()
        approach = shortest_path(self.graph, starts, target.vertex)
        if approach is None:
            return None
        return self.path_over(first_arrival(starts, approach), (*approach.departures, target))

    def departures_to(self, target: HalfEdgeId) -> tuple[HalfEdgeId, ...] | None:
        """By which half-edges a frontier is reached, first vertex first; None without a way."""
        approach = shortest_path(self.graph, self.starts(), target.vertex)
        return None if approach is None else (*approach.departures, target)

    def path_over(
        self, arrival: HalfEdgeId, departures: tuple[HalfEdgeId, ...]
    ) -> tuple[Branch, ...] | None:
        """Branches to drive, as far as they are in sight, to a vertex and on over departures.

        It arrives there by a half-edge.
        """
        path = self._to_end(arrival)
        if path is None:
            return None
        is_in_sight = self.gvg.end_of(path[-1]) == self.known.node_of.get(arrival.vertex)
        for departure in departures if is_in_sight else ():
            branch = self.known.branch_of.get(departure)
            if branch is None:
                break
            path = (branch,) if self._is_past(path, branch) else (*path, branch)
            if self.gvg.end_of(branch) not in self.known.vertex_of:
                return self._extended(path)
        return path

    def _is_past(self, path: tuple[Branch, ...], branch: Branch) -> bool:
        """Whether the robot is so little past a vertex on this branch that it need not go back."""
        edge = self.gvg.edges[branch.edge]
        past = self.place.station if branch.forward else edge.length - self.place.station
        return path == (Branch(branch.edge, not branch.forward),) and past < _PAST_M

    def along_own_edge(self, *, ahead: bool) -> tuple[Branch, ...]:
        """Along the present edge, away from the vertex that it leaves from, or back to it."""
        end = self.where.on_edge
        assert end is not None, "no edge to drive along"
        return self._extended((self._away_from(end) if ahead else self._back(),))

    def _back(self) -> Branch:
        return self.where.backwards(self.gvg, self.place, self.known, self.local_base)

    def line_along(self, path: tuple[Branch, ...]) -> tuple[Array, Array]:
        """What to drive to the place and on along a path: points (N, 2), m, and clearance (N,)."""
        line, room = self.gvg.line_from(self.place, path)
        return np.vstack([self.access.line, line]), np.concatenate([self.access.room, room])

    def ahead(self) -> tuple[Branch, ...]:
        """Straight on along the present edge, as far as it is in sight."""
        back = self._back()
        return self._extended((Branch(back.edge, not back.forward),))

    def astern(self) -> tuple[Branch, ...]:
        """Back along the present edge, as far as it is in sight."""
        return self._extended((self._back(),))

    def _away_from(self, end: HalfEdgeId) -> Branch:
        branch = self.known.branch_of.get(end)
        if branch is not None and branch.edge == self.place.edge:
            return branch
        back = self._back()
        return Branch(back.edge, not back.forward)

    def _to_end(self, arrival: HalfEdgeId) -> tuple[Branch, ...] | None:
        """To a vertex by its half-edge, for other ways that are in sight may lead there too."""
        node = self.known.node_of.get(arrival.vertex)
        if node is not None:
            _, path = self.gvg.routes(self.place).get(node, (0.0, ()))
            end = self._end_of(path)
            if arrival == end or (end is None and arrival not in self._loop_ends()):
                return path or None
        return self.astern() if arrival == self.where.on_edge else self.ahead()

    def _end_of(self, path: tuple[Branch, ...]) -> HalfEdgeId | None:
        """The half-edge that a path arrives by, if that is known."""
        last = path[-1] if path else None
        return last and self.known.half_edge_of.get(Branch(last.edge, not last.forward))

    def _extended(self, path: tuple[Branch, ...]) -> tuple[Branch, ...]:
        """The path and on through points that are no vertices, to the end of what is in sight."""
        while True:
            end = self.gvg.end_of(path[-1])
            node = self.gvg.nodes[end]
            if end in self.known.vertex_of or (node.degree != 2 and end not in self.doubted):
                return path
            arrived = Branch(path[-1].edge, not path[-1].forward)
            onwards = [b for b in node.branches if b not in node.weak and b != arrived]
            if not onwards:
                return path
            straight = self.gvg.bearing(arrived, node.clearance) + math.pi
            onward = min(
                onwards, key=lambda b: (self._leads_back(b), self._turn(b, node, straight))
            )
            if any(b.edge == onward.edge for b in path):
                return path
            path = (*path, onward)

    def _leads_back(self, branch: Branch) -> bool:
        """Whether a branch ends where the robot has come from: as one round another one does."""
        end = self.gvg.nodes[self.gvg.end_of(branch)].position
        return self.in_team and self.where.has_come_by(end)

    def _turn(self, branch: Branch, node: LocalNode, straight: float) -> float:
        """How much a branch turns away from straight on, rad."""
        return abs(wrap_angle(self.gvg.bearing(branch, node.clearance) - straight))
