import copy
import math
from dataclasses import dataclass, replace
from functools import cache

import msgspec
import numpy as np
import pytest

from gvgbot.autonomy.control.company import BodiesSeen
from gvgbot.autonomy.exploration.paths import Approach
from gvgbot.autonomy.slam.graph import Edge, GvgGraph, HalfEdge, HalfEdgeId, Vertex
from gvgbot.geometry import Array, Pose
from gvgbot.team.alignment import Alignment
from gvgbot.team.auction import Auction
from gvgbot.team.chart import Chart, ChartWay
from gvgbot.team.member import Comparison, Member, TeamConfig
from gvgbot.team.news import decode, encode
from tests.unit.team.building import Building, irregular, lattice

START = {
    "one": Pose(3.0, -2.0, 0.7),
    "two": Pose(11.0, 6.0, -2.4),
    "three": Pose(5.0, 5.0, 1.0),
}
RADIUS = {"one": 0.177, "two": 0.5, "three": 0.2}
LEFT, RIGHT = {0, 1, 2, 3, 5, 6, 7, 8, 10, 11, 12, 13}, {1, 2, 3, 6, 7, 8, 11, 12, 13, 14, 9, 4}
CONFIG = TeamConfig(enabled=True)


@dataclass
class Robot:
    """A robot of which only the graph and the place on it are real."""

    member: Member
    chart: Chart
    at: int

    @property
    def auction(self) -> Auction:
        return self.member.auction

    def choose(self) -> tuple[HalfEdgeId, Approach] | None:
        start = Approach(0.0, HalfEdgeId(self.at, -1))
        return self.auction.choose(graph_of(self.chart), [start])

    def outlook(self) -> tuple[tuple[HalfEdgeId, Approach] | None, bool, bool]:
        """What it chooses, whether it waits for others, and whether it is done."""
        return self.choose(), self.auction.is_waiting, self.auction.is_done

    def tell(
        self, stamp: float, *others: "Robot", finished: bool = False, at: Pose | None = None
    ) -> None:
        news = encode(self.member.news(stamp, at or Pose(), finished=finished))
        for other in others:
            other.member.hear(decode(news), stamp)

    def steer(
        self,
        stamp: float,
        other: "Robot",
        map_base: Pose,
        track: Array,
        seen: BodiesSeen | None = None,
    ) -> None:
        course = encode(self.member.course(stamp, map_base, track, seen))
        other.member.hear(decode(course), stamp)


def graph_of(chart: Chart) -> GvgGraph:
    graph = GvgGraph()
    for v in chart.vertices.values():
        vertex = graph.vertices[v.id] = Vertex(v.id, v.clearance, Pose(), 0.0, 0.0)
        vertex.half_edges = {d.key: HalfEdge(d.bearing, d.edge, d.blocked) for d in v.departures}
    for e in chart.edges.values():
        graph.edges[e.id] = Edge(e.id, e.a, e.b, e.polyline, e.length, e.min_clearance)
    return graph


def robot(name: str, building: Building, seen: set[int], at: int) -> Robot:
    made = Robot(Member(name, CONFIG, lambda: made.chart, radius=RADIUS[name]), Chart(), at)
    made.chart = building.chart(seen, START[name])
    return made


def settle(here: Robot, there: str) -> None:
    """Let a robot know for certain how the map of another one lies to its own."""
    true = START[here.member.name].to(START[there])
    alignment = Alignment(true, np.eye(3) * 1e-6, (), 1.0)
    here.member.settle(Comparison(there, 0, Chart(), Chart(), None), alignment)


def team() -> tuple[Robot, Robot]:
    """Two robots that have told each other what they know, and laid it on each other."""
    return copy.deepcopy(_met())


@cache
def _met() -> tuple[Robot, Robot]:
    building = irregular(1)
    one, two = robot("one", building, LEFT, 0), robot("two", building, RIGHT, 14)
    for _ in range(2):
        one.tell(0.0, two)
        two.tell(0.0, one)
    one.member.look(1.0)
    two.member.look(1.0)
    return one, two


