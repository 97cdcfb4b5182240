"""A hall so large that a short laser in its middle sees nothing, with corridors around it."""

from itertools import pairwise

import numpy as np

from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose
from gvgbot.worlds.canvas import RESOLUTION, Canvas

LENGTHS, WIDTHS = (23.0, 27.0), (17.5, 19.0)  # m
MARGIN = 3.5  # m around the hall
WALL = 0.3  # m between the hall and its corridors
CORRIDOR_WIDTHS = (1.6, 2.4)  # m
DOOR_WIDTHS = (0.9, 1.6)  # m
PILLARS = (3, 6)  # along each long side
PILLAR_SIDES = (0.4, 0.8)  # m
PILLARS_OFF_WALL = (1.8, 2.6)  # m from the long wall to the middle of a pillar
FROM_CORNER = 2.5  # m to the nearest door or pillar


def open_hall(seed: int = 0) -> tuple[World, Pose]:
    """Two rows of pillars, and corridors with doors along two, three or four sides."""
    rng = np.random.default_rng(seed)
    inside = np.array([rng.uniform(*LENGTHS), rng.uniform(*WIDTHS)])
    low, high = np.full(2, MARGIN), inside + MARGIN
    canvas = Canvas(*(high + MARGIN).tolist())
    canvas.carve(*low, *high)
    for y, direction in ((low[1], 1.0), (high[1], -1.0)):
        count = rng.integers(*PILLARS, endpoint=True)
        for x in _spread(low[0], high[0], count, rng):
            _build_pillar(canvas, x, y + direction * rng.uniform(*PILLARS_OFF_WALL), rng)
    _add_corridors(canvas, low, high, rng)
    start = Pose(float(low[0]) + 1.2, float(low[1] + inside[1] / 2), float(rng.uniform(-1, 1)))
    return canvas.world("open_hall"), start


def _spread(start: float, end: float, count: np.int64, rng: np.random.Generator) -> Array:
    """Places (count,) along a side, one in each of so many equal parts of it."""
    part = (end - start - 2 * FROM_CORNER) / count
    return start + FROM_CORNER + part * (np.arange(count) + rng.uniform(0.15, 0.85, count))


def _build_pillar(canvas: Canvas, x: float, y: float, rng: np.random.Generator) -> None:
    # Its middle lies between cells, so that even a round one has no tip of a single cell.
    x, y = (round(float(v) / RESOLUTION) * RESOLUTION for v in (x, y))
    half = rng.uniform(*PILLAR_SIDES) / 2
    if rng.random() < 0.5:
        canvas.build_disc(x, y, half)
    else:
        canvas.build(x - half, y - half, x + half, y + half)


def _add_corridors(canvas: Canvas, low: Array, high: Array, rng: np.random.Generator) -> None:
    """A corridor around some corners of the hall, with one or two doors in each of its sides."""
    width = rng.uniform(*CORRIDOR_WIDTHS)
    off = WALL + width / 2
    (x0, y0), (x1, y1) = low - off, high + off
    corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    first, sides = rng.integers(4), rng.integers(2, 4, endpoint=True)
    way = np.roll(np.concatenate((corners, corners)), -2 * first)[: sides + 1]
    canvas.carve_path([(x, y) for x, y in way.tolist()], width)
    for a, b in pairwise(way):
        ahead = (b - a) / np.hypot(*(b - a))
        inwards = np.array([-ahead[1], ahead[0]])  # the hall is on the left
        for along in _spread(off, np.hypot(*(b - a)) - off, rng.integers(1, 3), rng):
            x, y = (a + along * ahead).tolist()
            dx, dy = (off * inwards).tolist()
            canvas.carve_path([(x, y), (x + dx, y + dy)], rng.uniform(*DOOR_WIDTHS))
