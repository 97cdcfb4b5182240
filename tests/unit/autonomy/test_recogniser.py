"""How a vertex that was seen before is looked for where it should be."""

import math

import numpy as np
import pytest

from gvgbot.autonomy.evidence import MappingConfig
from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.recogniser import Match, Recogniser, Recognition
from gvgbot.autonomy.slam.ekf import Belief, add_vertex, predict
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId, Vertex
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

CONFIG = MappingConfig()
RECOGNISER = Recogniser(
    RecognitionConfig(),
    ScanMatchingConfig(),
    min_inliers=CONFIG.min_inliers,
    min_inliers_far=CONFIG.min_inliers_far,
    margin=CONFIG.margin,
    novelty_margin=CONFIG.novelty_margin,
)


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
    return RECOGNISER.find(belief, graph, [known], view, sighting).match


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


def recognised(
    *believed_x: float, sigma: float, street: float, gone: float = 0.0, wary: bool = False
) -> Recognition:
    """What the tee is taken for by who believes some that look like it at x, for x = 1.

    `sigma` is that of its own place, m, and a `street` leads from each tee to nowhere near. Of the
    walls around a tee a share has `gone`.
    """
    belief, graph, seen = Belief(), GvgGraph(), looked(WORLD, [Pose()])
    walls = PLACE.inverse().transform(seen.points())
    x = np.linspace(-3.0, 3.0, round(len(walls) * gone / (1.0 - gone)))
    for number, at in enumerate(believed_x, 1):
        belief = add_vertex(belief, number, Pose(at), np.eye(3) * 1e-4)
        tee = Vertex(number, 0.6, Pose(at), seen_at=-100.0, updated_at=-100.0)
        tee.snapshot = np.concatenate([walls, np.stack([x, 0.0 * x], axis=1)])
        tee.sights = np.concatenate([seen.sights(), np.tile([0.0, 1.0], (len(x), 1))])
        graph.vertices[number] = tee
        east, west, _ = (HalfEdgeId(number, tee.add_half_edge(bearing)) for bearing in TEE)
        graph.join(east, west, np.array([[0.0, 0.0], [street, 0.0]]), 0.6, driven=True)
    belief = predict(belief, Pose(), np.diag([sigma**2, sigma**2, 1e-4]))
    view = View(9, 9.0, 0.0, Pose(), LocalGvg(), seen)
    sighting = Sighting(PLACE.position, 0.6, TEE, meetpoint=True)
    tees = list(graph.vertices.values())
    return RECOGNISER.find(belief, graph, tees, view, sighting, wary=wary)


def test_of_two_that_may_be_it_a_place_is_neither() -> None:
    """It lies hardly deeper in the gate of the one than in that of the other."""
    one, two = (recognised(*at, sigma=3.0, street=60.0) for at in ((1.2,), (1.2, -1.5)))
    assert one.match is not None
    assert one.match.vertex.id == 1
    assert two.match is None
    assert two.rivals == (1, 2)


@pytest.mark.parametrize(("street", "is_known"), [(2.0, False), (60.0, True)])
def test_a_place_that_may_be_a_new_one_is_in_doubt_unless_there_is_no_room_for_one(
    street: float, *, is_known: bool
) -> None:
    """There is none half way along the streets of a known one: 3 sigma are 9 m."""
    found = recognised(1.2, sigma=3.0, street=street)
    assert (found.match is not None) == is_known
    assert found.rivals == (1,)


@pytest.mark.parametrize(("sigma", "is_known"), [(0.1, True), (3.0, False)])
def test_who_is_wary_knows_again_only_what_is_where_it_should_be(
    sigma: float, *, is_known: bool
) -> None:
    found = recognised(1.0, sigma=sigma, street=60.0, wary=True)
    assert (found.match is not None) == is_known
    assert found.rivals == (() if is_known else (1,))


@pytest.mark.parametrize(
    ("x", "gone", "is_known"),
    [(1.1, 0.2, True), (3.0, 0.2, False), (3.0, 0.0, True)],
)
def test_what_is_not_where_it_should_be_must_have_almost_all_of_its_walls(
    x: float, gone: float, *, is_known: bool
) -> None:
    assert CONFIG.min_inliers < 0.8 < CONFIG.min_inliers_far
    found = recognised(x, sigma=3.0, street=60.0, gone=gone)
    assert (found.match is not None) == is_known
