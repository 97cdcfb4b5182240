"""What the robot does because somebody asked for it: stand, go on, drive somewhere, look around."""

import math
from dataclasses import dataclass

import numpy as np

from gvgbot.autonomy.control.edge_follower import Track
from gvgbot.autonomy.destinations import Route, foot_of, route_to_foot, route_to_vertex
from gvgbot.autonomy.events import Decision, ErrandEnded, Event, Recovery
from gvgbot.autonomy.exploration.access import NEAR_M, straight_way, way_to_edge
from gvgbot.autonomy.exploration.certainty import Revisiting, robot_sigma
from gvgbot.autonomy.exploration.paths import Approach
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.mission import Drive, ExplorationConfig, LookAround, Mission, Order, Stand
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.autonomy.views import Correspondence, View
from gvgbot.autonomy.whereabouts import Situation
from gvgbot.geometry import Array

_THERE_M = 0.15  # from a destination, one has arrived
_AT_VERTEX_M = 1.0  # from a vertex, what stands in the way stands on the edge beyond it
_ALMOST_M = 0.6  # as well, where one cannot come nearer
_OFF_GRAPH_M = 3.0  # a point farther from every edge is out of reach
_DIRECT_M = 4.0  # the longest straight way to a point
_SHORT_M = 0.3  # a track so short leads nowhere
_PROGRESS_M = 0.3
_SURE_M = 0.4  # of a place that was found again
_LOOKS = 2  # around, before giving up
_LONGEST_VIEW_S = 2.0  # a longer gap between views is an outage, not a lack of progress


class Declined(Exception):
    """The robot will not do that, and says why; nothing has changed."""


@dataclass(frozen=True, slots=True)
class ToVertex:
    """Drive to a vertex."""

    vertex: int

    def __str__(self) -> str:
        return f"goto {self.vertex}"


@dataclass(frozen=True, slots=True)
class ToPoint:
    """Drive to a point, m, map frame."""

    x: float
    y: float

    def __str__(self) -> str:
        return f"goto {self.x:g} {self.y:g}"


@dataclass(frozen=True, slots=True)
class Home:
    """Drive to where the robot started."""

    x: float = 0.0
    y: float = 0.0

    def __str__(self) -> str:
        return "home"


@dataclass(frozen=True, slots=True)
class Look:
    """Doubt the pose, and look around."""

    def __str__(self) -> str:
        return "relocalise"


Errand = ToVertex | ToPoint | Home | Look


