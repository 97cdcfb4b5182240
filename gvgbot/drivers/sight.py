"""What a laser sees in the simulated world: walls, glass or what is behind it, people, robots."""

import numpy as np

from gvgbot.drivers.body import RobotBody, discs_of
from gvgbot.drivers.discs import cast_on_discs
from gvgbot.drivers.people import People
from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose

# Glass throws a beam back to its sensor when hit head-on, and hardly ever otherwise, by its dust.
HEAD_ON = 0.95  # probability of an echo at normal incidence
DUST = 0.03  # and far from it
SPREAD = 0.2  # rad of incidence in which the echo fades, as a normal distribution's sigma
AT_CORNER = 1e-6  # of a square: nearer than this, a beam may have met either side


class Sight:
    """Sees the world, the people and `others` in it; `seed` draws which beams glass lets pass."""

    def __init__(
        self, world: World, people: People | None, seed: int, others: list[RobotBody] | None = None
    ) -> None:
        """`others` may grow later."""
        self._world, self._people = world, people
        self._others = [] if others is None else others
        self._rng = np.random.default_rng(seed)

    def look(
        self, pose: Pose, bearings: Array, max_range: float, moved: Array | None = None
    ) -> Array:
        """Ranges (N,) in m as `World.cast` gives them, but through glass and with people.

        People and robots are seen from the pose, wherever a beam is `moved` to.
        """
        ranges = self._world.cast(pose, bearings, max_range, moved)
        if self._world.glass is not None:
            ranges = self._through_glass(pose, bearings, max_range, ranges, moved)
        if self._people is not None:
            ranges = np.minimum(ranges, self._people.cast(pose, bearings))
        if self._others:
            ranges = np.minimum(ranges, cast_on_discs(*discs_of(self._others), pose, bearings))
        return np.where(ranges <= max_range, ranges, np.inf)

    def _through_glass(
        self, pose: Pose, bearings: Array, max_range: float, surface: Array, moved: Array | None
    ) -> Array:
        """A beam that passes the first pane passes all behind it."""
        behind = self._world.without_glass.cast(pose, bearings, max_range, moved)
        panes = np.flatnonzero(surface < behind)
        incidence = self._incidence(pose, bearings[panes], surface[panes])
        passed = panes[self._rng.random(len(panes)) >= echo_probability(incidence)]
        ranges = surface.copy()
        ranges[passed] = behind[passed]
        return ranges

    def _incidence(self, pose: Pose, bearings: Array, ranges: Array) -> Array:
        """Angles (N,) between beams and the normals of the squares' sides they end on, rad."""
        x, y = np.cos(bearings + pose.theta), np.sin(bearings + pose.theta)
        points = pose.position + ranges[:, None] * np.column_stack((x, y))
        squares = (points - self._world.origin) / self._world.resolution_m
        off_x, off_y = np.abs(squares - np.rint(squares)).T
        along_normal = np.where(off_x < off_y, np.abs(x), np.abs(y))
        at_corner = np.abs(off_x - off_y) < AT_CORNER
        along_normal[at_corner] = np.maximum(np.abs(x), np.abs(y))[at_corner]
        return np.arccos(np.minimum(along_normal, 1.0))


def echo_probability(incidence: Array) -> Array:
    """How probably beams (N,) at these angles (rad) from the normal come back from glass."""
    return DUST + (HEAD_ON - DUST) * np.exp(-0.5 * (incidence / SPREAD) ** 2)
