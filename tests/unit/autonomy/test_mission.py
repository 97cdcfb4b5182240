"""What the robot decides in small hand-drawn situations, and how each of them ends."""

import math
from collections.abc import Collection, Sequence
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import cKDTree

from gvgbot.autonomy.control.company import Companion
from gvgbot.autonomy.control.orders import Drive, LookAround, Order, Stand
from gvgbot.autonomy.ending import Surveyed
from gvgbot.autonomy.events import Decision, Event, Finished, Recovery
from gvgbot.autonomy.evidence import MappingConfig
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.exploration.ears import nearest_frontier
from gvgbot.autonomy.exploration.paths import Approach
from gvgbot.autonomy.exploration.sharing import Sharing
from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.mission import Mission
from gvgbot.autonomy.slam.ekf import add_vertex
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId, Vertex
from gvgbot.autonomy.slam.recognition import RecognitionConfig
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.autonomy.views import Correspondence, View
from gvgbot.autonomy.whereabouts import Whereabouts
from gvgbot.geometry import Array, Pose
from tests.unit.autonomy.local_graphs import Point, drawn
from tests.unit.autonomy.sights import Rectangle, carved, looked

CONFIG = ExplorationConfig()
NOTHING_SEEN = LocalMap(LocalMapConfig())


class Narrow(LocalMap):
    """A corridor along x, a metre wide."""

    def tree(self) -> cKDTree:
        x = np.linspace(-4.0, 9.0, 131)
        return cKDTree(np.concatenate([np.stack([x, np.full_like(x, y)], 1) for y in (0.5, -0.5)]))


# A corridor with a tee at x = 3, its branch to the south; all three arms go on unseen.
TEE = drawn(
    {1: (-3.0, 0.0), 2: (3.0, 0.0), 3: (8.0, 0.0), 4: (3.0, -4.0)},
    {10: (1, 2, []), 11: (2, 3, []), 12: (2, 4, [])},
    unseen={1: math.pi, 3: 0.0, 4: -math.pi / 2},
)
PLAIN = drawn({1: (-3.0, 0.0), 3: (8.0, 0.0)}, {10: (1, 3, [])}, unseen={1: math.pi, 3: 0.0})
CLOSED = drawn({1: (-1.0, 0.0), 2: (4.0, 0.0)}, {10: (1, 2, [])})


class Robot:
    """A mission and its mapper, fed with one view after another."""

    def __init__(self) -> None:
        self.mapper = Mapper(MappingConfig(), RecognitionConfig(), ScanMatchingConfig())
        self.mission = Mission(CONFIG, self.mapper)
        self.events: list[Event] = []
        self.stamp = self.travelled = 0.0
        self.pose, self.walls = Pose(), NOTHING_SEEN
        self.somebody = np.empty((0, 2))  # where somebody stands
        self.passing = np.empty((0, 2))  # who has not stood for so long that he stays for certain
        self.field_of_view = -math.pi, math.pi
        self._count = 0

    def look(self, gvg: LocalGvg, *, period: float = 0.5) -> Order:
        """The order after one more view from where the robot is."""
        view = View(
            self._count,
            self.stamp,
            self.travelled,
            self.pose,
            gvg,
            self.walls,
            doubtful=self.somebody,
            passing=self.passing,
            field_of_view=self.field_of_view,
        )
        known, seen = self.mapper.observe(view)
        order, done = self.decide(view, known)
        self.events += [*seen, *done]
        self.stamp, self._count = self.stamp + period, self._count + 1
        return order

    def decide(self, view: View, known: Correspondence) -> tuple[Order, list[Event]]:
        """What it is asked for."""
        return self.mission.advance(view, known)

    def stand(self, gvg: LocalGvg, times: int, *, period: float = 0.5) -> Order:
        """The last order after some views from the same place."""
        return [self.look(gvg, period=period) for _ in range(times)][-1]

    def drive(self, gvg: LocalGvg, *corners: Point) -> Order:
        """The last order on the way along corners, a view every quarter of a metre."""
        order: Order = Stand()
        for (x0, y0), (x1, y1) in pairwise(corners):
            count = max(1, round(math.hypot(x1 - x0, y1 - y0) / 0.25))
            for share in np.arange(1, count + 1) / count:
                x, y = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
                here = Pose(float(x), float(y), math.atan2(y1 - y0, x1 - x0))
                self.travelled += self.pose.distance(here)
                self.mapper.move(self.pose.to(here), np.eye(3) * 1e-6)
                self.pose = here
                order = self.look(gvg)
        return order

    def said(self, kind: type) -> list[Event]:
        return [event for event in self.events if isinstance(event, kind)]


def end_of(order: Order) -> Point:
    assert isinstance(order, Drive)
    x, y = order.track.polyline[-1]
    return float(x), float(y)


def test_before_the_first_vertex_the_robot_drives_on_along_its_edge() -> None:
    order = Robot().look(PLAIN)
    assert end_of(order) == pytest.approx((8.0, 0.0))


def test_as_soon_as_a_vertex_is_known_the_robot_goes_for_a_frontier_of_it() -> None:
    robot = Robot()
    order = robot.stand(TEE, 8)
    (decision,) = robot.said(Decision)
    assert isinstance(decision, Decision)
    target = robot.mission.target
    assert target is not None
    assert decision.vertex == target.vertex
    half = robot.mapper.graph.half_edge(target)
    assert half is not None
    assert half.open
    ahead = {0.0: (8.0, 0.0), -math.pi / 2: (3.0, -4.0), math.pi: (-3.0, 0.0)}
    assert decision.bearing is not None
    bearing = min(ahead, key=lambda b: -math.cos(b - float(decision.bearing or 0.0)))
    assert end_of(order) == pytest.approx(ahead[bearing])


def test_a_target_is_kept_until_it_is_explored() -> None:
    robot = Robot()
    robot.stand(TEE, 8)
    chosen = robot.mission.target
    robot.stand(TEE, 50)
    assert robot.mission.target == chosen
    assert len(robot.said(Decision)) == 1


def test_what_was_in_the_way_of_one_target_is_not_in_the_way_of_the_next() -> None:
    """It is held for most of its patience, then goes elsewhere and still stands for a while."""
    robot, patience_s = Robot(), CONFIG.in_the_way_s
    robot.stand(TEE, 8)
    first = robot.mission.target
    assert first is not None
    until = robot.stamp + 0.8 * patience_s
    while robot.stamp < until:
        robot.mission.hold()
        robot.look(TEE)
    half = robot.mapper.graph.half_edge(first)
    assert half is not None
    half.blocked = True
    robot.stand(TEE, math.ceil(0.5 * patience_s / 0.5))
    assert robot.mission.target != first
    actions = [event.action for event in robot.events if isinstance(event, Recovery)]
    assert "try another way" not in actions


def test_a_map_without_frontiers_is_explored() -> None:
    robot = Robot()
    order: Order = robot.look(CLOSED)
    while robot.mission.outcome is None and robot.stamp < 60.0:
        order = robot.look(CLOSED)
    assert robot.mission.outcome == "explored"
    assert isinstance(order, Stand)
    (end,) = robot.said(Finished)
    assert isinstance(end, Finished)
    assert end.outcome == "explored"
    assert end.reason


