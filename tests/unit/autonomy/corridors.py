"""A corridor with a branch, drawn by hand, a loop, and a robot that walks along such graphs."""

from dataclasses import dataclass, field

from gvgbot.autonomy.gvg.local import Branch, LocalGvg
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.autonomy.views import Correspondence
from gvgbot.autonomy.whereabouts import Passage, Whereabouts
from tests.unit.autonomy.local_graphs import Point, drawn, resampled

EAST, WEST = 0, 1  # keys of the half-edges of each vertex along the corridor


def known_as(pairs: dict[Branch, HalfEdgeId], nodes: dict[int, int]) -> Correspondence:
    known = Correspondence()
    for node, vertex in nodes.items():
        known.pair(node, vertex)
    for branch, end in pairs.items():
        known.pair_branch(branch, end)
    return known


@dataclass
class Walk:
    """Whereabouts on the way along points, in sight of one local GVG after another."""

    where: Whereabouts = field(default_factory=Whereabouts)
    passages: list[Passage] = field(default_factory=list)

    def along(self, gvg: LocalGvg, known: Correspondence, *corners: Point) -> "Walk":
        for point in resampled(list(corners)):
            place = gvg.place(point)
            assert place is not None
            passage = self.where.follow(gvg, place, known, point)
            if passage is not None:
                self.passages.append(passage)
        return self


# A corridor from an end at x = 0 (vertex 1) by a meetpoint at x = 6 (vertex 2, its branch south)
# to an end at x = 12 (vertex 3), all in sight.
CORRIDOR = drawn(
    {1: (0.0, 0.0), 2: (6.0, 0.0), 3: (12.0, 0.0), 4: (6.0, -3.0)},
    {10: (1, 2, []), 11: (2, 3, []), 12: (2, 4, [])},
)
ENDS = {
    Branch(10, forward=True): HalfEdgeId(1, EAST),
    Branch(10, forward=False): HalfEdgeId(2, WEST),
    Branch(11, forward=True): HalfEdgeId(2, EAST),
    Branch(11, forward=False): HalfEdgeId(3, WEST),
    Branch(12, forward=True): HalfEdgeId(2, 2),
}
ALL_KNOWN = known_as(ENDS, {1: 1, 2: 2, 3: 3})

# A loop of 28 m that leaves vertex 1 at the origin to the east and comes back from the north, in
# three sights: the beginning, the far side, and the end.
LOOP: list[Point] = [(0.0, 0.0), (8.0, 0.0), (8.0, 6.0), (0.0, 6.0), (0.0, 0.0)]