class Errands:
    """Stands between the pipeline and the mission, which goes on where it was when there is none.

    What is asked for is answered with what happens now; Declined says why nothing does. `room_m`
    is how far from the walls the robot drives where there is no edge.
    """

    def __init__(
        self, mission: Mission, mapper: Mapper, config: ExplorationConfig, room_m: float
    ) -> None:
        self._mission, self._mapper, self._config = mission, mapper, config
        self._room_m = room_m
        self.errand: Errand | None = None
        self.is_paused = False
        self.is_waiting = False  # after an errand, for what comes next
        self.is_lost = False  # somebody doubts the pose; whoever takes that into account resets it
        self.happened: list[Event] = []  # because of requests; whoever tells of it takes it out
        self._seen: tuple[View, Correspondence] | None = None
        self._revisiting = Revisiting(config.certainty)
        self._is_own = False  # the errand: nobody asked for it, and exploring goes on after it
        self._begin(None)

    @property
    def is_resting(self) -> bool:
        """Whether there is nothing to do but to stand."""
        is_over = self.errand is None and (self.is_waiting or self._mission.outcome is not None)
        return self.is_paused or is_over

    def configure(self, config: ExplorationConfig) -> None:
        """Use another configuration from now on."""
        self._config = config
        self._revisiting = Revisiting(config.certainty)
        self._mission.configure(config)

    # -- what can be asked for ---------------------------------------------------------------------

    def pause(self) -> str:
        """Stand until `resume`."""
        if self.is_paused:
            return "it is paused already"
        self.is_paused = True
        return "it stands still until it is asked to resume"

    def resume(self) -> str:
        """Go on with what was paused."""
        if not self.is_paused:
            return "it was not paused"
        self.is_paused = False
        if self.errand is not None:
            return f"it goes on with: {self.errand}"
        if self.is_resting:
            return "it is not paused any more, and has nothing to do"
        return "it goes on exploring"

    def stop(self, stamp: float) -> str:
        """End the errand and the exploration."""
        self.is_paused = False
        had_errand = self.errand is not None
        self._end(stamp, "stopped", "by a request")
        if self._mission.outcome is not None:
            if had_errand:
                return f"it stands; the exploration had ended before: {self._mission.outcome}"
            return f"it had ended before: {self._mission.outcome}"
        self.happened.append(self._mission.stop(stamp, "stopped by a request"))
        return "the exploration has ended"

    def explore(self, stamp: float) -> str:
        """Go on exploring, even if that had ended."""
        self._check_going()
        if self.errand is None and not self.is_resting:
            return "it is exploring already"
        self._end(stamp, "replaced", "by explore")
        self.is_waiting = False
        if self._mission.outcome is not None:
            self._mission.reopen()
        return f"it explores; {len(self._mapper.graph.frontiers())} frontiers are known"

    def relocalise(self, stamp: float) -> str:
        """Find the place in the map again, by the walls around."""
        self._check_going()
        if not isinstance(self.errand, Look):
            self._take(Look(), stamp)
            self.is_lost = True
        return "it looks around; it finds its place if that is within about a metre of the believed"

    def home(self, stamp: float) -> str:
        """Drive to where the robot started, or as near to it as known ways lead."""
        return self._drive_to_point(Home(), stamp)

    def goto_point(self, x: float, y: float, stamp: float) -> str:
        """Drive to a point, m, map frame."""
        return self._drive_to_point(ToPoint(x, y), stamp)

    def goto_vertex(self, vertex: int, stamp: float) -> str:
        """Drive to a vertex."""
        self._check_going()
        graph, here = self._mapper.graph, self.whereabouts()
        if vertex not in graph.vertices:
            raise Declined(f"there is no vertex {vertex}; {_listed(list(graph.vertices))}")
        if self.errand == ToVertex(vertex) and not self._is_own:
            return f"it is on its way to vertex {vertex} already"
        route = None if here is None else route_to_vertex(graph, here.starts(), vertex)
        if here is not None and route is None:
            raise Declined(f"no known way leads to vertex {vertex}")
        self._take(ToVertex(vertex), stamp)
        return f"it drives{_far(route)} to vertex {vertex}"

    def _drive_to_point(self, errand: ToPoint | Home, stamp: float) -> str:
        self._check_going()
        if self.errand == errand:
            return "it is on its way there already"
        foot, here = foot_of(self._mapper, np.array([errand.x, errand.y])), self.whereabouts()
        base = self._mapper.belief.map_base
        away = math.hypot(errand.x - base.x, errand.y - base.y)
        if away > _DIRECT_M:
            if foot is None:
                raise Declined("no edge is known yet that it could drive on")
            if foot.away > _OFF_GRAPH_M and isinstance(errand, ToPoint):
                raise Declined(f"the nearest known way ends {foot.away:.1f} m from there")
            if here is not None and route_to_foot(here, here.starts(), foot) is None:
                raise Declined("no known way leads there")
        self._take(errand, stamp)
        where = "to where it started" if isinstance(errand, Home) else "there"
        return f"it drives {where}, {away:.1f} m away in a straight line"

    def _check_going(self) -> None:
        if self.is_paused:
            raise Declined("it is paused: ask it to resume first")
        if self._seen is None:
            raise Declined("it has not seen enough yet to know where it is")

    def whereabouts(self) -> Situation | None:
        """Where the robot was on the graph when it last looked; None if that was off it."""
        return None if self._seen is None else self._situation(*self._seen)

    def _take(self, errand: Errand, stamp: float) -> None:
        self._end(stamp, "replaced", f"by {errand}")
        self._mission.set_aside()
        self.is_waiting = False
        self._begin(errand)

    def _begin(self, errand: Errand | None) -> None:
        self.errand = errand
        self._closed: list[HalfEdgeId] = []  # ways that something stands in
        self._avoid: tuple[frozenset[HalfEdgeId], int] | None = None  # not that way on that edge
        self._heading: int | None = None  # the first vertex on the way
        self._route: Route | None = None  # that is being driven
        self._nearest_m = math.inf  # that has been left of it
        self._looks = 0
        self._is_looking = self._is_obstructed = False
        self._progress: float | None = None  # stamp
        self._last_view: float | None = None  # stamp
        self._travelled_then = -math.inf
        self._budget_m = math.inf  # of `travelled`

    def _end(self, stamp: float, how: str, reason: str) -> None:
        """Be done with the errand, if there is one, and wait for what comes next."""
        for end in self._closed:
            half = self._mapper.graph.half_edge(end)
            if half is not None:
                half.blocked = False
        if self.errand is not None:
            self.happened.append(ErrandEnded(stamp, str(self.errand), how, reason))
            self.is_waiting = not self._is_own
        self._is_own = False
        self._begin(None)

    # -- what is done about it ---------------------------------------------------------------------

    def advance(self, view: View, known: Correspondence) -> tuple[Order, list[Event]]:
        """The order for the next keyframe interval, and what has happened."""
        self._seen = view, known
        if self.errand is None and not self._revisit(view):
            self._revisiting.note_target(self._mission.target)
            return self._mission.advance(view, known)
        happened = self._mission.witness(view, known)
        order = self._pursue(view, known)
        return order, happened + self.take_events()

    def _revisit(self, view: View) -> bool:
        """Go back to a vertex, if that is to be done before exploring goes on; whether it is."""
        here = self.whereabouts()
        if here is None or not self._mission.is_choosing:
            return False
        belief = self._mapper.belief
        wanted = self._revisiting.next(self._mapper.graph, belief, here.starts())
        if wanted is None:
            doubtful = self._revisiting.too_uncertain(belief)
            self._mission.remark = (
                f"; {len(doubtful)} vertices stay less certain than wanted" if doubtful else ""
            )
            return False
        self._take(ToVertex(wanted.vertex), view.stamp)
        self._is_own = True
        self.happened.append(Decision(view.stamp, wanted.vertex, None, wanted.reason))
        return True

    def take_events(self) -> list[Event]:
        """What has happened and was not told of yet."""
        happened, self.happened = self.happened, []
        return happened

    def hold(self) -> None:
        """Note that the robot cannot go on just now: somebody may be in its way."""
        if self.errand is None:
            self._mission.hold()

    def obstruct(self, reason: str) -> None:
        """Note that there is no way on."""
        if self.errand is None:
            self._mission.obstruct(reason)
        else:
            self._is_obstructed = True

    def _pursue(self, view: View, known: Correspondence) -> Order:
        waited = self._watch(view)
        here = self._situation(view, known)
        match self.errand:
            case None:
                return Stand()
            case Look():
                return self._look_once(view)
            case ToVertex(vertex=vertex):
                return self._to_vertex(view, here, vertex, waited)
            case ToPoint() | Home():
                return self._to_point(view, here, self.errand, waited)

    def _watch(self, view: View) -> float:
        """Seconds without progress; too many of them close the way that the robot is on."""
        since = view.stamp if self._progress is None else self._progress
        if self._last_view is None:
            known = sum(edge.length for edge in self._mapper.graph.edges.values())
            self._budget_m = view.travelled + 2 * known + self._config.patience_m
        elif view.travelled > self._budget_m:
            self._give_up(view, "driven too far without reaching it")
        if self._last_view is not None:  # let no patience run out by an outage
            since += max(0.0, view.stamp - self._last_view - _LONGEST_VIEW_S)
        is_off = self._route is None  # the graph; on it, coming nearer is what counts
        has_moved = is_off and view.travelled > self._travelled_then + _PROGRESS_M
        if has_moved or self._is_looking:
            self._travelled_then, since = view.travelled, view.stamp
        self._progress, self._last_view, self._is_looking = since, view.stamp, False
        if self._is_obstructed or view.stamp - since > self._config.in_the_way_s:
            self._close_way(view)
        return view.stamp - since

    def _close_way(self, view: View) -> None:
        """Something stands in the way: try another one, if there is one."""
        self._is_obstructed, self._progress = False, view.stamp
        graph, on_edge = self._mapper.graph, self._mission.where.on_edge
        if self._route is not None and self._is_at(view, self._route.first):
            on_edge = next(iter(self._route.departures), on_edge)
        self._nearest_m = math.inf
        edge = None if on_edge is None else graph.edge_at(on_edge)
        ends = [edge.a, edge.b] if edge is not None else [on_edge] if on_edge is not None else []
        halves = [(end, half) for end in ends if (half := graph.half_edge(end)) is not None]
        if self._heading is None or all(half.blocked for _, half in halves):
            self._give_up(view, "something stands in the way")
            return
        self._avoid = frozenset(ends), self._heading
        for end, half in halves:
            if not half.blocked:
                half.blocked = True
                self._closed.append(end)
        self.happened.append(Recovery(view.stamp, "try another way", "something stands in the way"))

    def _is_at(self, view: View, vertex: int) -> bool:
        """Whether the robot is about at a vertex."""
        if vertex not in self._mapper.graph.vertices:
            return False
        there = self._mapper.in_local_frame(view, vertex).position
        return float(np.hypot(*(there - view.local_base.position))) < _AT_VERTEX_M

    def _look_once(self, view: View) -> Order:
        if self._looks:
            sigma = robot_sigma(self._mapper.belief)
            how = "arrived" if sigma < _SURE_M else "given up"
            self._end(view.stamp, how, f"it knows its place to {sigma:.2f} m")
            return Stand()
        return self._look_around(view)

    def _look_around(self, view: View) -> Order:
        self._looks += 1
        self._is_looking = True
        self.happened.append(Recovery(view.stamp, "look around", f"on the way: {self.errand}"))
        return LookAround(math.tau)

    def _to_vertex(self, view: View, here: Situation | None, vertex: int, waited: float) -> Order:
        graph = self._mapper.graph
        if vertex not in graph.vertices:
            return self._give_up(view, f"vertex {vertex} is not in the map any more")
        node = None if here is None else here.known.node_of.get(vertex)
        there = (
            self._mapper.in_local_frame(view, vertex).position
            if node is None
            else view.gvg.nodes[node].position
        )
        if self._is_there(view, there, waited):
            return self._arrive(view, f"vertex {vertex}")
        if here is None:
            return self._find_edge(view, waited)
        return self._drive(view, here, route_to_vertex(graph, self._starts(here), vertex), waited)

    def _to_point(
        self, view: View, here: Situation | None, errand: ToPoint | Home, waited: float
    ) -> Order:
        local_map = view.local_base.compose(self._mapper.belief.map_base.inverse())
        goal = local_map.transform(np.array([errand.x, errand.y]))
        away = float(np.hypot(*(goal - view.local_base.position)))
        if away < _THERE_M:
            return self._arrive(view, "")
        way = straight_way(view, goal, self._room_m) if away < _DIRECT_M else None
        if way is not None and waited < self._config.look_around_s:
            self._heading = self._route = None
            return Drive(Track.of(*way))
        foot = foot_of(self._mapper, np.array([errand.x, errand.y]))
        if foot is None:
            return self._give_up(view, "no edge is known that it could drive on")
        at_foot = foot.in_local_frame(self._mapper, view)
        if self._is_there(view, at_foot, waited):
            short = f"{away:.1f} m from there, where the known ways end"
            return (
                self._arrive(view, short)
                if isinstance(errand, Home)
                else self._give_up(view, f"the way is not free; it stands {short}")
            )
        if here is None:
            return self._find_edge(view, waited)
        return self._drive(
            view, here, route_to_foot(here, self._starts(here), foot), waited, at_foot
        )

    def _drive(
        self,
        view: View,
        here: Situation,
        route: Route | None,
        waited: float,
        end: Array | None = None,
    ) -> Order:
        """Along a route, to its end or to a point of it (2,), local frame."""
        if route is None:
            return self._give_up(view, "no known way leads there")
        self._heading, self._route = route.first, route
        if route.metres < self._nearest_m - _PROGRESS_M:
            self._nearest_m, self._progress = route.metres, view.stamp
        path = route.branches(here) or here.ahead()
        line, clearance = view.gvg.line_from(here.place, path)
        if end is not None:
            d = np.hypot(*(line - end).T)
            if d.min() < _ALMOST_M:
                i = max(1, int(np.argmin(d)))
                line, clearance = line[: i + 1], clearance[: i + 1]
        track = Track.of(line, clearance)
        if track.length < _SHORT_M and waited > self._config.look_around_s:
            if self._looks >= _LOOKS:
                return self._give_up(view, "the way there is not to be seen any more")
            return self._look_around(view)
        return Drive(track)

    def _find_edge(self, view: View, waited: float) -> Order:
        """Off the graph: go to the nearest edge, or look around for one."""
        self._heading = self._route = None
        way = way_to_edge(view)
        if way is not None and waited < self._config.look_around_s:
            return Drive(Track.of(*way))
        if self._looks >= _LOOKS:
            return self._give_up(view, "no edge is in sight")
        return self._look_around(view)

    def _is_there(self, view: View, there: Array, waited: float) -> bool:
        """Whether the robot is at a place (2,), local frame, or as near as it comes."""
        away = float(np.hypot(*(there - view.local_base.position)))
        has_waited = waited > self._config.look_around_s
        return away < _THERE_M or (has_waited and away < _ALMOST_M)

    def _starts(self, here: Situation) -> list[Approach]:
        """Where ways begin, without the one that something stands in."""
        starts = here.starts()
        if self._avoid is None or here.where.on_edge not in self._avoid[0]:
            return starts
        return [start for start in starts if start.arrival.vertex != self._avoid[1]]

    def _situation(self, view: View, known: Correspondence) -> Situation | None:
        place = view.gvg.place(view.local_base.position)
        if place is None or place.distance > NEAR_M:
            return None
        graph, where = self._mapper.graph, self._mission.where
        return Situation(view.gvg, known, graph, where, place, view.local_base, view.doubted)

    def _arrive(self, view: View, where: str) -> Order:
        self._end(view.stamp, "arrived", where)
        return Stand()

    def _give_up(self, view: View, reason: str) -> Order:
        self._end(view.stamp, "given up", reason)
        return Stand()


def _far(route: Route | None) -> str:
    return "" if route is None else f" {route.metres:.1f} m"


def _listed(vertices: list[int]) -> str:
    """Which vertices there are, in a few words."""
    if not vertices:
        return "none is known yet"
    return f"there are {len(vertices)}, with ids from {min(vertices)} to {max(vertices)}"
