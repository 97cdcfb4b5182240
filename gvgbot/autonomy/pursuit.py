"""What the robot goes after, and what is done when it does not get there."""

from gvgbot.autonomy.backtracking import Backtracking
from gvgbot.autonomy.choice import Choice
from gvgbot.autonomy.ending import (
    Outcome,
    Survey,
    cut_short,
    has_meetpoints,
    leading_nowhere,
    unless_closed_room,
    without_target,
)
from gvgbot.autonomy.events import Event, Finished, Recovery
from gvgbot.autonomy.examination import Examination
from gvgbot.autonomy.exploration.access import is_tight
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.exploration.hindrance import Hindrance
from gvgbot.autonomy.exploration.obstructions import Obstructions
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.neighbours import Neighbours
from gvgbot.autonomy.path_following import PathFollowing
from gvgbot.autonomy.progress import Progress
from gvgbot.autonomy.retracing import Retracing
from gvgbot.autonomy.scouting import Scouting
from gvgbot.autonomy.search import NO_EDGE, Search
from gvgbot.autonomy.situation import Situation
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.autonomy.topology import piece_of
from gvgbot.autonomy.views import View
from gvgbot.autonomy.whereabouts import Whereabouts

_UNSEEN = "the way on is not to be seen"
_SECOND = 1  # try, in the end, of what was given up: things may have changed