def way_from(building: Building, start: int, end: int, metres: float, name: str) -> ChartWay:
    """Part of a corridor, as a robot has driven it."""
    a, b = building.places[[start, end]]
    line = np.linspace(a, a + (b - a) * metres / math.dist(a, b), 40)
    return ChartWay(START[name].inverse().transform(line), 0.5)


def place(which: Robot, end: HalfEdgeId) -> np.ndarray:
    start = START[which.member.name]
    return start.transform(which.chart.vertices[end.vertex].position)


def test_robots_find_each_others_frames() -> None:
    one, two = team()
    true = START["one"].to(START["two"])
    assert one.member.frames["two"].distance(true) < 0.05
    assert two.member.frames["one"].distance(true.inverse()) < 0.05


def test_at_last_maps_are_laid_on_each_other_anew_though_none_has_grown() -> None:
    one, _ = team()
    true = START["one"].to(START["two"])
    aside = Alignment(Pose(0.15, -0.1).compose(true), np.eye(3) * 0.01, (), 1.0)
    one.member.settle(Comparison("two", 0, Chart(), Chart(), None), aside)
    one.member.look(2.0)
    assert one.member.frames["two"].distance(true) > 0.1
    one.member.look(2.0, at_last=True)
    assert one.member.frames["two"].distance(true) < 0.05


def test_a_crowd_of_names_is_not_remembered_for_ever() -> None:
    one, two = team()
    stranger = msgspec.structs.replace(two.member.news(2.0, Pose(), finished=False), frames=())
    for number in range(500):
        one.member.hear(msgspec.structs.replace(stranger, robot=f"stranger-{number}"), 2.0)
    later = 2.0 + CONFIG.align_every_s + CONFIG.lost_after_s
    assert len(one.member.due(later)) < 100
    assert set(one.member.frames) == {"two"}
    one.member.hear(msgspec.structs.replace(stranger, robot="new"), later)
    assert "new" in {comparison.robot for comparison in one.member.due(later)}


def test_a_frontier_goes_to_the_robot_that_is_nearer() -> None:
    one, two = team()
    mine = one.choose()
    assert mine is not None
    one.tell(2.0, two)
    theirs = two.choose()
    assert theirs is not None
    assert np.hypot(*(place(one, mine[0]) - place(two, theirs[0]))) > 1.0
    two.tell(2.0, one)
    assert one.auction.keeps(mine[0], graph_of(one.chart), [Approach(0.0, HalfEdgeId(0, -1))])


def test_who_is_on_another_departure_than_it_chose_keeps_it_only_if_nobody_followed_it() -> None:
    """The vertex that it went to was none, and the way there goes on from the one before."""
    one, _ = team()
    chosen = one.choose()
    assert chosen is not None
    graph, start = graph_of(one.chart), [Approach(0.0, HalfEdgeId(0, -1))]
    corridors = irregular(1).corridors
    followed = {end for end in graph.frontiers() if {*corridors[end.key]} <= RIGHT}
    kept = {end for end in graph.frontiers() if one.auction.keeps(end, graph, start)}
    assert followed
    assert kept
    assert kept == {*graph.frontiers()} - followed


def test_who_comes_to_see_what_another_one_has_seen_leaves_a_vertex_by_that() -> None:
    """From afar it saw two ways only, the way that it came and one that leads to a dead end."""
    places = np.array([(0.0, 0.0), (6.0, 0.0), (12.0, 0.0), (6.0, 5.0)])
    corridors = ((0, 1), (1, 3), (1, 2))
    whole, partly = Building(places, corridors), Building(places, corridors[:2])
    one, two = robot("one", partly, {0, 1}, 1), robot("two", whole, {1, 3}, 3)
    for _ in range(2):
        two.tell(1.0, one)
        one.member.news(1.0, Pose(), finished=False)
    settle(one, "two")
    chosen = one.choose()
    assert chosen is not None
    assert chosen[0] == HalfEdgeId(1, 1)  # the only open one that it knows
    at_vertex = [Approach(0.0, HalfEdgeId(1, -1))]
    assert one.auction.keeps(chosen[0], graph_of(one.chart), at_vertex)
    one.chart = whole.chart({0, 1}, START["one"])
    one.member.news(2.0, Pose(), finished=False)
    assert not one.auction.keeps(chosen[0], graph_of(one.chart), at_vertex)
    seen = one.choose()
    assert seen is not None
    assert seen[0] == HalfEdgeId(1, 2)


