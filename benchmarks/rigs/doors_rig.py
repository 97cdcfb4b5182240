"""A world shaped like the letter theta, whose doors can be shut and opened while a robot is in it.

Two meetpoints, 5 m apart over the bar in the middle and 12 m around either side. One door is in
the middle of the bar, another one shuts it off flush with the wall of the ring, so that the
meetpoint there is none any more.
"""

from collections.abc import Callable

from gvgbot.drivers.world import World
from gvgbot.geometry import Pose
from gvgbot.worlds.canvas import Canvas

SOUTH, NORTH = (5.5, 2.0), (5.5, 7.0)
START = Pose(3.5, 2.1, 0.2)
WIDTH = 1.4
MIDDLE = (4.7, 6.3, 4.4, 4.6)  # x, x, y, y of a door in the middle of the bar
FLUSH = (4.7, 6.3, 2.0 + WIDTH / 2, 2.2 + WIDTH / 2)  # and of one where it leaves the ring


def theta(east: float = 9.0, north: float = 7.0) -> World:
    """The world, or a smaller one whose ring ends at this x and y, m."""
    canvas = Canvas(east + 2.0, north + 2.0)
    ring = [(2.0, 2.0), (east, 2.0), (east, north), (2.0, north), (2.0, 2.0)]
    canvas.carve_path(ring, WIDTH)
    canvas.carve_path([SOUTH, (NORTH[0], north)], WIDTH)
    return canvas.world("theta")


def swing(
    world: World,
    door: tuple[float, float, float, float],
    *,
    shut: bool,
    built: Callable[[], World] = theta,
) -> None:
    """Shut or open a door in the world that everybody looks at."""
    x0, x1, y0, y1 = (round(at / world.resolution_m) for at in door)
    before = built().occupied[y0:y1, x0:x1]
    world.occupied.setflags(write=True)
    world.occupied[y0:y1, x0:x1] = True if shut else before
    world.occupied.setflags(write=False)
    for cached in ("_caster", "clearance", "without_glass"):
        world.__dict__.pop(cached, None)
