"""Who takes which frontier, by what another robot says that it is on its way to."""

import msgspec
import pytest

from gvgbot.autonomy.exploration.paths import Approach
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.geometry import Pose
from gvgbot.team.auction import Auction
from gvgbot.team.chart import Chart
from gvgbot.team.news import Claim
from tests.unit.team.building import irregular
from tests.unit.team.test_member import graph_of

CHART = irregular(1).chart({0, 1, 2, 5, 6, 7}, Pose())
STARTS = [Approach(0.0, HalfEdgeId(0, -1))]


class Others:
    """One other robot that has found nothing."""

    may_find_more = True

    def __init__(self, *claims: Claim) -> None:
        self.frames: dict[str, Pose] = {}
        self.told = [("two", claim) for claim in claims]

    def chart(self, name: str) -> Chart:
        raise KeyError(name)

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
