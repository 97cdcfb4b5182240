"""A robot that sees no edge, in a room: where it looks for one, and for how long."""

import math
from itertools import pairwise

import numpy as np
import pytest

from gvgbot.autonomy.control.orders import Drive, LookAround, Order, Stand
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.exploration.headway import Headway
from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.search import Search
from gvgbot.autonomy.views import View
from gvgbot.geometry import Pose
from tests.unit.autonomy.sights import carved, looked

CONFIG = ExplorationConfig()
ROOM = carved([(-1.0, -3.0, 7.0, 3.0)])
START = Pose(0.0, 0.0, 0.0)  # a metre from the western wall
SEEN = looked(ROOM, [START])


class Robot:
    """Searches, and may do as it is told."""

    def __init__(self, local_map: LocalMap, *, obeys: bool = True) -> None:
        self.search, self.headway = Search(), Headway()
        self.stamp, self.pose = 0.0, START
        self._local_map, self._obeys = local_map, obeys

    def live(self, seconds: float) -> list[Order]:
        """The orders of one view a second."""
        return [self._look() for _ in range(round(seconds))]

    def _look(self) -> Order:
        view = View(0, self.stamp, 0.0, self.pose, LocalGvg(), self._local_map)
        self.headway.note(self.pose.position, self.stamp)
        order, _ = self.search.advance(view, self.headway, CONFIG)
        if isinstance(order, Drive) and self._obeys:
            x, y = order.track.polyline[-1].tolist()
            self.pose = Pose(x, y, 0.0)
        self.stamp += 1.0
        return order


def test_it_looks_around_first_and_then_drives_to_where_there_is_more_room() -> None:
    look, drive = Robot(SEEN).live(2)
    assert look == LookAround(math.tau)
    assert isinstance(drive, Drive)
    x, y = drive.track.polyline[-1]
    walls = min(x + 1.0, 7.0 - x, y + 3.0, 3.0 - y)
    assert walls > 2.5  # no place has more than 3 m


def test_it_looks_around_wherever_it_has_driven_to() -> None:
    orders = Robot(SEEN).live(20)
    after = [next_one for order, next_one in pairwise(orders) if isinstance(order, Drive)]
    assert len(after) >= 2
    assert all(order == LookAround(math.tau) for order in after)


def test_no_place_is_sought_twice_and_after_some_it_stands() -> None:
    robot = Robot(SEEN)
    orders = robot.live(2 * CONFIG.nothing_in_sight_s)
    ends = np.array([o.track.polyline[-1] for o in orders if isinstance(o, Drive)])
    assert 2 <= len(ends) <= 5
    apart = np.hypot(*(ends[:, None] - ends[None]).transpose(2, 0, 1))
    assert apart[~np.eye(len(ends), dtype=bool)].min() > 1.0
    assert isinstance(orders[-1], Stand)


def test_a_way_that_it_does_not_get_on_with_is_left_after_a_while() -> None:
    orders = Robot(SEEN, obeys=False).live(CONFIG.in_the_way_s + 5.0)
    driving = [isinstance(order, Drive) for order in orders]
    assert driving[1 : 1 + round(CONFIG.in_the_way_s)] == [True] * round(CONFIG.in_the_way_s)
    assert orders[1 + round(CONFIG.in_the_way_s)] == LookAround(math.tau)


def test_where_nothing_is_known_it_looks_around_until_its_patience_ends() -> None:
    orders = Robot(LocalMap(LocalMapConfig())).live(CONFIG.nothing_in_sight_s + 2.0)
    assert orders[:-1] == [LookAround(math.tau)] * (len(orders) - 1)
    assert orders[-1] == Stand()


@pytest.mark.parametrize("is_ended", [False, True])
def test_an_edge_in_sight_meanwhile_makes_it_a_new_search(is_ended: bool) -> None:
    robot = Robot(LocalMap(LocalMapConfig()))
    robot.live(CONFIG.nothing_in_sight_s)
    if is_ended:
        robot.search.end()
    assert isinstance(robot.live(5.0)[-1], LookAround if is_ended else Stand)
