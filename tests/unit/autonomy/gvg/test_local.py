"""Ways over a local GVG drawn by hand, with a dead end, a loop and parallel edges."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.autonomy.gvg.local import Branch, LocalGvg, Place
from tests.unit.autonomy.local_graphs import Point, drawn

#        4
#        | 2 m
#  1 --- 2 --- 3      1-2: 3 m, 2-3: 2 m, and a second way from 2 to 3 of 6 m below;
#        +-----+      at 3 a loop of 4 m from 3 to itself.
POINTS = {1: (0.0, 0.0), 2: (3.0, 0.0), 3: (5.0, 0.0), 4: (3.0, 2.0)}
GVG = drawn(
    POINTS,
    {
        10: (1, 2, []),
        11: (2, 3, []),
        12: (2, 4, []),
        13: (3, 2, [(5.0, -2.0), (3.0, -2.0)]),
        14: (3, 3, [(6.0, 0.0), (6.0, 1.0), (5.0, 1.0)]),
    },
)


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ((1.0, 0.3), (10, 1.0, 0.3)),
        ((3.4, 1.6), (12, 1.6, 0.4)),
        ((4.0, -1.7), (13, 3.0, 0.3)),
        ((6.1, 0.6), (14, 1.6, 0.1)),
    ],
)
def test_the_nearest_place_is_named_by_its_edge_and_station(
    point: Point, expected: tuple[int, float, float]
) -> None:
    place = GVG.place(np.array(point))
    assert place is not None
    assert place == pytest.approx(expected, abs=0.05)


def test_the_nearest_place_is_before_virtual_walls() -> None:
    wall = np.stack([np.linspace(-1.0, 7.0, 81), np.full(81, 0.15)], axis=1)
    place = GVG.place(np.array([1.0, 0.3]), wall)
    assert place is not None
    assert place.edge == 12
    assert place.distance == pytest.approx(2.0, abs=0.05)


def test_on_an_empty_graph_there_is_no_place() -> None:
    assert LocalGvg().place(np.zeros(2)) is None


def test_a_branch_leads_from_its_node_to_the_other_end() -> None:
    assert GVG.end_of(Branch(10, forward=True)) == 2
    assert GVG.end_of(Branch(10, forward=False)) == 1
    assert GVG.leaving(Branch(13, forward=False))[0] == pytest.approx(POINTS[2])
    assert GVG.leaving(Branch(13, forward=False))[-1] == pytest.approx(POINTS[3])


@pytest.mark.parametrize(
    ("branch", "bearing"),
    [
        (Branch(10, forward=False), math.pi),
        (Branch(11, forward=True), 0.0),
        (Branch(12, forward=True), math.pi / 2),
        (Branch(13, forward=False), -math.pi / 2),
    ],
)
def test_a_bearing_is_the_direction_in_which_the_branch_leaves(
    branch: Branch, bearing: float
) -> None:
    assert math.cos(GVG.bearing(branch, 1.0) - bearing) == pytest.approx(1.0, abs=1e-3)


def test_routes_from_the_middle_of_an_edge_are_those_measured_by_hand() -> None:
    routes = GVG.routes(Place(10, 1.0, 0.0))
    assert {node: metres for node, (metres, _) in routes.items()} == pytest.approx(
        {1: 1.0, 2: 2.0, 4: 4.0, 3: 4.0}
    )
    assert routes[3][1] == (Branch(10, forward=True), Branch(11, forward=True))


def test_of_two_ways_to_a_node_the_shorter_one_is_driven() -> None:
    routes = GVG.routes(Place(13, 2.5, 0.0))  # 2.5 m from node 3, 3.5 m from node 2
    metres = [routes[node][0] for node in (1, 2, 3)]
    assert metres == pytest.approx([6.5, 3.5, 2.5])
    assert routes[2][1] == (Branch(13, forward=True),)
    assert routes[3][1] == (Branch(13, forward=False),)


def test_from_the_middle_of_a_loop_both_ways_lead_to_its_node() -> None:
    for station, forward in ((1.0, False), (3.0, True)):
        metres, path = GVG.routes(Place(14, station, 0.0))[3]
        assert metres == pytest.approx(1.0)
        assert path == (Branch(14, forward),)


@given(st.sampled_from(sorted(GVG.edges)), st.floats(0.0, 1.0))
def test_the_line_of_a_route_is_as_long_as_the_route(edge: int, share: float) -> None:
    start = Place(edge, share * GVG.edges[edge].length, 0.0)
    routes = GVG.routes(start)
    assert routes.keys() == POINTS.keys()
    for node, (metres, path) in routes.items():
        line, clearance = GVG.line_from(start, path)
        assert len(line) == len(clearance)
        length = float(np.hypot(*np.diff(line, axis=0).T).sum())
        assert metres - 0.11 <= length <= metres + 1e-9  # begins at the next point of the edge
        assert line[-1] == pytest.approx(POINTS[node])


def test_a_bearing_looks_past_a_point_where_nothing_branches_off() -> None:
    """The way bends half a metre off; its direction is taken 1.8 m off all the same."""
    lines: dict[int, tuple[int, int, list[Point]]] = {
        1: (1, 2, []),
        2: (2, 3, []),
        3: (1, 4, []),
        4: (1, 5, []),
    }
    points = {1: (0.0, 0.0), 2: (0.5, -0.5), 3: (4.0, -0.5), 4: (-4.0, 0.0), 5: (0.0, 4.0)}
    gvg = drawn(points, lines)
    beyond = math.sqrt(1.8**2 - 0.5**2)
    expected = math.atan2(-0.5, beyond)
    assert gvg.bearing(Branch(1, forward=True), 2.0) == pytest.approx(expected, abs=0.03)


@pytest.mark.parametrize("seen", [True, False])
def test_a_bearing_is_the_same_whether_the_next_meetpoint_is_seen_or_not(seen: bool) -> None:
    """In a hall, the next one may stand deep inside the disc; the way leaves towards it."""
    points = {1: (0.0, 0.0), 2: (1.3, 0.0), 3: (1.3, 6.0), 4: (-6.0, 0.0), 5: (0.0, -6.0)}
    lines: dict[int, tuple[int, int, list[Point]]] = {
        1: (1, 2, []),
        2: (2, 3, []),
        3: (1, 4, []),
        4: (1, 5, []),
    }
    if seen:
        points[6], lines[5] = (1.3, -6.0), (2, 6, [])
    gvg = drawn(points, lines, clearance=6.0)
    assert gvg.bearing(Branch(1, forward=True), 6.0) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("edge", "station", "at"),
    [(10, 1.0, (1.0, 0.0)), (13, 3.0, (4.0, -2.0)), (14, 2.0, (6.0, 1.0))],
)
def test_a_further_node_on_an_edge_leaves_all_ways_as_long_as_they_were(
    edge: int, station: float, at: Point
) -> None:
    divided, node = GVG.divided(Place(edge, station, 0.0))
    assert divided.nodes[node].position == pytest.approx(at, abs=0.06)
    assert divided.nodes[node].degree == 2
    start = Place(12, 2.0, 0.0)  # at 4
    before, after = (
        {key: metres for key, (metres, _) in gvg.routes(start).items()} for gvg in (GVG, divided)
    )
    length = GVG.edges[edge].length
    to_ends = [before[GVG.edges[edge].a] + station, before[GVG.edges[edge].b] + length - station]
    assert after.pop(node) == pytest.approx(min(to_ends), abs=0.06)
    assert after == pytest.approx(before)
    assert {key: value.degree for key, value in divided.nodes.items() if key != node} == {
        key: value.degree for key, value in GVG.nodes.items()
    }


@pytest.mark.parametrize(
    ("point", "cut"),
    [((2.0, 0.3), (2.0, 4.0)), ((4.1, 2.0), (0.0, 2.0)), ((0.0, 0.0), (4.0, 4.0))],
)
def test_a_ring_without_a_vertex_is_cut_on_its_far_side(point: Point, cut: Point) -> None:
    square: list[Point] = [(4.0, 0.0), (4.0, 4.0), (0.0, 4.0)]
    ring = drawn({1: (0.0, 0.0)}, {10: (1, 1, square)})
    edge = ring.rings_cut_far_from(np.array(point)).edges[10]
    assert edge.polyline[0] == pytest.approx(cut, abs=0.06)
    assert edge.polyline[-1] == pytest.approx(edge.polyline[0])
    assert edge.length == pytest.approx(16.0)
    steps = np.hypot(*np.diff(edge.polyline, axis=0).T)
    assert np.diff(edge.stations) == pytest.approx(steps)


def test_where_a_ring_is_cut_its_node_is_and_the_least_clearance_stays_where_it_was() -> None:
    square: list[Point] = [(4.0, 0.0), (4.0, 4.0), (0.0, 4.0)]
    ring = drawn({1: (0.0, 0.0)}, {10: (1, 1, square)})
    ring.edges[10].clearance[20] = 0.5  # at (2, 0)
    cut = ring.rings_cut_far_from(np.array([2.0, 0.0]))
    assert cut.nodes[1].position == pytest.approx((2.0, 4.0), abs=0.06)
    narrowest = cut.edges[10].clearance.argmin()
    assert cut.edges[10].polyline[narrowest] == pytest.approx((2.0, 0.0))
    assert len(cut.edges[10].clearance) == len(cut.edges[10].polyline)


def test_an_edge_that_comes_back_to_its_meetpoint_begins_there_wherever_the_robot_is() -> None:
    assert GVG.rings_cut_far_from(np.array([5.0, 0.0])).edges[14] is GVG.edges[14]
