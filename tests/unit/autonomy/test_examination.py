"""What is looked at once more, drawn by hand, when nothing is left to explore."""

import pytest

from gvgbot.autonomy.evidence import MappingConfig
from gvgbot.autonomy.examination import Examination
from gvgbot.autonomy.exploration.access import Access
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.slam.graph import GvgGraph
from gvgbot.autonomy.slam.recognition import RecognitionConfig
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.autonomy.views import Correspondence, View
from gvgbot.autonomy.whereabouts import Situation, Whereabouts
from gvgbot.geometry import Pose
from tests.unit.autonomy.local_graphs import drawn

# A corridor with a meetpoint at x = 6 that the map does not have.
TEE = drawn(
    {1: (0.0, 0.0), 2: (6.0, 0.0), 3: (12.0, 0.0), 4: (6.0, -3.0)},
    {10: (1, 2, []), 11: (2, 3, []), 12: (2, 4, [])},
)
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
    known, pose = Correspondence(), Pose(1.0, 0.0, 0.0)
    for node, vertex in ENDS.items():
        known.pair(node, vertex)
    place = TEE.place(pose.position)
    assert place is not None
    nodes = frozenset(doubted)
    view = View(0, 0.0, 0.0, pose, TEE, LocalMap(LocalMapConfig()), doubted=nodes)
    here = Situation(
        TEE, known, GvgGraph(), Whereabouts(), Access(place), pose, nodes, in_team=in_team
    )
    path = Examination(mapper).path(view, here, patience_s=60.0)
    assert (path is not None) == is_examined
