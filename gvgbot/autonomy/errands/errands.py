"""What can be asked of the robot, and what it does first because of that."""

import math

from gvgbot.autonomy.destinations import Route, route_to_vertex
from gvgbot.autonomy.errands.agenda import Agenda
from gvgbot.autonomy.errands.driving import DIRECT_M
from gvgbot.autonomy.errands.kinds import Coverage, Home, Look, Patrol, Stop, ToPoint, ToVertex
from gvgbot.autonomy.exploration.paths import shortest_paths
from gvgbot.autonomy.situation import Situation
from gvgbot.geometry import Twist
from gvgbot.words import counted

_MOST_NAMED = 40  # vertices, in an answer
_SEEKS_A_WAY = "no known way leads there: it explores until it finds one"


class Declined(Exception):
    """The robot will not do that, and says why; nothing has changed."""


class Errands(Agenda):
    """The agenda, as somebody may change it.

    What is asked for is answered with what happens now; Declined says why nothing does.
    """

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
        if self.unfit:
            return f"it does not drive: {self.unfit}"
        if self.unplaced:
            return self._unplaced_for()
        if self._plan is not None:
            return f"it goes on with: {self._plan}"
        if self.is_resting:
            return "it is not paused any more, and has nothing to do"
        return "it goes on exploring"

    def stop(self, stamp: float) -> str:
        """End the errand and the exploration; a paused robot stays so."""
        had_errand = self._plan is not None
        self._end(stamp, "stopped", "by a request")
        if self._mission.outcome is not None:
            self.is_waiting = True  # it makes way for nobody
            if had_errand:
                return f"it stands; the exploration had ended before: {self._mission.outcome}"
            return f"it had ended before: {self._mission.outcome}"
        self.happened.append(self._mission.stop(stamp, "stopped by a request"))
        return "the exploration has ended"

    def explore(self, stamp: float) -> str:
        """Go on exploring, even if that had ended; after a restart by finding its place first."""
        may_go = not (self.is_paused or self.unfit)
        explores = self._plan is None and self._command is None and not self.is_resting
        if may_go and explores:
            return "it is exploring already"
        if not (may_go and self.is_resting):
            self._check_going(stamp)
        self._end(stamp, "replaced", "by explore")
        self.is_waiting, self.unplaced = False, ""
        self.closures.open_all(self._mapper.graph)
        if self._mission.outcome is not None:
            self._mission.reopen()
            self.own_tasks.reopen()
        count = len(self._mapper.graph.frontiers())
        return f"it explores; {counted(count, 'frontier is', 'frontiers are')} known"

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
        route, graph = self._way_to_vertex(vertex), self._mapper.graph
        opened = self.closures.open_all(graph) if route is None else {}
        if opened:
            route = self._way_to_vertex(vertex)  # what was in the way may have gone
        here = self.whereabouts()
        if route is None and here is not None:
            self.closures.close_again(graph, opened)
            trouble = self._ground.no_way_to(ToVertex(vertex), here, f"to vertex {vertex}")
            self._check_explorable(ToVertex(vertex), here, trouble)
        self._take(ToVertex(vertex), stamp)
        if route is None and here is not None:
            return _SEEKS_A_WAY
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
        graph = self._mapper.graph
        edges = graph.edges.values()
        if not edges:
            raise Declined("no edge is known yet that it could drive on")
        if isinstance(self.errand, Coverage):
            return f"it does that already: {self._plan}"
        self.closures.open_all(graph)
        self._take(Coverage(), stamp)
        reached = set().union(*self._in_reach()) or graph.vertices.keys()
        there = (edge for edge in edges if edge.a.vertex in reached)
        lengths = [edge.length for edge in there if edge.id not in graph.walled]
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

    def _check_explorable(self, stop: Stop, here: Situation | None, trouble: str) -> None:
        """Raises Declined if a stop is out of reach, and nothing unknown may lead there."""
        if here is None or self._ground.way_to_explore(stop, here) is None:
            raise Declined(trouble)

    def _drive_to_point(self, errand: ToPoint | Home, stamp: float) -> str:
        self._check_going(stamp)
        if self.errand == errand and not self._is_own:
            return "it is on its way there already"
        base = self._mapper.belief.map_base
        away = math.hypot(errand.x - base.x, errand.y - base.y)
        here, graph = self.whereabouts(), self._mapper.graph
        trouble = self._ground.trouble_to(errand, here)
        opened = self.closures.open_all(graph) if trouble is not None else {}
        if opened:
            trouble = self._ground.trouble_to(errand, here)
        if trouble is not None and away > DIRECT_M:
            self.closures.close_again(graph, opened)
            self._check_explorable(errand, here, trouble)
        self._take(errand, stamp)
        if trouble is not None and away > DIRECT_M:
            return _SEEKS_A_WAY
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
        if self.unfit:
            raise Declined(self.unfit)
        if self.is_paused:
            raise Declined("it is paused: ask it to resume first")
        if self._seen is None and self.is_resting and self.unplaced:
            raise Declined(self._unplaced_for())
        if self._seen is None and self.is_resting:
            raise Declined("it does not know its place: ask it to explore, which looks for it")
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
        return f"known are {named}" + (" and others" if len(ids) > _MOST_NAMED else "")
