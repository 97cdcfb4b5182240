"""Robots in one world: they see each other and bump into each other, as two discs do."""

import math

import numpy as np
import pytest

from gvgbot.drivers.body import RobotBody
from gvgbot.drivers.sight import Sight
from gvgbot.geometry import Pose
from gvgbot.worlds.canvas import Canvas

RADIUS = RobotBody(Canvas(1.0, 1.0).world("nowhere"), Pose()).config.radius_m


def hall() -> Canvas:
    canvas = Canvas(12.0, 6.0)
    canvas.carve(0.5, 0.5, 11.5, 5.5)
    return canvas


def two(gap: float) -> tuple[RobotBody, RobotBody]:
    """Face to face in an empty hall, so far between their rims, m."""
    world = hall().world("hall")
    here = RobotBody(world, Pose(3.0, 3.0, 0.0))
    there = RobotBody(world, Pose(3.0 + gap + 2 * RADIUS, 3.0, math.pi))
    here.others.append(there)
    there.others.append(here)
    return here, there


def test_robots_that_drive_at_each_other_touch_and_never_overlap() -> None:
    here, there = two(gap=2.0)
    here.command(0.5, 0.0)
    there.command(0.3, 0.0)
    for step in range(1, 500):
        here.advance(0.02 * step)
        there.advance(0.02 * step)
        assert here.pose.distance(there.pose) >= 2 * RADIUS - 1e-5
    assert here.pose.distance(there.pose) == pytest.approx(2 * RADIUS, abs=1e-3)
    assert here.contacts + there.contacts >= 1
    assert here.bumper[1]
    assert there.bumper[1]


def test_a_robot_is_seen_as_a_disc() -> None:
    here, there = two(gap=1.5)
    sight = Sight(hall().world("hall"), None, seed=1, others=here.others)
    bearings = np.array([-0.5, 0.0, 0.5])
    left, ahead, right = sight.look(here.pose, bearings, 30.0)
    assert ahead == pytest.approx(1.5 + RADIUS, abs=1e-9)
    assert left == pytest.approx(2.5 / math.sin(0.5), abs=0.05)  # the wall beside it
    assert right == pytest.approx(2.5 / math.sin(0.5), abs=0.05)
    assert there.contacts == 0
