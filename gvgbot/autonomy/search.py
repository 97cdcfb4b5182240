"""What to do while no edge is in sight."""

import math

from gvgbot.autonomy.control.edge_follower import Track
from gvgbot.autonomy.control.orders import ARRIVED_M, Drive, LookAround, Order, Stand
from gvgbot.autonomy.events import Event, Recovery
from gvgbot.autonomy.exploration.access import way_into_the_open
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.exploration.headway import Headway
from gvgbot.autonomy.views import View
from gvgbot.geometry import Array

NO_EDGE = "no edge in sight"
_MOST_SOUGHT = 5  # places to look for an edge from
_MOST_LEFT = 3  # times that a slot is left for the open


class Search:
    """For an edge: looks around where the robot is, and then where there is more room."""

    def __init__(self) -> None:
        self._since: float | None = None  # stamp
        self._sought: list[Array] = []  # places to see an edge from, local frame
        self._track: Track | None = None  # to the last of them
        self.leaves_slot, self._left = False, 0  # now, and how often it was tried
        self.has_looked = False  # around, just now: perhaps there is nothing more to be seen

    @property
    def is_driving(self) -> bool:
        """Whether the robot is on its way to where there is more room."""
        return self._track is not None

    def end(self) -> None:
        """Search anew next time: an edge is in sight, or something else is to be done."""
        self._since, self._track, self.leaves_slot, self.has_looked = None, None, False, False

    def begin_in_slot(self) -> bool:
        """Search although an edge is in sight; whether that is worth another try."""
        if self._left >= _MOST_LEFT:
            return False
        self.end()
        self.leaves_slot, self._left = True, self._left + 1
        return True

    def skip(self, seconds: float) -> None:
        """Do not count a time in which nothing was to be seen."""
        self._since = None if self._since is None else self._since + seconds

    def advance(
        self, view: View, headway: Headway, config: ExplorationConfig
    ) -> tuple[Order, list[Event]]:
        """The order for the next keyframe interval: stand, if nothing is left to be tried."""
        if self._since is None:
            self._since, self._sought, self.has_looked = view.stamp, [], True
            return LookAround(math.tau), [Recovery(view.stamp, "look around", NO_EDGE)]
        if self._track is not None:
            away = math.dist(view.local_base.position, self._track.polyline[-1])
            if away > ARRIVED_M and headway.waited(view.stamp) < config.in_the_way_s:
                return Drive(self._track), []
            self._track = None
            return LookAround(math.tau), []
        seeks = len(self._sought) < _MOST_SOUGHT
        way = way_into_the_open(view, self._sought) if seeks else None
        if way is not None:
            self._sought.append(way[0][-1])
            self._track = Track.of(*way)
            headway.restart(view.stamp)
            event = Recovery(view.stamp, "go where there is more room", NO_EDGE)
            return Drive(self._track), [event]
        has_time = view.stamp - self._since <= config.nothing_in_sight_s
        return LookAround(math.tau) if has_time else Stand(), []