def test_who_follows_its_frontier_keeps_it_until_others_have_driven_it_from_the_far_end() -> None:
    building = Building(
        np.array([(0.0, 0.0), (10.0, 0.0), (0.0, 6.0), (10.0, 6.0), (-7.0, 0.0), (17.0, 0.0)]),
        ((0, 1), (0, 2), (1, 3), (0, 4), (1, 5)),
    )
    one, two = robot("one", building, {0, 2, 4}, 0), robot("two", building, {1, 3, 5}, 1)
    chosen = one.choose()
    assert chosen is not None
    on_it = [Approach(-4.5, chosen[0])]
    for _ in range(2):
        two.tell(1.0, one)
        one.member.news(1.0, Pose(), finished=False)
    settle(one, "two")
    assert one.auction.keeps(chosen[0], graph_of(one.chart), on_it)
    one.chart = replace(one.chart, ways=(way_from(building, 0, 1, 4.5, "one"),))
    two.chart = replace(two.chart, ways=(way_from(building, 1, 0, 5.0, "two"),))
    two.tell(2.0, one)
    assert not one.auction.keeps(chosen[0], graph_of(one.chart), on_it)


def test_of_two_on_one_edge_the_one_that_is_ahead_goes_on() -> None:
    """Nobody can drive through the other one: two stood behind each other for a minute."""
    building = Building(
        np.array([(0.0, 0.0), (15.0, 0.0), (0.0, 6.0), (-7.0, 0.0)]), ((0, 1), (0, 2), (0, 3))
    )
    behind, ahead = (robot(name, building, {0, 2, 3}, 0) for name in ("one", "two"))
    for _ in range(2):
        behind.tell(0.0, ahead)
        ahead.tell(0.0, behind)
    for here, there in ((behind, "two"), (ahead, "one")):
        settle(here, there)
    chosen = behind.choose()
    assert chosen is not None
    on_it, graph = [Approach(-2.4, chosen[0])], graph_of(behind.chart)
    assert behind.auction.keeps(chosen[0], graph, on_it)
    behind.tell(2.0, ahead)
    assert ahead.auction.keeps(chosen[0], graph, [Approach(-6.7, chosen[0])])
    ahead.tell(2.0, behind)
    assert not behind.auction.keeps(chosen[0], graph, on_it)
    assert ahead.auction.keeps(chosen[0], graph, [Approach(-7.0, chosen[0])])


def test_what_others_have_driven_and_what_they_have_not() -> None:
    one, two = team()
    edge = next(iter(two.chart.edges.values()))
    line = START["one"].to(START["two"]).transform(edge.polyline)
    assert not one.auction.has_driven(line)  # it was only seen
    with_way = replace(two.chart, ways=(ChartWay(edge.polyline, 0.5),))
    two.member._own_chart = lambda: with_way
    two.tell(3.0, one)
    assert one.auction.has_driven(line)
    assert not one.auction.has_driven(line[::-1])
    assert one.auction.has_driven(line[::-1], either_way=True)
    assert not one.auction.has_driven(np.concatenate([line, line[-1:] + 2.0]))
    driven = {edge.id: replace(edge, traversed=True)}
    whole = replace(two.chart, edges=two.chart.edges | driven)
    two.member._own_chart = lambda: whole
    two.tell(4.0, one)
    assert one.auction.has_driven(line[::-1], either_way=True)
    assert not one.auction.has_driven(line)  # an edge does not tell in which direction


