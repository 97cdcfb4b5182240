"""Passages, round rooms and turned rooms whose walls follow no axis, drawn from a seed."""

import math

import numpy as np

from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose
from gvgbot.worlds.canvas import Canvas
from gvgbot.worlds.lattice import lattice_links
from gvgbot.worlds.morphology import has_wide_passages, without_thin_walls

RESOLUTION = 0.025  # m: where walls follow no axis, their steps must be small
NODES = 3  # per side
PITCH = 8.0  # m between nodes
JITTER = 1.2  # m by which a node leaves its regular place
TURN = (0.15, 0.65)  # rad of the whole lattice
MARGIN = 3.5  # m from the edge to the outermost nodes
WIDTHS = (1.3, 2.2)  # m of passages
SAGITTAS = (0.8, 1.6)  # m, of the passages that are bent
BENT = 0.5  # of the passages
ROOMS = 0.7  # of the nodes
ROUND = 0.5  # of the rooms
ROOM_SIDES = (3.0, 4.6)  # m
LOOPS = 2
LEAST_PASSAGE = 1.0  # m


def slopes(seed: int = 0) -> tuple[World, Pose]:
    """Some twenty-five metres square, with loops."""
    rng = np.random.default_rng(seed)
    while True:
        nodes = _nodes(rng)
        width, height = (nodes.max(axis=0) + MARGIN).tolist()
        canvas = Canvas(width, height, RESOLUTION)
        for a, b in lattice_links(NODES, LOOPS, rng):
            _carve_passage(canvas, nodes[a], nodes[b], rng)
        for node in nodes[rng.random(len(nodes)) < ROOMS]:
            _carve_room(canvas, node, rng)
        canvas.occupied = without_thin_walls(canvas.occupied, RESOLUTION)
        if has_wide_passages(canvas.occupied, LEAST_PASSAGE, RESOLUTION):
            x, y = nodes[0].tolist()
            return canvas.world("slopes"), Pose(x, y, float(rng.uniform(-3, 3)))


def _nodes(rng: np.random.Generator) -> Array:
    """Points (N, 2) of a turned lattice, m."""
    line = np.arange(NODES) * PITCH
    lattice = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    lattice = lattice + rng.uniform(-JITTER, JITTER, lattice.shape)
    turned = Pose(0.0, 0.0, float(rng.uniform(*TURN))).transform(lattice)
    return np.asarray(turned - turned.min(axis=0) + MARGIN)


def _carve_passage(canvas: Canvas, a: Array, b: Array, rng: np.random.Generator) -> None:
    """A straight passage, or an arc of a circle, of one width."""
    width = rng.uniform(*WIDTHS)
    along = b - a
    length = math.hypot(*along)
    if rng.random() >= BENT:
        x, y = ((a + b) / 2).tolist()
        canvas.carve_turned(x, y, length, width, math.atan2(along[1], along[0]))
        for x, y in (a, b):
            canvas.carve_disc(x, y, width / 2)
        return
    sagitta = rng.choice((-1.0, 1.0)) * rng.uniform(*SAGITTAS)
    radius = (length**2 / 4 + sagitta**2) / (2 * sagitta)
    across = np.array([-along[1], along[0]]) / length
    centre = (a + b) / 2 + (sagitta - radius) * across
    half = math.asin(length / 2 / radius)
    for angle in np.linspace(-half, half, 200):
        x, y = centre + Pose(0.0, 0.0, float(angle)).transform(across * radius)
        canvas.carve_disc(x, y, width / 2)


def _carve_room(canvas: Canvas, node: Array, rng: np.random.Generator) -> None:
    (x, y), (length, width) = node, rng.uniform(*ROOM_SIDES, 2)
    if rng.random() < ROUND:
        canvas.carve_disc(x, y, length / 2)
    else:
        canvas.carve_turned(x, y, length, width, rng.uniform(0.0, math.pi))
