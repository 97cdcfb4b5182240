"""What the robot is about: explore every frontier, give up what is out of reach, say why."""

import math
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np

from gvgbot.autonomy.control.company import (
    Companion,
    free_metres,
    in_front,
    patience,
    refuge,
)
from gvgbot.autonomy.control.edge_follower import Track
from gvgbot.autonomy.events import Decision, Event, Finished, Recovery
from gvgbot.autonomy.exploration.access import NEAR_M, way_into_the_open, way_to_edge
from gvgbot.autonomy.exploration.certainty import CertaintyConfig, vertex_sigma
from gvgbot.autonomy.exploration.ears import ear_next, nearest_frontier
from gvgbot.autonomy.exploration.obstructions import Obstructions
from gvgbot.autonomy.exploration.paths import Approach, shortest_paths
from gvgbot.autonomy.exploration.sharing import Sharing
from gvgbot.autonomy.exploration.stay import Stay
from gvgbot.autonomy.gvg.local import Branch, Place
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.autonomy.start_edge import StartEdge, is_at_start
from gvgbot.autonomy.views import Correspondence, View
from gvgbot.autonomy.whereabouts import Passage, Situation, Whereabouts
from gvgbot.geometry import Array, Pose
from gvgbot.ranges import Range

_ARRIVED_M = 0.3  # at the end of a track, when no more of it is left
_BESIDE_M = 0.15  # farther from its edge than this, the robot goes there first
_LEAST_LOOP_M = 4.0  # an edge with both ends in sight is left to sight unless so much was driven
_WORTH_TURNING_M = 1.0  # a new frontier must be so much nearer than the old one
_FACING_RAD = 1.0  # looking so far past a thing, one would not see it go
_FACING_POINTS = 6  # of a polyline tell where its end points to
_MOST_NEAR = 2  # vertices to go to, for what no known way leads to
_AT_VERTEX_M = 0.5  # so near, all that there is to see from a vertex is seen
_MOST_SOUGHT = 5  # places to look for an edge from
_LONGEST_VIEW_S = 2.0  # a longer gap between views is an outage, not a lack of progress