@pytest.mark.parametrize("is_all_known", [True, False])
def test_who_has_no_vertex_waits_and_ends_if_the_others_know_all(*, is_all_known: bool) -> None:
    building = irregular(1)
    one = Robot(Member("one", CONFIG, Chart, radius=RADIUS["one"]), Chart(), 0)
    two = robot("two", building, set(range(len(building.places))) if is_all_known else RIGHT, 14)
    two.tell(1.0, one)
    settle(one, "two")
    for is_busy in (True, False):
        assert one.auction.choose(GvgGraph(), []) is None
        assert one.auction.is_waiting == (is_all_known and is_busy)
        assert one.auction.is_done == (is_all_known and not is_busy)
        one.tell(2.0, two)
        two.choose()
        two.tell(2.0, one, finished=not is_all_known)


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


def test_what_a_robot_was_about_to_do_that_is_held_for_minutes_is_free_again() -> None:
    """It is heard all the time, but its laser may be away, or somebody has lifted it."""
    one, two = team()
    two.at = one.at = 3
    first = one.choose()
    assert first is not None
    for stamp in (2.0, 60.0, 100.0):
        one.tell(stamp, two)
        two.choose()
        assert two.member.claims()
    one.tell(130.0, two)
    free = two.choose()
    assert free is not None
    np.testing.assert_allclose(place(two, free[0]), place(one, first[0]), atol=0.1)
    one.tell(135.0, two, at=Pose(1.0, 0.0, 0.0))  # it drives again
    assert two.member.claims()


def test_alone_a_robot_takes_the_nearest_frontier_of_its_own() -> None:
    one = robot("one", irregular(1), LEFT, 0)
    one.tell(0.0)
    chosen = one.choose()
    assert chosen is not None
    assert not one.auction.is_waiting
    assert not one.auction.is_done


def test_a_frontier_found_since_the_last_news_is_chosen_at_once() -> None:
    building = irregular(1)
    alone = robot("one", building, {0, 1}, 0)
    before = alone.choose()
    grown = building.chart({0, 1, 2, 5, 6}, START["one"])
    alone.chart.vertices.update(grown.vertices)
    alone.chart.edges.update(grown.edges)
    chosen = alone.choose()
    assert before is not None
    assert chosen is not None
    half = grown.vertices[chosen[0].vertex].departures
    assert next(d for d in half if d.key == chosen[0].key).edge is None
    assert not alone.auction.is_done


def test_old_news_do_not_replace_new_ones_and_a_restart_begins_anew() -> None:
    one, two = team()
    old = decode(encode(two.member.news(3.0, Pose(), finished=False)))
    new = decode(encode(two.member.news(4.0, Pose(1.0, 0.0, 0.0), finished=False)))
    one.member.hear(new, 4.0)
    place_then = one.member.others()["two"]
    one.member.hear(old, 4.0)
    assert one.member.others()["two"] == place_then
    restarted = Member("two", CONFIG, lambda: two.chart, radius=0.2, life=1)
    one.member.hear(restarted.news(5.0, Pose(), finished=False), 5.0)
    assert "two" not in one.member.frames  # its map frame is another one now


def is_joined(one: Robot, two: Robot) -> bool:
    """Whether one has laid the other's map where it belongs."""
    pose = one.member.frames.get(two.member.name)
    true = START[one.member.name].to(START[two.member.name])
    return pose is not None and pose.distance(true) < 0.05


def test_after_a_minute_without_network_robots_go_on_together() -> None:
    one, two = team()
    for stamp in np.arange(2.0, 62.0, 2.0).tolist():  # each for itself
        one.tell(stamp)
        two.tell(stamp)
    assert one.member.is_lost("two")
    assert one.member.company() == []
    one.tell(64.0, two)
    two.tell(64.0, one)
    assert not one.member.is_lost("two")
    assert is_joined(one, two)
    assert is_joined(two, one)
    assert len(one.member.company()) == 1


