"""People are narrow and stand free; walls that come into sight are neither."""

import math

import numpy as np

from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.newcomers import Newcomers, NewcomersConfig
from gvgbot.drivers.world import World
from gvgbot.geometry import Pose
from tests.unit.autonomy.sights import Rectangle, carved, sweep

ROOM: Rectangle = (-4.0, -3.0, 4.0, 3.0)
PERSON: Rectangle = (1.9, -0.2, 2.3, 0.2)
HERE = Pose()


def after(first: World, then: World, pose: Pose = HERE) -> tuple[Newcomers, int]:
    """What is new in the second world for who knows the first, and how many beams were dropped."""
    local_map, newcomers = LocalMap(LocalMapConfig()), Newcomers(NewcomersConfig())
    for _ in range(3):
        local_map.insert(sweep(first, HERE), HERE, 0.0)
    scan = sweep(then, pose)
    sifted = newcomers.sift(scan, pose, local_map)
    return newcomers, int(np.isnan(sifted.ranges).sum() - np.isnan(scan.ranges).sum())


def test_who_comes_into_an_empty_room_is_kept_out_of_the_map() -> None:
    newcomers, dropped = after(carved([ROOM]), carved([ROOM], [PERSON]))
    seen_of_it = 2 * math.atan2(0.2, 1.9) / (math.tau / 1080)  # beams, by its angle
    assert abs(dropped - seen_of_it) <= 2
    assert np.abs(newcomers.points - [1.95, 0.0]).max() < 0.35


def test_nothing_is_new_in_a_room_that_stays_as_it_was() -> None:
    newcomers, dropped = after(carved([ROOM], [PERSON]), carved([ROOM], [PERSON]))
    assert dropped == 0
    assert len(newcomers.points) == 0


def test_a_wall_is_no_newcomer_even_where_the_map_knew_free_space() -> None:
    smaller: Rectangle = (-4.0, -3.0, 3.4, 3.0)
    newcomers, dropped = after(carved([ROOM]), carved([smaller]))
    assert dropped == 0
    assert len(newcomers.points) == 0


def test_the_stretch_of_wall_within_a_short_range_is_no_newcomer() -> None:
    """A wall 3.4 m ahead, of which a laser that reaches 3.5 m sees the nearest part only."""
    local_map, newcomers = LocalMap(LocalMapConfig()), Newcomers(NewcomersConfig())
    local_map.insert(sweep(carved([ROOM]), HERE), HERE, 0.0)
    room: Rectangle = (-4.0, -3.0, 3.4, 3.0)
    short = sweep(carved([room]), HERE, reach=3.5)
    assert np.isinf(short.ranges).any()
    assert newcomers.sift(short, HERE, local_map) is short
