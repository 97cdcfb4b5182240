"""Furnished buildings: of chairs and tables, a laser near the floor sees only the legs."""

import math
from collections.abc import Iterator

import numpy as np

from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose
from gvgbot.worlds.floor_plan import Building, Space, Style

STYLE = Style(
    building_sides=(13.0, 18.0),
    corridor_widths=(1.8, 2.4),
    room_sides=(3.6, 6.5),
    door_widths=(0.9, 1.2),
    resolution=0.02,
)
LEGS = (0.04, 0.06)  # m, the two thicknesses
TABLE_LENGTHS, TABLE_WIDTHS = (0.8, 1.8), (0.45, 0.9)  # m between the middles of legs
CHAIR_SIDES = (0.36, 0.46)  # m, likewise
SEATS_AWAY = (0.15, 0.5)  # m from the table's side to the middle of a chair
MOST_CHAIRS = 4  # at a table
AREA_PER_TRY = 2.5  # m^2 of floor for each piece of furniture that is tried
FROM_WALL = 0.08  # m, the least
APART = 0.3  # m between the legs of different groups
KEPT_FREE = 0.9  # m around doors and the start


def clutter(seed: int = 0) -> tuple[World, Pose]:
    """A building with tables and chairs in its rooms and single chairs in its corridors."""
    rng = np.random.default_rng(seed)
    building = Building(STYLE, rng)
    canvas = building.canvas()
    bare = np.array([building.start.position, *(door.middle for door in building.doors)])
    legs = np.empty((0, 2))
    for space in building.spaces:
        for group in _tried(space, rng):
            if _fits(group, space) and _gap(group, bare) > KEPT_FREE and _gap(group, legs) > APART:
                legs = np.concatenate((legs, group))
    for (x, y), half in zip(legs, rng.choice(LEGS, len(legs)) / 2, strict=True):
        canvas.build(x - half, y - half, x + half, y + half)
    return canvas.world("clutter"), building.start


def _tried(space: Space, rng: np.random.Generator) -> Iterator[Array]:
    """Legs (N, 2) of groups of furniture somewhere in a space: it is not sure that they fit."""
    for _ in range(math.ceil(space.width * space.height / AREA_PER_TRY)):
        x, y, turn = rng.uniform((space.x0, space.y0, -math.pi), (space.x1, space.y1, math.pi))
        group = _chair(rng) if space.is_corridor else _table_with_chairs(rng)
        yield Pose(x, y, turn).transform(group)


def _table_with_chairs(rng: np.random.Generator) -> Array:
    """Legs (N, 2) about the middle of a table, the chairs at its long sides."""
    length, width = rng.uniform(*TABLE_LENGTHS), rng.uniform(*TABLE_WIDTHS)
    groups = [_four_legs(length, width)]
    for _ in range(rng.integers(MOST_CHAIRS + 1)):
        side = rng.choice((-1.0, 1.0))
        x = rng.uniform(-length / 2, length / 2)
        seat = Pose(x, side * (width / 2 + rng.uniform(*SEATS_AWAY)), rng.uniform(-0.5, 0.5))
        groups.append(seat.transform(_chair(rng)))
    return np.concatenate(groups)


def _chair(rng: np.random.Generator) -> Array:
    side = rng.uniform(*CHAIR_SIDES)
    return _four_legs(side, side)


def _four_legs(length: float, width: float) -> Array:
    """Corners (4, 2) of a rectangle about the origin, m."""
    return np.array([(x, y) for x in (-length / 2, length / 2) for y in (-width / 2, width / 2)])


def _fits(legs: Array, space: Space) -> bool:
    edge = FROM_WALL + max(LEGS) / 2
    above = legs - (space.x0 + edge, space.y0 + edge)
    below = (space.x1 - edge, space.y1 - edge) - legs
    return bool((above > 0.0).all() and (below > 0.0).all())


def _gap(a: Array, b: Array) -> float:
    """The least distance between points (N, 2) and (M, 2), m; inf if there are none."""
    return float(np.hypot(*(a[:, None] - b[None]).T).min(initial=math.inf))
