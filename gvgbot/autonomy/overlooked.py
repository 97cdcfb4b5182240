"""What a laser with a narrow view leaves unseen, at the start and at a vertex: it is behind it."""

import math
from collections.abc import Iterator

from gvgbot.autonomy.situation import Situation
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.autonomy.views import View
from gvgbot.hal.messages import Scan

_AT_M = 0.5  # from a vertex, all of it is to be seen by turning
_OVERLAP_RAD = 0.2  # of what is seen before and after a turn


def blind_angle(scan: Scan) -> float:
    """How far to turn left so that every direction has been seen, with some overlap; rad."""
    first, last = scan.field_of_view
    return max(0.0, math.tau - (last - first)) + _OVERLAP_RAD


class Overlooked:
    """Departures of which too little is seen: looked at once, or the robot had to come back."""

    def __init__(self) -> None:
        self._looked = set[int]()  # the vertices at which it has turned

    def turn(self, view: View, here: Situation, target: HalfEdgeId) -> float:
        """How far to turn left to see all of the vertex where the robot is, rad; 0 if it need not.

        The departure that it takes next it will see anyway.
        """
        for node, vertex in here.known.vertex_of.items():
            away = math.dist(here.gvg.nodes[node].position, view.local_base.position)
            if vertex in self._looked or away > _AT_M:
                continue
            turn = max(map(view.turn_to_see, _unclear(here, node, target)), default=0.0)
            if turn:
                self._looked.add(vertex)
                return turn + _OVERLAP_RAD
        return 0.0


def _unclear(here: Situation, node: int, target: HalfEdgeId) -> Iterator[float]:
    """Bearings, rad, local frame, of the frontiers of a vertex of which too little is seen."""
    centre = here.gvg.nodes[node]
    for branch in centre.weak:
        end = here.known.half_edge_of.get(branch)
        half = None if end is None else here.graph.half_edge(end)
        if half is not None and half.open and end != target:
            yield here.gvg.bearing(branch, centre.clearance)
