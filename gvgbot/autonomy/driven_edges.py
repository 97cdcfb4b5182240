"""What the map learns from where the robot drives: edges that it has followed to their ends."""

import math
from collections import Counter, deque
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.autonomy.control.orders import ARRIVED_M
from gvgbot.autonomy.gvg.local import Branch, Place
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.autonomy.start_edge import StartEdge, is_at_start
from gvgbot.autonomy.topology import direction
from gvgbot.autonomy.views import Correspondence, View
from gvgbot.autonomy.whereabouts import LEAST_LOOP_M, Passage, Whereabouts
from gvgbot.geometry import Array, length_of, wrap_angle

_APART_M, _TOGETHER_M = 0.5, 0.2  # two ways that are farther apart, or no farther
_FROM_VERTEX_M = 1.0  # nearer to one there is no second one that was missed
_SAME_RAD = 0.7  # a departure is the one that the robot left by
_LEAST_PART_M, _MOST_STRAYS = 0.3, 100  # of an edge, that are worth telling
_LEAST_LEFT_M = 1.0  # beyond a vertex's disc: through a door and out of it
_LEAST_LOST_M = 1.0  # less than before: it does not only go back over it
_TIMES_MISSED = 3  # driven past without being found, a vertex is none
_SHUTTLE_S = 3.0  # more often, it only looks as if it came from one end to the other
_TIMES_TO_AND_FRO = 4  # an edge is believed that is not seen as one
_BESIDE_M = 1.0  # beyond its disc: who stands there may take a way from it out of sight
_IN_CLEAR_M = 2.0  # from a vertex, it is seen which departures it has


@dataclass(slots=True, eq=False)
class _Part:
    """Of an edge, as far as it was driven: lines (N, 2), m, in the frame of its vertex, and map."""

    line: Array
    narrowest: float
    map_line: Array = field(default_factory=lambda: np.empty((0, 2)))


