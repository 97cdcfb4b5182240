"""Robots that have been at a place agree on what leaves it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gvgbot.geometry import Pose
from gvgbot.maps.joined_graph import joined_graph
from gvgbot.maps.moved import moved_graph
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode

FRAMES = (Pose(), Pose(3.0, -1.0, 2.0), Pose(-4.0, 0.5, -1.0), Pose(0.0, 7.0, 3.1))


def vertex(number: int, x: float, bearings: tuple[float, ...], followed: float) -> RouteNode:
    return RouteNode(
        id=number,
        kind="meetpoint",
        position=(x, 0.0),
        degree=len(bearings),
        bearings=bearings,
        clearance=0.8,
        covariance=(0.01, 0.0, 0.0, 0.01),
        frontiers=tuple(b for b in bearings if b != followed),
    )


def corridor(*, sees_door: bool, drove: bool = True) -> RouteGraph:
    """A way of 8 m between two meetpoints; a door north of the second one may have been seen."""
    door = (math.pi / 2,) if sees_door else ()
    return RouteGraph(
        (vertex(0, 0.0, (0.0, 3.0), 0.0), vertex(1, 8.0, (math.pi, -1.0, *door), math.pi)),
        (
            RouteEdge(
                start=0,
                end=1,
                polyline=np.linspace((0, 0), (8, 0), 80),
                min_clearance=0.8,
                traversals=int(drove),
            ),
        ),
    )


@pytest.mark.parametrize(
    ("saw", "missed", "never_there", "is_left"),
    [(1, 2, 0, False), (1, 3, 0, False), (2, 1, 0, True), (1, 1, 0, True), (1, 0, 2, True)],
)
def test_what_most_did_not_see_that_have_been_there_is_no_frontier(
    saw: int, missed: int, never_there: int, is_left: bool
) -> None:
    maps = [corridor(sees_door=True)] * saw + [corridor(sees_door=False)] * missed
    maps += [corridor(sees_door=False, drove=False)] * never_there
    for turn in range(len(maps)):
        told = [
            (moved_graph(one, frame.inverse()), frame)
            for one, frame in zip((*maps[turn:], *maps[:turn]), FRAMES, strict=False)
        ]
        whole = joined_graph(told)
        (end,) = (v for v in whole.vertices if math.dist(v.position, (8, 0)) < 0.1)
        assert end.degree == 2 + is_left
        assert sorted(end.frontiers) == pytest.approx([-1.0, *([math.pi / 2] if is_left else [])])


def with_somebody(*ahead: float) -> RouteGraph:
    """The way of 8 m, seen from one end to somebody who made a meetpoint of its middle."""
    middle = vertex(2, 4.0, (math.pi, *ahead), math.pi)
    first = vertex(0, 0.0, (0.0, 3.0), 0.0)
    line = np.linspace((0, 0), (4, 0), 40)
    return RouteGraph(
        (first, middle), (RouteEdge(start=0, end=2, polyline=line, min_clearance=0.5),)
    )


@pytest.mark.parametrize(
    ("ahead", "is_followed"), [((0.6, -0.6), True), ((0.6, -1.5), False), ((0.6,), True)]
)
@pytest.mark.parametrize("is_first", [True, False])
def test_where_one_robot_saw_a_way_go_on_round_somebody_another_one_has_it_pass(
    ahead: tuple[float, ...], *, is_followed: bool, is_first: bool
) -> None:
    """On both sides, or on one; neither drove all of it. What nobody has followed is left."""
    told = [(with_somebody(*ahead), FRAMES[0])]
    plain = moved_graph(corridor(sees_door=False, drove=False), FRAMES[1].inverse()), FRAMES[1]
    whole = joined_graph([*told, plain] if is_first else [plain, *told])
    places = sorted(v.position[0] for v in whole.vertices)
    assert places == pytest.approx([0.0, 8.0] if is_followed else [0.0, 4.0, 8.0], abs=0.01)
    if is_followed:
        (edge,) = whole.edges
        assert edge.length == pytest.approx(8.0, abs=0.01)
        ends = [vertex.position for vertex in whole.vertices if vertex.id in (edge.start, edge.end)]
        assert sorted(x for x, _ in ends) == pytest.approx([0.0, 8.0], abs=0.01)
        assert edge.min_clearance == 0.5
        assert {len(edge.polyline[np.hypot(*(edge.polyline - end).T) < 1e-6]) for end in ends} == {
            1
        }


@pytest.mark.parametrize(("beside", "is_left"), [(-0.6, False), (-1.5, True)])
@pytest.mark.parametrize("is_first", [True, False])
def test_what_one_saw_fork_a_little_where_an_edge_of_another_one_passes_is_no_fork(
    beside: float, *, is_left: bool, is_first: bool
) -> None:
    """Somebody stood there. What leads off the edge is another matter; neither drove there."""
    start, end = vertex(0, 0.0, (0.0, 3.0), 0.0), vertex(1, 8.0, (math.pi, -1.0), math.pi)
    middle = replace(vertex(2, 4.0, (math.pi, 0.0, beside), 0.0), frontiers=(beside,))
    lines = [((0, 2), (0, 4)), ((2, 1), (4, 8))]
    edges = tuple(
        RouteEdge(start=a, end=b, polyline=np.linspace((x, 0), (to, 0), 40), min_clearance=0.5)
        for (a, b), (x, to) in lines
    )
    forked = RouteGraph((start, end, middle), edges), Pose()
    plain = corridor(sees_door=False, drove=False), Pose()
    whole = joined_graph([forked, plain] if is_first else [plain, forked])
    assert len(whole.edges) == 1 + is_left
    assert sum(len(v.frontiers) for v in whole.vertices) == 2 + is_left
    assert len(whole.vertices) == 2 + is_left


def test_where_two_drove_up_to_somebody_from_both_sides_an_edge_passes() -> None:
    """One took him for a fork of which it followed nothing; the other one came from beyond him."""
    here = with_somebody(0.0)
    beyond = RouteGraph((vertex(1, 8.0, (math.pi, 0.0), 0.0),))
    way = np.linspace((8, 0), (4.1, 0), 40)
    whole = joined_graph([(here, Pose()), (beyond, Pose())], [(way, 0.6)])
    (edge,) = whole.edges
    assert edge.length == pytest.approx(8.0, abs=0.01)
    assert edge.min_clearance == 0.5
    assert sorted(v.position[0] for v in whole.vertices) == [0.0, 8.0]


def test_a_ring_keeps_the_one_vertex_that_it_has() -> None:
    angles = np.linspace(0.0, math.tau, 60)
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    only = RouteNode(
        id=0,
        kind="meetpoint",
        position=(1.0, 0.0),
        degree=2,
        bearings=(math.pi / 2, -math.pi / 2),
        clearance=0.5,
        covariance=(0.01, 0.0, 0.0, 0.01),
    )
    loop = RouteEdge(start=0, end=0, polyline=ring, min_clearance=0.5, traversals=1)
    whole = joined_graph([(RouteGraph((only,), (loop,)), Pose())] * 2)
    assert len(whole.vertices) == len(whole.edges) == 1