def test_a_meetpoint_that_has_become_a_bend_is_no_part_of_an_explored_map() -> None:
    """Its third departure led round somebody who has gone."""
    robot = Robot()
    robot.walls = Narrow(LocalMapConfig())
    robot.stand(CLOSED, 6)
    view = View(0, robot.stamp, 0.0, robot.pose, CLOSED, robot.walls)
    graph, place = robot.mapper.graph, np.array([1.5, 0.0])
    vertex = robot.mapper.add_driven(view, place, 0.0, math.pi, math.pi / 2)
    robot.mapper.part_edge_at(vertex)
    graph.remove_half_edge(HalfEdgeId(vertex.id, 2))
    assert len(graph.edges) == 2
    while robot.mission.outcome is None and robot.stamp < 100.0:
        robot.look(CLOSED)
    assert robot.mission.outcome == "explored"
    (edge,) = graph.edges.values()
    assert edge.length == pytest.approx(5.0, abs=0.01)
    assert vertex.id not in graph.vertices


LONG = drawn({1: (0.0, 0.0), 2: (20.0, 0.0)}, {10: (1, 2, [])})


def test_the_robot_does_not_go_back_for_a_look_at_what_it_knows() -> None:
    """From one dead end it sees the other, too far off to be measured again."""
    robot = Robot()
    robot.stand(LONG, 8)
    robot.drive(LONG, (0.0, 0.0), (20.0, 0.0))
    orders = [robot.look(LONG)]
    while robot.mission.outcome is None and robot.stamp < 100.0:
        orders.append(robot.look(LONG))
    assert robot.mission.outcome == "explored"
    assert not any(isinstance(order, Drive) and order.track.length > 1.0 for order in orders)


def test_what_is_seen_far_off_and_not_known_is_looked_at_before_all_is_called_explored() -> None:
    """A side corridor that was not to be seen in passing."""
    robot = Robot()
    robot.stand(LONG, 8)
    robot.drive(LONG, (0.0, 0.0), (12.0, 0.0))
    with_side = drawn(
        {1: (0.0, 0.0), 2: (20.0, 0.0), 3: (4.0, 0.0), 4: (4.0, 3.0)},
        {10: (1, 3, []), 11: (3, 2, []), 12: (3, 4, [])},
    )
    robot.drive(with_side, (12.0, 0.0), (20.0, 0.0))
    assert end_of(robot.stand(with_side, 2)) == pytest.approx((4.0, 0.0))


def test_without_an_edge_in_sight_the_robot_looks_around_and_then_gives_up() -> None:
    robot = Robot()
    orders = []
    while robot.mission.outcome is None and robot.stamp < 100.0:
        orders.append(robot.look(LocalGvg()))
    assert all(isinstance(order, LookAround) for order in orders[:-1])
    assert robot.mission.outcome == "failed"
    assert robot.stamp == pytest.approx(CONFIG.nothing_in_sight_s, abs=1.5)
    assert len(robot.said(Finished)) == 1


def test_where_another_frontier_comes_whenever_one_is_explored_it_goes_away_in_the_end() -> None:
    """A departure that is seen now and not then, at a threshold of sight."""
    robot = Robot()
    while robot.mission.outcome is None and robot.stamp < 10_000.0:
        robot.look(TEE)
        target = robot.mission.target
        if target is not None:
            vertex = robot.mapper.graph.vertices[target.vertex]
            bearing = vertex.half_edges[target.key].bearing
            robot.mapper.graph.remove_half_edge(target)
            vertex.add_half_edge(bearing)
    assert robot.mission.outcome == "explored_with_blocked"
    given_up = [e.reason for e in robot.said(Recovery) if isinstance(e, Recovery)]
    assert "whenever it is explored there is another one" in given_up