class DrivenEdges:
    """Counts traversals, and joins the two ends of an edge that was driven out of sight."""

    def __init__(self, mapper: Mapper) -> None:
        self._mapper = mapper
        self.start: StartEdge | None = None
        self._parts: dict[HalfEdgeId, _Part] = {}  # by the half-edge that they leave by
        # from no vertex, now, and from vertices that were none: map frame, and least clearance
        self._loose: tuple[Array, float] | None = None
        self._strays: deque[tuple[Array, float]] = deque(maxlen=_MOST_STRAYS)
        self._missed = Counter[int]()  # how often vertices were driven past as if they were none
        # between two ends, how often and when, s, it went to and fro
        self._shuttles: dict[frozenset[HalfEdgeId], tuple[int, float]] = {}

    def learn(self, view: View, known: Correspondence, place: Place, where: Whereabouts) -> None:
        """Account for the robot's present place, `where` included."""
        where.on_edge = self._mapper.unsettled.current(where.on_edge)
        came_from = self._mapper.came_from
        while where.on_edge in came_from:  # the vertex that the present edge left was none
            where.rejoin(*came_from[where.on_edge])
        clearance = view.gvg.edges[place.edge].clearance_at(place.station)
        self._close_ring(view, where, clearance)
        passage = where.follow(view.gvg, place, known, view.local_base.position)
        if passage is not None:
            self._account_for(view, known, passage)
        self._close_at_end(view, known, place, where)
        self._close_start_edge(view, where, clearance)
        self._note_part(view, where)
        self._mapper.driven_parts = [line for line, _ in self.parts()]

    def parts(self) -> list[tuple[Array, float]]:
        """Parts of edges that were driven: lines (N, 2), m, map frame, and least clearances, m."""
        found = [(part.map_line, part.narrowest) for part in self._parts.values()]
        found += self._strays if self._loose is None else [*self._strays, self._loose]
        return [(line, narrowest) for line, narrowest in found if length_of(line) > _LEAST_PART_M]

    def _note_part(self, view: View, where: Whereabouts) -> None:
        """Keep what has been driven of the present edge, as long as it is none of the graph."""
        graph, belief, end = self._mapper.graph, self._mapper.belief, where.on_edge
        half = None if end is None else graph.half_edge(end)
        before, self._loose = self._loose, None
        if len(where.trail) > 1:
            line = np.array(where.trail)
            if end is None or half is None:  # perhaps its vertex was none
                map_local = belief.map_base.compose(view.local_base.inverse())
                self._loose = map_local.transform(line), where.narrowest
            else:
                line = graph.vertices[end.vertex].local.inverse().transform(line)
                if end not in self._parts or length_of(self._parts[end].line) < length_of(line):
                    self._parts[end] = _Part(line, where.narrowest)
        left_m = 0.0 if self._loose is None else length_of(self._loose[0])
        if before is not None and left_m < length_of(before[0]) - _LEAST_LOST_M:
            self._strays.append(before)  # it has turned round, or is on another edge
        for end, part in list(self._parts.items()):
            half = graph.half_edge(end)
            if half is None:  # its vertex was none
                self._strays.append((part.map_line, part.narrowest))
            if half is None or half.edge is not None:
                self._note_dead_end(end, part)
                del self._parts[end]
            else:
                part.map_line = belief.map_vertex(end.vertex).transform(part.line)

    def _note_dead_end(self, end: HalfEdgeId, part: _Part) -> None:
        """An edge to a dead end was driven, although its end was seen before the robot was there.

        It turns back then. If it left by a door, that may be hard to see from outside.
        """
        graph = self._mapper.graph
        edge = graph.edge_at(end)
        if edge is None or graph.vertices[edge.other(end).vertex].degree > 1:
            return
        if length_of(part.line) > graph.vertices[end.vertex].clearance + _LEAST_LEFT_M:
            edge.driven = True

    def _account_for(self, view: View, known: Correspondence, passage: Passage) -> None:
        """Count a traversal, or close the edge that was driven from a vertex now out of sight."""
        graph, left, arrived = self._mapper.graph, passage.left, passage.arrived
        if left is None and arrived is not None and self.start is None:
            line = graph.vertices[arrived.vertex].local.inverse().transform(passage.line)
            self.start = StartEdge(arrived, line, passage.narrowest)
            self._parts[arrived] = _Part(line, passage.narrowest)
            self._loose = None
        if left is None or arrived is None or left == arrived:
            return
        edge = graph.edge_at(left)
        if edge is None:
            self._close(view, known, left, arrived, passage)
            return
        between = edge.other(left).vertex
        comes_back = arrived.vertex == left.vertex != between  # round something, past its end
        if not (comes_back or self._leads_past(between, arrived)):
            self._mapper.unsettled.note_way(edge, arrived.vertex)
        edge.traversals += 1
        edge.doubted_since = None
        if graph.edge_at(arrived) is not None:
            self._note_missed(view, known, between, arrived)
        else:
            self._join_beyond(view, between, arrived, passage)

    def _close(
        self,
        view: View,
        known: Correspondence,
        left: HalfEdgeId,
        arrived: HalfEdgeId,
        passage: Passage,
    ) -> None:
        """Join the frontier that the robot left by to where it has arrived, unless sight will."""
        graph = self._mapper.graph
        far, near = graph.half_edge(arrived), graph.half_edge(left)
        if far is None or near is None:
            return
        before = graph.edge_at(arrived)
        if before is not None and before.other(arrived).vertex == left.vertex:
            if self._may_be_elsewhere(view, left.vertex):
                return
            graph.remove_half_edge(left)  # it is the one by which that edge is known to leave
        is_known = far.edge is not None
        are_seen = left in known.branch_of and passage.driven < LEAST_LOOP_M
        are_seen &= is_known or not self._mapper.is_reopened(left, arrived)
        if are_seen and (is_known or not self._goes_to_and_fro(view.stamp, left, arrived)):
            return  # both ends, so that their edge will be, unless something keeps it from that
        if _has_gone(left, view, known):
            return  # what the robot drove on was none, and it has come onto another edge
        if not is_known:
            self._mapper.join(view, left, arrived, passage.line, passage.narrowest, driven=True)
        elif graph.half_edge(left) is not None:
            self._join_fork(view, left, arrived, passage)

    def _close_at_end(
        self, view: View, known: Correspondence, place: Place, where: Whereabouts
    ) -> None:
        """Join the edge to a dead end in sight, when the robot has come from its vertex to the end.

        There is no other edge that it could come onto there, and a lone echo beside this one, as of
        glass, may keep sight from believing it.
        """
        left, graph, gvg = where.on_edge, self._mapper.graph, view.gvg
        out = None if left is None else known.branch_of.get(left)
        if left is None or out is None or out.edge != place.edge:
            return
        arrived, end = known.half_edge_of.get(Branch(out.edge, not out.forward)), gvg.end_of(out)
        away = math.dist(gvg.nodes[end].position, view.local_base.position)
        if not gvg.nodes[end].is_endpoint or arrived in (None, left) or away > ARRIVED_M:
            return
        if graph.edge_at(left) is None and graph.edge_at(arrived) is None:
            narrowest = float(gvg.edges[out.edge].clearance.min())
            self._mapper.join(view, left, arrived, gvg.leaving(out), narrowest, driven=True)

    def _may_be_elsewhere(self, view: View, vertex: int) -> bool:
        """Whether somebody beside a vertex may make it look as if it were, and edges with it."""
        place = self._mapper.in_local_frame(view, vertex).position
        within = self._mapper.graph.vertices[vertex].clearance + _BESIDE_M
        return view.is_doubtful(place, within)

    def _goes_to_and_fro(self, stamp: float, left: HalfEdgeId, arrived: HalfEdgeId) -> bool:
        """Whether the robot has come from one end to the other again and again."""
        ends = frozenset((left, arrived))
        times, latest = self._shuttles.get(ends, (0, -math.inf))
        if stamp - latest > _SHUTTLE_S:
            times += 1
            self._shuttles[ends] = times, stamp
        return times >= _TIMES_TO_AND_FRO

    def _leads_past(self, between: int, arrived: HalfEdgeId) -> bool:
        """Whether the known way to where the robot has arrived comes from a vertex before that."""
        edge = self._mapper.graph.edge_at(arrived)
        return edge is not None and edge.other(arrived).vertex == between != arrived.vertex

    def _note_missed(
        self, view: View, known: Correspondence, between: int, arrived: HalfEdgeId
    ) -> None:
        """Count that the robot found no vertex where the known way has one between its ends.

        Seen from elsewhere, through glass, there was one; who drives there again and again knows,
        unless somebody stands there.
        """
        is_seen = between in known.node_of or self._may_be_elsewhere(view, between)
        if is_seen or not self._leads_past(between, arrived):
            return
        self._missed[between] += 1
        if self._missed[between] >= _TIMES_MISSED:
            del self._missed[between]
            self._mapper.driven_past(view, self._mapper.graph.vertices[between])

    def _join_beyond(self, view: View, between: int, arrived: HalfEdgeId, passage: Passage) -> None:
        """Close the edge that goes on from a vertex which the robot drove past without finding it.

        Whether there is such a vertex or not: that is the way by which it came.
        """
        graph = self._mapper.graph
        if graph.half_edge(arrived) is None or arrived.vertex == between:
            return
        vertex = self._mapper.in_local_frame(view, between)
        away = np.hypot(*(passage.line - vertex.position).T)
        at = int(np.argmin(away))
        if away[at] > _FROM_VERTEX_M or at == len(passage.line) - 1:
            return
        line = passage.line[at:]
        bearing = wrap_angle(direction(line - line[0]) - vertex.theta)
        half_edges = graph.vertices[between].half_edges
        turns = {key: abs(wrap_angle(half.bearing - bearing)) for key, half in half_edges.items()}
        key = min(turns, key=turns.__getitem__, default=None)
        if key is not None and turns[key] < _SAME_RAD and half_edges[key].edge is None:
            end = HalfEdgeId(between, key)
            self._mapper.join(view, end, arrived, line, passage.narrowest, driven=True)

    def _join_fork(
        self, view: View, left: HalfEdgeId, arrived: HalfEdgeId, passage: Passage
    ) -> None:
        """Make a vertex where the robot came onto an edge that it knew from another drive.

        It was missed in passing: in a hall one of its ways may be behind what the laser sees. If
        that edge is all that the robot drove on, it passes the vertex that was left.
        """
        mapper = self._mapper
        edge = mapper.graph.edge_at(arrived)
        assert edge is not None
        known_line = mapper.in_local_frame(view, edge.a.vertex).transform(edge.polyline)
        known_line = known_line if edge.a == arrived else known_line[::-1]
        at = _fork(passage.line, known_line + (passage.line[-1] - known_line[0]))
        if at is None:
            mapper.part_edge_at(mapper.graph.vertices[left.vertex], left.key)
            return
        place = passage.line[at]
        away = np.hypot(*(mapper.positions_from(view.local_base) - place).T)
        if away.min() < _FROM_VERTEX_M:
            return
        on = int(np.argmin(np.hypot(*(known_line - place).T)))
        ways = (known_line[on::-1], known_line[on:], passage.line[at::-1])
        vertex = mapper.add_driven(view, place, *(direction(way - place) for way in ways))
        *known_ends, end = vertex.ends
        if any(mapper.graph.edge_at(known_end) is None for known_end in known_ends):
            mapper.remove(view, vertex, "it is on no edge")
            return
        mapper.join(view, left, end, passage.line[: at + 1], passage.narrowest, driven=True)

    def _close_ring(self, view: View, where: Whereabouts, clearance: float) -> None:
        """Give an edge without an end a vertex, when the robot has come round to its start.

        It may have come onto it later: what seemed to be an edge before was none.
        """
        if self._mapper.graph.vertices or not where.trail:
            return
        map_local = self._mapper.belief.map_base.compose(view.local_base.inverse())
        start = where.round_from(view.local_base.position)
        if self._is_round(where, map_local.transform(where.trail[0]), clearance):
            start = 0
        if start is not None:
            self._mapper.close_ring(view, np.array(where.trail[start:]), where.narrowest)

    def _close_start_edge(self, view: View, where: Whereabouts, clearance: float) -> None:
        """Join the edge that the robot started on, when it comes there from the other end."""
        start, on_edge, graph = self.start, where.on_edge, self._mapper.graph
        if start is None or on_edge is None or on_edge == start.end:
            return
        ends = (graph.half_edge(on_edge), graph.half_edge(start.end))
        if any(half is None or half.edge is not None for half in ends):
            return
        map_vertex = self._mapper.belief.map_vertex(start.end.vertex)
        if not self._is_round(where, map_vertex.transform(start.line[0]), clearance):
            return
        rest = self._mapper.in_local_frame(view, start.end.vertex).transform(start.line)
        line = np.concatenate([np.array(where.trail), rest])
        narrowest = min(where.narrowest, start.narrowest)
        self._mapper.join(view, on_edge, start.end, line, narrowest, driven=True)

    def _is_round(self, where: Whereabouts, start: Array, clearance: float) -> bool:
        """Whether the robot has come back to where it came onto its first edge (2,), map frame."""
        driven = where.trail_length > LEAST_LOOP_M
        return driven and is_at_start(self._mapper.belief, start, clearance)


def _fork(line: Array, known_line: Array) -> int | None:
    """The index of the point of a line (N, 2) where it comes onto another (M, 2); None if nowhere.

    The other begins where the line ends.
    """
    gaps = np.asarray(cKDTree(known_line).query(line)[0])
    apart = np.flatnonzero(gaps > _APART_M)
    if not len(apart) or len(line) - apart[-1] < 2:
        return None
    at = int(apart[-1] + np.argmax(gaps[apart[-1] :] < _TOGETHER_M))
    return at if gaps[at] < _TOGETHER_M else None


def _has_gone(end: HalfEdgeId, view: View, known: Correspondence) -> bool:
    """Whether the robot stands before a vertex, sees all of it, and does not see this departure.

    Who comes back to a vertex on a loop may have forgotten what is behind it.
    """
    key = known.node_of.get(end.vertex)
    if key is None or end in known.branch_of:
        return False
    node = view.gvg.nodes[key]
    if not node.settled:
        return False
    away = node.position - view.local_base.position
    return float(np.hypot(*away)) < _IN_CLEAR_M
