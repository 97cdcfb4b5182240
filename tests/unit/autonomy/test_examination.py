"""What is looked at once more, drawn by hand, when nothing is left to explore."""

import numpy as np
import pytest

from gvgbot.autonomy.evidence import MappingConfig
from gvgbot.autonomy.examination import Examination
from gvgbot.autonomy.exploration.access import Access
from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.situation import Situation
from gvgbot.autonomy.slam.graph import GvgGraph
from gvgbot.autonomy.slam.recognition import RecognitionConfig
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.autonomy.views import Correspondence, View
from gvgbot.autonomy.whereabouts import Whereabouts
from gvgbot.geometry import Array, Pose
from tests.unit.autonomy.local_graphs import Point, drawn

# A corridor with a meetpoint at x = 6 that the map does not have.
TEE = drawn(
    {1: (0.0, 0.0), 2: (6.0, 0.0), 3: (12.0, 0.0), 4: (6.0, -3.0)},
    {10: (1, 2, []), 11: (2, 3, []), 12: (2, 4, [])},
)
PLAIN = drawn({1: (0.0, 0.0), 3: (12.0, 0.0)}, {10: (1, 3, [])})
CUT_OFF = drawn({1: (0.0, 0.0), 5: (4.5, 0.0)}, {10: (1, 5, [])}, unseen={5: 0.0})
NOTHING = np.empty((0, 2))
ENDS = {1: 1, 3: 3, 4: 4}  # are known


@pytest.mark.parametrize(
    ("in_team", "doubted", "is_examined"),
    [(False, set(), True), (False, {2}, True), (True, set(), True), (True, {2}, False)],
)
def test_in_a_team_what_only_bodies_make_is_not_waited_for(
    in_team: bool, doubted: set[int], is_examined: bool
) -> None:
    """Two robots that have nothing left would look at each other until their patience ends."""
    mapper = Mapper(MappingConfig(), RecognitionConfig(), ScanMatchingConfig())
    nodes = frozenset(doubted)
    assert sees(Examination(mapper), TEE, 1.0, nodes, in_team=in_team) == is_examined


@pytest.mark.parametrize(("bump", "is_examined"), [((6.0, 0.5), False), ((2.0, 0.5), True)])
def test_what_only_a_bump_makes_is_not_looked_at(bump: Point, is_examined: bool) -> None:
    """It stays as long as the robot stands before it. The meetpoint is a metre from its walls."""
    examination = Examination(Mapper(MappingConfig(), RecognitionConfig(), ScanMatchingConfig()))
    assert sees(examination, TEE, 1.0, felt=np.array([bump])) == is_examined


def test_what_was_seen_from_near_to_be_none_is_not_driven_to_again_from_afar() -> None:
    examination = Examination(Mapper(MappingConfig(), RecognitionConfig(), ScanMatchingConfig()))
    assert sees(examination, TEE, 1.0)
    assert not sees(examination, PLAIN, 4.0)
    assert not sees(examination, TEE, 1.0)
    assert sees(examination, TEE, 5.0)  # nearer than where nothing was to be seen
    examination.end()
    assert sees(examination, TEE, 1.0)  # there has been more to explore


def test_what_is_out_of_sight_for_a_moment_is_driven_to_nevertheless() -> None:
    """Far off, or where no edge is in sight at all."""
    for moment, x in ((PLAIN, 1.0), (CUT_OFF, 4.0)):
        examination = Examination(
            Mapper(MappingConfig(), RecognitionConfig(), ScanMatchingConfig())
        )
        assert sees(examination, TEE, 1.0)
        assert not sees(examination, moment, x)
        assert sees(examination, TEE, 1.0)


def sees(
    examination: Examination,
    gvg: LocalGvg,
    x: float,
    doubted: frozenset[int] = frozenset(),
    *,
    in_team: bool = False,
    felt: Array = NOTHING,
) -> bool:
    """Whether there is something to be examined, for a robot in the corridor."""
    known, pose = Correspondence(), Pose(x, 0.0, 0.0)
    for node, vertex in ENDS.items():
        known.pair(node, vertex)
    place = gvg.place(pose.position)
    assert place is not None
    view = View(0, 0.0, 0.0, pose, gvg, LocalMap(LocalMapConfig()), doubted=doubted, felt=felt)
    here = Situation(
        gvg, known, GvgGraph(), Whereabouts(), Access(place), pose, doubted, in_team=in_team
    )
    return examination.path(view, here, patience_s=60.0) is not None
