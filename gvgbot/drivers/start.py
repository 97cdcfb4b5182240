"""Where in a world a robot may start."""

import numpy as np
import structlog
from scipy import ndimage

from gvgbot.drivers.world import World
from gvgbot.errors import WorldError
from gvgbot.geometry import Pose

log = structlog.get_logger()

_SMALL = 0.25  # of the largest closed space: who starts in one that is smaller may not want to


def check_start(world: World, pose: Pose, radius: float) -> None:
    """Raise WorldError unless a round robot of this radius (m) fits at the pose."""
    where = f"start ({pose.x:.6g}, {pose.y:.6g}) in world {world.name}"
    if not world.contains(pose.x, pose.y):
        x0, y0, x1, y1 = world.extent
        raise WorldError(
            f"{where}: outside the map; choose x in {x0:.2f}..{x1:.2f} and y in {y0:.2f}..{y1:.2f}"
        )
    gaps = np.hypot(*world.wall_offsets(pose.x, pose.y, radius).T)
    if gaps.size and gaps.min() == 0.0:
        raise WorldError(
            f"{where}: inside a wall; choose a start in free space{_widest(world, radius)}"
        )
    if gaps.size and gaps.min() < radius:
        raise WorldError(
            f"{where}: a wall is {gaps.min():.3f} m away, but the robot's radius is "
            f"{radius:.3f} m; choose a start further from walls{_widest(world, radius)}"
        )


def warn_of_small_space(world: World, pose: Pose, radius: float) -> None:
    """Say so if walls close the robot in where it starts, and there is a far larger such space."""
    spaces = _Spaces(world)
    if not 0 < spaces.closed[spaces.at(pose)] < _SMALL * spaces.closed.max():
        return
    place = spaces.widest(radius)
    if place:
        start = f"{pose.x:.2f} {pose.y:.2f}"
        log.warning("start is in a small closed space", start=start, larger=f"--start {place}")


def _widest(world: World, radius: float) -> str:
    """A place of the largest space for a robot of this radius (m); nothing if it fits nowhere."""
    place = _Spaces(world).widest(radius)
    return place and f", such as {place}"


class _Spaces:
    """What walls part, and the sizes of these spaces; of `closed` ones 0 if they reach the rim."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._spaces, count = ndimage.label(~world.occupied)
        self._sizes = np.bincount(self._spaces.ravel(), minlength=count + 1)
        self._sizes[0] = 0
        rim = np.concatenate([self._spaces[[0, -1]].ravel(), self._spaces[:, [0, -1]].ravel()])
        self.closed = np.where(np.isin(np.arange(count + 1), rim), 0, self._sizes)

    def at(self, pose: Pose) -> int:
        """The number of the space that a pose within the map is in."""
        (x0, y0), cell = self._world.origin, self._world.resolution_m
        return int(self._spaces[int((pose.y - y0) / cell), int((pose.x - x0) / cell)])

    def widest(self, radius: float) -> str:
        """The widest place of the largest closed space, or of the largest one, as a start.

        Nothing if a robot of this radius (m) does not fit there either.
        """
        world = self._world
        largest = int(np.argmax(self.closed if self.closed.any() else self._sizes))
        room = np.where(self._spaces == largest, world.clearance, -1.0)
        if not self._sizes[largest] or room.max() < radius:
            return ""
        row, column = np.unravel_index(int(np.argmax(room)), room.shape)
        x, y = (
            origin + (index + 0.5) * world.resolution_m
            for origin, index in zip(world.origin, (column, row), strict=True)
        )
        return f"{x:.2f} {y:.2f} 0"
