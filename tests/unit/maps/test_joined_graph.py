"""Robots that have been at a place agree on what leaves it."""

import math

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
