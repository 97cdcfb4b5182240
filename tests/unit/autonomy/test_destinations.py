"""Where on the graph a robot leaves it for a point beside it."""

import math

import numpy as np
import pytest

from gvgbot.autonomy.destinations import foot_of
from gvgbot.autonomy.views import View
from gvgbot.geometry import Pose
from tests.unit.autonomy.local_graphs import drawn
from tests.unit.autonomy.sights import carved, looked
from tests.unit.autonomy.test_mission import Robot

CORRIDOR, DOOR, ROOM = (-2.0, -1.0, 5.0, 1.0), (-0.5, 0.9, 0.5, 1.3), (-1.0, 1.2, 4.0, 3.5)
ROOM_END = (0.5, 2.4)
EDGES = drawn(
    {1: (-1.0, 0.0), 2: (0.0, 0.0), 3: (4.0, 0.0), 4: ROOM_END},
    {10: (1, 2, []), 11: (2, 3, []), 12: (2, 4, [(0.0, 1.1)])},
)


@pytest.mark.parametrize(
    ("point", "place"), [((3.0, 0.5), (3.0, 0.0)), ((3.0, 2.2), ROOM_END)], ids=["corridor", "room"]
)
def test_a_foot_is_on_the_same_side_of_the_walls(
    point: tuple[float, float], place: tuple[float, float]
) -> None:
    """The edge in the corridor is nearer to most of the room than the one that ends in it."""
    robot = Robot()
    robot.walls = looked(carved([CORRIDOR, DOOR, ROOM]), [Pose(), Pose(*ROOM_END)])
    while len(robot.mapper.graph.edges) < len(EDGES.edges):
        robot.look(EDGES)
    foot = foot_of(robot.mapper, np.array(point))
    assert foot is not None
    view = View(0, 0.0, 0.0, Pose(), EDGES, robot.walls)
    assert math.dist(foot.in_local_frame(robot.mapper, view), place) < 0.1
    assert foot.away == pytest.approx(math.dist(point, place), abs=0.1)
