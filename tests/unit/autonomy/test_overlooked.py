"""A look at what is behind a laser with a narrow view, at a vertex drawn by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.exploration.access import access
from gvgbot.autonomy.gvg.local import Branch, LocalGvg
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.overlooked import Overlooked
from gvgbot.autonomy.situation import Situation
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId, Vertex
from gvgbot.autonomy.views import Correspondence, View
from gvgbot.autonomy.whereabouts import Whereabouts
from gvgbot.geometry import Pose
from tests.unit.autonomy.local_graphs import drawn

AHEAD, BEHIND, BACK_LEFT = 0, 1, 2  # half-edges of the vertex, and the edges that leave there
HALF_CIRCLE = (-math.pi / 2, math.pi / 2)
ENDS = {AHEAD: (3.0, 0.0), BEHIND: (-3.0, 0.0), BACK_LEFT: (-2.0, 2.0)}
TURN_TO_BACK_LEFT = math.pi / 4  # from the left, where the view ends, to there


def at_vertex(
    *weak: int, base: Pose, view_of: tuple[float, float] = HALF_CIRCLE
) -> tuple[View, Situation]:
    """A robot beside a vertex at the origin, of which some departures are not seen far enough."""
    gvg = drawn({9: (0.0, 0.0), **ENDS}, {key: (9, key, []) for key in ENDS})
    branches = {key: Branch(key, forward=True) for key in ENDS}
    node = replace(gvg.nodes[9], weak=frozenset(branches[key] for key in weak))
    gvg = LocalGvg({**gvg.nodes, 9: node}, gvg.edges)
    vertex, known, graph = Vertex(1, 1.0, Pose(), 0.0, 0.0), Correspondence(), GvgGraph()
    known.pair(9, 1)
    for key, (x, y) in ENDS.items():
        assert vertex.add_half_edge(math.atan2(y, x)) == key
        known.pair_branch(branches[key], HalfEdgeId(1, key))
    graph.vertices[1] = vertex
    view = View(0, 0.0, 0.0, base, gvg, LocalMap(LocalMapConfig()), field_of_view=view_of)
    found = access(view)
    assert found is not None
    return view, Situation(gvg, known, graph, Whereabouts(), found, base)


def turn(view: View, here: Situation, target: int = AHEAD) -> float:
    return Overlooked().turn(view, here, HalfEdgeId(1, target))


def test_it_turns_until_all_that_is_behind_it_has_been_in_view() -> None:
    one = turn(*at_vertex(BACK_LEFT, base=Pose()))
    both = turn(*at_vertex(BACK_LEFT, BEHIND, base=Pose()))
    assert TURN_TO_BACK_LEFT < one < TURN_TO_BACK_LEFT + 0.4
    assert math.pi / 2 < both < math.pi / 2 + 0.4


@pytest.mark.parametrize(
    "seen",
    [
        at_vertex(base=Pose()),
        at_vertex(BACK_LEFT, base=Pose(theta=math.pi)),
        at_vertex(BACK_LEFT, base=Pose(), view_of=(-2.4, 2.4)),
        at_vertex(BACK_LEFT, base=Pose(), view_of=(-math.pi, math.pi)),
        at_vertex(BACK_LEFT, base=Pose(2.0)),
    ],
    ids=["nothing unclear", "ahead", "in a wide view", "all around", "far from there"],
)
def test_it_does_not_turn_for_nothing(seen: tuple[View, Situation]) -> None:
    assert turn(*seen) == 0.0


def test_what_it_takes_next_it_will_see_anyway() -> None:
    assert turn(*at_vertex(BACK_LEFT, base=Pose()), target=BACK_LEFT) == 0.0


def test_what_is_explored_or_given_up_is_not_looked_at() -> None:
    view, here = at_vertex(BACK_LEFT, base=Pose())
    here.graph.vertices[1].half_edges[BACK_LEFT].blocked = True
    assert turn(view, here) == 0.0


def test_it_turns_to_the_same_departure_only_once() -> None:
    overlooked, target = Overlooked(), HalfEdgeId(1, AHEAD)
    view, here = at_vertex(BACK_LEFT, base=Pose())
    assert overlooked.turn(view, here, target) > 0.0
    assert overlooked.turn(view, here, target) == 0.0


@pytest.mark.parametrize("bearing", np.linspace(-3.0, 3.0, 13).tolist())
def test_after_the_turn_a_bearing_is_in_view(bearing: float) -> None:
    view, _ = at_vertex(base=Pose(1.0, 2.0, 0.7), view_of=(-1.0, 1.5))
    turned = view.turn_to_see(bearing)
    off = (bearing - 0.7 - turned + math.pi) % math.tau - math.pi
    assert -1.0 - 1e-9 <= off <= 1.5 + 1e-9
    assert 0.0 <= turned < math.tau
