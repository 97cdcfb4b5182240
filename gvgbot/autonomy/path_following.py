"""What to do with a path: drive it as far as others leave room, and look around at its end."""

import math

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.autonomy.control.edge_follower import Track
from gvgbot.autonomy.control.orders import ARRIVED_M, Drive, LookAround, Order, Stand
from gvgbot.autonomy.events import Event, Recovery
from gvgbot.autonomy.exploration.headway import Headway
from gvgbot.autonomy.exploration.hindrance import Hindrance
from gvgbot.autonomy.gvg.local import Branch
from gvgbot.autonomy.neighbours import Neighbours
from gvgbot.autonomy.situation import Situation
from gvgbot.autonomy.views import View, beside
from gvgbot.geometry import Array

_MOST_LOOKS = 2  # around, before nothing more is to be seen
_FACING_RAD = 1.0  # looking so far past a thing, one would not see it go
_BEHIND_RAD, _AS_NEAR_M = 0.5, 0.3  # a wall that the robot turns its back to, or as good a one
_LEFT_TO_OTHERS_M = 1.5  # between the middle of the robot and whom it waits for
_NO_NEARER_M = 0.05  # does it come to them when it draws back
_FACING_POINTS = 6  # of a polyline tell where its end points to


class PathFollowing:
    """Of paths on the local GVG, which end where sight ends."""

    def __init__(self, neighbours: Neighbours, hindrance: Hindrance, headway: Headway) -> None:
        self._neighbours, self._hindrance, self._headway = neighbours, hindrance, headway
        self._looked_around = 0

    def renew(self) -> None:
        """Let it look around anew: it goes somewhere else, or has come on."""
        self._looked_around = 0

    def make_way(self, view: View, here: Situation, *, is_at_leisure: bool = False) -> Order:
        """Stand, where others can pass."""
        track = self._neighbours.track_aside(view, here, is_at_leisure=is_at_leisure)
        return Stand() if track is None else Drive(track)

    def draw_back(self, view: View, here: Situation) -> Order:
        """Wait for what stands in the way, and leave it the room to go: it may be held up, too.

        In a team, so may a robot of which nobody knows yet where it is; known ones are no bodies.
        """
        bodies = view.passing if here.in_team else view.doubtful
        for path in (here.astern(), here.ahead()):
            line, room = here.line_along(path)
            free = self._neighbours.free_metres(view, line)
            away = None if free < ARRIVED_M else _track_away(bodies, line, room)
            if away is not None:
                return Drive(away.until(free))
        return self.make_way(view, here)

    def stand_by(self, view: View, here: Situation) -> Order:
        """Stand where others can pass, with the back to a wall: nobody comes from there unseen."""
        order = self.make_way(view, here, is_at_leisure=True)
        turn = _turn_of_the_back(view) if isinstance(order, Stand) else 0.0
        return LookAround(turn) if turn else order

    def follow(
        self,
        view: View,
        here: Situation,
        path: tuple[Branch, ...],
        look_around_s: float,
        *,
        looks_anew: bool,
    ) -> tuple[Order | None, list[Event]]:
        """The order for the next keyframe interval; None where nothing more is to be seen.

        It stands at the end for some seconds before it looks around. `looks_anew` says whether it
        may do so once more wherever it has come on.
        """
        line, room = here.line_along(path)
        free = self._neighbours.free_metres(view, line)
        is_round_somebody = here.where.has_come_round and any(
            view.gvg.end_of(branch) in view.doubted for branch in path
        )
        if free < ARRIVED_M or is_round_somebody:
            self._hindrance.hold()
            return self.make_way(view, here), []
        track = Track.of(line, room).until(free)
        end = view.gvg.end_of(path[-1])
        waited = self._headway.waited(view.stamp)
        if waited == 0.0 and looks_anew:
            self.renew()
        if track.length < ARRIVED_M and end not in here.known.vertex_of and end in view.doubted:
            self._hindrance.hold()
            away = _turn_to_doubt(view, path[-1], end)
            if min(away, math.tau - away) > _FACING_RAD:
                return LookAround(away), []
        elif track.length < ARRIVED_M and waited > look_around_s:
            return self._look_around(view.stamp)
        return Drive(track), []

    def _look_around(self, stamp: float) -> tuple[Order | None, list[Event]]:
        self._headway.restart(stamp)
        self._hindrance.end()
        self._looked_around += 1
        if self._looked_around > _MOST_LOOKS:
            return None, []
        event = Recovery(stamp, "look around", "standing at the end of sight")
        return LookAround(math.tau), [event]


def _track_away(bodies: Array, line: Array, room: Array) -> Track | None:
    """Along a line (N, 2) to where there is room for bodies (M, 2); None if that is no farther."""
    if not len(bodies):
        return None
    away = np.asarray(cKDTree(bodies).query(line)[0])
    far = np.flatnonzero(away > _LEFT_TO_OTHERS_M)
    count = 1 + (int(far[0]) if len(far) else int(away.argmax()))
    track = Track.of(line[:count], room[:count])
    comes_nearer = away[:count].min() < away[0] - _NO_NEARER_M
    return None if track.length < ARRIVED_M or comes_nearer else track


def _turn_of_the_back(view: View) -> float:
    """How far to turn left until a wall is behind the robot that no other is nearer than, rad."""
    away = view.local_map.points() - view.local_base.position
    if not len(away):
        return 0.0
    metres, astern = np.hypot(*away.T), view.local_base.theta + math.pi
    turns = (np.arctan2(away[:, 1], away[:, 0]) - astern) % math.tau
    is_behind = np.minimum(turns, math.tau - turns) < _BEHIND_RAD
    if metres[is_behind].min(initial=math.inf) < metres.min() + _AS_NEAR_M:
        return 0.0
    return float(turns[np.argmin(metres)])


def _turn_to_doubt(view: View, branch: Branch, end: int) -> float:
    """How far to turn left to look at what makes the end of a branch doubtful, rad.

    Bodies of a team are nothing to be seen: it looks along the end of the branch.
    """
    away = beside(view.gvg.nodes[end], view.doubtful) - view.local_base.position
    if len(away):
        dx, dy = away[np.hypot(*away.T).argmin()]
    else:
        dx, dy = np.diff(view.gvg.leaving(branch)[-_FACING_POINTS:][[0, -1]], axis=0)[0]
    return float((math.atan2(dy, dx) - view.local_base.theta) % math.tau)
