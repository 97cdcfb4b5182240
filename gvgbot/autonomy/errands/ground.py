"""What is known of the ground that errands lead over: where the robot is on it, and which ways."""

from dataclasses import replace

import numpy as np

from gvgbot.autonomy.destinations import (
    Route,
    foot_at,
    foot_of,
    route_exploring,
    route_to_foot,
    route_to_vertex,
)
from gvgbot.autonomy.errands.closures import Closures
from gvgbot.autonomy.errands.kinds import Home, Stop, ToPoint, ToVertex, Waypoint
from gvgbot.autonomy.exploration.access import NEAR_M, access
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.mission import Mission
from gvgbot.autonomy.situation import Situation
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.autonomy.views import Correspondence, View
from gvgbot.geometry import Pose

_OFF_GRAPH_M = 3.0  # a point farther from every edge is out of reach
AT_VERTEX_M = 1.0  # from a vertex, what stands in the way stands on the edge beyond it


class Ground:
    """What is known of the ground: where the robot is on it, and which ways are closed.

    `room_m` is how far from the walls the robot drives where there is no edge.
    """

    def __init__(self, mission: Mission, mapper: Mapper, room_m: float) -> None:
        self.mission, self.mapper, self.room_m = mission, mapper, room_m
        self.closures = Closures(mapper.unsettled.names)

    def situation(self, view: View, known: Correspondence) -> Situation | None:
        """Where the robot is on the graph; None if it is off it."""
        found = access(view)
        if found is None or found.place.distance > NEAR_M:
            return None
        graph, where = self.mapper.graph, self.mission.where
        return Situation(view.gvg, known, graph, where, found, view.local_base, view.doubted)

    def is_at(self, view: View, vertex: int) -> bool:
        """Whether the robot is about at a vertex."""
        if vertex not in self.mapper.graph.vertices:
            return False
        there = self.mapper.in_local_frame(view, vertex).position
        return float(np.hypot(*(there - view.local_base.position))) < AT_VERTEX_M

    def trouble_to(self, goal: ToPoint | Home, here: Situation | None) -> str | None:
        """Why no known way leads to a point."""
        foot = foot_of(self.mapper, np.array([goal.x, goal.y]))
        if foot is None:
            return "no edge is known yet that it could drive on"
        if foot.away > _OFF_GRAPH_M and isinstance(goal, ToPoint):
            return f"the nearest known way ends {foot.away:.1f} m from there"
        if here is not None and route_to_foot(here, here.starts(), foot) is None:
            return self.no_way_to(goal, here)
        return None

    def no_way_to(
        self,
        stop: Stop,
        here: Situation,
        there: str = "there",
        closed: HalfEdgeId | None = None,
    ) -> str:
        """That no known way leads to a stop, and whether one would but for virtual walls.

        Something may stand between the robot and an end of its edge, `closed`.
        """
        is_walled_off = self._is_walled_off(stop, here, closed)
        return f"no known way leads {there}" + " but over a virtual wall" * is_walled_off

    def way_to_explore(
        self, stop: Stop, here: Situation, closed: HalfEdgeId | None = None
    ) -> Route | None:
        """On where nobody has been, towards a place to which no known way leads; None without one.

        The robot does not set out for what lies behind virtual walls.
        """
        if not here.graph.frontiers() or self._is_walled_off(stop, here, closed):
            return None
        match stop:
            case ToVertex(vertex=vertex):
                goal = self.mapper.belief.map_vertex(self.mapper.unsettled.names.vertex(vertex))
            case ToPoint(x=x, y=y) | Home(x=x, y=y):
                goal = Pose(x, y)
                foot = foot_of(self.mapper, goal.position)
                if foot is None or foot.away > _OFF_GRAPH_M:
                    return None
            case _:
                return None
        return route_exploring(self.mapper, here, here.starts(closed), goal.position)

    def _is_walled_off(self, stop: Stop, here: Situation, closed: HalfEdgeId | None) -> bool:
        """Whether a known way leads to a stop that none leads to, but for virtual walls."""
        if not here.graph.walled:
            return False
        return self._leads_to(stop, replace(here, graph=here.graph.unwalled()), closed)

    def _leads_to(self, stop: Stop, here: Situation, closed: HalfEdgeId | None) -> bool:
        starts, names = here.starts(closed), self.mapper.unsettled.names
        match stop:
            case ToVertex(vertex=vertex):
                return route_to_vertex(here.graph, starts, names.vertex(vertex)) is not None
            case ToPoint(x=x, y=y) | Home(x=x, y=y):
                foot = foot_of(self.mapper, np.array([x, y]))
            case Waypoint(end=end, station=station):
                foot = foot_at(here.graph, names.half_edge(end), station)
            case _:
                return True
        return foot is not None and route_to_foot(here, starts, foot, closed) is not None
