"""Where a robot looks for a way that it does not know."""

import math

import numpy as np
import pytest

from gvgbot.autonomy.exploration.access import Access
from gvgbot.autonomy.gvg.local import Branch
from gvgbot.autonomy.scouting import Scouting
from gvgbot.autonomy.situation import Situation
from gvgbot.autonomy.slam.ekf import Belief, add_vertex
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId, Vertex
from gvgbot.autonomy.views import Correspondence
from gvgbot.autonomy.whereabouts import Whereabouts
from gvgbot.geometry import Pose
from tests.unit.autonomy.local_graphs import drawn

STREET = drawn({1: (-3.0, 0.0), 2: (4.0, 0.0)}, {10: (1, 2, [])}, unseen={1: math.pi, 2: 0.0})


HERE = np.zeros(2)


class Town:
    """Two vertices at the ends of a street, and perhaps another one that nothing leads to."""

    def __init__(self, lost: float | None = None) -> None:
        self.graph, self.belief = GvgGraph(), Belief()
        west, east = self._vertex(-3.0), self._vertex(4.0)
        self._east = east
        a, b = self._street(west, east)
        self.known = Correspondence()
        for node, vertex in ((1, west), (2, east)):
            self.known.pair(node, vertex.id)
        self.known.pair_branch(Branch(10, forward=True), a)
        self.known.pair_branch(Branch(10, forward=False), b)
        self.where = Whereabouts(on_edge=a)
        if lost is not None:
            self.lose_vertex(lost)

    def lose_vertex(self, x: float) -> None:
        """One more, with a frontier, that no known way leads to."""
        self._vertex(x).add_half_edge(0.0)

    def add_vertex_beyond(self) -> None:
        """One more, east of the street, that a known way leads to."""
        self._street(self._east, self._vertex(9.0))

    def _street(self, west: Vertex, east: Vertex) -> tuple[HalfEdgeId, HalfEdgeId]:
        a = HalfEdgeId(west.id, west.add_half_edge(0.0))
        b = HalfEdgeId(east.id, east.add_half_edge(math.pi))
        line = np.array([[0.0, 0.0], [east.local.x - west.local.x, 0.0]])
        self.graph.join(a, b, line, 1.0, driven=True)
        return a, b

    def _vertex(self, x: float) -> Vertex:
        vertex = Vertex(self.graph.next_id(), 1.0, Pose(x), 0.0, 0.0)
        self.graph.vertices[vertex.id] = vertex
        self.belief = add_vertex(self.belief, vertex.id, vertex.local, np.eye(3) * 1e-4)
        return vertex

    def seen_from(self, x: float, heading: float = 0.0) -> Situation:
        place = STREET.place(np.array([x, 0.0]))
        assert place is not None
        base = Pose(x, 0.0, heading)
        return Situation(STREET, self.known, self.graph, self.where, Access(place), base)


def end_of(path: tuple[Branch, ...] | None) -> tuple[float, float] | None:
    if path is None:
        return None
    x, y = STREET.nodes[STREET.end_of(path[-1])].position
    return float(x), float(y)


@pytest.mark.parametrize(("lost", "near"), [(-9.0, -3.0), (12.0, 4.0)])
def test_it_goes_to_the_vertex_that_is_nearest_to_what_is_lost_and_then_to_the_next(
    lost: float, near: float
) -> None:
    town, scouting = Town(lost), Scouting()
    scouting.begin(0.0, HERE)
    assert end_of(scouting.path_near(town.seen_from(0.0), town.belief, 1.0)) == (near, 0.0)
    assert scouting.path_near(town.seen_from(near), town.belief, 2.0) is None
    other = 1.0 - near
    assert end_of(scouting.path_near(town.seen_from(near), town.belief, 3.0)) == (other, 0.0)
    assert scouting.path_near(town.seen_from(other), town.belief, 4.0) is None
    assert scouting.path_near(town.seen_from(0.0), town.belief, 5.0) is None


def test_it_goes_to_two_vertices_and_to_no_more() -> None:
    town, scouting = Town(-9.0), Scouting()
    town.add_vertex_beyond()
    scouting.begin(0.0, HERE)
    for x in (-3.0, 4.0):
        assert end_of(scouting.path_near(town.seen_from(0.5), town.belief, 1.0)) == (x, 0.0)
        assert scouting.path_near(town.seen_from(x), town.belief, 2.0) is None
    assert scouting.path_near(town.seen_from(0.5), town.belief, 3.0) is None


