"""What the robot is about: explore every frontier, one after the other."""

from gvgbot.autonomy.control.company import Companion
from gvgbot.autonomy.control.edge_follower import Track
from gvgbot.autonomy.control.orders import Drive, LookAround, Order, Stand
from gvgbot.autonomy.driven_edges import DrivenEdges
from gvgbot.autonomy.ending import all_examined, left_to_others, unless_shut_in
from gvgbot.autonomy.events import Decision, Event, Recovery
from gvgbot.autonomy.exploration.access import NEAR_M, Access, access, is_tight, way_to_edge
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.exploration.paths import shortest_paths
from gvgbot.autonomy.gvg.local import Branch, Place
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.overlooked import Overlooked
from gvgbot.autonomy.progress import Progress
from gvgbot.autonomy.pursuit import Pursuit
from gvgbot.autonomy.scouting import Scouting
from gvgbot.autonomy.search import Search
from gvgbot.autonomy.situation import Situation
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.autonomy.views import Correspondence, View
from gvgbot.geometry import Array, Pose, wrap_angle


class Mission(Pursuit):
    """Chooses the frontier to explore, and the order that brings the robot nearer to it."""

    def __init__(self, config: ExplorationConfig, mapper: Mapper) -> None:
        super().__init__(config, mapper)
        self._driven, self._overlooked = DrivenEdges(mapper), Overlooked()
        self._frontiers: set[HalfEdgeId] = set()  # that were known at the last view

    def advance(self, view: View, known: Correspondence) -> tuple[Order, list[Event]]:
        """The order for the next keyframe interval."""
        self._events = []
        self._progress.note_ground(view)
        if self._progress.does_not_end:  # a survey is of no use to who drives on
            self._end_at_last(view)
            return Stand(), self._events
        self._backtracking.sees_known = bool(known.vertex_of)
        self._retracing.note(view, known)
        found = access(view)
        is_beside = found is not None and found.place.distance <= NEAR_M
        if found is not None and is_beside:
            self._learn(view, known, found.place)
            self._end_search(view)
        back = self._go_back(view) if self._backtracking.is_on else self._retrace(view)
        if back is not None:
            return back, self._events
        if found is None or self._search.leaves_slot:
            return self._look_for_an_edge(view), self._events
        if not is_beside:
            return self._access(view), self._events
        here = self._situation(view, known, found)
        self._watch_progress(view)
        self._watch_the_way(view)
        order = Stand() if self.outcome is not None else self._decide(view, here)
        return order, self._events

    def _situation(self, view: View, known: Correspondence, found: Access) -> Situation:
        return Situation(
            view.gvg,
            known,
            self._mapper.graph,
            self.where,
            found,
            view.local_base,
            view.doubted,
            in_team=self.choice.sharing is not None,
        )

    def parts(self) -> list[tuple[Array, float]]:
        """Parts of edges that were driven: lines (N, 2), m, map frame, and least clearances, m."""
        return self._driven.parts()

    @property
    def is_ending(self) -> bool:
        """Whether there is nothing more to be done but to say so."""
        return self._examination.is_over

    def witness(self, view: View, known: Correspondence) -> list[Event]:
        """Learn from where somebody else drives the robot."""
        self._events = []
        self._retracing.note(view, known)
        found = access(view)
        if found is not None and found.place.distance <= NEAR_M:
            self._learn(view, known, found.place)
        return self._events

    def make_way(self, view: View, known: Correspondence) -> tuple[Order, list[Event]]:
        """Be in nobody's way, with nothing else to do; the order for the next keyframe interval."""
        events, found = self.witness(view, known), access(view)
        if found is None or found.place.distance > NEAR_M:
            return Stand(), events
        return self._path_following.stand_by(view, self._situation(view, known, found)), events

    def reopen(self) -> None:
        """Go on after the end: also to what was given up."""
        self.outcome, self.reason = None, ""
        for end in self._mapper.graph.blocked():
            half = self._mapper.graph.half_edge(end)
            assert half is not None
            half.blocked = False
        self._obstructions = self._no_obstructions()
        self._scouting, self._search = Scouting(), Search()
        self._progress = Progress(self._mapper)
        self._path_following = self._new_path_following()
        self._retracing.renew()
        self.set_aside()

    def set_aside(self) -> None:
        """Let the robot do something else; choose anew when it comes back."""
        self.target = None
        self._progress.set_aside()
        self._path_following.renew()
        self._examination.end()
        self._hindrance.end()
        self._search.end()
        self._scouting.end()
        self._backtracking.end()
        self._retracing.end()

    def configure(self, config: ExplorationConfig) -> None:
        """Use another configuration from now on."""
        self._config = self.choice.config = config

    def skip(self, seconds: float) -> None:
        """Let no patience run out by a time in which nothing was to be seen."""
        self._progress.skip(seconds)
        self._search.skip(seconds)
        self._scouting.skip(seconds)
        self._hindrance.skip(seconds)
        self._examination.skip(seconds)

    def meet(self, local_base: Pose, company: list[Companion]) -> None:
        """Note where other robots are, local frame."""
        self._neighbours.meet(local_base, company)

    def hold(self) -> None:
        """Note that the robot cannot go on just now: somebody may be in its way."""
        self._hindrance.hold()

    def obstruct(self, reason: str) -> None:
        """Note that there is no way on."""
        self._hindrance.obstruct(reason)

    # -- the edge under the wheels -------------------------------------------------------------

    def _learn(self, view: View, known: Correspondence, place: Place) -> None:
        """Account for what has been driven, and for what the target is called now."""
        unsettled, came_from = self._mapper.unsettled, self._mapper.came_from
        self.target = unsettled.current(self.target)
        while self.target in came_from:
            self.target = came_from[self.target][0]
        self._driven.learn(view, known, place, self.where)
        came_from.clear()

    # -- where next ------------------------------------------------------------------------------

    def _decide(self, view: View, here: Situation) -> Order:
        self._set_target(view, here)
        if self.outcome is not None or self._retracing.is_on:
            return Stand()
        if self.target is None:
            return self._go_without_target(view, here)
        self._neighbours.depart_unseen(self._mapper, view, here, self.target)
        turn = self._overlooked.turn(view, here, self.target)
        if turn:
            return LookAround(turn)
        path = here.path_to(self.target)
        if path is None:
            return self._wait_for_a_way(view, here)
        self._scouting.rest(view.stamp)
        return self._drive(view, here, path)

    def _set_target(self, view: View, here: Situation) -> None:
        """Keep the target as long as there is none better; None if there is nothing to go for."""
        graph = self._mapper.graph
        if self.choice.sharing is not None:  # what was in the way may have been one that drives on
            self._reopen(view, "the way may be free again")
        if self._progress.finds_nothing_new:
            self._give_all_up(view, "they have not led anywhere new for a long time")
        target = self.target
        half = None if target is None else graph.half_edge(target)
        if target is None or half is None or not half.open:
            if target is not None:
                self._progress.come_to_an_end()
            self.target = self._choose(view, here)
            self._frontiers = set(graph.frontiers())
        else:
            self.target = self._reconsidered(view, here, target)

    def _go_without_target(self, view: View, here: Situation) -> Order:
        """Wait, look for a way to what is left, or examine what is in sight; at first, go on."""
        graph = self._mapper.graph
        if self._examination.is_over and self.choice.is_left_to_others:
            return Stand()
        if self._obstructions.waiting or self.choice.waits_for_others:
            self._progress.wait(view.stamp)
            if self.choice.waits_for_others:
                self._progress.set_aside()
            return self._path_following.draw_back(view, here)
        if graph.frontiers():
            return self._wait_for_a_way(view, here)
        if graph.vertices:
            return self._examine(view, here)
        path = self._ahead(view, here)
        self._scouting.end()
        return self._drive(view, here, path)

    def _ahead(self, view: View, here: Situation) -> tuple[Branch, ...]:
        """Straight on; before a vertex is known, once back if others have driven what is ahead."""
        may_turn = not (self._has_turned or self._mapper.graph.vertices)
        if may_turn and self.choice.is_led(view, here, either_way=False):
            self._has_turned = self.where.turn_round()
        return here.ahead()

    def _choose(self, view: View, here: Situation) -> HalfEdgeId | None:
        """The next frontier, by the policy."""
        graph = self._mapper.graph
        if not graph.vertices and not self.choice.is_led(view, here, either_way=True):
            self.choice.go_ahead()
            return None
        chosen, reason = self.choice.ear(self.target), "ear"
        if chosen is None:
            chosen, reason = self.choice.under_way(here), "nearest frontier"
        if chosen is None:
            nearest = self.choice.nearest(here.starts())
            if nearest is None and self._reopen(view, "nothing else is left"):
                nearest = self.choice.nearest(here.starts())
            if nearest is None:
                if self._team_is_done(view):
                    self._end_with_team(view)
                elif not (self.choice.waits_for_others or self._retracing.is_on):
                    self._give_up_the_rest(view)
                return None
            self._scouting.end()
            chosen = nearest[0]
        if self._progress.is_vain(chosen):
            self._leave(view, chosen, "whenever it is explored there is another one", retries=0)
            return None
        self._commit(view, here, chosen, reason)
        return chosen

    def _end_with_team(self, view: View) -> None:
        """End at the second look: the robot may have something else to do."""
        if self._examination.is_over:
            graph, unfollowed = self._mapper.graph, self.choice.unfollowed
            self._end(view, *left_to_others(graph, unfollowed, self.remark))
        self._examination.is_over = self.choice.is_left_to_others

    def _team_is_done(self, view: View) -> bool:
        """Whether all is left to others, and no way is worth a wait, or to be looked for."""
        if not self.choice.is_left_to_others:
            return False
        if self.choice.is_all_followed:
            self._mapper.forget_strays(view)
            return True
        return not self._obstructions.waiting and not self._begins_to_retrace(view)

    def _reconsidered(self, view: View, here: Situation, target: HalfEdgeId) -> HalfEdgeId | None:
        """The target, or a frontier found just now that is nearer than what is left of the way."""
        frontiers = set(self._mapper.graph.frontiers())
        found, self._frontiers = frontiers - self._frontiers, frontiers
        if not self.choice.keeps(target, here):
            return self._choose(view, here)
        if self.where.on_edge == target:
            return target
        nearer = self.choice.nearer(target, found, here.starts()) if found else None
        if nearer is None or self._progress.is_vain(nearer):
            return target
        self._commit(view, here, nearer, "nearer frontier")
        return nearer

    def _commit(self, view: View, here: Situation, chosen: HalfEdgeId, reason: str) -> None:
        way = shortest_paths(self._mapper.graph, here.starts()).get(chosen.vertex)
        self._progress.set_out(view, chosen, 0.0 if way is None else way.metres, self._config)
        self._path_following.renew()
        self._backtracking.renew()
        self._examination.end()
        self._hindrance.end()
        self._scouting.end()
        vertex = self._mapper.graph.vertices[chosen.vertex]
        psi = self._mapper.belief.map_vertex(chosen.vertex).theta
        bearing = wrap_angle(vertex.half_edges[chosen.key].bearing + psi)
        self._events.append(Decision(view.stamp, chosen.vertex, bearing, reason))

    def _wait_for_a_way(self, view: View, here: Situation) -> Order:
        """Drive on until a known vertex comes into sight, before a frontier is given up."""
        scouting = self._scouting
        if not scouting.is_on:
            scouting.begin(view.stamp, view.local_base.position)
            self._path_following.renew()
            self._events.append(Recovery(view.stamp, "drive on", "no way leads to the frontier"))
        near = None
        if self.target is None:
            near = scouting.path_near(here, self._mapper.belief, view.stamp)
        if near is not None:
            return self._drive(view, here, near)
        if scouting.lasted(view.stamp) > self._config.patience_s:
            scouting.end()
            if self._begins_to_retrace(view):
                return Stand()
            if self.target is None or self._mapper.graph.half_edge(self.target) is not None:
                self._give_up(view, "no way leads there")
        return self._drive(view, here, scouting.path_on(here))

    def _drive(self, view: View, here: Situation, path: tuple[Branch, ...]) -> Order:
        order, done = self._path_following.follow(
            view, here, path, self._config.look_around_s, looks_anew=self._scouting.is_on
        )
        self._events += done
        if order is None:
            self._see_no_more(view, here)
            return Stand()
        return order

    def _go_back(self, view: View) -> Order | None:
        """Over where the robot came from, until it sees vertices that it knows."""
        self._watch_progress(view)
        track = None
        if self.target is not None:
            track = self._backtracking.track(view, self.where, self._neighbours.company)
        if track is None:
            self._backtracking.end()
            return None
        return Drive(track)

    def _retrace(self, view: View) -> Order | None:
        """Back to what no known way leads to; None unless the robot is about that."""
        if not self._retracing.is_on:
            return None
        headway, track = self._progress.headway, None
        headway.note(view.local_base.position, view.stamp)
        if headway.waited(view.stamp) < self._config.in_the_way_s:
            track = self._retracing.track(view, self._neighbours.company)
        if track is None:
            self._retracing.end()
            self._scouting.end()
            return None
        return Drive(track)

    def _access(self, view: View) -> Order:
        """Go to the nearest edge, if the way there is free."""
        way = way_to_edge(view)
        if way is None:
            return self._look_for_an_edge(view)
        self._search.end()
        self._watch_progress(view)
        return Stand() if self.outcome is not None else Drive(Track.of(*way))

    def _end_search(self, view: View) -> None:
        """An edge is in sight; for who leaves a slot, only after it has come into the open.

        What it knew of the slot need not hang together with what is there.
        """
        if self._search.leaves_slot:
            if self._search.is_driving or is_tight(view):
                return
            for vertex in list(self._mapper.graph.vertices.values()):
                self._mapper.remove(view, vertex, "nothing leads on from there")
        self._search.end()

    def _look_for_an_edge(self, view: View) -> Order:
        """No edge in sight: look around, here and where there is more room, and go back."""
        if self._search.is_driving:
            self._watch_progress(view)
        elif self._search.has_looked and self._ends_in_closed_room(view):
            return Stand()
        order, done = self._search.advance(view, self._progress.headway, self._config)
        self._events += done
        if isinstance(order, Stand):
            self._end_search_in_vain(view)
        return order

    def _examine(self, view: View, here: Situation) -> Order:
        """Look at what may be a vertex, give others a chance to know more to do, and end."""
        path = self._examination.path(view, here, self._config.patience_s)
        if path is not None:
            self._examination.is_over = False
            return self._drive(view, here, path)
        if not self._examination.is_over:
            self._examination.is_over = True
            return Stand()
        explored = outcome, reason = all_examined(self._mapper.graph, self.remark)
        if outcome == "explored":
            survey = self.survey if self._knows_a_slot(view) else None
            self._conclude(view, unless_shut_in(survey, explored))
        else:
            self._end_before(view, reason)
        return Stand()
