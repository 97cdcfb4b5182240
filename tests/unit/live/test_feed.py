"""Scans, odometry and the plan as they travel: truly, not too often, and not to nobody."""

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId, Vertex
from gvgbot.geometry import Pose, Twist
from gvgbot.hal import messages
from gvgbot.live.feed import LiveFeed, Pace
from gvgbot.snapshots import plan, sweep
from gvgbot.topics import Odometry, Payload, Plan, Scan


def scan(stamp: float, ranges: list[float]) -> messages.Scan:
    return messages.Scan(stamp, np.array(ranges), -1.0, 0.01, 0.1, 30.0, 0.001, Pose(0.1, 0.0, 0.2))


class Listeners:
    def __init__(self, *heard: type[Payload]) -> None:
        self.heard = heard
        self.got: list[Payload] = []

    def publish(self, value: Payload) -> None:
        self.got.append(value)

    def is_heard(self, payload: type[Payload]) -> bool:
        return payload in self.heard


def crossing() -> Any:
    """A pipeline on an edge from vertex 1 to vertex 2; beyond it lies vertex 3 with a frontier.

    Each vertex frame is the map frame moved: 1 at (0, 0), 2 at (4, 0), 3 at (4, 5) and turned left.
    """
    graph = GvgGraph()
    poses = {1: Pose(0.0, 0.0, 0.0), 2: Pose(4.0, 0.0, 0.0), 3: Pose(4.0, 5.0, math.pi / 2)}
    for number, pose in poses.items():
        graph.vertices[number] = Vertex(number, 0.5, pose, 0.0, 0.0)
    east = HalfEdgeId(1, graph.vertices[1].add_half_edge(0.0))
    west = HalfEdgeId(2, graph.vertices[2].add_half_edge(math.pi))
    north = HalfEdgeId(2, graph.vertices[2].add_half_edge(math.pi / 2))
    south = HalfEdgeId(3, graph.vertices[3].add_half_edge(math.pi))
    ahead = HalfEdgeId(3, graph.vertices[3].add_half_edge(0.0))
    graph.join(east, west, np.array([[0.0, 0.0], [4.0, 0.0]]), 0.5, driven=True)
    line = np.array([[0.0, 0.0], [-5.0, 0.0]])  # from 3 to 2, in the frame of 3
    graph.join(south, north, line, 0.5, driven=True)
    return SimpleNamespace(
        mission=SimpleNamespace(
            target=ahead, where=SimpleNamespace(on_edge=east, trail_length=1.0)
        ),
        mapper=SimpleNamespace(
            graph=graph, belief=SimpleNamespace(map_vertex=lambda number: poses[number])
        ),
        errands=SimpleNamespace(errand=None),
        is_lost=False,
        track=np.array([[1.0, 0.0], [4.0, 0.0]]),
        map_base=Pose(1.0, 0.0, 0.0),
        map_base_at=lambda stamp: Pose(stamp, 0.0, 0.0),
    )


def test_ranges_travel_in_whole_millimetres_and_say_what_is_none() -> None:
    sent = sweep(scan(2.0, [1.2344, math.nan, math.inf, 0.02, 65.534, 70.0]), None)
    assert (
        sent.ranges == b"\xd2\x04" + b"\0\0" + b"\xff\xff" + b"\x14\0" + b"\xfe\xff" + b"\xff\xff"
    )
    got = sent.metres
    assert np.isnan(got[1])
    assert got[[0, 2, 3, 4, 5]] == pytest.approx([1.234, math.inf, 0.02, 65.534, math.inf])
    assert (sent.map_base, sent.base_laser) == (None, (0.1, 0.0, 0.2))


def test_a_scan_is_sent_with_the_pose_at_the_middle_of_its_sweep() -> None:
    network = Listeners(Scan)
    LiveFeed(network, cast(Pipeline, crossing()), 10.0).on_scan(scan(3.0, [1.0] * 100))
    (sent,) = network.got
    assert isinstance(sent, Scan)
    assert sent.map_base == pytest.approx((3.05, 0.0, 0.0))