def test_a_robot_that_comes_late_or_begins_anew_is_joined() -> None:
    one, two = team()
    three = robot("three", irregular(1), LEFT, 0)
    for stamp in (100.0, 102.0):
        three.tell(stamp, one, two)
        one.tell(stamp, three)
    one.member.look(103.0)
    three.member.look(103.0)
    assert is_joined(one, three)
    assert is_joined(three, one)
    again = robot("two", irregular(1), RIGHT, 14)
    again.member = Member("two", CONFIG, lambda: again.chart, radius=0.2, life=1)
    again.tell(120.0, one)
    assert "two" not in one.member.frames
    one.member.look(121.0)
    assert is_joined(one, again)


def test_company_is_where_the_newest_course_says_and_leads_along_it() -> None:
    one, two = team()
    map_base, track = Pose(2.0, 1.0, 0.3), np.array([[2.0, 1.0], [3.0, 1.3]])
    two.steer(2.0, one, map_base, track)
    (companion,) = one.member.company()
    true = START["one"].inverse().compose(START["two"])
    assert companion.pose.distance(true.compose(map_base)) < 0.05
    assert np.abs(companion.course[0] - true.transform(track[0])).max() < 0.05
    assert not companion.goes_first
    assert companion.radius == RADIUS["two"]
    one.steer(2.0, two, Pose(), np.zeros((0, 2)))
    assert [other.goes_first for other in two.member.company()] == [True]


def test_who_drives_and_falls_silent_is_not_believed_to_be_there_for_long() -> None:
    one, two = team()
    two.steer(2.0, one, Pose(1.0, 0.0, 0.0), np.zeros((0, 2)))
    two.tell(2.0, one, at=Pose(1.0, 0.0, 0.0))
    assert len(one.member.company()) == 1
    one.tell(4.0)
    assert one.member.company() == []
    two.tell(5.0, one, at=Pose(1.0, 0.0, 0.0))  # it stands there
    one.tell(9.0)
    assert len(one.member.company()) == 1
    two.tell(10.0, one, finished=True, at=Pose(1.0, 0.0, 0.0))
    assert [other.is_silent for other in one.member.company()] == [False]
    one.tell(100.0)
    assert [other.is_silent for other in one.member.company()] == [True]


def test_strangers_are_those_whose_map_lies_nobody_knows_where() -> None:
    one, two = team()
    three = robot("three", irregular(1), LEFT, 0)
    three.tell(2.0, one)
    assert one.member.strangers() == [RADIUS["three"]]
    assert three.member.strangers() == []  # it has heard nobody yet
    one.tell(200.0, three)
    assert one.member.strangers() == []  # who is not heard any more is no part of the team
    assert two.member.strangers() == []


def test_an_old_course_changes_nothing() -> None:
    one, two = team()
    old = two.member.course(3.0, Pose(5.0, 5.0, 0.0), np.zeros((0, 2)))
    two.steer(3.2, one, Pose(1.0, 0.0, 0.0), np.zeros((0, 2)))
    there = one.member.company()[0].pose
    one.member.hear(old, 3.3)
    assert one.member.company()[0].pose == there


def test_a_huge_number_told_in_its_name_silences_no_robot_for_good() -> None:
    one, two = team()
    news = two.member.news(2.0, Pose(), finished=False)
    one.member.hear(msgspec.structs.replace(news, sequence=2**62), 2.0)
    course = two.member.course(2.0, Pose(), np.zeros((0, 2)))
    one.member.hear(msgspec.structs.replace(course, sequence=2**62), 2.0)
    late = 2.0 + CONFIG.lost_after_s
    two.tell(late - 0.1, one, at=Pose(2.0, 0.0, 0.0))
    two.steer(late - 0.1, one, Pose(2.5, 0.0, 0.0), np.zeros((0, 2)))
    before = one.member.others()["two"]
    two.tell(late + 0.1, one, at=Pose(3.0, 0.0, 0.0))
    two.steer(late + 0.2, one, Pose(4.0, 0.0, 0.0), np.zeros((0, 2)))
    assert not one.member.is_lost("two")
    assert one.member.others()["two"].distance(before) == pytest.approx(4.0)
    two.tell(late + 2.0, one, at=Pose(5.0, 0.0, 0.0))
    assert one.member.others()["two"].distance(before) == pytest.approx(5.0)


