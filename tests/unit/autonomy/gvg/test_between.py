"""What walls places lie between: expected by geometry."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.gvg.between import between
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.drivers.world import World
from gvgbot.geometry import Pose
from gvgbot.worlds.canvas import Canvas
from tests.unit.autonomy.sights import carved, looked

CORRIDOR = (-6.0, -1.0, 6.0, 1.0)
# From (0, -0.25) both corners are as far as the wall.
TEE = carved([CORRIDOR, (-1.0, -6.0, 1.0, 1.0)])


@pytest.mark.parametrize(
    ("world", "place", "clearance", "walls"),
    [
        (carved([CORRIDOR]), (0.0, 0.0), 1.0, 2),
        (carved([CORRIDOR]), (0.0, 0.4), 0.6, 1),
        (carved([CORRIDOR]), (5.0, 0.0), 1.0, 3),  # where it ends
        (carved([(-6.0, -0.4, 6.0, 0.4)]), (0.0, 0.0), 0.4, 2),
        (carved([(-6.0, -0.2, 6.0, 0.2)]), (0.0, 0.0), 0.2, 2),
        (carved([(-6.0, -0.8, 6.0, 1.0)]), (0.0, 0.0), 0.8, 1),  # 0.2 m is not as near
        (carved([(-6.0, -0.94, 6.0, 1.0)]), (0.0, 0.0), 0.94, 2),  # 0.06 m is
        (carved([(-6.0, -6.0, 6.0, 1.0)]), (0.0, 0.0), 1.0, 1),
        (carved([(-1.0, -6.0, 6.0, 6.0)]), (0.0, 0.0), 1.0, 1),  # astern, where bearings begin
        (TEE, (0.0, -0.25), 1.25, 3),
        (TEE, (0.0, -3.0), 1.0, 2),
        (TEE, (0.0, 0.4), 0.6, 1),
        (carved([(-2.0, -2.0, 2.0, 2.0)]), (0.0, 0.0), 2.0, 4),
        (carved([(-2.0, -2.0, 2.0, 2.0)]), (-1.0, -1.0), 1.0, 2),  # on the way into a corner
    ],
)
def test_it_lies_between_the_walls_that_are_equally_near(
    world: World, place: tuple[float, float], clearance: float, walls: int
) -> None:
    path = [Pose(x, 0.0) for x in np.arange(-1.5, 1.6, 0.5).tolist()]
    found = between(looked(world, path), np.array(place))
    assert found.clearance == pytest.approx(clearance, abs=0.03)
    assert found.walls == walls


def test_a_round_wall_is_on_all_sides() -> None:
    canvas = Canvas(6.0, 6.0, 0.02)
    canvas.carve_disc(3.0, 3.0, 2.0)
    world = replace(canvas.world("disc"), origin=(-3.0, -3.0))
    local_map = looked(world, [Pose(0.0, 0.0, math.pi / 4)])
    assert between(local_map, np.zeros(2)).walls >= 3


def test_a_round_end_of_a_corridor_is_on_three_sides() -> None:
    canvas = Canvas(8.0, 4.0, 0.02)
    canvas.carve(0.5, 1.0, 5.0, 3.0)
    canvas.carve_disc(5.0, 2.0, 1.0)
    world = replace(canvas.world("round end"), origin=(-5.0, -2.0))
    local_map = looked(world, [Pose(x, 0.0) for x in (-2.0, -1.0, 0.0)])
    assert between(local_map, np.zeros(2)).walls >= 3
    assert between(local_map, np.array([-2.0, 0.0])).walls == 2


def test_where_nothing_is_seen_there_are_no_walls() -> None:
    assert between(LocalMap(LocalMapConfig()), np.zeros(2)) == (math.inf, 0)