def test_nothing_is_made_for_nobody() -> None:
    network = Listeners()
    feed = LiveFeed(network, cast(Pipeline, None), 10.0)  # which would fail if it were looked at
    feed.on_scan(scan(3.0, [1.0]))
    feed.on_odometry(messages.Odometry(3.0, Pose(), Twist(0.0, 0.0)))
    assert network.got == []


def test_odometry_travels_with_both_poses() -> None:
    network = Listeners(Odometry)
    feed = LiveFeed(network, cast(Pipeline, crossing()), 10.0)
    feed.on_odometry(messages.Odometry(3.0, Pose(7.0, 8.0, 0.5), Twist(0.3, -0.2)))
    assert network.got == [
        Odometry(stamp=3.0, map_base=(1.0, 0.0, 0.0), odom_base=(7.0, 8.0, 0.5), twist=(0.3, -0.2))
    ]


def test_a_plan_leads_over_the_known_edges_to_the_frontier() -> None:
    sent = plan(cast(Pipeline, crossing()), "ear", 9.0)
    assert (sent.vertex, sent.reason) == (3, "ear")
    assert sent.bearing == pytest.approx(math.pi / 2)  # straight on in a frame that is turned left
    assert sent.ahead.tolist() == [[1.0, 0.0], [4.0, 0.0]]
    assert sent.further == pytest.approx(np.array([[4.0, 0.0], [4.0, 5.0]]))


def test_a_plan_without_a_target_has_only_its_track() -> None:
    standing = crossing()
    standing.mission.target = None
    sent = plan(standing, "", 9.0)
    assert (sent.vertex, sent.bearing, sent.route) == (None, None, b"")


def test_on_an_errand_the_frontier_is_not_where_the_robot_goes() -> None:
    sent_away = crossing()
    sent_away.errands.errand = "goto 7"
    sent = plan(sent_away, "ear", 9.0)
    assert (sent.vertex, sent.reason, sent.route) == (None, "", b"")
    assert len(sent.ahead) == 2


def test_who_does_not_know_its_place_goes_nowhere_on_the_map_and_sees_nothing_there() -> None:
    network, lost = Listeners(Scan), crossing()
    lost.is_lost = True
    sent = plan(lost, "ear", 9.0)
    assert (sent.vertex, sent.bearing, sent.reason) == (None, None, "")
    assert (sent.track, sent.route) == (b"", b"")
    LiveFeed(network, lost, 10.0).on_scan(scan(3.0, [1.0] * 100))
    assert [seen.map_base for seen in network.got if isinstance(seen, Scan)] == [None]


def test_a_plan_is_sent_when_it_has_changed() -> None:
    network, mind = Listeners(), crossing()
    feed = LiveFeed(network, mind, 10.0)
    for stamp in (0.0, 1.0, 2.0):
        feed.on_beat(stamp, "ear")
    mind.track = mind.track[1:]
    feed.on_beat(3.0, "ear")
    assert [(type(sent), sent.stamp) for sent in network.got if isinstance(sent, Plan)] == [
        (Plan, 0.0),
        (Plan, 3.0),
    ]


@pytest.mark.parametrize(
    ("every_s", "rate_hz", "expected"),
    [
        pytest.param(0.025, 10.0, 100, id="four times too often"),
        pytest.param(0.02, 20.0, 200, id="no whole multiple"),
        pytest.param(0.1, 10.0, 100, id="just as often"),
        pytest.param(0.5, 10.0, 20, id="seldom"),
    ],
)
def test_what_comes_too_often_is_sent_at_the_rate(
    every_s: float, rate_hz: float, expected: int
) -> None:
    rng, pace = np.random.default_rng(1), Pace(rate_hz)
    stamps = np.arange(0.0, 10.0, every_s)
    stamps += rng.uniform(-0.05, 0.05, len(stamps)) * every_s  # as the clocks of devices do
    assert sum(pace.allows(stamp) for stamp in stamps.tolist()) == pytest.approx(expected, abs=1)


def test_after_a_pause_there_is_no_burst() -> None:
    pace = Pace(10.0)
    stamps = [0.0, 5.0, 5.02, 5.04]
    assert [pace.allows(stamp) for stamp in stamps] == [True, True, False, False]
