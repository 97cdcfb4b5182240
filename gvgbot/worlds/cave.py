"""A cave: winding passages of changing width between chambers, drawn from a seed."""

import numpy as np
from scipy import ndimage

from gvgbot.drivers.ray_casting import Mask
from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose
from gvgbot.worlds.canvas import Canvas
from gvgbot.worlds.lattice import lattice_links
from gvgbot.worlds.morphology import has_wide_passages, without_thin_walls

SIDE = 30.0  # m
RESOLUTION = 0.025  # m: where walls follow no axis, their steps must be small
CHAMBERS = 5  # per side
MARGIN = 3.2  # m from the edge to the outermost chambers
JITTER = 0.8  # m by which a chamber leaves its regular place
BEND = 0.7  # m by which a passage leaves the straight line
LOOPS = 6  # closed ways around rock
CHAMBER_RADII = (1.0, 1.7)  # m
PASSAGE_RADII = (0.65, 0.95)  # m
LEAST_PASSAGE = 1.0  # m
WORN = 0.2  # m, sigma


def cave(seed: int = 0) -> tuple[World, Pose]:
    """Thirty metres square, with loops; every passage is at least a metre wide."""
    rng = np.random.default_rng(seed)
    while True:
        chambers, radii = _chambers(rng)
        canvas = Canvas(SIDE, SIDE, RESOLUTION)
        for a, b in lattice_links(CHAMBERS, LOOPS, rng):
            _carve_passage(canvas, chambers[[a, b]], radii[[a, b]], rng)
        canvas.occupied = _worn(canvas.occupied)
        if has_wide_passages(canvas.occupied, LEAST_PASSAGE, RESOLUTION):
            return canvas.world("cave"), Pose(float(chambers[0, 0]), float(chambers[0, 1]), 0.0)


def _chambers(rng: np.random.Generator) -> tuple[Array, Array]:
    """Centres (N, 2) and radii (N,), m."""
    line = np.linspace(MARGIN, SIDE - MARGIN, CHAMBERS)
    regular = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    centres = regular + rng.uniform(-JITTER, JITTER, regular.shape)
    return centres, rng.uniform(*CHAMBER_RADII, len(centres))


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
    smooth = ndimage.gaussian_filter(occupied.astype(np.float64), WORN / RESOLUTION, mode="nearest")
    return without_thin_walls(smooth > 0.5, RESOLUTION)
