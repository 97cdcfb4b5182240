"""Where the robot is on the graph: the edge that it drives on, and from which vertex."""

import math
from dataclasses import dataclass, field

import numpy as np

from gvgbot.autonomy.gvg.local import Branch, LocalGvg, Place
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.autonomy.slam.recognition import match_bearings
from gvgbot.autonomy.views import Correspondence
from gvgbot.geometry import Array, Pose, length_of, stations_of, wrap_angle

LEAST_LOOP_M = 4.0  # a shorter way is none round anything
_STEP_M = 1.0  # from view to view, at most
_LOOP_M = 0.4  # a trail that comes this near to itself has been driven back
_AWAY_M = 0.7  # nearer to a vertex than this, the trail does not tell its edges apart
_LEFT_M, _ASIDE_M = (0.1, 0.8), 0.4  # past a vertex, and beside the way that leaves it
_BESIDE_M = 0.2, 1.5  # from the edge, the trail goes on beside the robot, on the edge
_ABREAST_M = 0.15  # along its edge, the robot came from neither side
_SAME_RAD = 0.7  # from its departure, the trail has come over that
_BACK_M = 0.8  # how far back along the trail one looks to tell ahead from behind


@dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """A change of edge: the half-edges that the old edge leaves and arrives by, its polyline."""

    left: HalfEdgeId | None
    arrived: HalfEdgeId | None
    line: Array  # (N, 2) local frame
    driven: float  # metres of it
    narrowest: float  # least clearance on it, m


