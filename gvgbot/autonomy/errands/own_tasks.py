"""What the robot does unasked before exploring goes on, or ends: drives for a better map."""

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from gvgbot.autonomy.control.orders import LookAround, Order, Stand
from gvgbot.autonomy.destinations import foot_of, route_to_foot
from gvgbot.autonomy.ending import Surveyed, too_narrow
from gvgbot.autonomy.errands.kinds import ToPoint, ToVertex
from gvgbot.autonomy.events import Decision
from gvgbot.autonomy.exploration.certainty import CertaintyConfig, Revisiting
from gvgbot.autonomy.exploration.unseen import Unseen
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.mission import Mission
from gvgbot.autonomy.situation import Situation
from gvgbot.autonomy.views import IN_FULL_VIEW_M, View
from gvgbot.geometry import Array
from gvgbot.words import counted

_DRIVEN_ON_M = 0.5  # what can be seen there is new
_AWAITED_S = 120.0  # that somebody goes who hides what it has come to see, or stands in it
_BESIDE_M = 1.2  # from the middle of somebody to where a way is narrowed by him
_SETTLED_S = 10.0  # after he has gone, what was behind him has been seen


class Task(NamedTuple):
    """Where to drive, and what to say about that."""

    errand: ToVertex | ToPoint
    decision: Decision