def given_up(chart: Chart) -> Chart:
    """The chart of a robot to which every frontier is blocked."""
    vertices = {
        key: replace(
            vertex,
            departures=tuple(replace(d, blocked=d.edge is None) for d in vertex.departures),
        )
        for key, vertex in chart.vertices.items()
    }
    return replace(chart, vertices=vertices)


def test_two_that_have_given_up_do_not_wait_for_each_other() -> None:
    one, two = team()
    for part in (one, two):
        part.chart = part.member._chart = given_up(part.chart)
    one.member._own_chart = lambda: one.chart
    two.member._own_chart = lambda: two.chart
    two.tell(2.0, one, at=Pose(1.0, 0.0, 0.0))  # it drives, and may find another way
    assert one.outlook() == (None, True, False)
    two.choose()
    two.tell(4.0, one, at=Pose(1.0, 0.0, 0.0))
    assert one.outlook() == (None, False, True)
    nobody_s = one.auction.unfollowed  # nobody knows the edges of these, and all were given up
    assert nobody_s
    for end in nobody_s:
        departures = one.chart.vertices[end.vertex].departures
        assert [d.blocked for d in departures if d.key == end.key] == [True]


def test_who_only_stops_to_think_is_waited_for_but_not_for_ever() -> None:
    """It is on its way to nothing for a moment, though there is something left."""
    one, two = team()
    one.chart = one.member._chart = given_up(one.chart)
    one.member._own_chart = lambda: one.chart
    for stamp in np.arange(2.0, 30.0, 2.0):
        two.tell(stamp, one)
        assert one.outlook() == (None, True, False)
    two.tell(62.0, one)
    assert one.outlook() == (None, False, True)


def all_followed(chart: Chart) -> Chart:
    """The chart of a robot for which there is no frontier."""
    vertices = {
        key: replace(vertex, departures=tuple(d for d in vertex.departures if d.edge is not None))
        for key, vertex in chart.vertices.items()
    }
    return replace(chart, vertices=vertices)


def test_who_has_nothing_left_waits_while_another_one_drives_and_may_want_to_pass() -> None:
    one, two = team()
    for part in (one, two):
        part.chart = part.member._chart = all_followed(part.chart)
    one.member._own_chart = lambda: one.chart
    two.member._own_chart = lambda: two.chart
    two.tell(2.0, one, at=Pose(1.0, 0.0, 0.0))
    assert one.outlook() == (None, True, False)
    two.tell(4.0, one, at=Pose(1.0, 0.0, 0.0), finished=True)
    assert one.outlook() == (None, False, True)


def pass_by(one: Robot, two: Robot, off: float = 0.0, since: float = 0.0) -> None:
    """Let two pass each other at (13, 6), world frame.

    Each sees the other come, `off` metres to its right, and hears where it says it is.
    """
    one.tell(since, two)
    two.tell(since, one)
    for t in np.arange(0.0, 12.0, 0.4).tolist():
        places = {"one": Pose(10.0 + 0.4 * t, 5.8, 0.0), "two": Pose(17.0 - 0.4 * t, 6.3, np.pi)}
        for here, there, side in ((one, two, -off), (two, one, off)):
            start, place = START[here.member.name], places[there.member.name].position
            x, y = start.inverse().transform(np.add(place, (0.0, side)))
            body = np.array([[x, y, RADIUS[there.member.name]]])
            map_base = start.to(places[here.member.name])
            seen = BodiesSeen(since + t, map_base, body)
            here.steer(since + t + 0.1, there, map_base, np.zeros((0, 2)), seen)


