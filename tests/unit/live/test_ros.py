"""What ROS hears of a robot, read by an independent implementation."""

import math
from collections import defaultdict
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam.ekf import OdometryNoise
from gvgbot.geometry import Array, Pose, Twist
from gvgbot.hal.messages import Odometry, Scan
from gvgbot.live.ros import LiveRos, UnixTime
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode
from gvgbot.ros2 import topics
from gvgbot.ros2.cdr import encode
from gvgbot.ros2.messages import Time
from gvgbot.ros2.topics import TOPICS, Topic
from gvgbot.ros2.translation import occupancy_grid, to_time
from gvgbot.ros_markers import markers
from tests.unit.live.test_past import RADIUS_M, drive
from tests.unit.ros2.oracle import STORE

NOISE = OdometryNoise()
LATER = 1.7e9  # s from the start of the robot's clock to 1970


class Heard:
    """Takes what it is told to want, and reads it."""

    def __init__(self, *wanted: Topic) -> None:
        self.wanted = wanted
        self.got: dict[Topic, list[Any]] = defaultdict(list)

    def wants(self, topic: Topic) -> bool:
        return topic in self.wanted

    def send(self, topic: Topic, data: bytes, unix_ns: int) -> None:
        self.got[topic].append(STORE.deserialize_cdr(data, topic.message.ros_name))


def live(heard: Heard, map_base: Pose | None = None, *, is_lost: bool = False) -> LiveRos:
    past = SimpleNamespace(last=None if map_base is None else object())
    mind = SimpleNamespace(past=past, map_base=map_base, is_lost=is_lost)
    return LiveRos([heard], cast(Pipeline, mind), NOISE, lambda stamp: stamp + LATER)


def scan(stamp: float, mount: Pose) -> Scan:
    ranges = np.array([1.0, math.nan, math.inf, 2.5])
    return Scan(stamp, ranges, -0.5, 0.25, 0.1, 30.0, 0.001, mount)


def matrix(transform: Any) -> Array:
    """Homogeneous (4, 4), of a translation and a quaternion."""
    q, t = transform.rotation, transform.translation
    x, y, z, w = q.x, q.y, q.z, q.w
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), t.x],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), t.y],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), t.z],
            [0, 0, 0, 1],
        ]
    )


def planar(pose: Pose) -> Array:
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    return np.array([[c, -s, 0, pose.x], [s, c, 0, pose.y], [0, 0, 1, 0], [0, 0, 0, 1]])


def test_transforms_lead_from_the_map_to_the_base() -> None:
    heard, map_base = Heard(topics.TF), Pose(3.0, -2.0, 2.5)
    live(heard, map_base).on_odometry(Odometry(12.25, Pose(1.0, 5.0, -3.0), Twist(0.3, -0.2)))
    (message,) = heard.got[topics.TF]
    by_frames = {(t.header.frame_id, t.child_frame_id): t for t in message.transforms}
    assert set(by_frames) == {("map", "odom"), ("odom", "base_link")}
    map_odom, odom_base = by_frames["map", "odom"], by_frames["odom", "base_link"]
    assert matrix(odom_base.transform) == pytest.approx(planar(Pose(1.0, 5.0, -3.0)))
    both = matrix(map_odom.transform) @ matrix(odom_base.transform)
    assert both == pytest.approx(planar(map_base))
    stamp = odom_base.header.stamp
    assert (stamp.sec, stamp.nanosec) == (1_700_000_012, 250_000_000)


def test_before_it_knows_anything_the_robot_is_nowhere_in_the_map() -> None:
    heard = Heard(topics.TF)
    live(heard).on_odometry(Odometry(1.0, Pose(), Twist()))
    (message,) = heard.got[topics.TF]
    assert [t.child_frame_id for t in message.transforms] == ["base_link"]


def test_a_robot_that_is_lost_claims_no_place_in_the_map() -> None:
    heard = Heard(topics.TF)
    live(heard, Pose(3.0, 4.0, 0.0), is_lost=True).on_odometry(Odometry(1.0, Pose(), Twist()))
    (message,) = heard.got[topics.TF]
    assert [t.child_frame_id for t in message.transforms] == ["base_link"]


def test_a_scan_comes_as_it_was_with_the_place_of_the_laser() -> None:
    heard, mount = Heard(topics.SCAN), Pose(0.1, -0.02, 3.0)
    to = live(heard)
    to.on_scan(scan(5.0, mount))
    to.on_scan(scan(5.1, mount))
    to.on_scan(scan(5.2, Pose(0.1, -0.02, 2.9)))  # where it looks has been learnt
    *before, learnt = heard.got[topics.TF_STATIC]
    heard.got[topics.TF_STATIC] = before
    assert matrix(learnt.transforms[0].transform) == pytest.approx(planar(Pose(0.1, -0.02, 2.9)))
    (static,) = heard.got[topics.TF_STATIC]  # once, and first: transforms that stay
    (laser,) = static.transforms
    assert (laser.header.frame_id, laser.child_frame_id) == ("base_link", "laser")
    assert matrix(laser.transform) == pytest.approx(planar(mount))
    first, second, _ = heard.got[topics.SCAN]
    assert first.header.frame_id == "laser"
    assert first.ranges == pytest.approx([1.0, math.nan, math.inf, 2.5], nan_ok=True)
    assert [first.angle_min, first.angle_max, first.angle_increment] == [-0.5, 0.25, 0.25]
    assert second.scan_time == pytest.approx(0.1)
    assert (second.range_min, second.range_max) == (pytest.approx(0.1), 30.0)


