"""Worlds of the paper's figures that are not among the built-in ones, drawn by code."""

from pathlib import Path

import numpy as np

from gvgbot.drivers.world import World, save_world
from gvgbot.worlds.canvas import Canvas

ALCOVES_START = "[2.0, 5.0, 1.57]"
BRANCHES_START = "[3.0, 20.0, 1.57]"
BRANCH_ENDS = {21.0: (20.0, 9.0), 45.5: (42.0, 6.5)}  # by their length, m


def alcoves() -> World:
    """Two long blocks side by side, all walls of which have niches: 25 by 10 m."""
    canvas = Canvas(25.0, 10.0)
    canvas.carve(0.5, 0.5, 24.5, 9.5)
    for x0, x1 in ((2.6, 11.6), (13.6, 22.4)):
        canvas.build(x0, 2.9, x1, 7.1)
    rng = np.random.default_rng(1)
    for x in np.arange(1.5, 23.5, 1.9).tolist():
        width, depth = rng.uniform(0.2, 0.45, 2).tolist()
        canvas.carve(x, 0.5 - depth / 2, x + width, 0.6)
        canvas.carve(x + 0.6, 9.4, x + 0.6 + width, 9.5 + depth / 2)
    for x in (*np.arange(3.6, 11.0, 1.7).tolist(), *np.arange(14.6, 21.8, 1.7).tolist()):
        width, depth = rng.uniform(0.2, 0.45, 2).tolist()
        canvas.carve(x, 2.8, x + width, 2.9 + depth)
        canvas.carve(x + 0.5, 7.1 - depth, x + 0.5 + width, 7.2)
    return canvas.world("alcoves")


def branches() -> World:
    """Two small loops, a branch of 21 m, and one of 45 m."""
    canvas = Canvas(45.0, 30.0)
    canvas.carve_path([(3.0, 18.0), (13.0, 18.0), (13.0, 27.0), (3.0, 27.0), (3.0, 18.0)], 2.0)
    canvas.carve_path([(3.0, 22.5), (13.0, 22.5)], 1.8)
    canvas.carve_path([(8.0, 18.0), (8.0, 9.0), (20.0, 9.0)], 1.8)
    canvas.carve_path([(13.0, 22.5), (42.0, 22.5), (42.0, 6.5)], 1.8)
    return canvas.world("branches")


def saved(world: World, directory: Path) -> Path:
    """The YAML file of a world, written there."""
    directory.mkdir(parents=True, exist_ok=True)
    return save_world(world, directory)
