"""What is remembered of bodies, by looks into a room from one place."""

from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.control.company import Companion
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.knowledge import Knowledge
from gvgbot.autonomy.newcomers import NewcomersConfig
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.traffic import Traffic
from gvgbot.drivers.world import World
from gvgbot.geometry import Pose
from tests.unit.autonomy.sights import Rectangle, carved, sweep
from tests.unit.autonomy.test_newcomers import RADIUS, to_disc

ROOM: Rectangle = (-4.0, -3.0, 4.0, 3.0)
EMPTY = carved([ROOM])
HERE, MAP_BASE = Pose(), Pose(10.0, 5.0, np.pi / 2)  # the base in the local frame, and in the map


class Room:
    """A room with a column or without it, and what is made of it."""

    def __init__(self) -> None:
        self.traffic = Traffic(NewcomersConfig(found_after_s=20.0))
        self.map = LocalMap(LocalMapConfig())
        self._known = Knowledge(Belief(np.array([MAP_BASE.x, MAP_BASE.y, MAP_BASE.theta])))

    def look(self, world: World, stamp: float, *, column: bool) -> None:
        scan = replace(sweep(world, HERE), stamp=stamp)
        if column:
            ranges = np.minimum(scan.ranges, to_disc(scan.bearings, (2.0, 0.0)))
            scan = replace(scan, ranges=ranges)
        sifted = self.traffic.sift(scan, HERE, self._known, self.map, 0)
        self.map.insert(sifted, HERE, 0.0)


@pytest.mark.parametrize(("aside", "seen"), [(0.25, True), (0.6, False)])
def test_another_robot_is_where_it_is_seen_and_not_a_little_aside(
    aside: float, *, seen: bool
) -> None:
    room, told = Room(), MAP_BASE.compose(Pose(2.0, aside, np.pi))
    course = MAP_BASE.transform(np.array([(2.0, aside), (1.0, aside)]))
    room.traffic.company = [Companion("lisa", told, True, course, radius=RADIUS)]
    for second in range(3):
        room.look(EMPTY, second, column=second > 0)
    (lisa,) = room.traffic.nearby(MAP_BASE.inverse())
    y = 0.0 if seen else aside
    assert (lisa.pose.x, lisa.pose.y) == pytest.approx((2.0, y), abs=0.03)
    assert lisa.course == pytest.approx(np.array([(2.0, y), (1.0, y)]), abs=0.03)
    room.traffic.glance(sweep(EMPTY, HERE), HERE)  # it is not seen there any more
    (lisa,) = room.traffic.nearby(MAP_BASE.inverse())
    assert (lisa.pose.x, lisa.pose.y) == pytest.approx((2.0, aside))


def test_who_fell_silent_and_was_carried_away_is_in_nobody_s_way() -> None:
    """One that had finished stays where it was, unless somebody sees that it does not."""
    room, told = Room(), MAP_BASE.compose(Pose(2.0, 0.0, np.pi))
    heard = Companion("lisa", told, True, radius=RADIUS)
    silent = replace(heard, is_silent=True)
    for second, (one, stands, is_there) in enumerate(
        [
            (heard, False, True),  # its own word is surer than a look
            (silent, True, True),
            (silent, False, False),
            (heard, True, True),
            (silent, True, True),
        ]
    ):
        room.traffic.company = [one]
        room.look(EMPTY, second, column=stands)
        assert bool(room.traffic.nearby(MAP_BASE.inverse())) == is_there
        assert room.traffic.is_somebody_about(MAP_BASE) == is_there


def test_a_body_that_was_let_in_is_remembered_where_it_is_in_the_map_until_it_has_gone() -> None:
    room = Room()
    for second in range(20):
        room.look(EMPTY, second, column=True)
    assert room.traffic.lasting == []
    for second in range(20, 23):
        room.look(EMPTY, second, column=True)
    assert np.array(room.traffic.lasting) == pytest.approx(np.array([[10.0, 7.0]]), abs=0.05)
    room.look(EMPTY, 23, column=False)
    assert room.traffic.lasting == []
