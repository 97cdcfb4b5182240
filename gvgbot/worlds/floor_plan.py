"""Buildings drawn at random: corridors between blocks of rooms, no two seeds alike."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from gvgbot.drivers.world import World
from gvgbot.geometry import Pose
from gvgbot.worlds.canvas import RESOLUTION, Canvas

WALL = 0.25  # m
CORRIDOR_WIDTHS = (1.4, 2.4)  # m, drawn for each
DOOR_WIDTHS = (0.85, 1.2)  # m, drawn for each
ROOM_SIDES = (3.2, 6.5)  # m, drawn until a block is used up
BUILDING_SIDES = (16.0, 34.0)  # m
LARGEST_BLOCK = 13.0  # m, a longer one gets a corridor through it
SECOND_DOORS = 0.2  # of the walls that need no door have one all the same
PERIMETER = 0.4  # how probably each outer side has a corridor along it


@dataclass(frozen=True)
class Space:
    """A rectangle of floor, m."""

    x0: float
    y0: float
    x1: float
    y1: float
    is_corridor: bool = False

    @property
    def width(self) -> float:
        """Extent along x, m."""
        return self.x1 - self.x0

    @property
    def height(self) -> float:
        """Extent along y, m."""
        return self.y1 - self.y0


def floor_plan(seed: int = 0) -> tuple[World, Pose]:
    """A building of corridors, dead ends, loops and rooms with one door or more."""
    rng = np.random.default_rng(seed)
    width, height = (_on_grid(side) for side in rng.uniform(*BUILDING_SIDES, 2))
    spaces: list[Space] = []
    _divide(_perimeter(Space(0.5, 0.5, width - 0.5, height - 0.5), spaces, rng), spaces, rng)
    canvas = Canvas(width, height)
    for space in spaces:
        canvas.carve(space.x0, space.y0, space.x1, space.y1)
    for door in _doors(spaces, rng):
        canvas.carve(door.x0, door.y0, door.x1, door.y1)
    start = max(spaces, key=lambda s: (s.is_corridor, s.width * s.height))
    middle = Pose((start.x0 + start.x1) / 2, (start.y0 + start.y1) / 2, float(rng.uniform(-3, 3)))
    return canvas.world("floor_plan"), middle


def _perimeter(block: Space, spaces: list[Space], rng: np.random.Generator) -> Space:
    """The block within the corridors that are drawn along its outer sides."""
    x0, y0, x1, y1 = block.x0, block.y0, block.x1, block.y1
    for side in range(4):
        if rng.uniform() > PERIMETER:
            continue
        width = _on_grid(rng.uniform(*CORRIDOR_WIDTHS))
        if side == 0:
            spaces.append(Space(x0, y0, x0 + width, y1, is_corridor=True))
            x0 += width + WALL
        elif side == 1:
            spaces.append(Space(x1 - width, y0, x1, y1, is_corridor=True))
            x1 -= width + WALL
        elif side == 2:
            spaces.append(Space(x0, y0, x1, y0 + width, is_corridor=True))
            y0 += width + WALL
        else:
            spaces.append(Space(x0, y1 - width, x1, y1, is_corridor=True))
            y1 -= width + WALL
    return Space(x0, y0, x1, y1)


def _divide(block: Space, spaces: list[Space], rng: np.random.Generator) -> None:
    """Corridors through a large block, rooms side by side in a small one."""
    if max(block.width, block.height) < LARGEST_BLOCK:
        spaces.extend(_rooms(block, rng))
        return
    width = _on_grid(rng.uniform(*CORRIDOR_WIDTHS))
    share = rng.uniform(0.35, 0.65)
    if block.width > block.height:
        x = _on_grid(block.x0 + share * (block.width - width))
        spaces.append(Space(x, block.y0, x + width, block.y1, is_corridor=True))
        parts = (
            Space(block.x0, block.y0, x - WALL, block.y1),
            Space(x + width + WALL, block.y0, block.x1, block.y1),
        )
    else:
        y = _on_grid(block.y0 + share * (block.height - width))
        spaces.append(Space(block.x0, y, block.x1, y + width, is_corridor=True))
        parts = (
            Space(block.x0, block.y0, block.x1, y - WALL),
            Space(block.x0, y + width + WALL, block.x1, block.y1),
        )
    for part in parts:
        _divide(part, spaces, rng)


def _rooms(block: Space, rng: np.random.Generator) -> Iterator[Space]:
    """Rows of rooms, each row divided anew."""
    for y0, y1 in _slices(block.y0, block.y1, rng):
        for x0, x1 in _slices(block.x0, block.x1, rng):
            yield Space(x0, y0, x1, y1)


def _slices(start: float, end: float, rng: np.random.Generator) -> Iterator[tuple[float, float]]:
    """Stretches with walls between them; none is shorter than the shortest room, but the block."""
    at = start
    while end - at > 2 * ROOM_SIDES[0] + WALL:
        side = _on_grid(min(rng.uniform(*ROOM_SIDES), end - at - WALL - ROOM_SIDES[0]))
        yield at, at + side
        at += side + WALL
    yield at, end


def _doors(spaces: list[Space], rng: np.random.Generator) -> Iterator[Space]:
    """Doors that connect all spaces, a few more than need be; corridors open into each other."""
    group = list(range(len(spaces)))
    walls = [(a, b) for a, b in combinations(range(len(spaces)), 2) if _gap(spaces[a], spaces[b])]
    order = rng.permutation(len(walls))
    # Corridors first, then rooms onto corridors: a room behind a room is the exception.
    corridors = [spaces[a].is_corridor + spaces[b].is_corridor for a, b in walls]
    for k in sorted(order.tolist(), key=lambda k: -corridors[k]):
        a, b = walls[k]
        if group[a] != group[b] or corridors[k] == 2 or rng.uniform() < SECOND_DOORS:
            gap = _gap(spaces[a], spaces[b])
            assert gap is not None
            yield gap if corridors[k] == 2 else _narrowed(gap, rng)
            group = [group[a] if g == group[b] else g for g in group]


def _gap(a: Space, b: Space) -> Space | None:
    """The wall between two neighbours where it is long enough for a door."""
    x0, x1 = max(a.x0, b.x0), min(a.x1, b.x1)
    y0, y1 = max(a.y0, b.y0), min(a.y1, b.y1)
    if x1 - x0 >= DOOR_WIDTHS[1] and 0 < y0 - y1 < 2 * WALL:
        return Space(x0, y1, x1, y0)
    if y1 - y0 >= DOOR_WIDTHS[1] and 0 < x0 - x1 < 2 * WALL:
        return Space(x1, y0, x0, y1)
    return None


def _narrowed(wall: Space, rng: np.random.Generator) -> Space:
    """A door somewhere in the stretch of wall, as deep as the wall."""
    door = _on_grid(rng.uniform(*DOOR_WIDTHS))
    along_x = wall.width > wall.height
    at = _on_grid(rng.uniform(0.0, max(wall.width, wall.height) - door))
    if along_x:
        return Space(wall.x0 + at, wall.y0, wall.x0 + at + door, wall.y1)
    return Space(wall.x0, wall.y0 + at, wall.x1, wall.y0 + at + door)


def _on_grid(metres: float) -> float:
    return round(float(metres) / RESOLUTION) * RESOLUTION