def test_nothing_is_made_for_nobody() -> None:
    heard = Heard()
    to = live(heard)
    to.on_scan(scan(5.0, Pose()))
    to.on_odometry(Odometry(1.0, Pose(), Twist()))
    assert set(heard.got) == {topics.TF_STATIC}  # which is kept for whoever comes


def test_odometry_comes_with_pose_and_twist() -> None:
    heard = Heard(topics.ODOM)
    live(heard).on_odometry(Odometry(1.0, Pose(1.0, 2.0, 0.5), Twist(0.3, -0.2)))
    (message,) = heard.got[topics.ODOM]
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link")
    pose, twist = message.pose.pose, message.twist.twist
    assert (pose.position.x, pose.position.y) == (1.0, 2.0)
    assert 2 * math.atan2(pose.orientation.z, pose.orientation.w) == pytest.approx(0.5)
    assert (twist.linear.x, twist.angular.z) == (0.3, -0.2)


def test_the_speed_is_as_uncertain_as_the_way_of_a_second_at_that_speed_in_that_time() -> None:
    """What is known of a tenth of a second is known of ten times the way."""
    heard, motion = Heard(topics.ODOM), Pose(0.03, 0.0, 0.02)
    to = live(heard)
    to.on_odometry(Odometry(7.0, Pose(), Twist(0.3, 0.2)))
    to.on_odometry(Odometry(7.1, motion, Twist(0.3, 0.2)))
    to.on_odometry(Odometry(7.1, motion, Twist(0.3, 0.2)))  # again: no time has passed
    first, second, again = (
        np.asarray(one.twist.covariance).reshape(6, 6)[np.ix_([0, 1, 5], [0, 1, 5])]
        for one in heard.got[topics.ODOM]
    )
    assert second == pytest.approx(100.0 * NOISE.covariance(motion, 0.1))
    assert not first.any()
    assert not again.any()


def test_the_covariance_is_that_of_many_robots_that_err_as_the_noise_says() -> None:
    heard, rng = Heard(topics.ODOM), np.random.default_rng(3)
    to, robots, place = live(heard), np.zeros((4000, 3)), Pose(2.0, -1.0, 0.7)
    robots[:] = place.x, place.y, place.theta
    motion = Pose(0.05, 0.002, 0.04)
    to.on_odometry(Odometry(0.0, place, Twist()))
    for k in range(1, 60):
        place = place.compose(motion)
        to.on_odometry(Odometry(0.1 * k, place, Twist()))
        steps = rng.multivariate_normal(
            (motion.x, motion.y, motion.theta), NOISE.covariance(motion, 0.1), len(robots)
        )
        c, s = np.cos(robots[:, 2]), np.sin(robots[:, 2])
        robots[:, 0] += c * steps[:, 0] - s * steps[:, 1]
        robots[:, 1] += s * steps[:, 0] + c * steps[:, 1]
        robots[:, 2] += steps[:, 2]
    told = np.asarray(heard.got[topics.ODOM][-1].pose.covariance).reshape(6, 6)
    planar_part = told[np.ix_([0, 1, 5], [0, 1, 5])]
    sigmas = np.sqrt(np.diag(planar_part))
    assert np.cov(robots.T) == pytest.approx(planar_part, abs=0.1 * sigmas.max() ** 2)
    assert np.std(robots, axis=0) == pytest.approx(sigmas, rel=0.06)
    assert not told[2:5].any()


def test_a_grid_lies_where_its_corner_is() -> None:
    cells = np.array([[0, 100, -1], [50, 0, -1]], np.int8)
    told: Any = STORE.deserialize_cdr(
        encode(occupancy_grid(cells, 0.05, (-1.0, 2.0), 7.5)), "nav_msgs/msg/OccupancyGrid"
    )
    assert told.data.tolist() == [0, 100, -1, 50, 0, -1]  # row-major from the origin
    assert (told.info.width, told.info.height) == (3, 2)
    assert told.info.resolution == pytest.approx(0.05)
    corner = told.info.origin
    assert (corner.position.x, corner.position.y, corner.orientation.w) == (-1.0, 2.0, 1.0)
    assert told.header.frame_id == "map"


