"""What is near a threshold stays as the map has it: hand-drawn fine graphs, lengths by design."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gvgbot.autonomy.gvg.draft import contracted
from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.gvg.reduction import KnownVertices, ReductionConfig, reduce_graph
from gvgbot.autonomy.gvg.voronoi import FineGraph
from gvgbot.geometry import Array

CONFIG = ReductionConfig(min_reach=1.7, merge_m=0.6)
CLEARANCE = 1.0  # m, everywhere


def fine(lines: list[tuple[tuple[float, float], tuple[float, float]]]) -> FineGraph:
    """A fine graph of straight chains, with a point about every 5 cm and all ends closed."""
    points: list[tuple[float, float]] = []
    ridges = []

    def index(point: Array) -> int:
        place = (round(float(point[0]), 6), round(float(point[1]), 6))
        if place not in points:
            points.append(place)
        return points.index(place)

    for a, b in lines:
        start, end = np.array(a), np.array(b)
        count = max(2, round(float(np.hypot(*(end - start))) / 0.05) + 1)
        chain = [index(p) for p in np.linspace(start, end, count)]
        ridges += list(pairwise(chain))
    n = len(points)
    return FineGraph(np.array(points), np.full(n, CLEARANCE), np.array(ridges), np.full(n, np.nan))


def crossing(offset: float) -> FineGraph:
    """A long street with a long side street on either hand, the two so many metres apart."""
    a, b = (-offset / 2, 0.0), (offset / 2, 0.0)
    return fine([((-6, 0), a), (a, b), (b, (6, 0)), (a, (-offset / 2, 6)), (b, (offset / 2, -6))])


def degrees(gvg: LocalGvg) -> list[int]:
    """Of all meetpoints."""
    return sorted(node.degree for node in gvg.nodes.values() if node.degree >= 3)


ONE = KnownVertices(np.array([[0.0, 0.0]]), np.array([4]))
FIRST_OF_TWO = KnownVertices(np.array([[-0.35, 0.0]]), np.array([3]))
TWO = KnownVertices(np.array([[-0.35, 0.0], [0.35, 0.0]]), np.array([3, 3]))
FAR = KnownVertices(np.array([[5.0, 5.0]]), np.array([4]))


@pytest.mark.parametrize(
    ("offset", "known", "expected"),
    [
        (0.5, None, [4]),
        (0.7, None, [3, 3]),
        (0.5, FAR, [4]),
        (0.7, FAR, [3, 3]),
        (0.7, ONE, [4]),  # not much more than the threshold: one it stays
        (0.85, ONE, [3, 3]),
        (0.7, FIRST_OF_TWO, [3, 3]),
        (0.5, TWO, [3, 3]),
        (0.35, TWO, [4]),
    ],
)
def test_two_close_meetpoints_stay_one_or_two(
    offset: float, known: KnownVertices | None, expected: list[int]
) -> None:
    assert degrees(reduce_graph(crossing(offset), CONFIG, known)) == expected


def test_chains_are_as_long_as_the_lines_between_forks_and_ends() -> None:
    lengths = sorted(chain.length() for chain in contracted(crossing(0.7)).chains.values())
    assert lengths == pytest.approx([0.7, 5.65, 5.65, 6.0, 6.0])


def branching(reach: float) -> FineGraph:
    """A street with a dangling branch of the given reach at its middle."""
    length = reach * CLEARANCE - CLEARANCE
    return fine([((-6, 0), (0, 0)), ((0, 0), (6, 0)), ((0, 0), (0, length))])


def ended(y: float) -> KnownVertices:
    """The map has an endpoint on the branch."""
    return KnownVertices(np.array([[0.0, y]]), np.array([1]))


@pytest.mark.parametrize(
    ("reach", "known", "is_kept"),
    [
        (1.65, None, False),
        (1.75, None, True),
        (1.65, ended(0.65), True),  # a known dead end
        (1.45, ended(0.45), False),
        (1.8, ended(0.0), False),  # the map has the dead end at the foot of the branch
        (1.75, ended(0.2), False),  # nearer to the foot than to the tip, and near enough to both
        (1.75, ended(0.5), True),
        (1.95, ended(0.0), True),
        (1.65, ended(5.0), False),
    ],
)
def test_a_branch_near_the_least_reach_stays_what_it_was(
    reach: float, known: KnownVertices | None, is_kept: bool
) -> None:
    gvg = reduce_graph(branching(reach), CONFIG, known)
    assert degrees(gvg) == ([3] if is_kept else [])


def hall(corridor: float) -> FineGraph:
    """The coast 8 m before the wall of a hall, and the way out there, so long beyond the wall."""
    graph = fine([((0, -6), (0, 0)), ((0, 0), (0, 6)), ((0, 0), (8 + corridor, 0))])
    return replace(graph, clearance=np.maximum(8.0 - graph.points[:, 0], CLEARANCE))


def corner_of_a_hall() -> FineGraph:
    """The coast 8 m before two walls, and the diagonal into their corner."""
    graph = fine([((0, -6), (0, 0)), ((0, 0), (-6, 0)), ((0, 0), (7.8, 7.8))])
    return replace(graph, clearance=np.minimum(8.0 - graph.points[:, 0], 8.0))


def test_what_is_worth_a_visit_does_not_grow_with_the_space_before_it() -> None:
    """Out of a wide space, four metres to the walls, a way of 2.8 m beyond them is 1.7 as far."""
    assert degrees(reduce_graph(hall(4.0), CONFIG)) == [3]
    assert degrees(reduce_graph(hall(1.5), CONFIG)) == []
    assert degrees(reduce_graph(corner_of_a_hall(), CONFIG)) == []


@pytest.mark.parametrize(
    ("left", "right", "known", "end"),
    [
        (1.65, 1.45, None, 0.65),  # a niche
        (1.55, 1.45, None, 0.0),  # two corners
        (1.65, 1.45, ended(0.0), 0.0),  # the map has the dead end where they fork
        (1.55, 1.45, ended(0.55), 0.55),  # or in the niche
        (1.62, 1.66, ended(0.62), 0.62),  # or in one of two
    ],
)
def test_an_edge_that_forks_into_corners_ends_in_the_one_that_is_a_niche(
    left: float, right: float, known: KnownVertices | None, end: float
) -> None:
    tips = [(0.0, (left - 1) * CLEARANCE), (0.0, (1 - right) * CLEARANCE)]
    gvg = reduce_graph(fine([((-6, 0), (0, 0)), *(((0, 0), tip) for tip in tips)]), CONFIG, known)
    assert degrees(gvg) == []
    (found,) = (node.position for node in gvg.nodes.values() if node.position[0] > -1.0)
    assert found == pytest.approx([0.0, end], abs=0.01)


def test_where_all_branches_are_corners_there_is_no_edge() -> None:
    tips = [(0.65, 0.0), (-0.6, 0.0), (0.0, 0.6)]
    assert not reduce_graph(fine([((0, 0), tip) for tip in tips]), CONFIG).edges


def test_twigs_of_a_corner_branch_do_not_shift_the_dead_end() -> None:
    """A room 4 m wide and 5.2 m deep, as its middle line has it; in one corner stands something."""
    door, near, far, fork = (0.0, -6.0), (0.0, -1.2), (0.0, 0.0), (1.0, -2.2)
    graph = fine(
        [
            (door, near),
            (near, far),
            (near, (-1.8, -3.0)),
            (near, fork),
            (fork, (1.8, -3.0)),
            (fork, (1.0, -2.6)),
            (far, (-1.8, 1.8)),
            (far, (1.8, 1.8)),
        ]
    )
    x, y = graph.points.T
    room = np.minimum(2 - np.abs(x), np.minimum(2 - y, 3.2 + y))
    graph = replace(graph, clearance=np.where(y < -3.0, 0.5, np.maximum(room, 0.2)))
    gvg = reduce_graph(graph, CONFIG)
    assert degrees(gvg) == []
    assert sorted(tuple(node.position.round(3)) for node in gvg.nodes.values()) == [door, far]


def cross_around_a_square(side: float, clearance: float) -> LocalGvg:
    """Four ways that end at the corners of a square."""
    corners = [(x * side / 2, y * side / 2) for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    lines = [
        *pairwise([*corners, corners[0]]),
        *((c, (9 * c[0] / side, 9 * c[1] / side)) for c in corners),
    ]
    graph = fine(lines)
    return reduce_graph(replace(graph, clearance=np.full(len(graph.points), clearance)), CONFIG)


@pytest.mark.parametrize("side", [0.1, 0.2, 0.35])
def test_round_a_speck_of_open_space_goes_no_edge(side: float) -> None:
    """Where the coast of the open is shorter than a way round the thinnest post would be."""
    gvg = cross_around_a_square(side, 4.5)
    assert sum(degree - 2 for degree in degrees(gvg)) == 2  # as many as the ways need
    pairs = [{edge.a, edge.b} for edge in gvg.edges.values()]
    assert all(len(pair) == 2 and pairs.count(pair) == 1 for pair in pairs)


def test_round_a_larger_one_there_are_meetpoints() -> None:
    assert degrees(cross_around_a_square(1.5, 4.5)) == [3, 3, 3, 3]


@pytest.mark.parametrize("side", [0.1, 0.35])
def test_a_short_way_round_a_post_is_an_edge(side: float) -> None:
    """What a robot that is small enough keeps a twentieth of the way's length from."""
    gvg = cross_around_a_square(side, 4 * side / 20)
    assert sum(degree - 2 for degree in degrees(gvg)) == 4