def passed(one: Robot, two: Robot, off: float = 0.0, since: float = 0.0) -> float:
    """How far off, m, the frames are of two that pass each other there, by what they saw.

    KeyError if they do not find out.
    """
    pass_by(one, two, off, since)
    worst = 0.0
    for here in (one, two):
        by_sight = [c for c in here.member.due(since + 12.0) if c.by_sight is not None]
        for comparison in by_sight:
            here.member.settle(comparison, comparison.made())
    for here, there in ((one, two), (two, one)):
        found = here.member.frames[there.member.name]
        true = START[here.member.name].to(START[there.member.name])
        middle = START[there.member.name].inverse().transform(np.array([13.0, 6.0]))
        worst = max(worst, math.dist(found.transform(middle), true.transform(middle)))
        assert [met.robot for met in here.member.met] == [there.member.name]
    return worst


def test_maps_are_not_compared_while_somebody_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes up to seconds, in which a robot would be deaf."""
    monkeypatch.setattr("gvgbot.team.member.refined", pytest.fail)
    monkeypatch.setattr("gvgbot.team.member.align", pytest.fail)
    grid = lattice(6.0 * np.arange(5), 6.0 * np.arange(4))
    one, two = robot("one", grid, {5, 6, 7}, 5), robot("two", grid, {8, 9}, 9)
    pass_by(one, two)
    assert not one.member.frames
    (comparison,) = one.member.due(12.0)
    assert comparison.by_sight is not None
    true = START["one"].to(START["two"])
    assert comparison.by_sight.pose.distance(true) < 0.1


def test_robots_that_pass_each_other_find_their_frames_where_maps_tell_nothing() -> None:
    """In a grid of equal corridors."""
    grid = lattice(6.0 * np.arange(5), 6.0 * np.arange(4))
    one, two = robot("one", grid, {5, 6, 7}, 5), robot("two", grid, {8, 9}, 9)
    assert passed(one, two) < 0.02
    one.member.look(20.0)
    assert one.member.frames, "equal corridors do not speak against it"


def test_robots_that_pass_each_other_lay_what_both_know_on_each_other_at_once() -> None:
    grid = lattice(6.0 * np.arange(5), 6.0 * np.arange(4))
    one, two = robot("one", grid, {5, 6, 7}, 5), robot("two", grid, {7, 8, 9}, 9)
    assert passed(one, two, off=0.15) < 0.02


def test_where_maps_speak_against_it_robots_have_to_pass_each_other_twice() -> None:
    """As behind glass, which one of them has looked through."""
    one, two = robot("one", irregular(1), LEFT, 0), robot("two", irregular(12), RIGHT, 14)
    with pytest.raises(KeyError):
        passed(one, two)
    assert not one.member.frames
    assert passed(one, two, since=40.0) < 0.02


def misled(one: Robot, two: Robot, pairs: tuple[tuple[int, int], ...] = ()) -> None:
    """Let either believe that the other's frame lies elsewhere."""
    for here, there in ((one, two), (two, one)):
        true = START[here.member.name].to(START[there.member.name])
        wrong = Alignment(true.compose(Pose(3.0, -2.0, 0.4)), np.eye(3) * 1e-4, pairs, 0.999)
        here.member._mates[there.member.name].alignment = wrong


def test_a_frame_that_two_meetings_contradict_gives_way_to_theirs() -> None:
    grid = lattice(6.0 * np.arange(5), 6.0 * np.arange(4))
    one, two = robot("one", grid, {5, 6, 7}, 5), robot("two", grid, {8, 9}, 9)
    one.tell(0.0, two)
    two.tell(0.0, one)
    misled(one, two)
    wrong = one.member.frames["two"]
    with pytest.raises(AssertionError):
        passed(one, two)
    assert one.member.frames["two"] == wrong, "a third robot may have moved in the same way"
    assert passed(one, two, since=40.0) < 0.02