class OwnTasks:
    """Back to vertices for the sake of certainty; to what the map may lack when all is explored."""

    def __init__(self, config: CertaintyConfig, mission: Mission, mapper: Mapper) -> None:
        self._mission, self._mapper = mission, mapper
        self._revisiting, self._unseen = Revisiting(config), Unseen()
        self._surveyed: set[int] = set()  # edges that there were,
        self._surveyed_m = 0.0  # and `travelled`
        self._narrows = np.empty((0, 2))  # ways too narrow for the robot
        self._awaited = np.empty((0, 2))  # and those that somebody may stand in
        self._has_met = False  # somebody who stood: he may have hidden something, and gone
        self._arrived: float | None = None  # stamp, where it went for a look
        self._watched = -math.inf  # stamp, when somebody was last waited for

    def configure(self, config: CertaintyConfig) -> None:
        """Use another configuration from now on."""
        self._revisiting.configure(config)

    def reopen(self) -> None:
        """Look at every place once more: somebody wants the exploration to go on after its end."""
        self._unseen = Unseen()

    def next(self, view: View, whereabouts: Callable[[], Situation | None]) -> Task | Order | None:
        """What to do now; None to go on with the mission. An order: a survey is to come."""
        mission = self._mission
        is_somebody_met = view.is_somebody_found or len(view.passing) > 0
        self._has_met |= is_somebody_met and not view.may_be_robots
        if not mission.is_choosing:
            self._revisiting.note_target(mission.target)
            self._unseen.begin_anew()
            return None
        here = whereabouts()
        if here is None:
            return None
        task = self._revisit(view, here) or self._look_again(view, here)
        mission.remark = self._remark()
        return task

    def _revisit(self, view: View, here: Situation) -> Task | None:
        """Back to a vertex that makes the robot or the map surer."""
        belief = self._mapper.belief
        wanted = self._revisiting.next(self._mapper.graph, belief, here.starts())
        if wanted is None:
            return None
        decision = Decision(view.stamp, wanted.vertex, None, wanted.reason)
        return Task(ToVertex(wanted.vertex), decision)

    def _look_again(self, view: View, here: Situation) -> Task | Order | None:
        """To where the map may lack something, when all frontiers are explored."""
        survey = self._mission.survey
        if survey is None or not self._is_explored():
            return None
        edges = set(self._mapper.graph.edges)
        has_news = edges != self._surveyed or (
            self._mission.is_ending and view.travelled > self._surveyed_m + _DRIVEN_ON_M
        )
        if self._unseen.is_done and not has_news:
            return None
        position = self._mapper.belief.map_base.position
        is_somebody_there = view.is_somebody_near()
        if not self._unseen.judge(position, is_somebody_there=is_somebody_there):
            self._watched = view.stamp
        if self._arrives(view) and self._has_met and _may_overlook(view):
            return LookAround(math.tau)
        is_watching, is_standing = self._watches(view), self._unseen.is_standing(view.travelled)
        if is_watching or not is_standing:
            return Stand()
        surveyed = survey()
        if surveyed is None or self._reopen(surveyed.barred):
            return Stand()
        self._narrows, self._awaited = surveyed.narrows, surveyed.awaited
        self._surveyed, self._surveyed_m = edges, view.travelled
        return self._visit(view, here, surveyed)

    def _is_explored(self) -> bool:
        """Whether all frontiers are; in a team those of the others, too."""
        if self._mission.choice.sharing is not None:
            return self._mission.is_ending
        return not (self._mapper.graph.frontiers() or self._mission.is_waiting)

    def _visit(self, view: View, here: Situation, surveyed: Surveyed) -> Task | None:
        """To what a survey has found, if that is worth it."""
        starts = here.starts()

        def metres_to(place: Array) -> float | None:
            foot = foot_of(self._mapper, place)
            route = None if foot is None else route_to_foot(here, starts, foot)
            return None if route is None else route.metres

        place = self._unseen.next(surveyed.places, metres_to, twice=self._has_met)
        reason = "something may be missing there"
        if place is None and self._has_met:
            place = self._unseen.once_more(surveyed.doorsteps, metres_to)
            reason = "somebody may have stood there"
        if place is None:
            return None
        if self._mission.choice.sharing is not None:  # bodies shape no edges there
            self._awaited = np.concatenate([surveyed.awaited, place[None]])
        self._arrived = None
        decision = Decision(view.stamp, None, None, reason)
        return Task(ToPoint(*place.round(2).tolist()), decision)

    def _reopen(self, barred: Iterable[int]) -> bool:
        """Take edges that may lead through glass for frontiers, once; whether there were any."""
        edges = self._mapper.graph.edges
        reopened = [self._mapper.reopen(edges[key]) for key in barred if key in edges]
        return any(reopened)

    def _watches(self, view: View) -> bool:
        """Whether there will be more to be seen: somebody stands here who may go, or has gone."""
        if view.is_somebody_found or self._is_awaited(view):
            self._watched = view.stamp
        return view.stamp - self._watched < _SETTLED_S

    def _arrives(self, view: View) -> bool:
        """Whether it has just come to where it went for a look."""
        if self._arrived is not None or not self._is_there():
            return False
        self._arrived = view.stamp
        return True

    def _is_there(self) -> bool:
        return self._unseen.is_visited(self._mapper.belief.map_base.position)

    def _is_awaited(self, view: View) -> bool:
        """Whether somebody hides what it has just come to see."""
        if self._arrived is None or not self._is_there():
            return False
        is_patient = view.stamp - self._arrived < _AWAITED_S
        return is_patient and (_is_hidden(view) or self._is_in_use(view))

    def _is_in_use(self, view: View) -> bool:
        """Whether somebody stands where it came for a look, or leaves it no room in a way."""
        map_local = self._mapper.map_in_local(view.local_base).inverse()
        aside = map_local.transform(view.passing)[:, None] - self._awaited
        return bool((np.hypot(*aside.T) < _BESIDE_M).any())

    def _remark(self) -> str:
        """What there is to say about the map, if that is the end."""
        doubtful, unseen = self._revisiting.too_uncertain(self._mapper.belief), self._unseen.where
        stay = counted(len(doubtful), "vertex stays", "vertices stay")
        remark = f"; {stay} less certain than wanted" if doubtful else ""
        remark += f"; something may be missing near {unseen}" if unseen else ""
        return remark + too_narrow(self._narrows)


def _may_overlook(view: View) -> bool:
    """Whether something may be behind the robot that somebody hid; who stands there still does."""
    return _is_hidden(view) or not view.is_somebody_near()


def _is_hidden(view: View) -> bool:
    """Whether somebody makes up meetpoints near by."""
    nodes = [view.gvg.nodes[key] for key in view.doubted]
    return any(
        math.dist(node.position, view.local_base.position) < IN_FULL_VIEW_M
        for node in nodes
        if node.degree > 2
    )
