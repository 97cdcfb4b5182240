"""Who takes which frontier, by what another robot says that it is on its way to."""

import math
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from gvgbot.autonomy.exploration.paths import Approach
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.geometry import Pose
from gvgbot.team.auction import Auction
from gvgbot.team.chart import Chart, ChartEdge, ChartVertex, ChartWay
from gvgbot.team.news import Claim
from tests.unit.team.building import irregular
from tests.unit.team.test_member import graph_of

CHART = irregular(1).chart({0, 1, 2, 5, 6, 7}, Pose())
STARTS = [Approach(0.0, HalfEdgeId(0, -1))]


class Others:
    """One other robot that has found nothing."""

    may_find_more = True

    def __init__(self, *claims: Claim, charts: dict[str, tuple[Chart, Pose]] | None = None) -> None:
        self.charts = charts or {}
        self.frames = {name: pose for name, (_, pose) in self.charts.items()}
        self.told = [("two", claim) for claim in claims]

    def chart(self, name: str) -> Chart:
        return self.charts[name][0]

    def claims(self) -> list[tuple[str, Claim]]:
        return self.told


def chosen(*claims: Claim) -> Claim:
    auction = Auction("one", lambda: CHART, Others(*claims))
    auction.choose(graph_of(CHART), STARTS)
    assert auction.claim is not None
    return auction.claim


@pytest.mark.parametrize(("nearer", "takes_over"), [(1.0, False), (3.0, True)])
def test_who_is_hardly_nearer_leaves_a_frontier_to_whom_is_on_its_way(
    nearer: float, takes_over: bool
) -> None:
    """Or two that are as far would take it from each other, over and over."""
    alone = chosen()
    theirs = msgspec.structs.replace(alone, metres=alone.metres + nearer)
    assert (chosen(theirs) == alone) == takes_over


def test_when_nothing_is_left_it_tells_what_others_know_and_what_it_has_driven_in_part() -> None:
    """In the own frame: theirs is a quarter turn to the left, 10 m ahead."""
    a, b = HalfEdgeId(0, 0), HalfEdgeId(1, 0)
    edge = ChartEdge(0, a, b, 4.0, 0.5, np.array([[0.0, 0.0], [4.0, 0.0]]))
    way = ChartWay(np.array([[0.0, 5.0], [0.0, 6.0]]), 0.5)
    own = Chart(edges={0: edge}, ways=(ChartWay(np.array([[0.0, 0.0], [-1.0, 0.0]]), 0.5),))
    ends = {i: ChartVertex(i, np.array([4.0 * i, 0.0]), np.eye(2), 0.5, ()) for i in (0, 1)}
    theirs = Chart(ends, {0: edge}, (way,))
    others = Others(charts={"two": (theirs, Pose(10.0, 0.0, math.pi / 2))})
    auction = Auction("one", lambda: replace(own, vertices=ends), others)
    auction.choose(graph_of(replace(own, vertices=ends)), STARTS)
    assert not auction.known_to_others
    others.may_find_more = False
    auction.choose(graph_of(replace(own, vertices=ends)), STARTS)
    told = [[[10, 0], [10, 4]], [[0, 0], [-1, 0]], [[5, 0], [4, 0]]]
    assert [line.round(6).tolist() for line in auction.known_to_others] == told