def test_frontiers_that_come_and_go_but_lead_nowhere_new_are_given_up_in_the_end() -> None:
    """Whenever one is chosen it is another one's turn to be seen, at a place of its own."""
    robot = Robot()
    robot.stand(TEE, 8)
    graph = robot.mapper.graph
    (tee,) = graph.vertices.values()
    for i in range(4000):
        if robot.mission.outcome is not None:
            break
        x, y = (-2.0, 2.0)[i // 40 % 2], 0.0
        robot.drive(TEE, (robot.pose.x, robot.pose.y), (x, y))
        if robot.mission.target is not None and i % 40 == 0:
            bearing = tee.half_edges[robot.mission.target.key].bearing
            graph.remove_half_edge(robot.mission.target)
            tee.add_half_edge(bearing)
            robot.mission._progress._attempts._places.clear()
    assert robot.mission.outcome == "explored_with_blocked"
    given_up = [e.action for e in robot.said(Recovery) if isinstance(e, Recovery)]
    assert "give all frontiers up" in given_up


def test_a_robot_that_goes_to_and_fro_and_never_knows_a_vertex_ends_all_the_same() -> None:
    """Nothing there is a frontier that could be given up. Who drives on is in no survey."""
    robot, asked = Robot(), list[float]()

    def survey() -> Surveyed | None:
        asked.append(robot.travelled)
        is_there = asked[-2:] == [robot.travelled] * 2
        return Surveyed(np.array([[5.0, 5.0]]), np.empty((0, 2))) if is_there else None

    robot.mission.survey = survey
    while not robot.said(Finished):
        assert robot.stamp < 3000.0
        order = robot.look(PLAIN, period=2.0)
        if isinstance(order, Drive):
            to = -2.0 if robot.pose.x > 2.0 else 7.0
            robot.mapper.move(robot.pose.to(Pose(to)), np.eye(3) * 1e-6)
            robot.travelled, robot.pose = robot.travelled + 9.0, Pose(to)
    assert robot.mission.outcome == "failed"


def test_who_has_a_map_and_sees_no_edge_any_more_has_not_failed() -> None:
    """Stuck in a narrow door, for instance: what it has mapped is there all the same."""
    robot = Robot()
    robot.stand(TEE, 8)
    while robot.mission.outcome is None and robot.stamp < 100.0:
        robot.look(LocalGvg())
    assert robot.mission.outcome == "explored_with_blocked"
    assert robot.mission.reason == "frontiers left: 3; no edge in sight"


def test_who_sees_no_edge_any_more_goes_back_to_where_it_saw_some() -> None:
    """It has come into a gap that it just fits into, which looks too narrow from within."""
    robot = Robot()
    robot.stand(TEE, 8)
    robot.drive(TEE, (0.0, 0.0), (3.0, 0.0), (3.0, -3.0))
    order: Order = Stand()
    while not isinstance(order, Drive) and robot.stamp < 100.0:
        order = robot.look(LocalGvg())
    assert end_of(order) == pytest.approx((3.0, 0.0), abs=0.8)  # a little beyond the vertex
    robot.drive(TEE, (3.0, -3.0), (3.0, 0.0))
    assert robot.mission.outcome is None
    assert isinstance(robot.look(TEE), Drive)


NONE = np.empty((0, 2))
NO_EDGE = "failed", "no edge in sight: there are no walls within range, or no way out"


@pytest.mark.parametrize(
    ("surveyed", "end"),
    [
        (Surveyed(NONE, NONE), ("explored", "a space without edges, and no way out")),
        (Surveyed(np.array([[5.0, 5.0]]), NONE), NO_EDGE),
        (Surveyed(NONE, NONE, is_walled=False), NO_EDGE),
    ],
    ids=["a round room", "a hall", "a field"],
)
def test_without_an_edge_it_ends_by_what_the_survey_tells(
    surveyed: Surveyed, end: tuple[str, str]
) -> None:
    """Which takes a moment. In a closed room it need not look for an edge from elsewhere."""
    robot, told = Robot(), [None, None, surveyed]
    robot.mission.survey = lambda: told.pop(0) if len(told) > 1 else told[0]
    while robot.mission.outcome is None and robot.stamp < 100.0:
        robot.look(LocalGvg())
    assert (robot.mission.outcome, robot.mission.reason) == end
    assert len(told) == 1
    assert (robot.stamp < 5.0) == (end != NO_EDGE)


def test_the_end_of_an_edge_that_was_none_is_forgotten_in_a_round_room() -> None:
    robot, nothing = Robot(), np.empty((0, 2))
    robot.mission.survey = lambda: Surveyed(nothing, nothing)
    robot.stand(drawn({1: (0.3, 0.0), 2: (3.0, 0.0)}, {10: (1, 2, [])}, unseen={2: 0.0}), 10)
    assert len(robot.mapper.graph.frontiers()) == 1
    while robot.mission.outcome is None and robot.stamp < 100.0:
        robot.look(LocalGvg())
    assert robot.mission.outcome == "explored"
    assert not robot.mapper.graph.vertices


def test_an_outage_costs_no_patience() -> None:
    """As if the robot had been asleep: it searches for as long as it would have without."""
    robot, outage = Robot(), 300.0
    robot.stand(LocalGvg(), 10)
    robot.stamp += outage
    robot.mission.skip(outage)
    while robot.mission.outcome is None and robot.stamp < 1000.0:
        robot.look(LocalGvg())
    assert robot.stamp == pytest.approx(outage + CONFIG.nothing_in_sight_s, abs=1.5)


def test_an_edge_that_comes_back_into_sight_in_time_ends_the_search() -> None:
    robot = Robot()
    robot.stand(LocalGvg(), 20)
    assert isinstance(robot.look(PLAIN), Drive)
    robot.stand(LocalGvg(), 20)
    assert robot.mission.outcome is None


def test_the_end_of_sight_is_looked_around_at_twice_before_a_frontier_is_given_up() -> None:
    """The robot stands at the eastern end of sight and nothing more comes into view."""
    robot = Robot()
    robot.stand(TEE, 8)
    (vertex,) = robot.mapper.graph.vertices.values()
    half = vertex.half_edges
    east = next(key for key, h in half.items() if math.cos(h.bearing) > 0.9)
    robot.mission.target = HalfEdgeId(vertex.id, east)
    robot.drive(TEE, (0.0, 0.0), (8.0, 0.0))
    robot.stand(TEE, 40)
    looks = [
        e for e in robot.said(Recovery) if isinstance(e, Recovery) and e.action == "look around"
    ]
    gave_up = [e for e in robot.said(Recovery) if isinstance(e, Recovery) and "give up" in e.action]
    assert len(looks) == 2
    assert len(gave_up) == 1
    assert half[east].blocked
    assert robot.mission.outcome is None  # there are others
    assert robot.mission.target is not None
    assert robot.mission.target.key != east


@pytest.mark.parametrize(("away", "tries"), [(2.0, 1 + CONFIG.retries), (5.0, 2)])
def test_a_frontier_is_tried_more_often_where_somebody_stands_who_may_go(
    away: float, tries: int
) -> None:
    """Whenever it is tried, nothing more comes into view at the end of sight."""
    robot = Robot()
    robot.stand(TEE, 8)
    graph = robot.mapper.graph
    (vertex,) = graph.vertices.values()
    halves = vertex.half_edges
    east = next(key for key, half in halves.items() if math.cos(half.bearing) > 0.9)
    robot.drive(TEE, (0.0, 0.0), (8.0, 0.0))
    robot.passing = np.array([(8.0, away)])
    tried, is_opened = 0, True
    while is_opened:
        robot.mission.target = HalfEdgeId(vertex.id, east)
        while not halves[east].blocked:
            robot.look(TEE)
        tried += 1
        later = robot.stamp + 2 * CONFIG.retry_after_s
        is_opened = robot.mission._obstructions.open(graph, later)
    assert tried == tries


@pytest.mark.parametrize(("away", "ends"), [(2.0, False), (5.0, True)])
def test_who_knows_no_vertex_does_not_give_up_while_somebody_is_there_who_may_go(
    away: float, *, ends: bool
) -> None:
    robot = Robot()
    robot.passing = np.array([(0.0, away)])
    while robot.mission.outcome is None and robot.stamp < 2.5 * CONFIG.patience_s:
        robot.look(PLAIN)
    assert (robot.mission.outcome is not None) == ends
    robot.passing = np.empty((0, 2))
    while robot.mission.outcome is None and robot.stamp < 5 * CONFIG.patience_s:
        robot.look(PLAIN)
    assert robot.mission.outcome == "failed"


def test_an_edge_that_is_not_to_be_seen_from_its_vertex_is_closed_and_not_what_lies_beyond() -> (
    None
):
    """From the tee another street is said to lead to a frontier in the north-east."""
    robot = Robot()
    robot.stand(TEE, 8)
    graph = robot.mapper.graph
    (tee,) = graph.vertices.values()
    beyond, end = (Vertex(graph.next_id(), 1.0, Pose(x, 6.0), 0.0, 0.0) for x in (9.0, 12.0))
    for vertex in (beyond, end):
        graph.vertices[vertex.id] = vertex
        robot.mapper.belief = add_vertex(
            robot.mapper.belief, vertex.id, vertex.local, np.diag([1e-4, 1e-4, 1e-4])
        )
    for (a, out), (b, back) in (((tee, 0.8), (beyond, -2.3)), ((beyond, 0.0), (end, math.pi))):
        ways = HalfEdgeId(a.id, a.add_half_edge(out)), HalfEdgeId(b.id, b.add_half_edge(back))
        graph.join(*ways, np.array([[0.0, 0.0], [3.0, 0.0]]), 1.0, driven=True)
    robot.mission.target = HalfEdgeId(beyond.id, beyond.add_half_edge(0.8))
    robot.drive(TEE, (0.0, 0.0), (3.0, 0.0))
    robot.stand(TEE, 40)
    (tried,) = [e for e in robot.said(Recovery) if isinstance(e, Recovery) and "way" in e.action]
    assert tried.reason == "the way on is not to be seen"
    assert [half.blocked for half in tee.half_edges.values()] == [False, False, False, True]
    assert [half.blocked for half in beyond.half_edges.values()] == [True, False, False]
    assert robot.mission.target is not None
    assert robot.mission.target.vertex == tee.id


@pytest.mark.parametrize(
    ("unseen", "outcome"),
    [(np.empty((0, 2)), "explored"), (np.array([[2.0, 1.0]]), "failed")],
    ids=["closed", "open"],
)
def test_a_room_without_a_vertex_is_explored_when_all_of_it_is_seen(
    unseen: Array, outcome: str
) -> None:
    """The middle of a round or square room, of which an edge is no longer than an error."""
    middle = drawn({1: (-0.05, 0.0), 2: (0.05, 0.0)}, {10: (1, 2, [])}, unseen={1: 2.0, 2: -1.0})
    robot = Robot()
    robot.mission.survey = lambda: Surveyed(unseen, np.empty((0, 2)))
    robot.stand(middle, 100)
    assert not robot.mapper.graph.vertices
    assert robot.mission.outcome == outcome


@pytest.mark.parametrize(
    ("unseen", "outcome"),
    [(np.empty((0, 2)), "explored"), (np.array([[2.0, 1.0]]), "explored_with_blocked")],
    ids=["closed", "open"],
)
def test_an_end_that_is_none_from_nearer_leaves_a_room_without_edges(
    unseen: Array, outcome: str
) -> None:
    """Of a room a little longer than wide, the far end of the middle line was not in sight."""
    from_afar = drawn({1: (1.0, 0.0), 2: (3.0, 0.0)}, {10: (1, 2, [])}, unseen={2: 0.0})
    middle = drawn({1: (1.0, 0.0), 2: (1.6, 0.0)}, {10: (1, 2, [])}, unseen={1: 2.0, 2: -1.0})
    robot = Robot()
    robot.mission.survey = lambda: Surveyed(unseen, np.empty((0, 2)))
    robot.stand(from_afar, 10)
    assert len(robot.mapper.graph.vertices) == 1
    robot.drive(middle, (0.0, 0.0), (1.6, 0.0))
    while robot.mission.outcome is None and robot.stamp < 1000.0:
        robot.look(middle)
    assert robot.mission.outcome == outcome
    assert len(robot.mapper.graph.vertices) == len(unseen)


@pytest.mark.parametrize(
    ("is_whole", "outcome", "left"),
    [(True, "explored", []), (False, "explored_with_blocked", ["meetpoint"])],
)
def test_a_departure_into_a_wall_is_none_in_the_end_if_the_map_lacks_nothing(
    *, is_whole: bool, outcome: str, left: list[str]
) -> None:
    """Somebody who stood in a corridor made it; it is given up, and an edge passes there."""
    none = np.empty((0, 2))
    robot = Robot()
    robot.mission.survey = lambda: Surveyed(none, none, is_whole=is_whole)
    made_up = drawn(
        {1: (-1.0, 0.0), 2: (1.5, 0.0), 3: (4.0, 0.0), 4: (1.5, -1.0)},
        {10: (1, 2, []), 11: (2, 3, []), 12: (2, 4, [])},
        unseen={4: -math.pi / 2},
    )
    robot.stand(made_up, 20)
    (frontier,) = robot.mapper.graph.frontiers()
    robot.mapper.graph.vertices[frontier.vertex].half_edges[frontier.key].blocked = True
    while robot.mission.outcome is None and robot.stamp < 300.0:
        robot.look(made_up)
    vertices = robot.mapper.graph.vertices.values()
    assert robot.mission.outcome == outcome
    assert [vertex.kind for vertex in vertices if vertex.kind != "endpoint"] == left
    assert len(robot.mapper.graph.edges) == 1 + len(left)


def test_what_nothing_leads_to_is_not_left_in_the_map() -> None:
    """The rest of a way through a gap, which is too narrow to be seen from beyond it."""
    corridor = {1: (-2.0, 0.0), 2: (4.0, 0.0), 3: (0.0, 4.0), 4: (1.2, 4.0)}
    robot, seen = Robot(), drawn(corridor, {10: (1, 2, []), 11: (3, 4, [])})
    robot.stand(seen, 6)
    assert len(robot.mapper.graph.vertices) == 4
    while robot.mission.outcome is None and robot.stamp < 300.0:
        robot.look(seen)
    assert robot.mission.outcome == "explored"
    assert len(robot.mapper.graph.vertices) == 2


SLOT: Rectangle = (-0.3, -0.23, 1.0, 0.23)
HALL: Rectangle = (1.0, -3.0, 4.0, 3.0)
IN_SLOT = drawn({1: (-0.1, 0.0), 2: (0.6, 0.0)}, {10: (1, 2, [])})


def in_a_slot(*free: Rectangle, is_beside_floor: bool) -> Robot:
    """A robot that sees only the edge in its slot, and what is free."""
    robot = Robot()
    robot.walls = looked(carved(list(free)), [robot.pose])
    places = np.array([[2.0, 1.0]])
    robot.mission.survey = lambda: Surveyed(
        places, np.empty((0, 2)), is_beside_floor=is_beside_floor
    )
    return robot


@pytest.mark.parametrize("is_beside_floor", [False, True])
def test_an_edge_in_a_slot_is_not_all_there_is_if_floor_is_in_sight(
    *, is_beside_floor: bool
) -> None:
    robot = in_a_slot(SLOT, is_beside_floor=is_beside_floor)
    while robot.mission.outcome is None and robot.stamp < 300.0:
        robot.look(IN_SLOT)
    assert robot.mission.outcome == ("failed" if is_beside_floor else "explored")


def test_who_knows_only_the_slot_it_is_in_drives_out_and_begins_anew() -> None:
    robot = in_a_slot(SLOT, HALL, is_beside_floor=True)
    order = robot.look(IN_SLOT)
    while not isinstance(order, Drive) or end_of(order)[0] < 1.2:
        assert robot.mission.outcome is None
        order = robot.look(IN_SLOT)
    assert len(robot.mapper.graph.vertices) == 2
    robot.drive(IN_SLOT, (0.0, 0.0), end_of(order))
    hall = drawn({1: (2.5, -2.0), 2: (2.5, 2.0)}, {10: (1, 2, [])}, unseen={1: -1.6, 2: 1.6})
    assert isinstance(robot.stand(hall, 2), Drive)
    assert not robot.mapper.graph.vertices


def test_who_is_asked_to_explore_tries_to_leave_a_slot_however_often_that_was_in_vain() -> None:
    """Somebody may have freed it; it has stood there all the time before."""
    robot = in_a_slot(SLOT, HALL, is_beside_floor=True)
    for _ in range(5):
        order: Order = Stand()
        while not isinstance(order, Drive) or end_of(order)[0] < 1.2:
            assert robot.mission.outcome is None
            order = robot.look(IN_SLOT)
        while robot.mission.outcome is None:
            robot.look(IN_SLOT)
        robot.mission.reopen()


def test_who_has_lost_sight_of_all_that_is_known_goes_back_over_the_way_it_came() -> None:
    """Five metres past the tee, nothing but a stretch that leads away from there is in sight."""
    elsewhere = drawn({5: (8.0, 0.0), 6: (9.0, 1.0)}, {20: (5, 6, [])}, unseen={5: 2.0, 6: 0.8})
    robot = Robot()
    robot.stand(TEE, 8)
    (vertex,) = robot.mapper.graph.vertices.values()
    east, _, south = sorted(
        vertex.half_edges, key=lambda key: vertex.half_edges[key].bearing % math.tau
    )
    robot.mission.target = HalfEdgeId(vertex.id, east)
    robot.drive(TEE, (0.0, 0.0), (8.0, 0.0))
    robot.mission.target = HalfEdgeId(vertex.id, south)
    robot.drive(elsewhere, (8.0, 0.0), (9.0, 1.0), (8.0, 0.0))
    while robot.stamp < 200.0 and not any("go back" in str(e) for e in robot.said(Recovery)):
        robot.stand(elsewhere, 1)
    assert math.dist(end_of(robot.look(elsewhere)), (3.0, 0.0)) < 0.5
    robot.drive(elsewhere, (8.0, 0.0), (4.0, 0.0))
    assert end_of(robot.look(TEE)) == (3.0, -4.0)
    assert vertex.half_edges[south].open


def test_what_hangs_together_with_nothing_is_forgotten_and_not_called_blocked() -> None:
    """Seen through a pane, say: no edge leads to the vertex whose frontier the robot is after."""
    with_end = drawn(
        {1: (-3.0, 0.0), 2: (3.0, 0.0), 3: (8.0, 0.0), 4: (3.0, -4.0)},
        {10: (1, 2, []), 11: (2, 3, []), 12: (2, 4, [])},
        unseen={3: 0.0, 4: -math.pi / 2},
    )
    robot = Robot()
    robot.stand(with_end, 30)
    graph = robot.mapper.graph
    stray = Vertex(graph.next_id(), 1.0, Pose(50.0), 0.0, 0.0)
    robot.mission.target = HalfEdgeId(stray.id, stray.add_half_edge(0.0))
    graph.vertices[stray.id] = stray
    robot.mapper.belief = add_vertex(
        robot.mapper.belief, stray.id, Pose(50.0), np.diag([1e-4, 1e-4, 1e-4])
    )
    while robot.stamp < CONFIG.patience_s + 30.0:
        robot.drive(with_end, (-3.0, 0.0), (2.5, 0.0), (-3.0, 0.0))
    assert stray.id not in graph.vertices
    assert not graph.blocked()
    assert robot.mission.target in graph.frontiers()


def far_from_all_that_is_known() -> Robot:
    robot = Robot()
    join_out_of_reach(robot)
    return robot


def join_out_of_reach(robot: Robot) -> None:
    """Two vertices behind the robot, beyond its corridor, that are joined to each other only."""
    graph = robot.mapper.graph
    beyond = [Vertex(graph.next_id(), 1.0, Pose(x), 0.0, 0.0) for x in (-7.0, -9.0)]
    for vertex in beyond:
        graph.vertices[vertex.id] = vertex
        robot.mapper.belief = add_vertex(
            robot.mapper.belief, vertex.id, vertex.local, np.diag([1e-4, 1e-4, 1e-4])
        )
    ends = [HalfEdgeId(vertex.id, vertex.add_half_edge(math.pi)) for vertex in beyond]
    graph.join(ends[0], ends[1], np.array([[0.0, 0.0], [-2.0, 0.0]]), 1.0, driven=True)
    beyond[1].add_half_edge(math.pi)


def test_the_robot_goes_near_what_no_known_way_leads_to_before_it_gives_that_up() -> None:
    robot = far_from_all_that_is_known()
    robot.stand(CLOSED, 40)
    assert end_of(robot.look(CLOSED)) == pytest.approx((-1.0, 0.0))
    robot.drive(CLOSED, (0.0, 0.0), (-0.9, 0.0))
    while robot.mission.outcome is None and robot.stamp < 5 * CONFIG.patience_s:
        robot.look(CLOSED)
    assert robot.mission.outcome == "explored_with_blocked"


def test_who_looks_for_a_way_where_hardly_anything_is_in_sight_looks_around_twice() -> None:
    """Then the frontier is given up, and tried once more, as one that a way leads to."""
    stub = drawn({1: (-0.1, 0.0), 2: (0.1, 0.0)}, {10: (1, 2, [])}, unseen={1: math.pi, 2: 0.0})
    robot = far_from_all_that_is_known()
    while robot.mission.outcome is None:
        robot.look(stub)
    twice = ["look around", "look around", "give up a frontier"]
    did = [e.action for e in robot.said(Recovery) if isinstance(e, Recovery)]
    assert did == ["drive on", *twice, "try again", *twice]
    assert robot.mission.outcome == "explored_with_blocked"


def test_who_has_come_on_looks_around_twice_again_before_a_frontier_is_given_up() -> None:
    """It looks for a way at one end of a corridor and then at the other."""
    robot = far_from_all_that_is_known()
    robot.drive(CLOSED, (0.0, 0.0), (3.0, 0.0))
    for x in (3.0, 0.0):
        ends = {1: (x - 0.1, 0.0), 2: (x + 0.1, 0.0)}
        robot.stand(drawn(ends, {10: (1, 2, [])}, unseen={1: math.pi, 2: 0.0}), 18)
        robot.drive(CLOSED, (x, 0.0), (0.0, 0.0))
    did = [e.action for e in robot.said(Recovery) if isinstance(e, Recovery)]
    assert did == ["drive on", *["look around"] * 4]


def test_who_came_in_by_a_gap_that_is_not_to_be_seen_from_inside_goes_back_by_it_at_once() -> None:
    """A side street that ends, and is narrow where it begins."""
    ways: dict[int, tuple[int, int, list[Point]]] = {10: (1, 2, []), 11: (2, 3, []), 12: (2, 4, [])}
    places = {1: (-3.0, 0.0), 2: (3.0, 0.0), 3: (8.0, 0.0), 4: (3.0, -4.0)}
    tee = drawn(places, ways, unseen={1: math.pi, 3: 0.0})
    inside = drawn({5: (3.0, -2.5), 4: (3.0, -4.0)}, {12: (5, 4, [])}, unseen={5: math.pi / 2})
    robot = Robot()
    robot.stand(tee, 8)
    robot.drive(tee, (0.0, 0.0), (3.0, 0.0), (3.0, -3.5))
    begin, order = robot.stamp, robot.look(inside)
    while not any("retrace" in str(event) for event in robot.said(Recovery)):
        assert robot.stamp < begin + 60.0
        if isinstance(order, Drive):
            robot.drive(inside, (robot.pose.x, robot.pose.y), end_of(order))
        order = robot.look(inside)
    order = robot.look(inside)
    while end_of(order)[1] < -0.5:
        x, y = end_of(order)
        assert x == pytest.approx(3.0, abs=0.05)
        order = robot.drive(inside, (robot.pose.x, robot.pose.y), (x, y))
    done = [(e.action, e.reason) for e in robot.events if isinstance(e, Recovery)]
    assert ("retrace the way", "the way on is not to be seen") in done
    assert {"try another way", "give up a frontier"}.isdisjoint(dict(done))
    robot.drive(tee, (robot.pose.x, robot.pose.y), (3.0, 0.0), (2.25, 0.0))
    assert end_of(robot.look(tee)) in {(8.0, 0.0), (-3.0, 0.0)}


ALL_WAYS: dict[int, tuple[int, int, list[Point]]] = {
    **{10: (1, 2, []), 11: (2, 3, []), 12: (3, 4, []), 13: (4, 5, [])},
    **{14: (2, 6, []), 15: (3, 7, []), 16: (4, 8, [])},
}
STREET = drawn(  # with three side streets to the south, which go on unseen, as its ends do
    {1: (-8.0, 0.0), 2: (-4.0, 0.0), 3: (0.0, 0.0), 4: (4.0, 0.0), 5: (8.0, 0.0)}
    | {6: (-4.0, -4.0), 7: (0.0, -4.0), 8: (4.0, -4.0)},
    ALL_WAYS,
    unseen={1: math.pi, 5: 0.0} | dict.fromkeys((6, 7, 8), -math.pi / 2),
)


@pytest.mark.parametrize("open_at", [{}, {5: -math.pi / 2, 6: math.pi / 2}], ids=str)
def test_what_no_known_way_leads_to_any_more_is_gone_back_to_over_the_way_that_was_driven(
    open_at: dict[int, float],
) -> None:
    """Through a gap that is hardly wide enough, into a room of which no edge leads back.

    Where the ends of that one are not to be seen, it is on none of the map.
    """
    room = drawn({5: (4.0, 6.0), 6: (4.0, 9.0)}, {20: (5, 6, [])}, unseen=open_at)
    robot = Robot()
    robot.stand(STREET, 20)
    robot.drive(STREET, (0.0, 0.0), (-5.0, 0.0), (4.0, 0.0), (4.0, 1.2))
    robot.drive(room, (4.0, 1.2), (4.0, 7.0))
    robot.mission.where = Whereabouts()
    lost = {end.vertex for end in robot.mapper.graph.frontiers()}
    while not any("retrace" in str(event) for event in robot.said(Recovery)):
        assert robot.mission.outcome is None
        robot.drive(room, (robot.pose.x, robot.pose.y), (4.0, 8.5), (4.0, 6.5))
    order = robot.look(room)
    while end_of(order)[1] > 1.0:
        x, y = end_of(order)
        assert x == pytest.approx(4.0, abs=0.05)
        order = robot.drive(room, (robot.pose.x, robot.pose.y), (x, y))
    order = robot.drive(STREET, (robot.pose.x, robot.pose.y), (4.0, 0.5))
    assert robot.mission.outcome is None
    assert robot.mission.target is not None
    assert robot.mission.target.vertex in lost


def test_who_explores_anew_looks_for_ways_also_where_it_has_been() -> None:
    robot = Robot()
    robot.stand(TEE, 8)
    graph = robot.mapper.graph
    robot.mission._obstructions.close(graph, graph.frontiers(), robot.stamp)
    robot.mission._scouting._gone_near.add((1, 2))
    robot.mission._retracing._been.add(1)
    robot.mission.reopen()
    assert len(graph.frontiers()) == 3
    assert not robot.mission.is_waiting
    assert not robot.mission._scouting._gone_near
    assert not robot.mission._retracing._been


def test_who_explores_anew_looks_around_at_the_end_of_sight_no_sooner_than_before() -> None:
    """It stands there for a while first, as more may come into view by itself."""
    robot = Robot()
    robot.stand(TEE, 8)
    robot.mission.stop(robot.stamp, "stopped by a request")
    robot.mission.reopen()
    (vertex,) = robot.mapper.graph.vertices.values()
    east = next(key for key, h in vertex.half_edges.items() if math.cos(h.bearing) > 0.9)
    robot.mission.target = HalfEdgeId(vertex.id, east)
    robot.drive(TEE, (0.0, 0.0), (8.0, 0.0))
    there = robot.stamp
    robot.stand(TEE, 20)
    first = next(e for e in robot.said(Recovery) if isinstance(e, Recovery))
    assert first.action == "look around"
    assert first.stamp - there > CONFIG.look_around_s - 1.0


def test_a_robot_that_drives_to_and_fro_gives_up_its_target_after_its_patience() -> None:
    """Between two places a metre apart, which it may do when two ways look equally good."""
    robot = Robot()
    robot.stand(TEE, 8)
    begin, target = robot.stamp, robot.mission.target
    while robot.mission.target == target and robot.stamp < begin + 10 * CONFIG.patience_s:
        robot.drive(TEE, (0.0, 0.0), (1.0, 0.0), (0.0, 0.0))
    assert abs(robot.stamp - begin - CONFIG.patience_s) < 10.0
    given_up = [e for e in robot.said(Recovery) if isinstance(e, Recovery)]
    assert [e.reason for e in given_up] == ["no progress"]


def test_a_robot_that_cannot_move_gives_up_its_target_after_its_patience() -> None:
    robot = Robot()
    robot.stand(TEE, 8)
    first = robot.mission.target
    robot.stand(TEE, round(CONFIG.patience_s / 0.5) + 2)
    assert first is not None
    half = robot.mapper.graph.half_edge(first)
    assert half is not None
    assert half.blocked


def test_a_frontier_to_which_a_way_is_only_ever_seen_for_a_moment_is_given_up() -> None:
    """To and fro in a corridor, of whose tee nothing is seen for ten seconds each time."""
    robot = Robot()
    robot.stand(TEE, 8)
    begin, limit = robot.stamp, 2 * CONFIG.patience_s
    while not robot.mapper.graph.blocked() and robot.stamp - begin < limit:
        for way in (((0.0, 0.0), (-2.5, 0.0)), ((-2.5, 0.0), (0.0, 0.0))):
            robot.mission.where.on_edge = None
            robot.drive(PLAIN, *way)
        robot.look(TEE)
    (given_up,) = (r for r in robot.said(Recovery) if getattr(r, "action", "") != "drive on")
    assert isinstance(given_up, Recovery)
    assert given_up.reason == "no way leads there"
    assert given_up.stamp - begin < 1.3 * CONFIG.patience_s


def test_a_target_that_vanishes_when_patience_ends_costs_one_frontier_and_not_all() -> None:
    waiting = Robot()
    waiting.stand(TEE, 8)
    looks = 8
    while not waiting.said(Recovery):
        waiting.look(TEE)
        looks += 1
    robot = Robot()
    robot.stand(TEE, looks - 1)
    graph, target = robot.mapper.graph, robot.mission.target
    assert target is not None
    graph.remove_half_edge(target)
    robot.look(TEE)
    assert robot.mission.outcome is None
    assert len(graph.blocked()) == 1
    assert graph.frontiers()


@pytest.mark.parametrize(
    ("somebody_at_x", "waits_at_x"),
    [([], 1.0), ([2.0], 0.5), ([0.0], 1.5), ([2.9], 1.0), ([0.0, 2.0], 1.0)],
)
def test_who_waits_for_somebody_leaves_him_the_room_to_go(
    somebody_at_x: list[float], waits_at_x: float
) -> None:
    """A metre and a half, either way along its corridor; between two it stays."""
    robot = Robot()
    robot.drive(TEE, (-2.0, 0.0), (1.0, 0.0))
    robot.somebody = np.array([(x, 0.0) for x in somebody_at_x]).reshape(-1, 2)
    order: Order = Stand()
    while robot.mission.target is not None and robot.stamp < 100.0:
        robot.mission.hold()
        order = robot.look(TEE)
    x = 1.0 if isinstance(order, Stand) else end_of(order)[0]
    assert x == pytest.approx(waits_at_x, abs=0.11)


@pytest.mark.parametrize("is_another_known", [False, True])
def test_a_robot_of_a_team_draws_back_from_who_may_be_another_one(
    *, is_another_known: bool
) -> None:
    """A metre and a half: both may wait for each other, and each knows the other as it moves.

    A third one is known, and nowhere near.
    """
    robot = Robot()
    if is_another_known:
        third = Companion("third", Pose(3.0, -3.0), goes_first=True, radius=0.2)
        robot.mission.meet(robot.pose, [third])
    robot.mission.choice.sharing = Alone()
    robot.drive(TEE, (-2.0, 0.0), (1.0, 0.0))
    robot.passing = np.array([(1.5, 0.0)])
    order: Order = Stand()
    while robot.mission.target is not None and robot.stamp < 100.0:
        robot.mission.hold()
        order = robot.look(TEE)
    assert end_of(order) == pytest.approx((0.0, 0.0), abs=0.11)


def test_who_has_nowhere_to_go_but_past_another_robot_makes_way() -> None:
    """Held up west of the tee by a robot behind it, until every way is closed for a while."""
    robot = Robot()
    robot.stand(TEE, 8)
    begin, order = robot.stamp, robot.look(TEE)
    while robot.mission.target is not None and robot.stamp < begin + 60.0:
        robot.mission.meet(
            robot.pose, [Companion("other", Pose(-1.0, 0.0, 0.0), goes_first=True, radius=0.2)]
        )
        robot.mission.hold()
        order = robot.look(TEE)
    assert robot.stamp - begin < 2 * CONFIG.in_the_way_s  # three ways, a third of that for each
    assert end_of(order) == pytest.approx((3.0, -4.0))
    robot.mission.meet(
        robot.pose, [Companion("other", Pose(-2.5, 0.0, 0.0), goes_first=True, radius=0.2)]
    )
    assert isinstance(robot.look(TEE), Stand)


@pytest.mark.parametrize("goes_first", [True, False])
def test_who_is_done_goes_before_another_one_where_two_cannot_pass(*, goes_first: bool) -> None:
    """From the east, in a corridor of which no side branch is in sight; it looks at its end."""
    robot = Robot()
    robot.stand(TEE, 8)
    robot.drive(CLOSED, (0.0, 0.0), (2.0, 0.0))
    robot.mission.outcome = "explored"
    order: Order = Stand()
    for _ in range(3):
        other = Companion("other", Pose(2.8, 0.0, math.pi), goes_first=goes_first, radius=0.2)
        robot.mission.meet(robot.pose, [other])
        view = View(99, robot.stamp, robot.travelled, robot.pose, CLOSED, robot.walls)
        known, _ = robot.mapper.observe(view)
        order, _ = robot.mission.make_way(view, known)
    assert isinstance(order, Drive) == goes_first
    if goes_first:
        assert end_of(order) == pytest.approx((-1.0, 0.0))


def test_who_has_to_wait_where_another_one_wants_to_come_through_goes_out_of_its_way() -> None:
    """In a corridor that both only fit through one by one, before a tee that lies behind it."""
    robot = Robot()
    robot.walls = Narrow(LocalMapConfig())
    robot.drive(TEE, (0.0, 0.0), (2.6, 0.0), (1.0, 0.0))
    (vertex,) = robot.mapper.graph.vertices.values()
    west = next(k for k, half in vertex.half_edges.items() if abs(half.bearing) > 3.0)
    robot.mission.target = HalfEdgeId(vertex.id, west)
    assert end_of(robot.look(TEE)) == pytest.approx((-3.0, 0.0))
    course = np.stack([np.linspace(-0.2, 7.0, 73), np.zeros(73)], axis=1)
    comes = Companion("other", Pose(-0.2, 0.0, 0.0), goes_first=True, course=course, radius=0.2)
    robot.mission.meet(robot.pose, [comes])
    assert end_of(robot.look(TEE)) == pytest.approx((3.0, -4.0))


def test_who_stands_in_a_crossing_leaves_it_for_who_wants_to_come_through() -> None:
    """From the south to the east; it would like to go west itself, and that is out of the way."""
    robot = Robot()
    robot.walls = Narrow(LocalMapConfig())
    robot.drive(TEE, (0.0, 0.0), (3.3, 0.0))
    (vertex,) = robot.mapper.graph.vertices.values()
    west = next(k for k, half in vertex.half_edges.items() if abs(half.bearing) > 3.0)
    robot.mission.target = HalfEdgeId(vertex.id, west)
    up, on = np.linspace((3.0, -0.8), (3.0, 0.0), 9), np.linspace((3.0, 0.0), (7.0, 0.0), 41)
    course = np.concatenate([up, on[1:]])
    comes = Companion("other", Pose(3.0, -0.8), goes_first=True, course=course, radius=0.2)
    robot.mission.meet(robot.pose, [comes])
    assert end_of(robot.look(TEE)) == pytest.approx((-3.0, 0.0))


@pytest.mark.parametrize("is_hidden", [False, True])
def test_a_crossing_that_another_robot_hides_is_left_by_the_way_that_is_wanted(
    is_hidden: bool,
) -> None:
    """It stands in the branch to the south, so that only a corridor is to be seen."""
    robot = Robot()
    robot.drive(TEE, (0.0, 0.0), (2.6, 0.0))
    (vertex,) = robot.mapper.graph.vertices.values()
    east = next(key for key, half in vertex.half_edges.items() if abs(half.bearing) < 0.1)
    robot.mission.target = HalfEdgeId(vertex.id, east)
    company = [Companion("other", Pose(3.0, -1.5, 0.0), goes_first=True, radius=0.2)]
    robot.mission.meet(robot.pose, company if is_hidden else [])
    order = robot.drive(PLAIN if is_hidden else TEE, (2.6, 0.0), (3.4, 0.0))
    assert end_of(order) == pytest.approx((8.0, 0.0))
    assert robot.mission.where.on_edge == HalfEdgeId(vertex.id, east)


class Alone:
    """Shares the frontiers with others of whom nothing has been heard."""

    is_waiting = is_done = is_explored = False
    unfollowed: Collection[HalfEdgeId] = ()
    known_to_others: Sequence[Array] = ()

    def choose(self, graph: GvgGraph, starts: list[Approach]) -> tuple[HalfEdgeId, Approach] | None:
        return nearest_frontier(graph, starts)

    def keeps(self, target: HalfEdgeId, graph: GvgGraph, starts: list[Approach]) -> bool:
        return True

    def has_driven(self, line: Array, *, either_way: bool = False) -> bool:
        return False


class Claimed(Alone):
    """Another robot follows all that is open, a metre beyond its vertex."""

    is_waiting = True

    def choose(self, graph: GvgGraph, starts: list[Approach]) -> None:
        return None

    def keeps(self, target: HalfEdgeId, graph: GvgGraph, starts: list[Approach]) -> bool:
        return starts[0].metres < -1.0


@pytest.mark.parametrize(("x", "is_ahead"), [(3.6, False), (5.0, True)])
def test_who_is_on_an_edge_ahead_of_who_claims_it_goes_on(*, x: float, is_ahead: bool) -> None:
    robot = Robot()
    robot.drive(TEE, (0.0, 0.0), (x, 0.0))
    (vertex,) = robot.mapper.graph.vertices.values()
    east = next(key for key, half in vertex.half_edges.items() if abs(half.bearing) < 0.1)
    assert robot.mission.where.on_edge == HalfEdgeId(vertex.id, east)
    robot.mission.choice.sharing, robot.mission.target = Claimed(), None
    order = robot.look(TEE)
    assert robot.mission.target == (HalfEdgeId(vertex.id, east) if is_ahead else None)
    if is_ahead:
        assert end_of(order) == pytest.approx((8.0, 0.0))


class Led(Alone):
    """Others have driven everywhere, from some time on."""

    is_led = False

    def has_driven(self, line: Array, *, either_way: bool = False) -> bool:
        return self.is_led


def test_who_knows_no_vertex_turns_round_once_where_others_have_driven_on() -> None:
    robot, others = Robot(), Led()
    robot.mission.choice.sharing = others
    assert end_of(robot.drive(PLAIN, (0.0, 0.0), (2.0, 0.0))) == pytest.approx((8.0, 0.0))
    others.is_led = True
    assert end_of(robot.look(PLAIN)) == pytest.approx((-3.0, 0.0))
    assert end_of(robot.drive(PLAIN, (2.0, 0.0), (1.0, 0.0))) == pytest.approx((-3.0, 0.0))


class Following(Led):
    """Others have driven everywhere and leave nothing, some of them from some time on."""

    is_led = True

    def choose(self, graph: GvgGraph, starts: list[Approach]) -> None:
        return None


def test_who_knows_no_vertex_where_others_have_driven_all_waits_for_them_and_ends() -> None:
    robot, others = Robot(), Following()
    robot.mission.choice.sharing = others
    assert isinstance(robot.look(PLAIN), Drive)
    others.is_waiting = True
    assert isinstance(robot.look(PLAIN), Stand)
    assert robot.mission.outcome is None
    others.is_led = False  # ahead is what nobody has driven, whatever they said before
    assert isinstance(robot.look(PLAIN), Drive)
    others.is_led, others.is_waiting = True, True
    assert isinstance(robot.look(PLAIN), Stand)
    others.is_waiting, others.is_done = False, True
    others.is_led = False
    assert isinstance(robot.look(PLAIN), Drive)
    assert robot.mission.outcome is None
    others.is_led = True
    robot.stand(PLAIN, 2)
    assert robot.mission.outcome == "explored"


class Last(Alone):
    """Has nothing left to go to, nor have the others."""

    is_done = True

    def choose(self, graph: GvgGraph, starts: list[Approach]) -> None:
        return None


@pytest.mark.parametrize("is_explored", [False, True])
def test_a_robot_whose_team_is_done_leaves_no_vertex_that_hangs_on_nothing(
    *, is_explored: bool
) -> None:
    robot = Robot()
    robot.mission.choice.sharing = last = Last()
    last.is_explored = is_explored
    graph = robot.mapper.graph
    stray = Vertex(graph.next_id(), 1.0, Pose(50.0), 0.0, 0.0)
    stray.add_half_edge(0.0)
    graph.vertices[stray.id] = stray
    robot.mapper.belief = add_vertex(
        robot.mapper.belief, stray.id, stray.local, np.diag([1e-4, 1e-4, 1e-4])
    )
    while not graph.edges:
        robot.mapper.observe(View(0, 0.0, 0.0, Pose(), CLOSED, NOTHING_SEEN))
    robot.stand(CLOSED, 2)
    assert robot.mission.outcome == "explored"
    assert {v.kind for v in graph.vertices.values()} == {"endpoint"}
    assert stray.id not in graph.vertices


def before_a_closed_way(sharing: Sharing | None) -> tuple[Robot, HalfEdgeId]:
    """A robot that has waited long enough before its first frontier, and that."""
    robot = Robot()
    robot.mission.choice.sharing = sharing
    robot.stand(TEE, 8)
    closed = robot.mission.target
    assert closed is not None
    while robot.mission.target == closed:
        robot.mission.hold()
        robot.look(TEE)
    return robot, closed


@pytest.mark.parametrize("is_followed", [False, True])
def test_what_a_robot_of_a_team_gave_up_and_nobody_followed_is_not_explored(
    *, is_followed: bool
) -> None:
    last = Last()
    robot, closed = before_a_closed_way(Alone())
    robot.mission.choice.sharing, robot.mission.target = last, None
    last.is_explored, last.unfollowed = True, () if is_followed else (closed,)
    robot.stand(TEE, 2)
    assert robot.mission.outcome == ("explored" if is_followed else "explored_with_blocked")


@pytest.mark.parametrize("is_explored", [False, True])
def test_for_a_way_that_was_closed_one_waits_only_if_nobody_has_driven_it(
    *, is_explored: bool
) -> None:
    robot, _ = before_a_closed_way(Alone())
    robot.mission.choice.sharing = last = Last()
    last.is_explored, robot.mission.target = is_explored, None
    robot.stand(TEE, 2)
    assert robot.mission.outcome == ("explored" if is_explored else None)


@pytest.mark.parametrize("is_in_team", [False, True])
def test_in_a_team_a_way_that_was_closed_is_open_again_before_all_others_are_driven(
    is_in_team: bool,
) -> None:
    robot, closed = before_a_closed_way(Alone() if is_in_team else None)
    half = robot.mapper.graph.half_edge(closed)
    assert half is not None
    assert half.blocked
    robot.stand(TEE, round(CONFIG.retry_after_s / 0.5) + 2)
    assert half.blocked != is_in_team


def test_to_and_fro_on_the_spot_is_no_progress() -> None:
    robot = Robot()
    robot.stand(TEE, 8)
    first = robot.mission.target
    assert first is not None
    while robot.stamp < CONFIG.patience_s + 10.0:
        for x in (0.1, 0.0):
            robot.pose, robot.travelled = Pose(x), robot.travelled + 0.1
            robot.look(TEE)
    half = robot.mapper.graph.half_edge(first)
    assert half is not None
    assert half.blocked


def test_beside_its_edge_the_robot_goes_straight_there_first() -> None:
    robot = Robot()
    robot.pose = Pose(0.0, 0.4, 0.0)
    order = robot.stand(TEE, 8)
    assert isinstance(order, Drive)
    assert order.track.polyline[0] == pytest.approx((0.0, 0.4))
    assert order.track.polyline[1] == pytest.approx((0.0, 0.0), abs=0.06)


def test_with_everything_given_up_the_outcome_says_so() -> None:
    robot = Robot()
    while robot.mission.outcome is None and robot.stamp < 10 * CONFIG.patience_s:
        robot.look(TEE)
    assert robot.mission.outcome == "explored_with_blocked"
    assert len(robot.mapper.graph.blocked()) == 3
    assert len(robot.said(Finished)) == 1
    given_up = [e for e in robot.said(Recovery) if "give up" in str(e)]
    assert len(given_up) == 2 * 3  # each has had a second chance


def test_turning_into_the_first_open_street_on_the_left_after_driving_an_edge() -> None:
    """From the east to a crossing whose arms all go on: left of westbound is south."""
    crossing = drawn(
        {1: (-4.0, 0.0), 2: (0.0, 0.0), 3: (6.0, 0.0), 4: (0.0, -4.0), 5: (0.0, 4.0)},
        {10: (1, 2, []), 11: (2, 3, []), 12: (2, 4, []), 13: (2, 5, [])},
        unseen={1: math.pi, 4: -math.pi / 2, 5: math.pi / 2},
    )
    robot = Robot()
    robot.pose = Pose(5.0, 0.0, math.pi)
    order = robot.drive(crossing, (5.0, 0.0), (1.5, 0.0))
    assert end_of(order) == pytest.approx((0.0, -4.0))


def test_the_passing_of_a_vertex_counts_a_traversal_of_the_edge_driven() -> None:
    """From the middle of one edge past both ends of the next one: of that only all was driven."""
    street = drawn(
        {1: (0.0, 0.0), 2: (5.0, 0.0), 3: (9.0, 0.0), 4: (15.0, 0.0), 5: (5.0, 3.0), 6: (9.0, 2.0)},
        {10: (1, 2, []), 11: (2, 3, []), 12: (3, 4, []), 13: (2, 5, []), 14: (3, 6, [])},
    )
    robot = Robot()
    robot.pose = Pose(2.5, 0.0, 0.0)
    robot.stand(street, 8)
    robot.drive(street, (2.5, 0.0), (11.0, 0.0))
    driven = {round(edge.length): edge.traversals for edge in robot.mapper.graph.edges.values()}
    assert driven == {5: 0, 4: 1, 6: 0, 3: 0, 2: 0}
