from dataclasses import dataclass

import numpy as np

from gvgbot.autonomy.exploration.paths import Approach
from gvgbot.autonomy.slam.graph import Edge, GvgGraph, HalfEdge, HalfEdgeId, Vertex
from gvgbot.geometry import Pose
from gvgbot.team.chart import Chart
from gvgbot.team.member import Member, TeamConfig
from gvgbot.team.news import decode, encode
from tests.unit.team.building import Building, irregular

START = {"one": Pose(3.0, -2.0, 0.7), "two": Pose(11.0, 6.0, -2.4)}
LEFT, RIGHT = {0, 1, 2, 3, 5, 6, 7, 8, 10, 11, 12, 13}, {1, 2, 3, 6, 7, 8, 11, 12, 13, 14, 9, 4}
CONFIG = TeamConfig(enabled=True)


@dataclass
class Robot:
    """A robot of which only the graph and the place on it are real."""

    member: Member
    chart: Chart
    at: int

    def choose(self) -> tuple[HalfEdgeId, Approach] | None:
        start = Approach(0.0, HalfEdgeId(self.at, -1))
        return self.member.choose(graph_of(self.chart), [start])

    def tell(self, stamp: float, *others: "Robot", finished: bool = False) -> None:
        news = encode(self.member.news(stamp, Pose(), 0.0, finished=finished))
        for other in others:
            other.member.hear(decode(news), stamp)


def graph_of(chart: Chart) -> GvgGraph:
    graph = GvgGraph()
    for v in chart.vertices.values():
        vertex = graph.vertices[v.id] = Vertex(v.id, v.clearance, Pose(), 0.0, 0.0)
        vertex.half_edges = {d.key: HalfEdge(d.bearing, d.edge, d.blocked) for d in v.departures}
    for e in chart.edges.values():
        graph.edges[e.id] = Edge(e.id, e.a, e.b, e.polyline, e.length, e.min_clearance)
    return graph


def robot(name: str, building: Building, seen: set[int], at: int) -> Robot:
    chart = building.chart(seen, START[name])
    return Robot(Member(name, CONFIG, lambda: chart), chart, at)


def team(seed: int = 1) -> tuple[Robot, Robot]:
    """Two robots that have told each other what they know, and laid it on each other."""
    building = irregular(seed)
    one, two = robot("one", building, LEFT, 0), robot("two", building, RIGHT, 14)
    for _ in range(2):
        one.tell(0.0, two)
        two.tell(0.0, one)
    one.member.look(1.0)
    two.member.look(1.0)
    return one, two


def place(which: Robot, end: HalfEdgeId) -> np.ndarray:
    start = START[which.member.name]
    return start.transform(which.chart.vertices[end.vertex].position)


def test_robots_find_each_others_frames() -> None:
    one, two = team()
    true = START["one"].to(START["two"])
    assert one.member.frames["two"].distance(true) < 0.05
    assert two.member.frames["one"].distance(true.inverse()) < 0.05


def test_a_frontier_goes_to_the_robot_that_is_nearer() -> None:
    one, two = team()
    mine = one.choose()
    assert mine is not None
    one.tell(2.0, two)
    theirs = two.choose()
    assert theirs is not None
    assert np.hypot(*(place(one, mine[0]) - place(two, theirs[0]))) > 1.0
    two.tell(2.0, one)
    assert one.member.keeps(mine[0], graph_of(one.chart), [Approach(0.0, HalfEdgeId(0, -1))])


def test_what_a_lost_robot_was_about_to_do_is_free_again() -> None:
    one, two = team()
    two.at = one.at = 3
    first = one.choose()
    assert first is not None
    one.tell(2.0, two)
    other = two.choose()
    assert other is None or np.hypot(*(place(one, first[0]) - place(two, other[0]))) > 1.0
    two.tell(2.0 + CONFIG.lost_after_s + 1.0)  # it goes on, and has heard nothing
    free = two.choose()
    assert free is not None
    np.testing.assert_allclose(place(two, free[0]), place(one, first[0]), atol=0.1)


def test_alone_a_robot_takes_the_nearest_frontier_of_its_own() -> None:
    one = robot("one", irregular(1), LEFT, 0)
    one.tell(0.0)
    chosen = one.choose()
    assert chosen is not None
    assert not one.member.is_waiting
    assert not one.member.is_done


def test_old_news_do_not_replace_new_ones_and_a_restart_begins_anew() -> None:
    one, two = team()
    old = decode(encode(two.member.news(3.0, Pose(), 0.0, finished=False)))
    new = decode(encode(two.member.news(4.0, Pose(1.0, 0.0, 0.0), 0.0, finished=False)))
    one.member.hear(new, 4.0)
    place_then = one.member.others()["two"]
    one.member.hear(old, 4.0)
    assert one.member.others()["two"] == place_then
    restarted = Member("two", CONFIG, lambda: two.chart, life=1)
    one.member.hear(restarted.news(5.0, Pose(), 0.0, finished=False), 5.0)
    assert "two" not in one.member.frames  # its map frame is another one now