@pytest.mark.parametrize("pairs", [(), ((0, 0),)])
def test_meetings_that_maps_speak_against_void_only_what_no_map_bears_out(
    pairs: tuple[tuple[int, int], ...],
) -> None:
    one, two = robot("one", irregular(1), LEFT, 0), robot("two", irregular(12), RIGHT, 14)
    one.tell(0.0, two)
    two.tell(0.0, one)
    misled(one, two, pairs)
    for since in (0.0, 40.0):
        with pytest.raises((AssertionError, KeyError)):
            passed(one, two, since=since)
    two.tell(60.0, one)
    assert ("two" in one.member.frames) == bool(pairs)


def test_a_body_where_a_robot_says_that_it_is_can_be_nobody_else() -> None:
    one, two = team()
    there = Pose(4.0, 1.0, 0.0)
    two.steer(2.0, one, there, np.zeros((0, 2)))
    own = one.member.frames["two"].compose(there).position
    bodies = np.array([[*own, 0.5], [*(own + 1.0), 0.5]])
    told = one.member.course(2.1, Pose(), np.zeros((0, 2)), BodiesSeen(2.05, Pose(), bodies)).look
    assert told is not None
    assert told.bodies == (tuple(bodies[1].tolist()),)


def test_what_was_seen_long_ago_is_not_told_and_nothing_twice() -> None:
    one = robot("one", irregular(1), LEFT, 0).member
    seen = BodiesSeen(5.0, Pose(), np.array([[1.0, 2.0, 0.2]]))
    assert one.course(90.0, Pose(), np.zeros((0, 2)), seen).look is None
    seen = replace(seen, stamp=89.5)
    first = one.course(90.0, Pose(), np.zeros((0, 2)), seen).look
    assert first is not None
    assert first.age == 0.5
    assert one.course(90.2, Pose(), np.zeros((0, 2)), seen).look is None
    seen = replace(seen, stamp=91.0)
    assert one.course(200.0, Pose(), np.zeros((0, 2)), seen).look is None


def test_who_hears_that_its_frame_was_found_knows_the_other_ones() -> None:
    building = irregular(1)
    one, two = robot("one", building, LEFT, 0), robot("two", building, RIGHT, 14)
    one.tell(0.0, two)
    two.tell(0.0, one)
    one.member.look(1.0)
    one.tell(2.0, two)
    true, found = START["two"].to(START["one"]), two.member.frames["one"]
    middle = START["one"].inverse().transform(np.array([6.0, 2.0]))
    assert np.hypot(*(found.transform(middle) - true.transform(middle))) < 0.1


def test_frames_are_known_over_others_whichever_of_two_has_found_the_other() -> None:
    """Two knows one, and three has found two, which has not found it."""
    three = robot("three", irregular(2), LEFT, 0)
    one, two = team()
    two.tell(2.0, three)
    settle(three, "two")
    for _ in range(2):
        three.tell(2.0, one, two)
        two.tell(2.0, one, three)
    for who in (one, two):
        true = START[who.member.name].to(START["three"])
        found = who.member.frames["three"]
        middle = START["three"].inverse().transform(np.array([6.0, 2.0]))
        assert np.hypot(*(found.transform(middle) - true.transform(middle))) < 0.1


def test_where_a_robot_was_before_it_began_anew_says_nothing_of_its_new_map() -> None:
    one, _ = team()
    three = robot("three", irregular(1), LEFT, 0)
    three.tell(2.0, one)
    one.tell(2.0, three)
    three.member.look(3.0)
    again = robot("two", irregular(1), RIGHT, 14)
    again.member = Member("two", CONFIG, lambda: again.chart, radius=0.2, life=1)
    again.tell(4.0, three)
    one.tell(4.0, again, three)  # who has not heard yet that it began anew
    assert again.member.frames == {}
    assert "two" not in three.member.frames
    again.tell(6.0, one)
    one.member.look(20.0)
    one.tell(20.0, again, three)
    assert is_joined(again, one)
    assert is_joined(three, again)
