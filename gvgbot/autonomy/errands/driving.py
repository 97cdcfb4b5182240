"""Driving to one stop: along known ways, round what stands in them, and when it is over."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gvgbot.autonomy.control.edge_follower import Track
from gvgbot.autonomy.control.orders import Drive, LookAround, Order, Stand
from gvgbot.autonomy.destinations import (
    NOWHERE,
    Foot,
    Route,
    foot_at,
    foot_of,
    route_to_foot,
    route_to_vertex,
)
from gvgbot.autonomy.errands.ground import AT_VERTEX_M, Ground
from gvgbot.autonomy.errands.kinds import Home, Look, Rest, Stop, ToPoint, ToVertex, Waypoint
from gvgbot.autonomy.events import Event, Recovery
from gvgbot.autonomy.exploration.access import bent_way, straight_way, way_to_edge
from gvgbot.autonomy.exploration.certainty import robot_sigma
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.keyframes import has_come_on
from gvgbot.autonomy.situation import Situation
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.autonomy.views import Correspondence, View
from gvgbot.geometry import Array, Pose, length_of, wrap_angle

DIRECT_M = 4.0  # off a point, one drives there straight, or with one bend
_ACROSS_M, _OPEN_M = 8.0, 1.0  # as far from where the edges end, with so much room on both sides
_THERE_M = 0.15  # from a destination, one has arrived
_PAST_M = 0.5  # from a stop at which one does not stop
_ALMOST_M = 0.6  # as well, where one cannot come nearer
_SHORT_M = 0.3  # a track so short leads nowhere
_PROGRESS_M = 0.3
_TURNED_RAD, _AHEAD_M = 0.3, 0.4  # less to turn to where its track leads, so far ahead
_STIRS_M, _STIRS_RAD = 0.05, 0.1  # who moves less stands
_SURE_M = 0.4  # of a place that was found again
_BESIDE_RAD = 0.5  # who stands before a place hides no more on either side of it
_LOOKS = 2  # around, before giving up
_UNSEEN_LOOKS = 3, 15  # at where an edge should leave: before it waits, and gives that up
_THROUGH_RAD = 0.8  # an edge that leaves so near to where one is seen is that one
_LONGEST_VIEW_S = 2.0  # a longer gap between views is an outage, not a lack of progress


@dataclass(frozen=True, slots=True)
class Ended:
    """How driving to a stop ended, and what there is to say about it."""

    outcome: Literal["arrived", "given up"]
    reason: str


class Driving:
    """The way to one stop; one that `explores` looks for it where no known way leads there."""

    def __init__(
        self, stop: Stop, ground: Ground, config: ExplorationConfig, *, explores: bool
    ) -> None:
        self.stop, self._ground, self.config = stop, ground, config
        self._mapper = ground.mapper
        self.happened: list[Event] = []  # whoever tells of it takes it out
        self._began: float | None = None  # stamp
        self._closed: HalfEdgeId | None = None  # something stands between it and the robot
        self._route: Route | None = None  # that is being driven
        self._nearest_m: dict[bool, float] = {}  # least that was left of it, and straight on
        self._straight_m = math.inf  # so long a way straight on is not driven
        self._goes_round = False  # by the edges, what stood in the way straight on
        self._least_turn = math.inf  # rad, that was left to the track since it came nearer
        self._looks = 0
        self._unseen = 0  # looks at where the route goes on, without seeing that
        self._is_looking = self._is_obstructed = False
        self._is_off = True  # the ways it knows, and looks for one; else coming nearer counts
        self._may_explore, self._explores = explores, False
        self._progress = self._stood = -math.inf  # stamps: since when it has made none, and stands
        self._place: Pose | None = None  # where it stands
        self._last_view = -math.inf  # stamp
        self._travelled_then = -math.inf
        self._budget_m = math.inf  # of `travelled`

    def obstruct(self) -> None:
        """Note that there is no way on."""
        self._is_obstructed = True

    def advance(self, view: View, known: Correspondence) -> Order | Ended:
        """The order for the next keyframe interval, or how it ended."""
        if self._began is None:
            self._begin(view)
        if view.travelled > self._budget_m:
            return Ended("given up", "driven too far without reaching it")
        waited = self._waited(view)
        if self._is_obstructed or waited > self.config.in_the_way_s:
            ended = self._close_way(view)
            if ended is not None:
                return ended
        order = self._order(view, self._ground.situation(view, known))
        if isinstance(order, Drive):
            self._turn_to(view, order.track)
        return order

    def _order(self, view: View, here: Situation | None) -> Order | Ended:
        names = self._mapper.unsettled.names
        match self.stop:
            case Look():
                return self._look_once(view)
            case Rest(seconds=seconds):
                return self._rest(view, seconds)
            case ToVertex(vertex=vertex):
                return self._to_vertex(view, here, names.vertex(vertex))
            case Waypoint(end=end, station=station):
                foot = foot_at(self._mapper.graph, names.half_edge(end), station)
                return self._past(view, here, foot)
            case ToPoint() | Home():
                return self._to_point(view, here, self.stop)

    def _begin(self, view: View) -> None:
        known = sum(edge.length for edge in self._mapper.graph.edges.values())
        self._budget_m = view.travelled + 2 * known + self.config.patience_m
        self._began = self._last_view = view.stamp
        self._wait_anew(view)

    def _waited(self, view: View) -> float:
        """Seconds without progress."""
        unseen = max(0.0, view.stamp - self._last_view - _LONGEST_VIEW_S)  # an outage
        self._progress += unseen
        self._stood += unseen
        self._last_view = view.stamp
        has_moved = self._is_off and view.travelled > self._travelled_then + _PROGRESS_M
        if has_moved or self._is_looking:
            self._travelled_then, self._progress = view.travelled, view.stamp
        if self._is_looking or has_come_on(self._place, view.local_base, _STIRS_M, _STIRS_RAD):
            self._place, self._stood = view.local_base, view.stamp
        self._is_looking = False
        return view.stamp - self._progress

    def _stands(self, view: View) -> bool:
        """Whether it has not stirred for so long that it will come no nearer in this way."""
        return view.stamp - self._stood > self.config.look_around_s

    def _wait_anew(self, view: View) -> None:
        """Let no patience run out by the time before."""
        self._progress = self._stood = view.stamp

    # -- something in the way ----------------------------------------------------------------------

    def _close_way(self, view: View) -> Ended | None:
        """Something stands in the way: try another one, if there is one.

        After the way straight on that is the one along the edges, once.
        """
        route, on_edge = self._route, self._ground.mission.where.on_edge
        straight = self._nearest_m.pop(True, None)
        if straight is not None:
            self._straight_m = straight - _PROGRESS_M
            if route is None and not self._goes_round:
                self._goes_round = True
                self._try_another_way(view)
                return None
        if route is not None and route.departures and self._ground.is_at(view, route.first.vertex):
            end = route.departures[0]
            edge = self._mapper.graph.edge_at(end)
            return self._close(view, end, NOWHERE if edge is None else edge.other(end))
        return self._close(view, on_edge, None if route is None else route.first)

    def _close(
        self, view: View, end: HalfEdgeId | None, heading: HalfEdgeId | None
    ) -> Ended | None:
        """Drive an edge no more, and not to that end of it if the robot is on it."""
        graph = self._mapper.graph
        edge = None if end is None else graph.edge_at(end)
        ends = [edge.a, edge.b] if edge is not None else [end] if end is not None else []
        halves = [half for end in ends if (half := graph.half_edge(end)) is not None]
        if heading is None or all(half.blocked for half in halves):
            return Ended("given up", "something stands in the way")
        self._closed = heading
        until = view.stamp + self.config.remember_blocked_s
        self._ground.closures.close(graph, ends, until)
        self._try_another_way(view)
        return None

    def _try_another_way(self, view: View) -> None:
        self._is_obstructed, self._unseen = False, 0
        self._wait_anew(view)
        self._nearest_m.clear()
        self._least_turn = math.inf
        self.happened.append(Recovery(view.stamp, "try another way", "something stands in the way"))

    def _is_missing(self, view: View, here: Situation, departure: HalfEdgeId) -> bool:
        """Whether nothing is to be seen of an edge where it should leave, which is in sight."""
        half = self._mapper.graph.half_edge(departure)
        if departure in here.known.branch_of or half is None:
            return False
        node = here.known.node_of.get(departure.vertex)
        if node is not None:
            return view.gvg.nodes[node].settled and node not in view.doubted
        local_vertex = self._mapper.in_local_frame(view, departure.vertex)
        place = view.gvg.place(local_vertex.position)
        if place is None or place.distance > _PAST_M:
            return False
        passing = view.gvg.edges[place.edge]
        ways = [
            passing.polyline[int(np.argmin(np.abs(passing.stations - place.station - way)))]
            - local_vertex.position
            for way in (-AT_VERTEX_M, AT_VERTEX_M)
        ]
        bearing = half.bearing + local_vertex.theta
        turns = [abs(wrap_angle(math.atan2(dy, dx) - bearing)) for dx, dy in ways]
        return min(turns) > _THROUGH_RAD

    # -- the kinds of stops ------------------------------------------------------------------------

    def _look_once(self, view: View) -> Order | Ended:
        if not self._looks:
            return self._look_around(view)
        sigma = robot_sigma(self._mapper.belief)
        reason = f"it knows its place to {sigma:.2f} m"
        return Ended("arrived" if sigma < _SURE_M else "given up", reason)

    def _rest(self, view: View, seconds: float) -> Order | Ended:
        assert self._began is not None
        self._wait_anew(view)
        return Stand() if view.stamp < self._began + seconds else Ended("arrived", "")

    def _to_vertex(self, view: View, here: Situation | None, vertex: int) -> Order | Ended:
        graph = self._mapper.graph
        if vertex not in graph.vertices:
            return Ended("given up", f"vertex {vertex} is not in the map any more")
        node = None if here is None else here.known.node_of.get(vertex)
        there = (
            self._mapper.in_local_frame(view, vertex).position
            if node is None
            else view.gvg.nodes[node].position
        )
        if self._is_there(view, there):
            return Ended("arrived", f"vertex {vertex}")
        if here is None:
            return self._find_edge(view)
        route = route_to_vertex(graph, here.starts(self._closed), vertex)
        return self._drive(view, here, route, there if node is None else None)

    def _past(self, view: View, here: Situation | None, foot: Foot | None) -> Order | Ended:
        if foot is None:
            return Ended("given up", "the edge is not in the map any more")
        away = foot.in_local_frame(self._mapper, view) - view.local_base.position
        if float(np.hypot(*away)) < _PAST_M:
            return Ended("arrived", "")
        if here is None:
            return self._find_edge(view)
        route = route_to_foot(here, here.starts(self._closed), foot, self._closed)
        if route is not None and route.metres < _PAST_M:
            return Ended("arrived", "")
        return self._drive(view, here, route)

    def _to_point(self, view: View, here: Situation | None, stop: ToPoint | Home) -> Order | Ended:
        goal = np.array([stop.x, stop.y])
        local_goal = self._mapper.map_in_local(view.local_base).transform(goal)
        away = float(np.hypot(*(local_goal - view.local_base.position)))
        if away < _THERE_M:
            return Ended("arrived", "")
        foot = None if away < DIRECT_M else foot_of(self._mapper, goal)
        way = self._straight_to(view, local_goal, away, foot)
        if way is not None and length_of(way[0]) < self._straight_m and not self._stands(view):
            self._route, track = None, Track.of(*way)
            self._come_nearer(view, track.length, straight=True)
            return Drive(track)
        foot = foot or foot_of(self._mapper, goal)
        if foot is None:
            if self._looks < _LOOKS:  # the way may only be out of sight
                return self._look_around(view)
            return Ended("given up", "no edge is known that it could drive on")
        at_foot = foot.in_local_frame(self._mapper, view)
        if self._is_there(view, at_foot):
            if way is not None and isinstance(stop, ToPoint):  # who stands in it may go
                self._route, self._straight_m, self._goes_round = None, math.inf, True
                return Drive(Track.of(*way))
            dx, dy = local_goal - view.local_base.position
            turn = view.turn_to_see(math.atan2(dy, dx))
            if turn and self._looks < _LOOKS:  # who stood there may have gone behind its back
                return self._look_around(view, turn + _BESIDE_RAD)
            short = f"{away:.1f} m from there, where the known ways end"
            if isinstance(stop, Home):
                return Ended("arrived", short)
            return Ended("given up", f"the way is not free; it stands {short}")
        if here is None:
            return self._find_edge(view)
        route = route_to_foot(here, here.starts(self._closed), foot, self._closed)
        return self._drive(view, here, route, at_foot)

    def _straight_to(
        self, view: View, local_goal: Array, away: float, foot: Foot | None
    ) -> tuple[Array, Array] | None:
        """The way without the edges to a point (2,) so many metres off, if there is one.

        From DIRECT_M on only from about where the edges are nearest to the point, its foot.
        """
        if away < DIRECT_M:
            room_m = self._ground.room_m
            return straight_way(view, local_goal, room_m) or bent_way(view, local_goal, room_m)
        if foot is None or away > min(foot.away + _ALMOST_M, _ACROSS_M):
            return None
        return straight_way(view, local_goal, _OPEN_M)

    # -- on the way --------------------------------------------------------------------------------

    def _drive(
        self,
        view: View,
        here: Situation,
        route: Route | None,
        end: Array | None = None,
    ) -> Order | Ended:
        """Along a route, to its end or to a point of it (2,), local frame."""
        is_known = route is not None
        route = route or self._explore(view, here)
        if route is None:
            trouble = self._ground.no_way_to(self.stop, here, closed=self._closed)
            return Ended("given up", trouble)
        self._route = route
        next_one = next(iter(route.departures), None)
        is_missing = (
            next_one is not None
            and self._ground.is_at(view, route.first.vertex)
            and self._is_missing(view, here, next_one)
        )
        self._unseen = self._unseen + 1 if is_missing else 0
        if self._unseen >= _UNSEEN_LOOKS[1]:
            return self._close_way(view) or Stand()
        if self._unseen >= _UNSEEN_LOOKS[0]:  # a door that has opened just now is still a wall
            self._wait_anew(view)
            return Stand()
        if is_known:
            self._come_nearer(view, route.metres + here.place.distance)
        path = route.branches(here) or here.ahead()
        line, clearance = here.line_along(path)
        if end is not None:
            d = np.hypot(*(line - end).T)
            if d.min() < _ALMOST_M:
                i = max(1, int(np.argmin(d)))
                line, clearance = line[: i + 1], clearance[: i + 1]
        track = Track.of(line, clearance)
        is_at_end = track.length < _SHORT_M and self._stands(view)
        if is_at_end and not view.is_end_doubted(line[-1]):  # else somebody hides the rest
            if self._looks < _LOOKS:
                return self._look_around(view)
            self._looks = 0
            return self._close_way(view) or Stand()
        return Drive(track)

    def _explore(self, view: View, here: Situation) -> Route | None:
        """On where nobody has been, if no known way leads there: whatever it drives counts."""
        may, way_to_explore = self._may_explore, self._ground.way_to_explore
        route = way_to_explore(self.stop, here, self._closed) if may else None
        if route is not None and not self._explores:
            self.happened.append(Recovery(view.stamp, "explore", "no known way leads there"))
        self._explores = self._is_off = route is not None
        return route

    def _come_nearer(self, view: View, metres: float, *, straight: bool = False) -> None:
        """Note how much is left of the way: wheels that spin are no progress.

        A route may end before the stop: what is left of it says nothing of the way straight on.
        """
        self._is_off = False
        if metres < self._nearest_m.get(straight, math.inf) - _PROGRESS_M:
            self._nearest_m[straight], self._progress = metres, view.stamp
            self._least_turn = math.inf

    def _turn_to(self, view: View, track: Track) -> None:
        """Note how far the robot has yet to turn to its track: that is progress, too, but once."""
        base = view.local_base
        is_ahead = np.hypot(*(track.polyline - base.position).T) > _AHEAD_M
        ahead = track.polyline[int(is_ahead.argmax()) if is_ahead.any() else -1]
        x, y = base.inverse().transform(ahead)
        turn = abs(math.atan2(y, x))
        if turn < self._least_turn - _TURNED_RAD:
            self._least_turn, self._progress = turn, view.stamp

    def _find_edge(self, view: View) -> Order | Ended:
        """Off the graph: go to the nearest edge, or look around for one."""
        self._route, self._is_off = None, True
        way = way_to_edge(view)
        if way is not None and not self._stands(view):
            return Drive(Track.of(*way))
        if self._looks >= _LOOKS:
            return Ended("given up", "no edge is in sight")
        return self._look_around(view)

    def _look_around(self, view: View, turn: float = math.tau) -> Order:
        self._looks += 1
        self._is_looking = True
        self.happened.append(Recovery(view.stamp, "look around", f"on the way: {self.stop}"))
        return LookAround(turn)

    def _is_there(self, view: View, there: Array) -> bool:
        """Whether the robot is at a place (2,), local frame, or as near as it comes."""
        away = float(np.hypot(*(there - view.local_base.position)))
        return away < _THERE_M or (away < _ALMOST_M and self._stands(view))
