"""Who takes which frontier, by what another robot says that it is on its way to."""

import math

import msgspec
import numpy as np
import pytest

from gvgbot.autonomy.exploration.paths import Approach
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.geometry import Pose
from gvgbot.team.auction import Auction
from gvgbot.team.chart import Chart, ChartEdge, ChartWay
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


def test_how_far_others_are_is_told_by_their_edges_and_by_what_they_have_driven_of_others() -> None:
    """In the own frame: theirs is a quarter turn to the left, 10 m ahead."""
    (a, b) = (HalfEdgeId(0, 0), HalfEdgeId(1, 0))
    edge = ChartEdge(0, a, b, 4.0, 0.5, np.array([[0.0, 0.0], [2.0, 0.0], [4.0, 0.0]]))
    way = ChartWay(np.array([[0.0, 5.0], [0.0, 6.0]]), 0.5)
    two = Chart(edges={0: edge}, ways=(way,)), Pose(10.0, 0.0, math.pi / 2)
    auction = Auction("one", lambda: CHART, Others(charts={"two": two}))
    places = np.array([[10.0, 2.0], [10.3, 4.0], [4.0, -1.0]])
    assert auction.metres_from(places) == pytest.approx([0.0, 0.3, 1.0])


def test_what_one_has_driven_of_an_edge_is_known_as_one() -> None:
    own = Chart(ways=(ChartWay(np.array([[0.0, 0.0], [2.0, 0.0]]), 0.5),))
    auction = Auction("one", lambda: own, Others())
    assert auction.metres_from(np.array([[2.0, 1.0]])).tolist() == [1.0]


def test_whose_maps_lie_nobody_knows_where_are_infinitely_far() -> None:
    auction = Auction("one", lambda: CHART, Others())
    assert auction.metres_from(np.zeros((2, 2))).tolist() == [math.inf, math.inf]
