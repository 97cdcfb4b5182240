"""How a vertex that was seen before is looked for where it should be."""

import math

import numpy as np
import pytest

from gvgbot.autonomy.evidence import MappingConfig
from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.recogniser import Match, Recogniser
from gvgbot.autonomy.slam.ekf import Belief, add_vertex, predict
from gvgbot.autonomy.slam.graph import GvgGraph, Vertex
from gvgbot.autonomy.slam.recognition import RecognitionConfig, Sighting
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.autonomy.views import View
from gvgbot.geometry import Array, Pose
from tests.unit.autonomy.sights import carved, looked

WORLD = carved([(-4.0, -0.6, 6.0, 0.6), (0.4, -5.0, 1.6, -0.6)])
TEE = (0.0, math.pi, -math.pi / 2)  # where its corridors lead
PLACE = Pose(1.0, 0.0, 0.0)  # of their meetpoint
LOST = 0.3  # rad
TURN = 0.35  # rad, so much that walls turned by it are missed


def heading(sigma: float) -> Array:
    return np.diag([0.0, 0.0, sigma**2])


def found(before: float, since: float, walls: float, bearings: float) -> Match | None:
    """What is known, where walls and departures are seen turned about the robot, rad.

    `before` and `since` are the sigmas of what was turned before it was seen, and after, rad.
    """
    belief = predict(Belief(), Pose(), heading(before))
    belief = predict(add_vertex(belief, 1, PLACE, np.eye(3) * 1e-4), Pose(), heading(since))
    known = Vertex(1, 0.6, PLACE, seen_at=-100.0, updated_at=-100.0)  # m driven
    seen = looked(WORLD, [Pose()])
    known.snapshot = PLACE.inverse().transform(seen.points())
    known.sights = seen.sights()
    for bearing in TEE:
        known.add_half_edge(bearing)
    graph, turned = GvgGraph(), Pose(0.0, 0.0, walls)
    graph.vertices[1] = known
    view = View(9, 9.0, 0.0, Pose(), LocalGvg(), looked(WORLD, [Pose()], local_world=turned))
    there = turned.transform(PLACE.position)
    sighting = Sighting(there, 0.6, tuple(bearing + bearings for bearing in TEE), meetpoint=True)
    config = MappingConfig()
    recogniser = Recogniser(
        RecognitionConfig(),
        ScanMatchingConfig(),
        min_inliers=config.min_inliers,
        min_inliers_far=config.min_inliers_far,
        margin=config.margin,
        novelty_margin=config.novelty_margin,
    )
    return recogniser.find(belief, graph, [known], view, sighting).match


def test_a_vertex_is_found_turned_by_what_was_driven_since_it_was_seen() -> None:
    match = found(before=0.0, since=LOST, walls=TURN, bearings=TURN)
    assert match is not None
    assert match.agreement > 0.9
    assert match.local.theta == pytest.approx(TURN, abs=0.02)


def test_a_heading_that_was_lost_before_turns_no_vertex() -> None:
    """It is as wrong for the vertex: departures that look turned are seen badly."""
    match = found(before=LOST, since=0.0, walls=0.0, bearings=TURN)
    assert match is not None
    assert match.agreement > 0.9
    assert match.local.theta == pytest.approx(0.0, abs=0.02)
