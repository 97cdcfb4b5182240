"""Harder buildings of the same random plans: narrow corridors or doors, glass, people."""

from dataclasses import replace

import numpy as np

from gvgbot.drivers.world import World
from gvgbot.geometry import Pose
from gvgbot.worlds.floor_plan import Building, Space, Style

NARROW = Style(building_sides=(14.0, 24.0), corridor_widths=(1.0, 1.0), door_widths=(0.85, 0.95))
# A fine grid, so that the doors have many widths; a Kobuki is 0.354 m wide.
DOORS = Style(building_sides=(14.0, 22.0), door_widths=(0.25, 0.9), resolution=0.025)
GLAZED = 0.4  # of the walls between rooms and corridors
FRAME = 0.3  # m of wall left at either end of a pane
SHORTEST_PANE = 1.0  # m
PEOPLE = 8


def narrow(seed: int = 0) -> tuple[World, Pose]:
    """A building with corridors of one metre."""
    building = Building(NARROW, np.random.default_rng(seed))
    return building.canvas().world("narrow"), building.start


def doors(seed: int = 0) -> tuple[World, Pose]:
    """A building with doors of all widths, some of them too narrow for the robot."""
    building = Building(DOORS, np.random.default_rng(seed))
    return building.canvas().world("doors"), building.start


def crowd(seed: int = 0) -> tuple[World, Pose]:
    """A building where people walk about."""
    building = Building(Style(), np.random.default_rng(seed))
    return replace(building.canvas().world("crowd"), people=PEOPLE), building.start


def glass(seed: int = 0) -> tuple[World, Pose]:
    """A building with glass between some of its rooms and corridors."""
    rng = np.random.default_rng(seed)
    building = Building(Style(), rng)
    canvas = building.canvas()
    for wall in building.walls:
        if wall.corridors == 1 and rng.uniform() < GLAZED:
            pane = _pane(wall.stretch)
            canvas.glaze(pane.x0, pane.y0, pane.x1, pane.y1)
    return canvas.world("glass"), building.start


def _pane(wall: Space) -> Space:
    """The stretch of wall within its frame; an empty one if it is too short."""
    length = max(wall.width, wall.height)
    frame = FRAME if length >= SHORTEST_PANE + 2 * FRAME else length / 2
    if wall.width > wall.height:
        return Space(wall.x0 + frame, wall.y0, wall.x1 - frame, wall.y1)
    return Space(wall.x0, wall.y0 + frame, wall.x1, wall.y1 - frame)
