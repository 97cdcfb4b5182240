"""What can be asked of the robot, and what it does first because of that."""

import math

from gvgbot.autonomy.control.orders import Order, Stand
from gvgbot.autonomy.destinations import Route, route_to_vertex
from gvgbot.autonomy.errands.driving import DIRECT_M, Driving, Ended, Ground
from gvgbot.autonomy.errands.kinds import (
    Coverage,
    Errand,
    Home,
    Look,
    Patrol,
    ToPoint,
    ToVertex,
)
from gvgbot.autonomy.errands.own_tasks import OwnTasks
from gvgbot.autonomy.errands.plans import Here, Kept, Plan, plan_for, recalled
from gvgbot.autonomy.events import ErrandEnded, Event
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.exploration.paths import shortest_paths
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.mission import Mission
from gvgbot.autonomy.views import Correspondence, View
from gvgbot.autonomy.whereabouts import Situation
from gvgbot.geometry import STANDSTILL, Twist

_MOST_NAMED = 40  # vertices, in an answer
_MOST_STOPS = 10  # that are passed at once
_HOLD_S = 0.5  # that a twist of somebody who drives holds; without another one the robot stands


class Declined(Exception):
    """The robot will not do that, and says why; nothing has changed."""


class Errands:
    """Stands between the pipeline and the mission, which goes on where it was when there is none.

    What is asked for is answered with what happens now; Declined says why nothing does. `room_m`
    is how far from the walls the robot drives where there is no edge.
    """

    def __init__(
        self, mission: Mission, mapper: Mapper, config: ExplorationConfig, room_m: float
    ) -> None:
        self._mission, self._mapper, self._config = mission, mapper, config
        self.room_m, self._ground = room_m, Ground(mission, mapper, room_m)
        self.closures = self._ground.closures
        self.is_paused = False
        self.is_carried = False  # perhaps: it paused by itself, until it is started anew
        self.is_waiting = False  # after an errand, for what comes next
        self.unplaced = ""  # why it found no place on its map when it looked for that
        self.is_lost = False  # somebody doubts the pose; whoever takes that into account resets it
        self.happened: list[Event] = []  # because of requests; whoever tells of it takes it out
        self._seen: tuple[View, Correspondence] | None = None
        self.own_tasks = OwnTasks(config.certainty, mission, mapper)
        self._is_own = False  # the errand: nobody asked for it, and exploring goes on after it
        self._plan: Plan | None = None
        self._driving: Driving | None = None
        self._command: tuple[Twist, float] | None = None  # of whoever drives, and when it came, s

    @property
    def errand(self) -> Errand | None:
        """What the robot is about, other than exploring."""
        return None if self._plan is None else self._plan.errand

    @property
    def progress(self) -> str | None:
        """The errand, and how far that is, in words."""
        if self._command is not None:
            return "driven by somebody"
        return None if self._plan is None else str(self._plan)

    @property
    def is_resting(self) -> bool:
        """Whether there is nothing to do but to stand."""
        is_free = self._plan is None and self._command is None
        is_over = is_free and (self.is_waiting or self._mission.outcome is not None)
        return self.is_paused or is_over or bool(self.unplaced)

    @property
    def stands_by(self) -> bool:
        """Whether it has explored what it could, and nobody has asked it for anything since."""
        asked = self.is_paused or self.is_waiting or self.unplaced
        return self.is_resting and not asked and self._mission.outcome != "stopped"

    @property
    def is_exploring(self) -> bool:
        """Whether it is the robot that decides where to drive."""
        is_own = self._is_own or (self._plan is None and self._command is None)
        return is_own and not self.is_resting

    def configure(self, config: ExplorationConfig) -> None:
        """Use another configuration from now on."""
        self._config = config
        self.own_tasks.configure(config.certainty)
        self._mission.configure(config)
        if self._driving is not None:
            self._driving.config = config

    # -- what can be asked for ---------------------------------------------------------------------

    def pause(self) -> str:
        """Stand until `resume`."""
        self.is_carried = False
        if self.is_paused:
            return "it is paused already"
        self.is_paused, self._command = True, None
        return "it stands still until it is asked to resume"

    def resume(self) -> str:
        """Go on with what was paused."""
        if not self.is_paused:
            return "it was not paused"
        self.is_paused = self.is_carried = False
        if self.unplaced:
            return self._unplaced_for()
        if self._plan is not None:
            return f"it goes on with: {self._plan}"
        if self.is_resting:
            return "it is not paused any more, and has nothing to do"
        return "it goes on exploring"

    def stop(self, stamp: float) -> str:
        """End the errand and the exploration."""
        self.is_paused = False
        had_errand = self._plan is not None
        self._end(stamp, "stopped", "by a request")
        if self._mission.outcome is not None:
            if had_errand:
                return f"it stands; the exploration had ended before: {self._mission.outcome}"
            return f"it had ended before: {self._mission.outcome}"
        self.happened.append(self._mission.stop(stamp, "stopped by a request"))
        return "the exploration has ended"

    def explore(self, stamp: float) -> str:
        """Go on exploring, even if that had ended; after a restart by finding its place first."""
        if not self.is_resting or self.is_paused:
            self._check_going(stamp)
        if self._plan is None and self._command is None and not self.is_resting:
            return "it is exploring already"
        self._end(stamp, "replaced", "by explore")
        self.is_waiting, self.unplaced = False, ""
        self.closures.open_all(self._mapper.graph)
        if self._mission.outcome is not None:
            self._mission.reopen()
            self.own_tasks.reopen()
        return f"it explores; {len(self._mapper.graph.frontiers())} frontiers are known"

    def relocalise(self, stamp: float) -> str:
        """Find the place in the map again, by the walls around."""
        self._check_going(stamp)
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
        self._check_going(stamp)
        self._check_known(vertex)
        if self.errand == ToVertex(vertex) and not self._is_own:
            return f"it is on its way to vertex {vertex} already"
        route = self._way_to_vertex(vertex)
        if route is None and self.closures.open_all(self._mapper.graph):
            route = self._way_to_vertex(vertex)  # what was in the way may have gone
        if route is None and self.whereabouts() is not None:
            raise Declined(f"no known way leads to vertex {vertex}")
        self._take(ToVertex(vertex), stamp)
        far = "" if route is None else f" {route.metres:.1f} m"
        return f"it drives{far} to vertex {vertex}"

    def patrol(self, vertices: tuple[int, ...], stamp: float) -> str:
        """Drive from vertex to vertex over and over, in this order; to all if none is named."""
        self._check_going(stamp)
        for vertex in vertices:
            self._check_known(vertex)
        places = set(vertices or self._mapper.graph.vertices)
        if len(places) < 2:
            raise Declined(f"a patrol takes two vertices or more; {self._known_vertices()}")
        if self.errand == Patrol(vertices):
            return f"it does that already: {self._plan}"
        if not places <= set.intersection(*(self._in_reach() or [set()])):
            self.closures.open_all(self._mapper.graph)
        self._take(Patrol(vertices), stamp)
        return f"it patrols {len(places)} vertices until it is asked for something else"

    def coverage(self, stamp: float) -> str:
        """Drive over every edge once."""
        self._check_going(stamp)
        edges = self._mapper.graph.edges.values()
        if not edges:
            raise Declined("no edge is known yet that it could drive on")
        if isinstance(self.errand, Coverage):
            return f"it does that already: {self._plan}"
        self.closures.open_all(self._mapper.graph)
        self._take(Coverage(), stamp)
        reached = set().union(*self._in_reach()) or self._mapper.graph.vertices.keys()
        lengths = [edge.length for edge in edges if edge.a.vertex in reached]
        return (
            f"it drives over {len(lengths)} of {len(edges)} edges, {sum(lengths):.0f} m "
            "and what must be driven twice"
        )

    def drive(self, twist: Twist, stamp: float) -> bool:
        """Let somebody else drive until something is asked for; whether that is new.

        A twist holds until the next one comes, but not for long. Meanwhile the robot learns.
        """
        self._check_going(stamp)
        is_new = self._command is None
        if is_new:
            self._end(stamp, "replaced", "by somebody who drives")
            self._mission.set_aside()
            self.is_waiting = True
        self._command = twist, stamp
        return is_new

    def command(self, stamp: float) -> Twist | None:
        """What somebody who drives wants now; None if nobody does."""
        if self._command is None:
            return None
        twist, since = self._command
        return twist if stamp - since < _HOLD_S else STANDSTILL

    def _drive_to_point(self, errand: ToPoint | Home, stamp: float) -> str:
        self._check_going(stamp)
        if self.errand == errand and not self._is_own:
            return "it is on its way there already"
        base = self._mapper.belief.map_base
        away = math.hypot(errand.x - base.x, errand.y - base.y)
        here = self.whereabouts()
        trouble = self._ground.trouble_to(errand, here)
        if trouble is not None and self.closures.open_all(self._mapper.graph):
            trouble = self._ground.trouble_to(errand, here)
        if trouble is not None and away > DIRECT_M:
            raise Declined(trouble)
        self._take(errand, stamp)
        where = "to where it started" if isinstance(errand, Home) else "there"
        return f"it drives {where}, {away:.1f} m away in a straight line"

    def _way_to_vertex(self, vertex: int) -> Route | None:
        here = self.whereabouts()
        if here is None:
            return None
        return route_to_vertex(self._mapper.graph, here.starts(), vertex)

    def _in_reach(self) -> list[set[int]]:
        """The vertices that known ways lead to from each that the robot may come to first.

        It may be between two of them, with something in the way behind it or ahead.
        """
        here = self.whereabouts()
        starts = [] if here is None else here.starts()
        return [set(shortest_paths(self._mapper.graph, [start])) for start in starts]

    def _unplaced_for(self) -> str:
        again = "it looks again when it is asked to explore"
        return f"it has looked for its place, and is {self.unplaced}; {again}"

    def _check_going(self, stamp: float) -> None:
        if self.is_paused:
            raise Declined("it is paused: ask it to resume first")
        if self._seen is None and self.is_resting and self.unplaced:
            raise Declined(self._unplaced_for())
        if self._seen is None and self.is_resting:
            raise Declined("it has not looked for its place since its start: ask it to explore")
        if self._seen is None:
            raise Declined("it has not seen enough yet to know where it is")
        self.closures.open_due(self._mapper.graph, stamp)

    def _check_known(self, vertex: int) -> None:
        if vertex not in self._mapper.graph.vertices:
            raise Declined(f"there is no vertex {vertex}; {self._known_vertices()}")

    def _known_vertices(self) -> str:
        """Which vertices there are, in a few words."""
        ids = self._mapper.graph.vertices
        if not ids:
            return "none is known yet"
        named = ", ".join(str(vertex) for vertex in sorted(ids)[:_MOST_NAMED])
        return f"there are {named}" + (" and others" if len(ids) > _MOST_NAMED else "")

    def whereabouts(self) -> Situation | None:
        """Where the robot was on the graph when it last looked; None if that was off it."""
        return None if self._seen is None else self._ground.situation(*self._seen)

    def _take(self, errand: Errand, stamp: float) -> None:
        self._end(stamp, "replaced", f"by {errand}")
        self._mission.set_aside()
        self.is_waiting = False
        self._plan = plan_for(errand)

    def _end(self, stamp: float, how: str, reason: str) -> None:
        """Be done with the errand, if there is one, and wait for what comes next."""
        if self._plan is not None:
            self.happened.append(ErrandEnded(stamp, str(self._plan.errand), how, reason))
            self.is_waiting = not self._is_own
        if self._is_own:
            self.closures.open_due(self._mapper.graph, math.inf)
        self._is_own = False
        self._plan = self._driving = self._command = None

    def give_up(self, stamp: float, reason: str) -> None:
        """End the errand, if there is one: it is about a map that is forgotten."""
        self._end(stamp, "given up", reason)

    # -- after a restart ---------------------------------------------------------------------------

    def kept(self) -> Kept | None:
        """What there is to remember of the errand that somebody asked for."""
        return None if self._plan is None or self._is_own else self._plan.kept()

    @property
    def will_wait(self) -> bool:
        """Whether it waits, or would after a restart: what it is about cannot be kept."""
        is_asked = self._plan is not None and not self._is_own
        return self.is_waiting or (is_asked and self.kept() is None)

    def recall(self, kept: Kept | None) -> None:
        """Go on with an errand that was remembered."""
        self._plan = None if kept is None else recalled(kept)

    def forget(self) -> None:
        """Be free to explore: what a robot was asked for is no part of its map."""
        self.recall(None)
        self.is_waiting = self.is_paused = False

    # -- what is done about it ---------------------------------------------------------------------

    def advance(self, view: View, known: Correspondence) -> tuple[Order, list[Event]]:
        """The order for the next keyframe interval, and what has happened."""
        self._seen = view, known
        self.closures.open_due(self._mapper.graph, view.stamp)
        if self._command is not None:
            return Stand(), self._mission.witness(view, known) + self.take_events()
        if self._plan is None and self._mission.outcome is not None:
            return self._mission.make_way(view, known)
        if self._plan is None:
            task = self.own_tasks.next(view, self.whereabouts)
            if task is None:
                return self._mission.advance(view, known)
            if isinstance(task, Stand):
                return task, self._mission.witness(view, known)
            self._take(task.errand, view.stamp)
            self._is_own = True
            self.happened.append(task.decision)
        happened = self._mission.witness(view, known)
        order = self._pursue(view, known)
        return order, happened + self.take_events()

    def take_events(self) -> list[Event]:
        """What has happened and was not told of yet."""
        happened, self.happened = self.happened, []
        return happened

    def hold(self) -> None:
        """Note that the robot cannot go on just now: somebody may be in its way."""
        if self._plan is None and self._command is None:
            self._mission.hold()

    def obstruct(self, reason: str) -> None:
        """Note that there is no way on."""
        if self._plan is None and self._command is None:
            self._mission.obstruct(reason)
        elif self._driving is not None:
            self._driving.obstruct()

    def _pursue(self, view: View, known: Correspondence) -> Order:
        """Drive to the stop, or on to the next one; a stop to pass is no reason to stand."""
        for _ in range(_MOST_STOPS):
            plan = self._plan
            assert plan is not None, "there is an errand"
            driving = self._driving or self._next(plan, view)
            if driving is None:
                break
            order = driving.advance(view, known)
            self.happened += driving.happened
            driving.happened.clear()
            if not isinstance(order, Ended):
                return order
            plan.note(self._here(view), order)
            self._driving = None
        return Stand()

    def _next(self, plan: Plan, view: View) -> Driving | None:
        """Begin to drive to the next stop; without one that is the end of the errand."""
        stop = plan.next(self._here(view))
        self.happened += plan.happened
        plan.happened.clear()
        if isinstance(stop, Ended):
            self._end(view.stamp, stop.outcome, stop.reason)
            return None
        self._driving = Driving(stop, self._ground, self._config)
        return self._driving

    def _here(self, view: View) -> Here:
        here = self.whereabouts()
        starts = [] if here is None else here.starts()
        return Here(view.stamp, self._mapper.graph, starts, view.travelled)