Outcome = Literal["explored", "explored_with_blocked", "failed", "stopped"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplorationConfig:
    """What is worth a drive, and when to give up.

    `ears`: at the end of an edge the next one clockwise, and the nearest frontier when there is
    none. `nearest`: always the nearest; at a vertex with several, the next clockwise. `balanced`:
    as `nearest`, but the standard deviation of a frontier's place counts, too.
    """

    # which frontier comes next, see above
    policy: Literal["ears", "nearest", "balanced"] = "nearest"
    detour_m_per_m: Annotated[float, Range(0.0, 1000.0)] = (
        50.0  # for less standard deviation, if balanced
    )
    certainty: CertaintyConfig = field(default_factory=CertaintyConfig)
    drive_dead_ends: bool = False  # although the end of a dead end can be seen from its mouth
    patience_m: Annotated[float, Range(5.0, 1000.0)] = (
        60.0  # driven beyond twice the way to a frontier
    )
    patience_s: Annotated[float, Range(10.0, 3600.0)] = 60.0  # without coming nearer to anything
    look_around_s: Annotated[float, Range(0.5, 60.0)] = (
        3.0  # standing at the end of sight before turning
    )
    in_the_way_s: Annotated[float, Range(1.0, 600.0)] = (
        10.0  # behind something before another way is tried
    )
    retry_after_s: Annotated[float, Range(0.0, 3600.0)] = 20.0  # and at the end, that way again,
    retries: Annotated[int, Range(0, 20)] = 3  # so many times
    # a way that something stood in is not driven by errands for so long
    remember_blocked_s: Annotated[float, Range(0.0, 86400.0)] = 300.0
    nothing_in_sight_s: Annotated[float, Range(2.0, 600.0)] = (
        20.0  # without any edge before giving up
    )


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """Follow a track."""

    track: Track


@dataclass(frozen=True, slots=True)
class LookAround:
    """Turn on the spot by an angle, rad."""

    angle: float


@dataclass(frozen=True, slots=True)
class Stand:
    """Stay where you are."""


Order = Drive | LookAround | Stand


class Mission:
    """Chooses the frontier to explore, and the order that brings the robot nearer to it."""

    def __init__(self, config: ExplorationConfig, mapper: Mapper) -> None:
        self._config, self._mapper = config, mapper
        self.where = Whereabouts()
        self.sharing: Sharing | None = None  # of frontiers with other robots, if there are any
        self.target: HalfEdgeId | None = None
        self.outcome: Outcome | None = None
        self.reason = ""
        self.remark = ""  # on how certain the map is, for the end
        self._budget_m = math.inf  # of `travelled`, for the present target
        self._newest_m = 0.0  # of the target edge that has been driven
        self._last_progress = 0.0  # stamp
        self._last_view = math.inf  # stamp
        self._stay = Stay()
        self._progress_at: Array | None = None  # local frame; to and fro on the spot is none
        self._start_edge: StartEdge | None = None
        self._frontiers: set[HalfEdgeId] = set()  # that were known at the last view
        self._looked_around = 0
        self._obstructions = Obstructions(config.retries, config.retry_after_s)
        self._obstructed = ""  # why there is no way on, since the last view
        self._held = False
        self._patience = 1.0  # share of the usual one, with what is in the way
        self._company: list[Companion] = []  # local frame
        self._in_front: Companion | None = None  # that is near
        self._held_since: float | None = None
        self._lost_since: float | None = None
        self._sought: list[Array] = []  # places to see an edge from, local frame
        self._seeking: Track | None = None  # to the last of them
        self._stranded_since: float | None = None
        self._gone_near = set[int]()  # vertices that the robot has been at since
        self._turned_back = False  # looking for a way, after the end of sight
        self._examining_since: float | None = None
        self._sees_known = False  # a vertex at least
        self._going_back = self._went_back = False  # to where it does, for the present target
        self._events: list[Event] = []

    def advance(self, view: View, known: Correspondence) -> tuple[Order, list[Event]]:
        """The order for the next keyframe interval."""
        self._events = []
        self._sees_known = bool(known.vertex_of)
        place = view.gvg.place(view.local_base.position)
        is_beside = place is not None and place.distance <= NEAR_M
        if place is not None and is_beside:
            self._lost_since = None
            self._learn(view, known, place)
        back = self._go_back(view) if self._going_back else None
        if back is not None:
            return back, self._events
        if place is None:
            return self._search(view), self._events
        if not is_beside:
            return self._access(view), self._events
        graph = self._mapper.graph
        here = Situation(view.gvg, known, graph, self.where, place, view.local_base, view.doubted)
        self._watch_progress(view)
        self._watch_the_way(view)
        order = Stand() if self.outcome is not None else self._decide(view, here)
        return order, self._events

    @property
    def is_choosing(self) -> bool:
        """Whether a task is done, and the next one has to be chosen on the graph."""
        graph = self._mapper.graph
        half = None if self.target is None else graph.half_edge(self.target)
        return self.outcome is None and bool(graph.vertices) and (half is None or not half.open)

    def witness(self, view: View, known: Correspondence) -> list[Event]:
        """Learn from where somebody else drives the robot."""
        self._events = []
        place = view.gvg.place(view.local_base.position)
        if place is not None and place.distance <= NEAR_M:
            self._learn(view, known, place)
        return self._events

    def stop(self, stamp: float, reason: str) -> Event:
        """End the exploration, because somebody wants that."""
        self.outcome, self.reason = "stopped", reason
        return Finished(stamp, "stopped", reason)

    def reopen(self) -> None:
        """Go on after the end: also to what was given up."""
        self.outcome, self.reason = None, ""
        for end in self._mapper.graph.blocked():
            half = self._mapper.graph.half_edge(end)
            assert half is not None
            half.blocked = False
        self._obstructions = Obstructions(self._config.retries, self._config.retry_after_s)
        self.set_aside()

    def set_aside(self) -> None:
        """Let the robot do something else; choose anew when it comes back."""
        self.target = None
        self._stay.end()
        self._looked_around = 0
        self._held = self._going_back = False
        self._held_since = self._lost_since = None
        self._stranded_since = self._examining_since = None

    def configure(self, config: ExplorationConfig) -> None:
        """Use another configuration from now on."""
        self._config = config

    def skip(self, seconds: float) -> None:
        """Let no patience run out by a time in which nothing was to be seen."""
        self._last_progress += seconds
        self._stay.skip(seconds)
        self._last_view += seconds
        self._held_since = _later(self._held_since, seconds)
        self._lost_since = _later(self._lost_since, seconds)
        self._stranded_since = _later(self._stranded_since, seconds)
        self._examining_since = _later(self._examining_since, seconds)

    def meet(self, local_base: Pose, company: list[Companion]) -> None:
        """Note where other robots are, local frame."""
        self._patience = patience(local_base, company)
        self._in_front = in_front(local_base, company)
        self._company = company

    def hold(self) -> None:
        """Note that the robot cannot go on just now: somebody may be in its way."""
        self._held = True

    def obstruct(self, reason: str) -> None:
        """Note that there is no way on."""
        self._obstructed = reason

    # -- the edge under the wheels -------------------------------------------------------------

    def _learn(self, view: View, known: Correspondence, place: Place) -> None:
        """Account for what has been driven."""
        self.where.on_edge = self._mapper.unsettled.current(self.where.on_edge)
        self.target = self._mapper.unsettled.current(self.target)
        self._rejoin()
        clearance = view.gvg.edges[place.edge].clearance_at(place.station)
        self._close_ring(view, clearance)
        passage = self.where.follow(view.gvg, place, known, view.local_base.position)
        if passage is not None:
            self._account_for(view, known, passage)
        self._close_start_edge(view, clearance)

    def _rejoin(self) -> None:
        """Go on with the edge before, if the vertex that the present one left was none."""
        came_from = self._mapper.came_from
        if self.target in came_from:
            self.target = came_from[self.target][0]
        if self.where.on_edge in came_from:
            self.where.rejoin(*came_from[self.where.on_edge])

    def _account_for(self, view: View, known: Correspondence, passage: Passage) -> None:
        """Count a traversal, or close the edge that was driven from a vertex now out of sight."""
        graph, left, arrived = self._mapper.graph, passage.left, passage.arrived
        if left is None and arrived is not None and self._start_edge is None:
            line = graph.vertices[arrived.vertex].local.inverse().transform(passage.line)
            self._start_edge = StartEdge(arrived, line, passage.narrowest)
        if left is None or arrived is None or left == arrived:
            return
        edge = graph.edge_at(left)
        if edge is not None:
            self._mapper.unsettled.note_way(edge, arrived.vertex)
            edge.traversals += 1
            edge.doubted_since = None
            return
        far, near = graph.half_edge(arrived), graph.half_edge(left)
        if far is None or near is None or not (far.open and near.open):
            return
        if left in known.branch_of and passage.driven < _LEAST_LOOP_M:
            return
        self._mapper.join(view, left, arrived, passage.line, passage.narrowest, driven=True)

    def _close_ring(self, view: View, clearance: float) -> None:
        """Give an edge without an end a vertex, when the robot has come round to its start."""
        if self._mapper.graph.vertices or not self.where.trail:
            return
        map_local = self._mapper.belief.map_base.compose(view.local_base.inverse())
        if self._is_round(map_local.transform(self.where.trail[0]), clearance):
            self._mapper.close_ring(view, np.array(self.where.trail), self.where.narrowest)

    def _close_start_edge(self, view: View, clearance: float) -> None:
        """Join the edge that the robot started on, when it comes there from the other end."""
        start, on_edge, graph = self._start_edge, self.where.on_edge, self._mapper.graph
        if start is None or on_edge is None or on_edge == start.end:
            return
        ends = (graph.half_edge(on_edge), graph.half_edge(start.end))
        if any(half is None or not half.open for half in ends):
            return
        map_vertex = self._mapper.belief.map_vertex(start.end.vertex)
        if not self._is_round(map_vertex.transform(start.line[0]), clearance):
            return
        rest = self._mapper.in_local_frame(view, start.end.vertex).transform(start.line)
        line = np.concatenate([np.array(self.where.trail), rest])
        narrowest = min(self.where.narrowest, start.narrowest)
        self._mapper.join(view, on_edge, start.end, line, narrowest, driven=True)

    def _is_round(self, start: Array, clearance: float) -> bool:
        """Whether the robot has come back to where it came onto its first edge (2,), map frame."""
        driven = self.where.trail_length > _LEAST_LOOP_M
        return driven and is_at_start(self._mapper.belief, start, clearance)

    # -- where next ------------------------------------------------------------------------------

    def _decide(self, view: View, here: Situation) -> Order:
        graph = self._mapper.graph
        if self.sharing is not None:  # what was in the way may have been one that drives on
            self._reopen(view, "the way may be free again")
        target = self.target
        half = None if target is None else graph.half_edge(target)
        if target is None or half is None or not half.open:
            self.target = self._choose(view, here)
            self._frontiers = set(graph.frontiers())
        else:
            self.target = self._reconsidered(view, here, target)
        if self.outcome is not None:
            return Stand()
        if self.target is None and (self._obstructions.waiting or self._waits_for_others()):
            self._last_progress = view.stamp
            self._stay.end()
            return self._make_way(view, here)
        if self.target is None and graph.frontiers():
            return self._wait_for_a_way(view, here)
        if self.target is None and graph.vertices:
            return self._examine(view, here)
        path = here.ahead() if self.target is None else here.path_to(self.target)
        if path is None:
            return self._wait_for_a_way(view, here)
        self._stranded_since = None
        return self._drive(view, here, path)

    def _choose(self, view: View, here: Situation) -> HalfEdgeId | None:
        """The next frontier, by the policy."""
        graph = self._mapper.graph
        if not graph.vertices:
            return None
        chosen, reason = self._ear(here), "ear"
        if chosen is None:
            nearest = self._nearest(here.starts())
            if nearest is None and self._reopen(view, "nothing else is left"):
                nearest = self._nearest(here.starts())
            if nearest is None:
                if self._is_left_to_others():
                    self._end(view, "explored", "no frontier of the team is left")
                elif not self._waits_for_others():
                    self._finish(view)
                return None
            self._stranded_since = None
            chosen, reason = nearest[0], "nearest frontier"
        self._commit(view, here, chosen, reason)
        return chosen

    def _reconsidered(self, view: View, here: Situation, target: HalfEdgeId) -> HalfEdgeId | None:
        """The target, or a frontier found just now that is nearer than what is left of the way."""
        frontiers = set(self._mapper.graph.frontiers())
        found, self._frontiers = frontiers - self._frontiers, frontiers
        if self.where.on_edge == target:
            if self.sharing is not None:
                self.sharing.enter()
            return target
        starts = here.starts()
        if self.sharing is not None and not self.sharing.keeps(target, self._mapper.graph, starts):
            return self._choose(view, here)
        if not found:
            return target
        way = shortest_paths(self._mapper.graph, starts).get(target.vertex)
        nearest = self._nearest(starts)
        if nearest is None or nearest[0].vertex not in {end.vertex for end in found}:
            return target
        if way is not None and nearest[1].metres > way.metres - _WORTH_TURNING_M:
            return target
        self._commit(view, here, nearest[0], "nearer frontier")
        return nearest[0]

    def _nearest(self, starts: list[Approach]) -> tuple[HalfEdgeId, Approach] | None:
        graph, belief = self._mapper.graph, self._mapper.belief
        if self.sharing is not None:
            return self.sharing.choose(graph, starts)
        if self._config.policy != "balanced":
            return nearest_frontier(graph, starts)

        def handicap(vertex: int) -> float:
            return self._config.detour_m_per_m * vertex_sigma(belief, vertex)

        return nearest_frontier(graph, starts, handicap)

    def _waits_for_others(self) -> bool:
        """Whether other robots are on their way to every frontier that is left."""
        return self.sharing is not None and self.sharing.is_waiting

    def _is_left_to_others(self) -> bool:
        """Whether there are frontiers, but others have followed all of them."""
        return (
            self.sharing is not None
            and self.sharing.is_done
            and not self._obstructions.waiting
            and bool(self._mapper.graph.frontiers())
        )

    def _ear(self, here: Situation) -> HalfEdgeId | None:
        """The ear rule at the end of the edge just explored."""
        graph = self._mapper.graph
        if (
            self._config.policy != "ears"
            or self.sharing is not None
            or self.target is None
            or graph.half_edge(self.target) is None
        ):
            return None
        edge = graph.edge_at(self.target)
        return None if edge is None else ear_next(graph, edge.other(self.target))

    def _commit(self, view: View, here: Situation, chosen: HalfEdgeId, reason: str) -> None:
        starts = here.starts()
        away = max((s.metres for s in starts), default=0.0)
        total = sum(e.length for e in self._mapper.graph.edges.values())
        self._budget_m = view.travelled + 2 * (away + total) + self._config.patience_m
        self._newest_m = 0.0
        self._looked_around = 0
        self._went_back = False
        self._examining_since = None
        vertex = self._mapper.graph.vertices[chosen.vertex]
        psi = self._mapper.belief.map_vertex(chosen.vertex).theta
        bearing = vertex.half_edges[chosen.key].bearing + psi
        self._events.append(Decision(view.stamp, chosen.vertex, bearing, reason))

    def _wait_for_a_way(self, view: View, here: Situation) -> Order:
        """Drive on until a known vertex comes into sight, before a frontier is given up."""
        if self._stranded_since is None:
            self._stranded_since, self._turned_back = view.stamp, False
            self._gone_near = set()
            self._events.append(Recovery(view.stamp, "drive on", "no way leads to the frontier"))
        near = self._way_near(here) if self.target is None else None
        if near is not None:
            self._stranded_since = view.stamp
            return self._drive(view, here, near)
        if view.stamp - self._stranded_since > self._config.patience_s:
            self._stranded_since = None
            self._mapper.forget_strays(view)
            if self.target is None or self._mapper.graph.half_edge(self.target) is not None:
                self._give_up(view, "no way leads there")
        path = here.astern() if self._turned_back else here.ahead()
        if Track.of(*view.gvg.line_from(here.place, path)).length < _ARRIVED_M:
            self._turned_back = not self._turned_back
        return self._drive(view, here, path)

    def _way_near(self, here: Situation) -> tuple[Branch, ...] | None:
        """To the vertices next to a frontier that no known way leads to: one may be seen there."""
        graph, belief = self._mapper.graph, self._mapper.belief
        approaches = shortest_paths(graph, here.starts())
        lost = {end.vertex for end in graph.frontiers()} - approaches.keys()
        rest = sorted(approaches.keys() - self._gone_near)
        if not lost or not rest or len(self._gone_near) >= _MOST_NEAR:
            return None
        places = np.array([belief.map_vertex(vertex).position for vertex in sorted(lost)])
        nearest = min(
            rest,
            key=lambda v: np.hypot(*(places - belief.map_vertex(v).position).T).min(),
        )
        approach = approaches[nearest]
        if approach.metres < _AT_VERTEX_M:
            self._gone_near.add(nearest)
            return None
        first = approach.departures[0].vertex if approach.departures else nearest
        return here.path_over(first, approach.departures)

    def _make_way(self, view: View, here: Situation) -> Order:
        """Stand, but aside of a robot that is near and may want to pass."""
        other = self._in_front
        way = None if other is None else refuge(here.gvg, here.place, other.pose.position)
        return Stand() if way is None else self._drive(view, here, way)

    def _drive(self, view: View, here: Situation, path: tuple[Branch, ...]) -> Order:
        line, room = view.gvg.line_from(here.place, path)
        if here.place.distance > _BESIDE_M:  # straight to the edge first, or it may scrape along
            base = view.local_base.position
            line, room = np.vstack([base, line]), np.concatenate([room[:1], room])
        free = self._free_metres(view, line)
        if free < _ARRIVED_M:
            self._held = True
            return Stand()
        track = Track.of(line, room).until(free)
        end = view.gvg.end_of(path[-1])
        waited = view.stamp - self._last_progress
        if track.length < _ARRIVED_M and end not in here.known.vertex_of and end in view.doubted:
            self._held = True
            away = _turn_to_face(view, path[-1])
            if min(away, math.tau - away) > _FACING_RAD:
                return LookAround(away)
        elif track.length < _ARRIVED_M and waited > self._config.look_around_s:
            self._last_progress = view.stamp
            self._looked_around += 1
            if self._looked_around > 2 and self._stranded_since is None:
                self._give_up(view, "nothing more is to be seen there")
                return Stand()
            self._events.append(Recovery(view.stamp, "look around", "standing at the end of sight"))
            return LookAround(math.tau)
        return Drive(track)

    def _go_back(self, view: View) -> Order | None:
        """Over where the robot came from, until it sees vertices that it knows."""
        self._watch_progress(view)
        line = self.where.way_back(view.local_base.position)
        room, _ = view.local_map.tree().query(line)
        free = self._free_metres(view, line)
        track = Track.of(line, np.asarray(room)).until(free)
        if self._sees_known or self.target is None or track.length < _ARRIVED_M:
            self._going_back = False
            return None
        return Drive(track)

    def _free_metres(self, view: View, line: Array) -> float:
        """How far to drive before another robot has to come through where two cannot pass."""
        if not self._company:
            return math.inf
        from_walls, _ = view.local_map.tree().query(line)
        return free_metres(line, np.asarray(from_walls), self._company)

    # -- something in the way ----------------------------------------------------------------------

    def _watch_the_way(self, view: View) -> None:
        """Wait a little for what stands in the way, then try another one."""
        if self._held and self._held_since is None:
            self._held_since = view.stamp
        if view.stamp == self._last_progress:
            self._held_since = None
        self._held = False
        waited = 0.0 if self._held_since is None else view.stamp - self._held_since
        if not self._obstructed and waited > self._patience * self._config.in_the_way_s:
            self._obstructed = "something stands in the way"
        if self._obstructed:
            self._block(view, self._obstructed)
            self._obstructed, self._held_since = "", None

    def _block(self, view: View, reason: str) -> None:
        """Close the edge under the wheels, or else the target, for a while."""
        end = self.where.on_edge if self.target is not None else None
        edge = None if end is None else self._mapper.graph.edge_at(end)
        ends = (self.target,) if edge is None else (edge.a, edge.b)
        closed = [end for end in ends if end is not None]
        if not closed:
            return
        self._obstructions.close(self._mapper.graph, closed, view.stamp)
        self._events.append(Recovery(view.stamp, "try another way", reason))
        self.target = None

    def _reopen(self, view: View, reason: str) -> bool:
        """Open what was closed long enough ago; whether there was something."""
        opened = self._obstructions.open(self._mapper.graph, view.stamp)
        if opened:
            self._events.append(Recovery(view.stamp, "try again", reason))
        return opened

    # -- giving up ---------------------------------------------------------------------------------

    def _watch_progress(self, view: View) -> None:
        base, then = view.local_base.position, self._progress_at
        if then is None or np.hypot(*(base - then)) > 0.3:
            self._progress_at, self._last_progress = base, view.stamp
        unseen = max(0.0, view.stamp - self._last_view - _LONGEST_VIEW_S)
        self._last_progress += unseen
        self._stay.skip(unseen)
        self._last_view = view.stamp
        stayed = self._stay.note(base, view.stamp)
        if self.where.on_edge == self.target and self.where.trail_length > self._newest_m + 0.5:
            self._newest_m = self.where.trail_length  # new ground: as long as there is more, go on
            self._budget_m = max(self._budget_m, view.travelled + self._config.patience_m)
        if self.target is not None and view.travelled > self._budget_m:
            self._give_up(view, "driven too far without reaching it")
        elif max(stayed, view.stamp - self._last_progress) > self._config.patience_s:
            self._last_progress = view.stamp
            self._stay.end()
            self._give_up(view, "no progress")

    def _give_up(self, view: View, reason: str) -> None:
        """Mark the target as blocked, after having gone back; without one, that is the end."""
        self._looked_around = 0
        half = None if self.target is None else self._mapper.graph.half_edge(self.target)
        if half is None:
            self._mapper.forget_strays(view)
            if self._mapper.graph.vertices and not self._mapper.graph.frontiers():
                return
            if self._mapper.graph.vertices:
                given_up = len(self._mapper.graph.frontiers()) + self._given_up()
                self._end(view, "explored_with_blocked", f"{given_up} frontiers left: {reason}")
            else:
                self._end(view, "failed", f"no vertex found, perhaps no way out: {reason}")
            return
        has_left = self.where.on_edge not in (None, self.target) and not self._sees_known
        if has_left and not self._went_back:
            self._going_back = self._went_back = True
            self._events.append(Recovery(view.stamp, "go back", reason))
            return
        half.blocked = True
        self._events.append(Recovery(view.stamp, "give up a frontier", reason))
        self.target = None

    def _access(self, view: View) -> Order:
        """Go to the nearest edge, if the way there is free."""
        way = way_to_edge(view)
        if way is None:
            return self._search(view)
        self._lost_since = None
        self._watch_progress(view)
        return Stand() if self.outcome is not None else Drive(Track.of(*way))

    def _search(self, view: View) -> Order:
        """No edge in sight: look around, here and where there is more room, and then give up."""
        reason = "no edge in sight"
        if self._lost_since is None:
            self._lost_since, self._sought, self._seeking = view.stamp, [], None
            self._events.append(Recovery(view.stamp, "look around", reason))
            return LookAround(math.tau)
        if self._seeking is not None:
            if self._is_under_way(view, self._seeking):
                return Drive(self._seeking)
            self._seeking = None
            return LookAround(math.tau)
        seeks = len(self._sought) < _MOST_SOUGHT
        way = way_into_the_open(view, self._sought) if seeks else None
        if way is not None:
            self._sought.append(way[0][-1])
            self._seeking, self._last_progress = Track.of(*way), view.stamp
            self._events.append(Recovery(view.stamp, "go where there is more room", reason))
            return Drive(self._seeking)
        if view.stamp - self._lost_since > self._config.nothing_in_sight_s:
            self._end(view, "failed", f"{reason}: there are no walls within range, or no way out")
            return Stand()
        return LookAround(math.tau)

    def _is_under_way(self, view: View, track: Track) -> bool:
        """Whether the robot has not come to the end of a track yet, and nothing keeps it."""
        self._watch_progress(view)
        waited = view.stamp - self._last_progress
        away = math.dist(view.local_base.position, track.polyline[-1])
        return away > _ARRIVED_M and waited < self._config.in_the_way_s

    def _examine(self, view: View, here: Situation) -> Order:
        """Go where something in sight may prove to be a vertex, before all is called explored."""
        if self._examining_since is None:
            self._examining_since = view.stamp
        paths = sorted(
            (metres, node, path)
            for node, (metres, path) in here.gvg.routes(here.place).items()
            if node not in here.known.vertex_of and here.gvg.nodes[node].may_be_vertex
        )
        if paths and view.stamp - self._examining_since < self._config.patience_s:
            return self._drive(view, here, paths[0][2])
        blocked = self._given_up()
        if blocked:
            self._end(view, "explored_with_blocked", f"{blocked} frontiers were given up")
        else:
            self._end(view, "explored", f"no frontier is left{self.remark}")
        return Stand()

    def _given_up(self) -> int:
        """How many frontiers were given up."""
        graph = self._mapper.graph
        return sum(graph.edge_at(end) is None for end in graph.blocked())

    def _finish(self, view: View) -> None:
        """Some frontiers cannot be reached: that is the end, after having looked for a way."""
        since = self._stranded_since
        if since is None or view.stamp - since < self._config.patience_s:
            return
        self._mapper.forget_strays(view)
        frontiers = len(self._mapper.graph.frontiers())
        if frontiers:
            self._end(view, "explored_with_blocked", f"{frontiers} frontiers cannot be reached")

    def _end(self, view: View, outcome: Outcome, reason: str) -> None:
        self.outcome, self.reason = outcome, reason
        self._events.append(Finished(view.stamp, outcome, reason))


def _turn_to_face(view: View, branch: Branch) -> float:
    """How far to turn left until the robot looks along the end of a branch, rad."""
    dx, dy = np.diff(view.gvg.leaving(branch)[-_FACING_POINTS:][[0, -1]], axis=0)[0]
    return float((math.atan2(dy, dx) - view.local_base.theta) % math.tau)


def _later(stamp: float | None, seconds: float) -> float | None:
    return None if stamp is None else stamp + seconds
