"""Whether the robot gets anywhere with what it is about: in time, by its way, and to new ground."""

import math

from gvgbot.autonomy.exploration.attempts import Attempts
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.exploration.headway import Headway
from gvgbot.autonomy.exploration.new_ground import NewGround
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.autonomy.views import View
from gvgbot.geometry import Array

_FARTHER_M = 0.5  # along the target edge, there is more of it


class Progress:
    """Of the present target, and of the exploration as a whole."""

    def __init__(self, mapper: Mapper) -> None:
        self._mapper = mapper
        self.headway = Headway()
        self._attempts, self._ground = Attempts(), NewGround()
        self._budget_m = math.inf  # of `travelled`, for the present target
        self._newest_m = 0.0  # of the target edge that has been driven

    def set_out(
        self, view: View, target: HalfEdgeId, way_m: float, config: ExplorationConfig
    ) -> None:
        """Take a frontier for the target, to which it is so far."""
        self._attempts.begin(self._place_of(target))
        self._newest_m = 0.0
        self._budget_m = view.travelled + 2 * way_m + config.patience_m

    def come_to_an_end(self) -> None:
        """The target is explored, or gone."""
        self._attempts.end()

    def is_vain(self, target: HalfEdgeId) -> bool:
        """Whether there is always another frontier where this one is."""
        return self._attempts.are_vain(self._place_of(target))

    def wait(self, stamp: float) -> None:
        """Count anew how long the robot has been where it is: it has a reason."""
        self.headway.restart(stamp)
        self.headway.restart_stay()

    def set_aside(self) -> None:
        """Count later: there is something else to do, or to wait for others."""
        self.headway.restart_stay()
        self._ground.set_aside()

    def skip(self, seconds: float) -> None:
        """Let no patience run out by a time in which nothing was to be seen."""
        self.headway.skip(seconds)
        self._ground.skip(seconds)

    def trouble(
        self, view: View, target: HalfEdgeId | None, driven_m: float, config: ExplorationConfig
    ) -> str | None:
        """Why the target is to be given up; None if it is not.

        `driven_m` is how much of its edge has been driven: as long as there is more, it goes on.
        """
        waited = self.headway.note(view.local_base.position, view.stamp)
        if driven_m > self._newest_m + _FARTHER_M:
            self._newest_m = driven_m
            self._budget_m = max(self._budget_m, view.travelled + config.patience_m)
        if target is not None and view.travelled > self._budget_m:
            return "driven too far without reaching it"
        if waited > config.patience_s:
            self.wait(view.stamp)
            return "no progress"
        return None

    def note_ground(self, view: View) -> None:
        """The robot is where it is: there is more patience on new ground, and less elsewhere."""
        place = self._mapper.belief.map_base.position
        self._ground.note(place, view.stamp, self._known_m)

    @property
    def finds_nothing_new(self) -> bool:
        """Whether no target has led anywhere new for a long time."""
        return self._ground.is_over

    @property
    def does_not_end(self) -> bool:
        """Whether that was so long ago that it should have ended."""
        return self._ground.is_past_its_end

    @property
    def _known_m(self) -> float:
        """How long all known edges are together, m."""
        return sum(edge.length for edge in self._mapper.graph.edges.values())

    def _place_of(self, end: HalfEdgeId) -> Array:
        """Where its vertex stands (2,), m, map frame."""
        return self._mapper.belief.map_vertex(end.vertex).position
