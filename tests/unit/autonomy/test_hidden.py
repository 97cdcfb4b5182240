"""A fork in a street, beside which somebody stands as the robot passes."""

import math
from dataclasses import replace

import numpy as np

from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.hidden import Hidden
from gvgbot.autonomy.mapping import Mapper, MappingConfig
from gvgbot.autonomy.slam.recognition import RecognitionConfig
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.autonomy.views import View
from gvgbot.geometry import Pose
from tests.unit.autonomy.local_graphs import drawn
from tests.unit.autonomy.test_scouting import Town, end_of

NOTHING_SEEN = LocalMap(LocalMapConfig())
FORK = drawn(
    {1: (-3.0, 0.0), 2: (4.0, 0.0), 3: (2.0, 0.0), 4: (2.0, -2.0)},
    {10: (1, 3, []), 11: (3, 2, []), 12: (3, 4, [])},
    unseen={1: math.pi, 2: 0.0, 4: -math.pi / 2},
)
SOMEBODY = np.array([[2.0, -1.2], [2.2, -1.2]])
PATIENCE = 60.0


class Walk:
    """A robot in the street, whose map frame is its local frame."""

    def __init__(self) -> None:
        self.town, self.hidden, self.stamp = Town(), Hidden(), 0.0
        self.mapper = Mapper(MappingConfig(), RecognitionConfig(), ScanMatchingConfig())
        self.mapper.graph, self.mapper.belief = self.town.graph, self.town.belief

    def look(self, x: float, times: int = 1, *, meets: bool) -> "Walk":
        for _ in range(times):
            self.hidden.note(self._view(x, meets=meets), Pose())
            self.stamp += 0.5
        return self

    def way_from(self, x: float) -> tuple[float, float] | None:
        here = self.town.seen_from(x)
        view = self._view(x, meets=False)
        return end_of(self.hidden.path(view, here, self.mapper, PATIENCE))

    def _view(self, x: float, *, meets: bool) -> View:
        view = View(0, self.stamp, 0.0, Pose(x), FORK, NOTHING_SEEN)
        return replace(view, people=SOMEBODY) if meets else view


def test_where_nobody_stood_nothing_is_hidden() -> None:
    assert Walk().look(1.5, 20, meets=False).way_from(-2.0) is None


def test_it_leads_back_to_where_somebody_stood_until_that_has_been_seen_without_him() -> None:
    walk = Walk().look(1.5, 3, meets=True)
    assert walk.way_from(-2.0) == (4.0, 0.0)  # the fork is on the edge to there
    assert walk.look(1.5, 2, meets=False).way_from(-2.0) == (4.0, 0.0)
    assert walk.look(1.5, 20, meets=False).way_from(-2.0) is None


def test_who_comes_when_all_has_been_explored_hides_nothing() -> None:
    walk = Walk()
    assert walk.way_from(-2.0) is None
    assert walk.look(1.5, 3, meets=True).way_from(-2.0) is None


def test_who_stands_there_far_away_is_left_to_a_nearer_look() -> None:
    assert Walk().look(-2.0, 3, meets=True).way_from(-2.0) is None


def test_a_look_from_far_away_or_with_somebody_there_tells_nothing() -> None:
    walk = Walk().look(1.5, 3, meets=True).look(-2.0, 20, meets=False).look(1.5, 20, meets=True)
    assert walk.way_from(-2.0) == (4.0, 0.0)


def test_who_stays_is_waited_for_in_vain_once() -> None:
    walk = Walk().look(1.5, 3, meets=True)
    begin = walk.stamp
    while walk.way_from(-2.0) is not None and walk.stamp < begin + 1000.0:
        walk.look(1.5, meets=True)
    assert PATIENCE < walk.stamp - begin < 3 * PATIENCE
    assert walk.look(1.5, 10, meets=True).way_from(-2.0) is None
