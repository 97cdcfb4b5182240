"""When the way to a frontier has been long enough, by the metres driven."""

import numpy as np

from gvgbot.autonomy.evidence import MappingConfig
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.progress import Progress
from gvgbot.autonomy.slam import ekf
from gvgbot.autonomy.slam.graph import HalfEdgeId, Vertex
from gvgbot.autonomy.slam.recognition import RecognitionConfig
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.autonomy.views import View
from gvgbot.geometry import Pose

CONFIG = ExplorationConfig(patience_m=60.0)
FRONTIER = HalfEdgeId(1, 0)


def view(metres: float) -> View:
    """To and fro, never long in one place."""
    base = Pose(metres % 8.0, 0.0, 0.0)
    return View(0, 2.0 * metres, metres, base, LocalGvg(), LocalMap(LocalMapConfig()))


def mapper() -> Mapper:
    """A large map: 500 m of edges, and the vertex of a frontier."""
    made = Mapper(MappingConfig(), RecognitionConfig(), ScanMatchingConfig())
    for vertex in (1, 2):
        place = Pose(500.0 * (vertex - 1), 0.0, 0.0)
        made.graph.vertices[vertex] = Vertex(vertex, 1.0, place, 0.0, 0.0)
        for bearing in (0.0, np.pi):
            made.graph.vertices[vertex].add_half_edge(bearing)
        made.belief = ekf.add_vertex(made.belief, vertex, place, 1e-4 * np.eye(3))
    line = np.array([[0.0, 0.0], [500.0, 0.0]])
    made.graph.join(HalfEdgeId(1, 1), HalfEdgeId(2, 1), line, 1.0, driven=True)
    return made


def given_up_after(way_m: float, *driven_m: float) -> int:
    """Metres until the frontier is given up; after so many each, of its edge so much is driven."""
    progress = Progress(mapper())
    progress.set_out(view(0.0), FRONTIER, way_m, CONFIG)
    for metres in range(1000):
        driven = driven_m[min(metres // 50, len(driven_m) - 1)] if driven_m else 0.0
        if progress.trouble(view(float(metres)), FRONTIER, driven, CONFIG) is not None:
            return metres
    raise AssertionError("it was not given up")


def test_a_frontier_that_is_not_reached_is_given_up_after_twice_the_way_and_some_patience() -> None:
    assert given_up_after(5.0) == 2 * 5 + 60 + 1
    assert given_up_after(100.0) == 2 * 100 + 60 + 1


def test_as_long_as_there_is_more_of_its_edge_it_goes_on() -> None:
    assert given_up_after(5.0, 0.0, 10.0, 20.0) == 100 + 60 + 1
