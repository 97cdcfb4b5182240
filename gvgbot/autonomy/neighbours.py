"""What other robots near by mean to a mission: how far to drive, how long to wait, where to."""

import math

import numpy as np

from gvgbot.autonomy.control.company import (
    Companion,
    free_metres,
    in_front,
    patience,
    refuge,
    way_off,
    wide_place,
)
from gvgbot.autonomy.control.edge_follower import Track
from gvgbot.autonomy.control.orders import ARRIVED_M
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.situation import Situation
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.autonomy.views import View
from gvgbot.geometry import Array, Pose


class Neighbours:
    """Other robots, local frame."""

    def __init__(self) -> None:
        self.company: list[Companion] = []
        self.patience = 1.0  # share of the usual one, with what is in the way
        self._in_front: Companion | None = None  # that is near

    def meet(self, local_base: Pose, company: list[Companion]) -> None:
        """Note where they are now."""
        self.company = company
        self.patience = patience(local_base, company)
        self._in_front = in_front(local_base, company)

    def free_metres(self, view: View, line: Array) -> float:
        """How far to drive along a line (N, 2) before one has to come through a narrow place."""
        return _free_metres(view, line, self.company)

    def track_aside(
        self, view: View, here: Situation, *, is_at_leisure: bool = False
    ) -> Track | None:
        """To where to wait: in no door, and aside of one that is near and may want to pass.

        A way that leads away from who goes first is nothing to wait for: to stay is in its way. Who
        is at leisure goes before it where no such place is in sight.
        """
        others = self.company
        way = wide_place(here.gvg, here.place, others) if others else None
        if way is None and self._in_front is not None:
            other = self._in_front.pose.position
            way = refuge(here.gvg, here.place, other)
            if way is None and is_at_leisure and self._in_front.goes_first:
                way = way_off(here.gvg, here.place, other)
            others = [one for one in others if one is not self._in_front]
        if way is None:
            return None
        line, room = here.line_along(way)
        free = _free_metres(view, line, others)
        return None if free < ARRIVED_M else Track.of(line, room).until(free)

    def depart_unseen(
        self, mapper: Mapper, view: View, here: Situation, target: HalfEdgeId
    ) -> None:
        """Note that the robot is past the vertex of its target, where that is not to be seen.

        One that stands in one of its ways takes it out of sight.
        """
        is_seen = target.vertex in here.known.node_of
        if not self.company or is_seen or here.where.on_edge == target:
            return
        place = mapper.in_local_frame(view, target.vertex)
        bearing = mapper.graph.vertices[target.vertex].half_edges[target.key].bearing
        base = view.local_base.position
        here.where.depart(target, place.position, place.theta + bearing, base)


def _free_metres(view: View, line: Array, others: list[Companion]) -> float:
    if not others:
        return math.inf
    from_walls, _ = view.local_map.tree().query(line)
    return free_metres(line, np.asarray(from_walls), others)
