"""When a frontier that comes into sight on the way is worth more than the one it drives to."""

import numpy as np
import pytest

from gvgbot.autonomy.choice import Choice
from gvgbot.autonomy.evidence import MappingConfig
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.exploration.paths import Approach
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.slam.graph import HalfEdgeId, Vertex
from gvgbot.autonomy.slam.recognition import RecognitionConfig
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.geometry import Pose

FOUND, TARGET = HalfEdgeId(2, 1), HalfEdgeId(3, 1)


@pytest.mark.parametrize(("metres", "is_new", "turns"), [(3.9, 1, 1), (4.1, 1, 0), (3.9, 0, 0)])
def test_it_turns_for_a_new_frontier_only_if_that_is_clearly_nearer(
    metres: float, is_new: bool, turns: bool
) -> None:
    """The target is 5 m away; it would go to and fro between two that are about as near."""
    mapper = Mapper(MappingConfig(), RecognitionConfig(), ScanMatchingConfig())
    graph = mapper.graph
    for number in (1, 2, 3):
        vertex = graph.vertices[number] = Vertex(number, 1.0, Pose(), 0.0, 0.0)
        for bearing in (0.0, 2.0):
            vertex.add_half_edge(bearing)
    graph.serial = 3
    for key, (far, length) in enumerate(((2, metres), (3, 5.0))):
        line = np.array([[0.0, 0.0], [length, 0.0]])
        graph.join(HalfEdgeId(1, key), HalfEdgeId(far, 0), line, 1.0, driven=True)
    choice, starts = Choice(ExplorationConfig(), mapper), [Approach(0.0, HalfEdgeId(1, 0))]
    nearer = choice.nearer(TARGET, {FOUND} if is_new else set(), starts)
    assert nearer == (FOUND if turns else None)
