"""Which frontier to explore next, alone or in a team."""

from collections.abc import Collection

import numpy as np

from gvgbot.autonomy.exploration.certainty import vertex_sigma
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.exploration.ears import ear_next, nearest_frontier
from gvgbot.autonomy.exploration.paths import Approach, shortest_path
from gvgbot.autonomy.exploration.sharing import Sharing
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.situation import Situation
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.autonomy.views import View

_LED_M = 1.0, 4.0  # ahead: who drives there behind others need not
_WORTH_TURNING_M = 1.0  # a new frontier must be so much nearer than the old one


class Choice:
    """Of the next frontier: by the policy, or as the robots of a team have agreed."""

    def __init__(self, config: ExplorationConfig, mapper: Mapper) -> None:
        self.config, self._mapper = config, mapper
        self.sharing: Sharing | None = None  # with other robots, if there are any
        self._has_asked = False  # them, when it last had to choose

    @property
    def waits_for_others(self) -> bool:
        """Whether other robots are on their way to every frontier that is left."""
        return self.sharing is not None and self._has_asked and self.sharing.is_waiting

    @property
    def is_left_to_others(self) -> bool:
        """Whether there are frontiers, but others have followed all of them."""
        is_done = self.sharing is not None and self.sharing.is_done
        graph = self._mapper.graph
        return is_done and bool(graph.frontiers() or not graph.vertices)

    @property
    def is_all_followed(self) -> bool:
        """Whether the robots of a team have followed every departure that one of them knows."""
        return self.sharing is not None and self.sharing.is_explored

    @property
    def unfollowed(self) -> Collection[HalfEdgeId]:
        """The departures of the map that no robot of the team has followed."""
        return () if self.sharing is None else self.sharing.unfollowed

    def go_ahead(self) -> None:
        """Choose nothing, and wait for nobody: the robot drives on where nobody has been."""
        self._has_asked = False

    def is_led(self, view: View, here: Situation, *, either_way: bool) -> bool:
        """Whether other robots have driven what is straight ahead."""
        if self.sharing is None:
            return False
        line, _ = here.line_along(here.ahead())
        away = np.hypot(*(line - view.local_base.position).T)
        ahead = line[(away > _LED_M[0]) & (away < _LED_M[1])]
        map_local = self._mapper.belief.map_base.compose(view.local_base.inverse())
        return self.sharing.has_driven(map_local.transform(ahead), either_way=either_way)

    def under_way(self, here: Situation) -> HalfEdgeId | None:
        """The open edge that a robot of a team is on, if nobody else is farther on it."""
        end = here.where.on_edge
        half = None if end is None else self._mapper.graph.half_edge(end)
        if self.sharing is None or end is None or half is None or not half.open:
            return None
        return end if self.keeps(end, here) else None

    def ear(self, explored: HalfEdgeId | None) -> HalfEdgeId | None:
        """By the ear rule, at the end of the edge just explored, if that is the policy."""
        graph = self._mapper.graph
        is_alone = self.sharing is None
        if self.config.policy != "ears" or not is_alone or explored is None:
            return None
        edge = None if graph.half_edge(explored) is None else graph.edge_at(explored)
        return None if edge is None else ear_next(graph, edge.other(explored))

    def nearest(self, starts: list[Approach]) -> tuple[HalfEdgeId, Approach] | None:
        """What costs least to reach; None if nothing can be reached, or is left to this robot."""
        graph, belief = self._mapper.graph, self._mapper.belief
        if self.sharing is not None:
            self._has_asked = True
            return self.sharing.choose(graph, starts)
        if self.config.policy != "balanced":
            return nearest_frontier(graph, starts)

        def handicap(vertex: int) -> float:
            return self.config.detour_m_per_m * vertex_sigma(belief, vertex)

        return nearest_frontier(graph, starts, handicap)

    def keeps(self, target: HalfEdgeId, here: Situation) -> bool:
        """Whether a target is still this robot's own."""
        if self.sharing is None:
            return True
        is_on_it = here.where.on_edge == target
        so_far = [Approach(-here.where.trail_length, target)]  # so far past its vertex
        starts = so_far if is_on_it else here.starts()
        return self.sharing.keeps(target, self._mapper.graph, starts)

    def nearer(
        self, target: HalfEdgeId, found: set[HalfEdgeId], starts: list[Approach]
    ) -> HalfEdgeId | None:
        """A frontier `found` just now that is nearer than what is left of the way to the target."""
        nearest = self.nearest(starts)
        if nearest is None or nearest[0].vertex not in {end.vertex for end in found}:
            return None
        way = shortest_path(self._mapper.graph, starts, target.vertex)
        if way is not None and nearest[1].metres > way.metres - _WORTH_TURNING_M:
            return None
        return nearest[0]
