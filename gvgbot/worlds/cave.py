"""A cave: winding passages of changing width between chambers, drawn from a seed."""

from collections.abc import Iterator

import numpy as np
from scipy import ndimage

from gvgbot.drivers.ray_casting import Mask
from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose
from gvgbot.worlds.canvas import RESOLUTION, Canvas

SIDE = 30.0  # m
CHAMBERS = 5  # per side
MARGIN = 3.2  # m from the edge to the outermost chambers
JITTER = 0.8  # m by which a chamber leaves its regular place
BEND = 0.7  # m by which a passage leaves the straight line
LOOPS = 6  # closed ways around rock
CHAMBER_RADII = (1.0, 1.7)  # m
PASSAGE_RADII = (0.65, 0.95)  # m
LEAST_PASSAGE = 1.0  # m
LEAST_WALL = 4  # cells
LEAST_ROCK = 1.5  # m^2: smaller islands of wall are taken away

Link = tuple[int, int]


def cave(seed: int = 0) -> tuple[World, Pose]:
    """Thirty metres square, with loops; every passage is at least a metre wide."""
    rng = np.random.default_rng(seed)
    while True:
        chambers, radii = _chambers(rng)
        canvas = Canvas(SIDE, SIDE)
        for a, b in _links(rng):
            _carve_passage(canvas, chambers[[a, b]], radii[[a, b]], rng)
        canvas.occupied = _worn(canvas.occupied)
        if has_wide_passages(canvas.occupied, LEAST_PASSAGE):
            return canvas.world("cave"), Pose(float(chambers[0, 0]), float(chambers[0, 1]), 0.0)


def has_wide_passages(occupied: Mask, width: float) -> bool:
    """Whether a disc of this diameter (m) gets along every way through one connected free space."""
    depth = ndimage.distance_transform_edt(~occupied) * RESOLUTION
    ways, wide_ways = _topology(depth > 0.0), _topology(depth > width / 2)
    return ways == wide_ways and ways[0] == 1


def _topology(free: Mask) -> tuple[int, int]:
    """Connected free spaces, and islands of wall with the outer wall."""
    return ndimage.label(free)[1], ndimage.label(~free, np.ones((3, 3)))[1]


def _chambers(rng: np.random.Generator) -> tuple[Array, Array]:
    """Centres (N, 2) and radii (N,), m."""
    line = np.linspace(MARGIN, SIDE - MARGIN, CHAMBERS)
    regular = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    centres = regular + rng.uniform(-JITTER, JITTER, regular.shape)
    return centres, rng.uniform(*CHAMBER_RADII, len(centres))


def _links(rng: np.random.Generator) -> list[Link]:
    """Pairs of neighbouring chambers: a random tree over all of them, and some more for loops."""
    pairs = [*_neighbours()]
    group = list(range(CHAMBERS**2))
    tree: list[Link] = []
    spare: list[Link] = []
    for a, b in (pairs[i] for i in rng.permutation(len(pairs))):
        if group[a] == group[b]:
            spare.append((a, b))
            continue
        group = [group[a] if g == group[b] else g for g in group]
        tree.append((a, b))
    return tree + spare[:LOOPS]


def _neighbours() -> Iterator[Link]:
    for k in range(CHAMBERS**2):
        if (k + 1) % CHAMBERS:
            yield k, k + 1
        if k + CHAMBERS < CHAMBERS**2:
            yield k, k + CHAMBERS


def _carve_passage(canvas: Canvas, ends: Array, radii: Array, rng: np.random.Generator) -> None:
    """A bow between two chambers, narrow in its middle and as wide as they are at its ends."""
    t = np.linspace(0.0, 1.0, 60)[:, None]
    along = ends[1] - ends[0]
    across = np.array([-along[1], along[0]]) / np.hypot(*along)
    bow = rng.uniform(-BEND, BEND) * np.sin(np.pi * t) + 0.2 * np.sin(3.0 * np.pi * t)
    way = ends[0] + t * along + bow * across
    narrow = rng.uniform(*PASSAGE_RADII)
    near_end = np.abs(2.0 * t[:, 0] - 1.0) ** 4
    radius = narrow + near_end * (np.where(t[:, 0] < 0.5, radii[0], radii[1]) - narrow)
    for (x, y), r in zip(way, radius, strict=True):
        canvas.carve_disc(x, y, r)


def _worn(occupied: Mask) -> Mask:
    """The walls with their edges smoothed, and without thin or small pieces of rock."""
    smooth = ndimage.gaussian_filter(occupied.astype(np.float64), 4.0, mode="nearest") > 0.5
    across = np.arange(LEAST_WALL) - (LEAST_WALL - 1) / 2
    disc = np.hypot(across, across[:, None]) <= LEAST_WALL / 2
    padded = np.pad(smooth, LEAST_WALL, constant_values=True)
    thick = ndimage.binary_opening(padded, disc)[LEAST_WALL:-LEAST_WALL, LEAST_WALL:-LEAST_WALL]
    rocks, _ = ndimage.label(thick)
    large = np.bincount(rocks.ravel()) * RESOLUTION**2 >= LEAST_ROCK
    large[0] = False
    worn: Mask = large[rocks]
    return worn