@dataclass(slots=True, eq=False)
class Whereabouts:
    """The half-edge by which the robot's edge leaves its last vertex, and the way driven since."""

    on_edge: HalfEdgeId | None = None
    trail: list[Array] = field(default_factory=list)  # local frame, without detours
    narrowest: float = math.inf  # least clearance since the vertex, m
    _round_at: Array | None = None  # where the trail has come back to itself, local frame

    @property
    def has_come_round(self) -> bool:
        """Whether the robot has just driven round something, and so past a fork, on its edge."""
        return self._round_at is not None

    @property
    def trail_length(self) -> float:
        """Metres driven along the edge since its vertex."""
        return length_of(self._points)

    @property
    def _points(self) -> Array:
        """The trail (N, 2), local frame."""
        return np.array(self.trail).reshape(-1, 2)

    def leave(self) -> None:
        """Go another way from where it has come round."""
        self._round_at = None

    def has_come_by(self, point: Array) -> bool:
        """Whether the trail passes a point (2,), local frame."""
        return bool((np.hypot(*(self._points - point).T) < _LOOP_M).any())

    def way_back(self, base: Array) -> Array:
        """The way (N, 2) back over where the robot came from, from beside it to its vertex."""
        points = self._points
        return points[np.argmin(np.hypot(*(points - base).T)) :: -1] if len(points) else points

    def follow(
        self, gvg: LocalGvg, place: Place, known: Correspondence, base: Array
    ) -> "Passage | None":
        """Account for the robot's present place; the change of edge, if there was one.

        The base (2,) is in the local frame.
        """
        edge = gvg.edges[place.edge]
        ends = [
            (metres, known.half_edge_of[branch], branch)
            for branch, metres in (
                (Branch(place.edge, forward=True), place.station),
                (Branch(place.edge, forward=False), edge.length - place.station),
            )
            if branch in known.half_edge_of
        ]
        passage = None
        if ends and all(end != self.on_edge for _, end, _ in ends):
            _, end, out = min(ends)
            passage = self._passage(gvg, place, known, edge.a if out.forward else edge.b)
            line, rooms = gvg.line_from(place, (Branch(place.edge, not out.forward),))
            self.on_edge, self.trail, self._round_at = end, list(line[::-1]), None
            self.narrowest = float(rooms.min())
        station = int(np.searchsorted(edge.stations, place.station))
        foot = edge.polyline[min(station, len(edge.polyline) - 1)]
        here = foot if _BESIDE_M[0] < place.distance < _BESIDE_M[1] else base
        if self.on_edge is None and self._leaps_to(here):
            self.trail, self.narrowest = [], math.inf  # it has come onto another edge
        self.narrowest = min(self.narrowest, float(edge.clearance[station]))
        self._extend(here)
        return passage

    def round_from(self, base: Array) -> int | None:
        """Which point of the trail the robot is at once more, the way round that it has driven.

        None if it has not come round, or not along the trail. The base (2,) is in the local frame.
        """
        points = self._points
        away = np.hypot(*(points - base).T)
        if len(points) < 2 or away[-1] > _STEP_M:
            return None
        since = stations_of(points[::-1])[::-1]
        found = np.flatnonzero((since > LEAST_LOOP_M) & (away < _LOOP_M))
        return int(found[np.argmin(away[found])]) if len(found) else None

    def depart(self, end: HalfEdgeId, vertex: Array, bearing: float, base: Array) -> None:
        """Be on the edge that leaves a vertex (2,) in a direction, if the robot is just past that.

        For vertices that are out of sight: those that are in sight are noticed by `follow`.
        """
        along, aside = Pose(theta=bearing).inverse().transform(base - vertex)
        if _LEFT_M[0] < along < _LEFT_M[1] and abs(aside) < _ASIDE_M:
            self.on_edge, self.trail, self.narrowest = end, [vertex, base], math.inf

    def turn_round(self, heading: float | None = None) -> bool:
        """Let what was ahead be behind, on an edge of which no vertex is known; whether it is now.

        It takes some way to tell them apart, or a heading, rad, local frame.
        """
        if self.on_edge is not None or not self.trail:
            return False
        base = self.trail[-1]
        away = np.hypot(*(self._points - base).T)
        came = self.trail[int(np.argmin(np.abs(away - _BACK_M)))]
        if len(self.trail) < 2:
            if heading is None:
                return False
            came = base - _BACK_M * np.array([math.cos(heading), math.sin(heading)])
        self.trail = [2 * base - came, base]
        return True

    def rejoin(self, end: HalfEdgeId, line: Array) -> None:
        """Be on the edge that begins at another end, which a line (N, 2), local frame, comes from.

        The vertex at which the present edge began, where the line ends, is none.
        """
        since, self.trail, self.on_edge = self.trail, list(line), end
        for point in since:
            self._extend(point)

    def _passage(self, gvg: LocalGvg, place: Place, known: Correspondence, node: int) -> Passage:
        centre = gvg.nodes[node].position
        trail = self._points
        d = np.hypot(*(trail - centre).T)
        is_loop = len(trail) > 0 and d[0] < _AWAY_M  # it starts at the node, too
        farthest = int(np.argmax(d)) if is_loop else 0
        if len(trail) and d[farthest:].min() < _AWAY_M:  # the robot is past the node already
            trail = trail[: farthest + int(np.argmin(d[farthest:])) + 1]
            rest, rooms = centre[None], np.array([gvg.nodes[node].clearance])
        else:
            towards = Branch(place.edge, forward=node == gvg.edges[place.edge].b)
            rest, rooms = gvg.line_from(place, (towards,))
        driven = length_of(trail)
        arrived = self._arrival(gvg, place, known, node, trail)
        narrowest = min(self.narrowest, float(rooms.min()))
        return Passage(self.on_edge, arrived, np.concatenate([trail, rest]), driven, narrowest)

    def _arrival(
        self, gvg: LocalGvg, place: Place, known: Correspondence, node: int, trail: Array
    ) -> HalfEdgeId | None:
        """The half-edge by which a trail came to a node, or comes to it if that is ahead.

        It may have come through points that are no vertices (yet). Who has not been away, or has
        come back over its way, comes by where it left.
        """
        away = np.hypot(*(trail - gvg.nodes[node].position).T) > _AWAY_M
        left = self.on_edge
        if left is not None and left.vertex == known.vertex_of.get(node) and not away.any():
            return left
        outside = trail[away][-1:]  # the last point there
        came_over = gvg.place(outside[0]) if len(outside) else None
        if came_over is None or came_over.distance > _AWAY_M:
            if len(outside) and not away[-1]:
                return _half_edge_towards(outside[0], gvg, known, node)
            came_over = place
        _, path = gvg.routes(came_over).get(node, (0.0, ()))
        if not path or any(gvg.end_of(branch) in known.vertex_of for branch in path[:-1]):
            return None
        return known.half_edge_of.get(Branch(path[-1].edge, not path[-1].forward))

    def _leaps_to(self, point: Array) -> bool:
        """Whether what lies between the trail and a point was not driven.

        Between two edges, now one is nearer and now the other.
        """
        return bool(self.trail) and bool(np.hypot(*(self.trail[-1] - point)) > _STEP_M)

    def _extend(self, point: Array) -> None:
        if len(self.trail) > 3:
            d = np.hypot(*(self._points - point).T)
            back = int(np.argmax(d < _LOOP_M))
            if d[back] < _LOOP_M and back < len(self.trail) - 3:
                if length_of(np.array(self.trail[back:])) > LEAST_LOOP_M:
                    self._round_at = point
                del self.trail[back + 1 :]
        if self._round_at is not None and np.hypot(*(self._round_at - point)) > _STEP_M:
            self._round_at = None
        if not self.trail or np.hypot(*(self.trail[-1] - point)) > 0.1:
            self.trail.append(point)

    def backwards(
        self, gvg: LocalGvg, place: Place, known: Correspondence, local_base: Pose
    ) -> Branch:
        """The way along the robot's local edge to the vertex that its edge leaves from."""
        out = None if self.on_edge is None else known.branch_of.get(self.on_edge)
        if out is not None and out.edge == place.edge:
            return Branch(out.edge, not out.forward)
        edge = gvg.edges[place.edge]
        i = min(int(np.searchsorted(edge.stations, place.station)), len(edge.polyline) - 2)
        along = edge.polyline[i + 1] - edge.polyline[i]
        if len(self.trail) > 1:
            points = self._points
            back = stations_of(points[::-1])[1:]
            came = points[len(points) - 2 - min(int(np.searchsorted(back, _BACK_M)), len(back) - 1)]
            d = np.hypot(*(edge.polyline - came).T)
            offset = float(edge.stations[int(np.argmin(d))]) - place.station
            if abs(offset) < _ABREAST_M:  # it came from beside: the same answer however it turns
                offset = float((came - local_base.position) @ along)
            return Branch(place.edge, forward=offset > 0)
        same = abs(wrap_angle(math.atan2(along[1], along[0]) - local_base.theta)) < math.pi / 2
        return Branch(place.edge, forward=not same)


def _half_edge_towards(
    point: Array, gvg: LocalGvg, known: Correspondence, node: int
) -> HalfEdgeId | None:
    """The half-edge that leaves a node towards a point (2,) to which no known way leads."""
    x, y = point - gvg.nodes[node].position
    branches, clearance = gvg.nodes[node].branches, gvg.nodes[node].clearance
    bearings = {i: gvg.bearing(branch, clearance) for i, branch in enumerate(branches)}
    matched = match_bearings((math.atan2(y, x),), bearings, _SAME_RAD)
    return known.half_edge_of.get(branches[matched[0]]) if matched else None
