"""Rooms side by side with doors between them."""

from collections.abc import Iterator

import numpy as np

from gvgbot.drivers.world import World
from gvgbot.geometry import Pose
from gvgbot.worlds.canvas import Canvas

# Widths of the columns and heights of the rows, m: nearly square rooms have one middle.
SIDES = (4.6, 4.9, 4.7), (4.8, 4.6, 4.9)
WALL = 0.3  # m
DOORS = (0.9, 1.0)  # m
WALLED_UP = 2  # of the twelve doors

ROOMS_A_SIDE = 3

Room = tuple[int, int]
Door = tuple[Room, Room]


def rooms(seed: int = 0) -> tuple[World, Pose]:
    """Three by three rooms in two loops: the seed draws the doors' widths and two missing doors."""
    rng = np.random.default_rng(seed)
    columns, rows = (np.cumsum([WALL, *(side + WALL for side in sides)]) for sides in SIDES)
    canvas = Canvas(columns[-1], rows[-1])
    middles: dict[Room, tuple[float, float]] = {}
    for i, j in np.ndindex(ROOMS_A_SIDE, ROOMS_A_SIDE):
        x, y = float(columns[i]), float(rows[j])
        canvas.carve(x, y, x + SIDES[0][i], y + SIDES[1][j])
        middles[i, j] = x + SIDES[0][i] / 2, y + SIDES[1][j] / 2
    for here, there in _open_doors(rng):
        canvas.carve_path([middles[here], middles[there]], float(rng.choice(DOORS)))
    x, y = middles[1, 1]
    return canvas.world("rooms"), Pose(x + 1.0, y + 0.5, 0.0)


def _open_doors(rng: np.random.Generator) -> list[Door]:
    """All doors but the walled up ones; every room keeps one, so that all stay connected."""
    doors = [*_all_doors()]
    last = len(doors) - WALLED_UP
    while True:
        chosen = [doors[i] for i in sorted(rng.permutation(len(doors))[:last])]
        if len({room for door in chosen for room in door}) == ROOMS_A_SIDE**2:
            return chosen


def _all_doors() -> Iterator[Door]:
    for i, j in np.ndindex(ROOMS_A_SIDE, ROOMS_A_SIDE):
        if i < ROOMS_A_SIDE - 1:
            yield (i, j), (i + 1, j)
        if j < ROOMS_A_SIDE - 1:
            yield (i, j), (i, j + 1)