def test_where_it_has_been_it_does_not_go_again_for_the_same() -> None:
    town, scouting = Town(-9.0), Scouting()
    for x in (-3.0, 4.0):
        scouting.begin(0.0, HERE)
        assert end_of(scouting.path_near(town.seen_from(0.5), town.belief, 1.0)) == (x, 0.0)
        assert scouting.path_near(town.seen_from(x), town.belief, 2.0) is None
        scouting.end()
    scouting.begin(3.0, HERE)
    assert scouting.path_near(town.seen_from(0.5), town.belief, 4.0) is None
    town.lose_vertex(9.0)
    assert end_of(scouting.path_near(town.seen_from(0.5), town.belief, 5.0)) == (4.0, 0.0)


def test_of_what_is_lost_it_begins_with_what_is_nearer_by_the_known_way() -> None:
    town, scouting = Town(-4.0), Scouting()
    town.lose_vertex(6.0)  # farther from the street's end, but that is the nearer one
    scouting.begin(0.0, HERE)
    assert end_of(scouting.path_near(town.seen_from(2.5), town.belief, 1.0)) == (4.0, 0.0)


def test_with_nothing_lost_there_is_nothing_to_go_near_to() -> None:
    town = Town()
    assert Scouting().path_near(town.seen_from(0.0), town.belief, 0.0) is None


def test_patience_runs_while_it_is_not_on_its_way_to_a_vertex() -> None:
    town, scouting = Town(12.0), Scouting()
    assert scouting.lasted(100.0) == 0.0
    scouting.begin(0.0, HERE)
    assert scouting.lasted(5.0) == 5.0
    scouting.path_near(town.seen_from(0.0), town.belief, 5.0)
    assert scouting.lasted(8.0) == 3.0
    scouting.skip(2.0)
    assert scouting.lasted(8.0) == 1.0
    scouting.end()
    assert not scouting.is_on


def test_at_the_end_of_sight_it_turns_back() -> None:
    town, scouting = Town(), Scouting()
    scouting.begin(0.0, HERE)

    def aim(x: float) -> tuple[float, float] | None:
        return end_of(scouting.path_on(town.seen_from(x)))

    assert aim(0.0) == (4.0, 0.0)
    assert aim(4.0) == (4.0, 0.0)  # where it stands: from now on the other way
    assert aim(3.9) == (-3.0, 0.0)
    assert aim(-3.0) == (-3.0, 0.0)
    assert aim(-2.9) == (4.0, 0.0)


def test_back_from_the_end_of_sight_it_drives_on_past_where_its_edge_began() -> None:
    """The vertex there has proved to be none: nothing tells that the robot passes it."""
    town, scouting = Town(), Scouting()
    town.where = Whereabouts(on_edge=HalfEdgeId(99, 0))
    scouting.begin(0.0, HERE)

    def drive_to(x: float, heading: float) -> tuple[float, float] | None:
        town.where._extend(np.array([x, 0.0]))
        return end_of(scouting.path_on(town.seen_from(x, heading)))

    assert {drive_to(x, 0.0) for x in np.arange(0.0, 3.5, 0.2)} == {(4.0, 0.0)}
    drive_to(3.8, 0.0)
    assert {drive_to(x, math.pi) for x in np.arange(3.6, -2.0, -0.2)} == {(-3.0, 0.0)}


def test_a_way_that_comes_and_goes_in_one_place_is_no_hope() -> None:
    scouting = Scouting()
    for start in (0.0, 20.0, 40.0):
        scouting.begin(start, np.array([0.05 * start, 1.0]))
        assert scouting.is_on
        scouting.rest(start + 8.0)
        assert not scouting.is_on
    assert scouting.lasted(60.0) == 24.0
    scouting.begin(60.0, np.array([9.0, 1.0]))  # much farther on
    assert scouting.lasted(61.0) == 1.0
    scouting.end()
    scouting.begin(70.0, np.array([9.0, 1.0]))  # for another frontier
    assert scouting.lasted(71.0) == 1.0