def test_the_map_is_drawn_anew_when_a_loop_has_closed() -> None:
    pipeline, heard = drive(), Heard(topics.MAP)
    around = np.full(360, 3.0)  # round walls, wherever it stood
    pipeline.past.keyframes = [
        replace(one, scan=Scan(one.stamp, around, -math.pi, math.tau / 360, 0.1, 30.0))
        for one in pipeline.past.keyframes
    ]
    live = LiveRos([heard], pipeline, NOISE, lambda stamp: stamp + LATER)
    later, pipeline.past.keyframes = pipeline.past.keyframes, pipeline.past.keyframes[:1]
    for stamp in (0.0, 10.0, 20.0):
        draw = live.draw(stamp)
        assert draw is not None
        draw()
        pipeline.past.keyframes = later
        if stamp > 0.0:
            live.doubt()
    _, believed, corrected = ((m.info.width, m.info.height) for m in heard.got[topics.MAP])
    whole = 2 * (RADIUS_M + 3.0) + 1.0  # with a margin of half a metre
    assert np.multiply(corrected, 0.05) == pytest.approx([whole, whole], abs=0.3)
    assert np.abs(np.multiply(believed, 0.05) - whole).max() > 0.6
    late = Heard(topics.MAP)
    draw = LiveRos([late], pipeline, NOISE, lambda stamp: stamp + LATER).draw(20.0)
    assert draw is not None
    draw()
    (anew,), latest = late.got[topics.MAP], heard.got[topics.MAP][-1]
    assert latest.data.tolist() == anew.data.tolist()  # nothing of what was believed is left
    for told in (
        latest.header,
        latest.info.map_load_time,
        heard.got[topics.MARKERS][-1].markers[0],
    ):
        assert seconds(told) == 1_700_000_020


def seconds(told: Any) -> int:
    """Of a time, or of the time of a header or a marker."""
    stamp = getattr(getattr(told, "header", told), "stamp", told)
    return int(stamp.sec)


def vertex(number: int, x: float, kind: Any, frontiers: tuple[float, ...] = ()) -> RouteNode:
    return RouteNode(
        id=number,
        kind=kind,
        position=(x, 1.0),
        degree=3,
        bearings=frontiers,
        clearance=0.5,
        covariance=(1.0, 0.0, 0.0, 1.0),
        frontiers=frontiers,
    )


def test_markers_show_vertices_edges_and_frontiers() -> None:
    line = np.array([[0.0, 1.0], [2.0, 1.5], [4.0, 1.0]])
    edge = RouteEdge(start=1, end=2, polyline=line, min_clearance=0.5)
    ends = (vertex(1, 0.0, "meetpoint", (math.pi / 2,)), vertex(2, 4.0, "meetpoint"))
    told: Any = STORE.deserialize_cdr(
        encode(markers(RouteGraph(ends, (edge,)), 7.5)), "visualization_msgs/msg/MarkerArray"
    )
    drawn = {marker.ns: marker for marker in told.markers}
    points = {name: [(p.x, p.y) for p in m.points] for name, m in drawn.items()}
    assert points["edges"] == [(0.0, 1.0), (2.0, 1.5), (2.0, 1.5), (4.0, 1.0)]  # pairs, a line each
    assert points["meetpoints"] == [(0.0, 1.0), (4.0, 1.0)]
    assert points["frontiers"] == [(0.0, 1.0), pytest.approx((0.0, 1.5))]
    kinds = {name: (m.type, m.action) for name, m in drawn.items()}
    line_list, sphere_list, add, delete = 5, 7, 0, 2  # as visualization_msgs/Marker has them
    assert kinds == {
        "edges": (line_list, add),
        "meetpoints": (sphere_list, add),
        "endpoints": (sphere_list, delete),
        "frontiers": (line_list, add),
    }
    assert all(m.color.a == 1.0 and m.pose.orientation.w == 1.0 for m in told.markers)


def test_stamps_follow_a_clock_that_is_set_and_do_not_shiver() -> None:
    now, wall = [10.0], [LATER + 10.0]
    unix = UnixTime(lambda: now[0], lambda: wall[0])
    assert unix(9.5) == LATER + 9.5
    wall[0] += 0.0001
    assert unix(9.5) == LATER + 9.5
    wall[0] += 3600.0
    assert unix(9.5) == pytest.approx(LATER + 3609.5, abs=0.001)


@pytest.mark.parametrize(
    ("stamp", "sec"), [(2.0**31 - 1, 2**31 - 1), (2.0**31, -(2**31)), (2.0**32 + 7, 7), (-1.0, -1)]
)
def test_a_clock_that_is_set_wrong_gives_stamps_all_the_same(stamp: float, sec: int) -> None:
    time = to_time(stamp + 0.5)
    assert time == Time(sec, 500_000_000)
    assert len(encode(time)) == len(encode(Time()))


def test_every_topic_has_a_name_of_its_own() -> None:
    assert {topic.name for topic in TOPICS} == {
        "/scan", "/odom", "/tf", "/tf_static", "/map", "/gvg/markers"
    }  # fmt: skip
