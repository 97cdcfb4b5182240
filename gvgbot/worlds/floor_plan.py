"""Buildings drawn at random: corridors between blocks of rooms, no two seeds alike."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from gvgbot.drivers.world import World
from gvgbot.geometry import Pose
from gvgbot.worlds.canvas import RESOLUTION, Canvas

WALL = 0.25  # m
LARGEST_BLOCK = 13.0  # m, a longer one gets a corridor through it
SECOND_DOORS = 0.2  # of the walls that need no door have one all the same
PERIMETER = 0.4  # how probably each outer side has a corridor along it


@dataclass(frozen=True, slots=True, kw_only=True)
class Style:
    """What a building is like, in m: each size is drawn anew between two bounds."""

    building_sides: tuple[float, float] = (16.0, 34.0)
    corridor_widths: tuple[float, float] = (1.4, 2.4)
    room_sides: tuple[float, float] = (3.2, 6.5)
    door_widths: tuple[float, float] = (0.85, 1.2)
    resolution: float = RESOLUTION


@dataclass(frozen=True, slots=True)
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

    @property
    def middle(self) -> tuple[float, float]:
        """Its centre, m."""
        return (self.x0 + self.x1) / 2, (self.y0 + self.y1) / 2


@dataclass(frozen=True, slots=True)
class Wall:
    """Where two neighbouring spaces, by their numbers, could have a door."""

    a: int
    b: int
    stretch: Space
    corridors: int  # how many of the two are corridors


def floor_plan(seed: int = 0) -> tuple[World, Pose]:
    """A building of corridors, dead ends, loops and rooms with one door or more."""
    building = Building(Style(), np.random.default_rng(seed))
    return building.canvas().world("floor_plan"), building.start


def large_plan(seed: int = 0) -> tuple[World, Pose]:
    """The same over 60 by 60 m: more than a hundred rooms and corridors."""
    building = Building(Style(building_sides=(60.0, 60.0)), np.random.default_rng(seed))
    return building.canvas().world("large_plan"), building.start


class Building:
    """A building drawn at random: its `spaces`, the `walls` between them, and the `doors` there.

    The `start` is in the middle of its largest corridor.
    """

    def __init__(self, style: Style, rng: np.random.Generator) -> None:
        self._style, self._rng = style, rng
        width, height = (self._on_grid(side) for side in rng.uniform(*style.building_sides, 2))
        self.size = width, height
        self.spaces: list[Space] = []
        self._divide(self._perimeter(Space(0.5, 0.5, width - 0.5, height - 0.5)))
        self.walls = [*_walls(self.spaces, style.door_widths[1])]
        self.doors = [*self._doors()]
        largest = max(self.spaces, key=lambda s: (s.is_corridor, s.width * s.height))
        self.start = Pose(*largest.middle, float(rng.uniform(-3, 3)))

    def canvas(self) -> Canvas:
        """All spaces and doors, carved."""
        canvas = Canvas(*self.size, self._style.resolution)
        for space in (*self.spaces, *self.doors):
            canvas.carve(space.x0, space.y0, space.x1, space.y1)
        return canvas

    def _perimeter(self, block: Space) -> Space:
        """The block within the corridors that are drawn along its outer sides."""
        x0, y0, x1, y1 = block.x0, block.y0, block.x1, block.y1
        for side in range(4):
            if self._rng.uniform() > PERIMETER:
                continue
            width = self._corridor_width()
            if side == 0:
                self._add_corridor(x0, y0, x0 + width, y1)
                x0 += width + WALL
            elif side == 1:
                self._add_corridor(x1 - width, y0, x1, y1)
                x1 -= width + WALL
            elif side == 2:
                self._add_corridor(x0, y0, x1, y0 + width)
                y0 += width + WALL
            else:
                self._add_corridor(x0, y1 - width, x1, y1)
                y1 -= width + WALL
        return Space(x0, y0, x1, y1)

    def _add_corridor(self, x0: float, y0: float, x1: float, y1: float) -> None:
        self.spaces.append(Space(x0, y0, x1, y1, is_corridor=True))

    def _corridor_width(self) -> float:
        return self._on_grid(self._rng.uniform(*self._style.corridor_widths))

    def _divide(self, block: Space) -> None:
        """Corridors through a large block, rooms side by side in a small one."""
        if max(block.width, block.height) < LARGEST_BLOCK:
            self.spaces.extend(self._rooms(block))
            return
        width = self._corridor_width()
        share = self._rng.uniform(0.35, 0.65)
        if block.width > block.height:
            x = self._on_grid(block.x0 + share * (block.width - width))
            self._add_corridor(x, block.y0, x + width, block.y1)
            parts = (
                Space(block.x0, block.y0, x - WALL, block.y1),
                Space(x + width + WALL, block.y0, block.x1, block.y1),
            )
        else:
            y = self._on_grid(block.y0 + share * (block.height - width))
            self._add_corridor(block.x0, y, block.x1, y + width)
            parts = (
                Space(block.x0, block.y0, block.x1, y - WALL),
                Space(block.x0, y + width + WALL, block.x1, block.y1),
            )
        for part in parts:
            self._divide(part)

    def _rooms(self, block: Space) -> Iterator[Space]:
        """Rows of rooms, each row divided anew."""
        for y0, y1 in self._slices(block.y0, block.y1):
            for x0, x1 in self._slices(block.x0, block.x1):
                yield Space(x0, y0, x1, y1)

    def _slices(self, start: float, end: float) -> Iterator[tuple[float, float]]:
        """Stretches with walls between them; only the block itself is shorter than any room."""
        shortest, longest = self._style.room_sides
        at = start
        while end - at > 2 * shortest + WALL:
            side = self._rng.uniform(shortest, longest)
            side = self._on_grid(min(side, end - at - WALL - shortest))
            yield at, at + side
            at += side + WALL
        yield at, end

    def _doors(self) -> Iterator[Space]:
        """Doors that connect all spaces, and a few more; corridors open into each other."""
        group = list(range(len(self.spaces)))
        order = self._rng.permutation(len(self.walls)).tolist()
        # Corridors first, then rooms onto corridors: a room behind a room is the exception.
        for wall in sorted((self.walls[k] for k in order), key=lambda wall: -wall.corridors):
            a, b, is_opening = wall.a, wall.b, wall.corridors == 2
            if group[a] != group[b] or is_opening or self._rng.uniform() < SECOND_DOORS:
                yield wall.stretch if is_opening else self._narrowed(wall.stretch)
                group = [group[a] if g == group[b] else g for g in group]

    def _narrowed(self, wall: Space) -> Space:
        """A door somewhere in the stretch of wall, as deep as the wall."""
        door = self._on_grid(self._rng.uniform(*self._style.door_widths))
        at = self._on_grid(self._rng.uniform(0.0, max(wall.width, wall.height) - door))
        if wall.width > wall.height:
            return Space(wall.x0 + at, wall.y0, wall.x0 + at + door, wall.y1)
        return Space(wall.x0, wall.y0 + at, wall.x1, wall.y0 + at + door)

    def _on_grid(self, metres: float) -> float:
        return round(float(metres) / self._style.resolution) * self._style.resolution


def _walls(spaces: list[Space], shortest: float) -> Iterator[Wall]:
    """The walls between neighbours that are long enough (m) for a door."""
    for (i, a), (j, b) in combinations(enumerate(spaces), 2):
        x0, x1 = max(a.x0, b.x0), min(a.x1, b.x1)
        y0, y1 = max(a.y0, b.y0), min(a.y1, b.y1)
        if x1 - x0 >= shortest and 0 < y0 - y1 < 2 * WALL:
            yield Wall(i, j, Space(x0, y1, x1, y0), a.is_corridor + b.is_corridor)
        elif y1 - y0 >= shortest and 0 < x0 - x1 < 2 * WALL:
            yield Wall(i, j, Space(x1, y0, x0, y1), a.is_corridor + b.is_corridor)