class Pursuit:
    """Of one target after the other; each is reached, closed for a while, or given up."""

    def __init__(self, config: ExplorationConfig, mapper: Mapper) -> None:
        self._config, self._mapper = config, mapper
        self.where = Whereabouts()
        self.choice = Choice(config, mapper)
        self.survey: Survey | None = None  # of what is worth another look in the end
        self.target: HalfEdgeId | None = None
        self.outcome: Outcome | None = None
        self.reason = ""
        self.remark = ""  # on how certain the map is, for the end
        self._progress = Progress(mapper)
        # before it knew a vertex: others had driven on, or nothing was there
        self._has_turned = False
        self._obstructions = self._no_obstructions()
        self._hindrance, self._search = Hindrance(), Search()
        self._otherwise: tuple[Outcome, str] = "failed", ""  # if it does not get out of a slot
        self._neighbours = Neighbours()
        self._scouting, self._backtracking = Scouting(), Backtracking()
        self._retracing = Retracing()
        self._path_following = self._new_path_following()
        self._examination = Examination(mapper)
        self._events: list[Event] = []

    @property
    def is_choosing(self) -> bool:
        """Whether a task is done, and the next one has to be chosen on the graph."""
        graph = self._mapper.graph
        half = None if self.target is None else graph.half_edge(self.target)
        return self.outcome is None and bool(graph.vertices) and (half is None or not half.open)

    @property
    def is_waiting(self) -> bool:
        """Whether ways are closed that will be tried again."""
        return self._obstructions.waiting

    def stop(self, stamp: float, reason: str, outcome: Outcome = "stopped") -> Event:
        """End the exploration, because somebody wants that or it cannot even begin."""
        self.outcome, self.reason = outcome, reason
        return Finished(stamp, outcome, reason)

    def _new_path_following(self) -> PathFollowing:
        """As at the beginning; it waits by the headway of the progress that there is now."""
        return PathFollowing(self._neighbours, self._hindrance, self._progress.headway)

    # -- something in the way ----------------------------------------------------------------------

    def _no_obstructions(self) -> Obstructions:
        config, names = self._config, self._mapper.unsettled.names
        return Obstructions(config.retries, config.retry_after_s, names)

    def _watch_the_way(self, view: View) -> None:
        """Wait a little for what stands in the way, then try another one."""
        reason = self._hindrance.reason_to_turn(
            view.stamp,
            has_come_on=self._progress.headway.waited(view.stamp) == 0.0,
            patience_s=self._neighbours.patience * self._config.in_the_way_s,
        )
        if reason:
            self._block(view, reason)

    def _block(self, view: View, reason: str) -> None:
        """Close the edge under the wheels, or else the target, for a while."""
        self.where.leave()
        end = self.where.on_edge if self.target is not None else None
        edge = None if end is None else self._mapper.graph.edge_at(end)
        ends = (self.target,) if edge is None else (edge.a, edge.b)
        closed = [end for end in ends if end is not None]
        if not closed:
            if self.choice.sharing is not None:  # who is in the way may have driven the rest
                self.where.turn_round()
            return
        self._obstructions.close(self._mapper.graph, closed, view.stamp)
        self._events.append(Recovery(view.stamp, "try another way", reason))
        self.target = None

    def _reopen(self, view: View, reason: str) -> bool:
        """Open what was closed long enough ago; whether there was something."""
        opened = self._obstructions.open(self._mapper.graph, view.stamp)
        if opened:
            self._examination.end()
            self._events.append(Recovery(view.stamp, "try again", reason))
        return opened

    # -- no way on ---------------------------------------------------------------------------------

    def _see_no_more(self, view: View, here: Situation) -> None:
        """Go another way, or give up what is ahead: of what no way leads to, what is nearest."""
        if (
            self._turns_round(view)
            or self._returns_to_vertex(view, here)
            or self._closes_unseen_edge(view, here)
        ):
            return
        if self.target is None and self._scouting.is_on:
            self.target = self._frontier_beside(view)
        self._give_up(view, "nothing more is to be seen there")

    def _turns_round(self, view: View) -> bool:
        """Go the other way, once, before a vertex is known; whether it does.

        Who starts in the corner of a room may have gone into that first.
        """
        if self._has_turned or self._mapper.graph.vertices:
            return False
        self._has_turned = self.where.turn_round(view.local_base.theta)
        if self._has_turned:
            self._path_following.renew()
            self._events.append(Recovery(view.stamp, "turn round", "this way leads nowhere"))
        return self._has_turned

    def _returns_to_vertex(self, view: View, here: Situation) -> bool:
        """Go back to the vertex where the way goes on, once, over where the robot came from there.

        A door that it just fits through may seem too narrow from another side. Whether it does.
        """
        departures = None if self.target is None else here.departures_to(self.target)
        if departures is None or departures[0] == self.where.on_edge:
            return False
        self._path_following.renew()
        return self._retraces(view, {departures[0].vertex}, _UNSEEN)

    def _closes_unseen_edge(self, view: View, here: Situation) -> bool:
        """Close the edge by which the way goes on here if that is not to be seen; whether it was.

        The target lies beyond it, and there may be another way.
        """
        departures = None if self.target is None else here.departures_to(self.target)
        edge = None if departures is None else self._mapper.graph.edge_at(departures[0])
        if departures is None or edge is None or departures[0] in here.known.branch_of:
            return False
        self.target = None
        self._path_following.renew()
        self._obstructions.close(self._mapper.graph, [edge.a, edge.b], view.stamp)
        self._events.append(Recovery(view.stamp, "try another way", _UNSEEN))
        return True

    def _begins_to_retrace(self, view: View) -> bool:
        """Forget what was only seen and nothing leads to; whether it goes back to what was driven.

        If something was forgotten, it may be missing now. Who is on no edge of the map goes back to
        where it was on one.
        """
        vertices, on_edge = self._mapper.graph.vertices, self.where.on_edge
        here = set() if on_edge is None else piece_of(self._mapper.graph, on_edge.vertex)
        before = len(vertices)
        self._mapper.forget_strays(view)
        if len(vertices) < before:
            self._examination.end()
        reason = "no known way leads to a part of the map"
        return self._retraces(view, vertices.keys() - here, reason)

    def _retraces(self, view: View, lost: set[int], reason: str) -> bool:
        """Go back to where one of these vertices was near last; whether it does."""
        if not self._retracing.begin(lost):
            return False
        self._events.append(Recovery(view.stamp, "retrace the way", reason))
        self._progress.wait(view.stamp)
        return True

    # -- giving up ---------------------------------------------------------------------------------

    def _watch_progress(self, view: View) -> None:
        driven_m = self.where.trail_length if self.where.on_edge == self.target else 0.0
        reason = self._progress.trouble(view, self.target, driven_m, self._config)
        if reason is None:
            return
        if self.target is None or self._mapper.graph.half_edge(self.target) is None:
            self.target = self._frontier_beside(view)  # one that comes and goes
        self._give_up(view, reason)

    def _give_up(self, view: View, reason: str) -> None:
        """Mark the target as blocked, after having gone back; without one, that is the end.

        Not where somebody stands who may go: then there may be more to be seen.
        """
        self._path_following.renew()
        half = None if self.target is None else self._mapper.graph.half_edge(self.target)
        if half is None:
            is_going_back = self._begins_to_retrace(view)
            is_done = self._mapper.graph.vertices and not self._mapper.graph.frontiers()
            if is_going_back or is_done or view.is_somebody_near():
                return
            self._conclude(view, without_target(self._mapper.graph, self.survey, reason))
            return
        has_left = self.where.on_edge not in (None, self.target)
        if has_left and self._backtracking.begin():
            self._events.append(Recovery(view.stamp, "go back", reason))
            return
        assert self.target is not None, "it has a half-edge"
        may_go = view.is_somebody_near()
        retries = self._config.retries if may_go else _SECOND
        self._leave(view, self.target, reason, retries=retries)
        self.target = None

    def _leave(self, view: View, frontier: HalfEdgeId, reason: str, *, retries: int) -> None:
        """Give up a frontier, to be tried again so many times in the end."""
        self._obstructions.close(self._mapper.graph, [frontier], view.stamp, retries=retries)
        self._events.append(Recovery(view.stamp, "give up a frontier", reason))

    def _give_all_up(self, view: View, reason: str) -> None:
        """Close all frontiers, if there are any."""
        frontiers = self._mapper.graph.frontiers()
        if frontiers:
            self._obstructions.close(self._mapper.graph, frontiers, view.stamp, retries=0)
            self._events.append(Recovery(view.stamp, "give all frontiers up", reason))
            self.target = None

    def _end_at_last(self, view: View) -> None:
        """End, whatever the robot is about, once it is told how."""
        reason = "they have not led anywhere new for far too long"
        verdict = without_target(self._mapper.graph, self.survey, reason)
        if verdict is not None:
            self._end(view, *verdict)

    def _frontier_beside(self, view: View) -> HalfEdgeId | None:
        """The frontier nearest to the robot as the crow flies."""

        def away(end: HalfEdgeId) -> float:
            return self._mapper.in_local_frame(view, end.vertex).distance(view.local_base)

        return min(self._mapper.graph.frontiers(), key=away, default=None)

    def _give_up_the_rest(self, view: View) -> None:
        """Close frontiers that cannot be reached, after having looked for a way."""
        if self._scouting.lasted(view.stamp) < self._config.patience_s:
            return
        if not self._begins_to_retrace(view):
            self._give_all_up(view, "no way leads there")

    def _end_before(self, view: View, reason: str) -> None:
        """End with frontiers left, once it is told whether they are any."""
        self._conclude(view, leading_nowhere(self._mapper.graph, self.survey, reason))

    def _conclude(self, view: View, verdict: tuple[Outcome, str] | None) -> None:
        """End, once it is told how; from a slot the robot goes into the open first."""
        if verdict is None:
            return
        is_hopeful = verdict[0] != "explored" and self._knows_a_slot(view)
        if is_hopeful and self._search.begin_in_slot():
            self._otherwise = verdict
            return
        self._end(view, *verdict)

    def _ends_in_closed_room(self, view: View) -> bool:
        """End if all floor is in sight, and no edge; whether it does, or has to wait for that."""
        graph = self._mapper.graph
        found = unless_closed_room(graph, self.survey, cut_short(graph, NO_EDGE, NO_EDGE))
        if found is not None and found[0] == "explored":
            self._end(view, *found)
        self._search.has_looked = found is None
        return found is None or self.outcome is not None

    def _end_search_in_vain(self, view: View) -> None:
        """No edge is in sight from here: go back to where some were, once, or end."""
        graph, verdict = self._mapper.graph, self._otherwise
        if not self._search.leaves_slot:
            if self._retraces(view, set(graph.vertices), NO_EDGE):
                self._search.end()
                return
            reason = f"{NO_EDGE}: there are no walls within range, or no way out"
            nowhere = cut_short(graph, reason, NO_EDGE)
            found = unless_closed_room(graph, self.survey, nowhere)
            if found is None:
                return
            verdict = found
        self._end(view, *verdict)

    def _knows_a_slot(self, view: View) -> bool:
        """Whether the robot is in a narrow place, and knows an edge at most."""
        return is_tight(view) and not has_meetpoints(self._mapper.graph)

    def _end(self, view: View, outcome: Outcome, reason: str) -> None:
        self.outcome, self.reason = outcome, reason
        if outcome == "explored" and not self.choice.is_left_to_others:
            self._mapper.forget_frontiers(view)
            self._mapper.forget_strays(view)
        self._mapper.forget_bends(view)
        self._mapper.establish()
        self._events.append(Finished(view.stamp, outcome, reason))
