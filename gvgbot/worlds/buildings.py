"""Buildings of corridors and rooms."""

import math

import numpy as np
from numpy.typing import NDArray

from gvgbot.drivers.world import World
from gvgbot.geometry import Pose
from gvgbot.worlds.canvas import Canvas

# Widths and centre lines of the office's corridors, m: the first three rows make three loops,
# then come a long branch and two dead ends.
OFFICE_CORRIDORS: tuple[tuple[float, list[tuple[float, float]]], ...] = (
    (2.0, [(3.0, 4.0), (23.0, 4.0), (23.0, 20.9), (3.0, 20.9), (3.0, 4.0)]),
    (2.4, [(3.2, 12.2), (22.8, 12.2)]),
    (1.6, [(12.8, 4.0), (12.8, 12.2)]),
    (1.8, [(23.0, 12.2), (36.9, 12.2), (36.9, 22.3), (27.5, 22.3), (27.5, 16.5)]),
    (1.6, [(23.0, 6.6), (34.0, 6.6)]),
    (1.6, [(10.0, 20.9), (10.0, 16.0)]),
)
# Each room and the door that leads out of it, as opposite corners x0, y0, x1, y1, m. No room is
# much longer than wide, so that its middle is a dead end and not a fork into its corners.
OFFICE_ROOMS: tuple[tuple[float, float, float, float], ...] = (
    *((5.8, 5.3, 10.2, 9.3), (7.5, 5.0, 8.5, 5.3)),
    *((14.2, 5.3, 17.4, 8.3), (15.35, 5.0, 16.25, 5.3)),
    *((18.0, 7.5, 21.4, 10.7), (19.2, 10.7, 20.2, 11.0)),
    *((13.0, 13.7, 17.4, 17.9), (14.75, 13.4, 15.65, 13.7)),
    *((17.8, 16.2, 21.4, 19.6), (19.1, 19.6, 20.1, 19.9)),
    *((27.0, 1.8, 31.0, 5.5), (28.55, 5.5, 29.45, 5.8)),
)
GRID_MARGIN = 0.5  # m of wall around the grids


def office(_seed: int = 0) -> tuple[World, Pose]:
    """Corridors in three loops, dead ends, a branch of forty metres, and rooms with doors."""
    canvas = Canvas(40.0, 25.0)
    for width, corners in OFFICE_CORRIDORS:
        canvas.carve_path(corners, width)
    for rectangle in OFFICE_ROOMS:
        canvas.carve(*rectangle)
    return canvas.world("office"), Pose(3.0, 8.0, math.pi / 2)


def grid(_seed: int = 0) -> tuple[World, Pose]:
    """Four by four equal blocks of eight metres between corridors of two."""
    return _street_grid("grid", np.full((2, 4), 8.0), np.full((2, 5), 2.0))


def jittered(seed: int = 0) -> tuple[World, Pose]:
    """Four by four blocks whose sides and corridors differ, drawn from the seed."""
    rng = np.random.default_rng(seed)
    blocks = rng.uniform(6.5, 9.5, (2, 4))
    return _street_grid("jittered", blocks, rng.uniform(1.6, 2.4, (2, 5)))


def _street_grid(
    name: str, blocks: NDArray[np.float64], corridors: NDArray[np.float64]
) -> tuple[World, Pose]:
    """Straight corridors right across, along x and along y; sizes (2, N) and (2, N + 1) in m."""
    starts = np.cumsum(
        np.hstack((np.full((2, 1), GRID_MARGIN), corridors[:, :-1] + blocks)), axis=1
    )
    ends = starts + corridors
    width, height = ends[:, -1] + GRID_MARGIN
    canvas = Canvas(width, height)
    for x0, x1 in zip(starts[0], ends[0], strict=True):
        canvas.carve(x0, GRID_MARGIN, x1, ends[1, -1])
    for y0, y1 in zip(starts[1], ends[1], strict=True):
        canvas.carve(GRID_MARGIN, y0, ends[0, -1], y1)
    x, y = ((starts[:, 0] + ends[:, 0]) / 2).tolist()
    return canvas.world(name), Pose(x, y + 3.0, math.pi / 2)


def comb(_seed: int = 0) -> tuple[World, Pose]:
    """A corridor with seven equal dead ends on one side."""
    canvas = Canvas(30.0, 9.0)
    canvas.carve_path([(2.0, 2.0), (28.0, 2.0)], 2.0)
    for x in np.arange(4.4, 27.0, 3.6):
        canvas.carve_path([(x, 2.0), (x, 7.4)], 1.6)
    return canvas.world("comb"), Pose(2.6, 2.0, 0.0)


def spiral(_seed: int = 0) -> tuple[World, Pose]:
    """One corridor that winds inwards."""
    canvas = Canvas(20.0, 20.0)
    canvas.carve_path(
        [(2, 2), (18, 2), (18, 18), (2, 18), (2, 5), (15, 5), (15, 15), (5, 15), (5, 8), (12, 8)],
        1.8,
    )
    return canvas.world("spiral"), Pose(4.0, 2.0, 0.0)


def ring(_seed: int = 0) -> tuple[World, Pose]:
    """A circular corridor with one short side branch, so that the loop has a landmark."""
    canvas = Canvas(16.0, 20.0)
    canvas.carve_disc(8.0, 8.0, 7.0)
    canvas.carve_path([(8.0, 14.0), (8.0, 18.4)], 1.8)
    canvas.build_disc(8.0, 8.0, 5.0)
    return canvas.world("ring"), Pose(14.0, 8.0, math.pi / 2)


def hall(_seed: int = 0) -> tuple[World, Pose]:
    """An open hall with pillars, its walls beyond the reach of a short laser."""
    canvas = Canvas(19.0, 15.0)
    canvas.carve(0.5, 0.5, 18.5, 14.5)
    for x in (5.0, 14.0):
        for y in (4.5, 10.5):
            canvas.build(x - 0.6, y - 0.6, x + 0.6, y + 0.6)
    return canvas.world("hall"), Pose(2.0, 7.5, 0.0)
