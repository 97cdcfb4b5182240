"""A charging dock in the simulated world: where its beams go, and when a base stands on it."""

import math
from collections.abc import Callable

from gvgbot.drivers.kobuki.payloads import DockIr
from gvgbot.geometry import Pose, wrap_angle

# Each beam says which sector in front of the dock it fills, and whether near or far.
_NEAR = {"left": 0x01, "centre": 0x02, "right": 0x04}
_FAR = {"left": 0x10, "centre": 0x08, "right": 0x20}
_NEAR_END, _FAR_START, _FAR_END = 1.0, 0.8, 5.0  # m from the dock; they overlap,
_CENTRE_EDGE, _SIDE_EDGE = math.radians(10), math.radians(7)  # as the sectors do
_HALF_WIDTH = 1.0  # m to either side of the dock's axis

_LOOKS = {"left": math.radians(60), "centre": 0.0, "right": math.radians(-60)}  # of receivers
_HALF_VIEW = math.radians(40)
_WALL = 0.15  # m: the dock stands in front of a wall, not in it

_REACH = 0.23  # m from the centre of a base to the dock that it touches
_SKEW = math.radians(10)  # more than this, and the contacts do not meet


class Dock:
    """A dock at a pose in the world, x being the way it faces; its left is its own."""

    def __init__(self, pose: Pose) -> None:
        self._pose = pose

    def shines_on(self, base: Pose, look: Callable[[float], float]) -> DockIr:
        """What the receivers of a base there see.

        `look(bearing)` is the distance in m from the base to the next wall (rad, base frame).
        """
        dock = self._pose.to(base)
        distance, bearing = math.hypot(dock.x, dock.y), _bearing(base.to(self._pose))
        beams = self._beams(dock)
        if not beams or look(bearing) < distance - _WALL:
            return DockIr(0, 0, 0)
        seen = {
            name: beams if abs(wrap_angle(bearing - axis)) <= _HALF_VIEW else 0
            for name, axis in _LOOKS.items()
        }
        return DockIr(seen["right"], seen["centre"], seen["left"])

    def holds(self, base: Pose) -> bool:
        """Whether a base there touches the contacts: close by, in front, and facing the dock."""
        place = self._pose.to(base)
        is_close = math.hypot(place.x, place.y) <= _REACH
        is_in_front = abs(_bearing(place)) <= _SKEW
        return is_close and is_in_front and abs(_bearing(base.to(self._pose))) <= _SKEW

    def _beams(self, place: Pose) -> int:
        """The beams that pass a place in the dock's frame, one bit each."""
        distance, bearing = math.hypot(place.x, place.y), _bearing(place)
        if place.x <= 0.0 or abs(place.y) > _HALF_WIDTH:
            return 0
        sectors = [
            name
            for name, is_inside in (
                ("left", bearing >= _SIDE_EDGE),
                ("centre", abs(bearing) <= _CENTRE_EDGE),
                ("right", bearing <= -_SIDE_EDGE),
            )
            if is_inside
        ]
        near = sum(_NEAR[name] for name in sectors) if distance <= _NEAR_END else 0
        far = sum(_FAR[name] for name in sectors) if _FAR_START <= distance <= _FAR_END else 0
        return near + far


def _bearing(place: Pose) -> float:
    return math.atan2(place.y, place.x)
