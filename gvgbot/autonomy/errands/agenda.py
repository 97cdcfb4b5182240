"""What the robot is about: one errand after the other, and the mission when there is none."""

import math

from gvgbot.autonomy.control.orders import Order, Stand
from gvgbot.autonomy.errands.driving import Driving, Ended
from gvgbot.autonomy.errands.ground import Ground
from gvgbot.autonomy.errands.kinds import Errand
from gvgbot.autonomy.errands.own_tasks import OwnTasks, Task
from gvgbot.autonomy.errands.plans import Here, Kept, Plan, plan_for, recalled
from gvgbot.autonomy.events import ErrandEnded, Event
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.mission import Mission
from gvgbot.autonomy.situation import Situation
from gvgbot.autonomy.views import Correspondence, View
from gvgbot.geometry import STANDSTILL, Twist

_MOST_STOPS = 10  # that are passed at once
_HOLD_S = 0.5  # that a twist of somebody who drives holds; without another one the robot stands


class Agenda:
    """Stands between the pipeline and the mission, which goes on where it was after an errand.

    `room_m` is how far from the walls the robot drives where there is no edge.
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
        self.unfit = ""  # why it must not drive until it is started anew
        self.is_map_spoilt = False  # by what makes it unfit
        self.is_lost = False  # somebody doubts the pose; whoever takes that into account resets it
        self.given_up: Errand | None = None  # in vain, until something else is asked for
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
        return self.is_paused or is_over or bool(self.unplaced or self.unfit)

    @property
    def stands_by(self) -> bool:
        """Whether it has explored what it could, and nobody has asked it for anything since."""
        asked = self.is_paused or self.is_waiting or self.unplaced
        return self.is_resting and not (asked or self.unfit) and self._mission.outcome != "stopped"

    @property
    def is_exploring(self) -> bool:
        """Whether it is the robot that decides where to drive."""
        is_own = self._is_own or (self._plan is None and self._command is None)
        return is_own and not self.is_resting

    @property
    def is_busy(self) -> bool:
        """Whether it explores or is on an errand, or will when it is resumed."""
        is_over = self._plan is None and (self.is_waiting or self._mission.outcome is not None)
        return not (is_over or self.unplaced or self._command is not None)

    @property
    def is_placed(self) -> bool:
        """Whether it has looked around where it knows to be on its map."""
        return self._seen is not None

    def configure(self, config: ExplorationConfig) -> None:
        """Use another configuration from now on."""
        self._config = config
        self.own_tasks.configure(config.certainty)
        self._mission.configure(config)
        if self._driving is not None:
            self._driving.config = config

    def whereabouts(self) -> Situation | None:
        """Where the robot was on the graph when it last looked; None if that was off it."""
        return None if self._seen is None else self._ground.situation(*self._seen)

    def command(self, stamp: float) -> Twist | None:
        """What somebody who drives wants now; None if nobody does."""
        if self._command is None:
            return None
        twist, since = self._command
        return twist if stamp - since < _HOLD_S else STANDSTILL

    def _take(self, errand: Errand, stamp: float) -> None:
        self._end(stamp, "replaced", f"by {errand}")
        self._mission.set_aside()
        self.is_waiting = False
        self._plan = plan_for(errand)

    def _end(self, stamp: float, how: str, reason: str) -> None:
        """Be done with the errand, if there is one, and wait for what comes next."""
        self.given_up = self.errand if how == "given up" else None
        if self._plan is not None:
            self.happened.append(ErrandEnded(stamp, str(self._plan.errand), how, reason))
            self.is_waiting = not self._is_own
        if self._is_own:
            self.closures.open_due(self._mapper.graph, math.inf)
        self._is_own = False
        self._plan = self._driving = self._command = None

    def note_lifted(self) -> None:
        """Wait for what comes next: who lifts a robot that has finished wants it somewhere else."""
        self.is_waiting |= self.stands_by

    def give_up(self, stamp: float, reason: str) -> None:
        """End the errand, if there is one: it is about a map that is forgotten."""
        self._end(stamp, "given up", reason)

    def halt(self, stamp: float, reason: str, *, spoils_map: bool) -> None:
        """Do nothing any more, whatever is asked for, until it is started anew."""
        self.unfit, self.is_map_spoilt = reason, spoils_map
        self._end(stamp, "given up", reason)

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
            if not isinstance(task, Task):
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
        self._driving = Driving(stop, self._ground, self._config, explores=not self._is_own)
        return self._driving

    def _here(self, view: View) -> Here:
        here = self.whereabouts()
        starts = [] if here is None else here.starts()
        names = self._mapper.unsettled.names
        return Here(view.stamp, self._mapper.graph, starts, view.travelled, names)

    # -- after a restart ---------------------------------------------------------------------------

    def kept(self) -> Kept | None:
        """What there is to remember of the errand that somebody asked for."""
        kept = None if self._plan is None or self._is_own else self._plan.kept()
        return None if kept is None else kept.renamed(self._mapper.unsettled.names)

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
