"""What neighbours that speak the messages of ROS 2 are told while the robot moves."""

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Protocol

import numpy as np

from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam.ekf import OdometryNoise
from gvgbot.clock import Clock, OffLoop
from gvgbot.geometry import Array, rotated_covariance
from gvgbot.hal.messages import Odometry, Scan
from gvgbot.live.past import LivePast, Portion
from gvgbot.maps.occupancy import GrowingGrid
from gvgbot.maps.route_graph import RouteGraph
from gvgbot.report import route_graph
from gvgbot.ros2 import topics, translation
from gvgbot.ros2.cdr import Message, encode
from gvgbot.ros2.topics import Topic
from gvgbot.ros2.translation import BASE, LASER, MAP, ODOM
from gvgbot.ros_markers import markers

MAP_EVERY = 5.0  # s at least between two maps, which travel whole
_CLOCK_SET_S = 0.005  # a larger change of the computer's clock is followed

Drawn = Callable[[float], Mapping[Topic, Message]]  # map and markers, given a stamp


class Neighbour(Protocol):
    """Where messages go."""

    def wants(self, topic: Topic) -> bool:
        """Whether to send messages of a topic."""

    def send(self, topic: Topic, data: bytes, unix_ns: int) -> None:
        """Send a message, in CDR, that was true at a time since 1970, without waiting."""


class UnixTime:
    """Stamps of the robot's clock as seconds since 1970, whenever somebody sets the computer's."""

    def __init__(
        self,
        now: Callable[[], float],
        wall: Callable[[], float] = time.time,  # noqa: TID251  # what ROS stamps messages with
    ) -> None:
        """`now` is the robot's clock."""
        self._now, self._wall = now, wall
        self._ahead = wall() - now()

    def __call__(self, stamp: float) -> float:
        """Seconds since 1970."""
        ahead = self._wall() - self._now()
        if abs(ahead - self._ahead) > _CLOCK_SET_S:
            self._ahead = ahead
        return stamp + self._ahead


class LiveRos:
    """Turns scans, odometry and the map into messages, if any neighbour wants them."""

    def __init__(
        self,
        neighbours: Sequence[Neighbour],
        pipeline: Pipeline,
        noise: OdometryNoise,
        unix: Callable[[float], float],
    ) -> None:
        """`unix` turns stamps of the robot's clock into seconds since 1970."""
        self._neighbours, self._pipeline, self._unix = neighbours, pipeline, unix
        self._drift = _Drift(noise)
        self._last_scan: Scan | None = None
        self._drawing = _Drawing()

    def on_scan(self, scan: Scan) -> None:
        """Send a scan, and before the first one where the laser is."""
        last, self._last_scan = self._last_scan, scan
        stamp = self._unix(scan.stamp)
        if last is None or last.base_laser != scan.base_laser:
            mount = translation.transforms(stamp, {(BASE, LASER): scan.base_laser})
            self._send(topics.TF_STATIC, mount, stamp)
        if self._is_wanted(topics.SCAN):
            period = 0.0 if last is None else scan.stamp - last.stamp
            self._send(topics.SCAN, translation.laser_scan(scan, stamp, period), stamp)

    def on_odometry(self, odometry: Odometry) -> None:
        """Send odometry, and where odometry began in the map."""
        pose, twist = self._drift.after(odometry)
        stamp = self._unix(odometry.stamp)
        if self._is_wanted(topics.ODOM):
            self._send(topics.ODOM, translation.odometry(odometry, stamp, pose, twist), stamp)
        if self._is_wanted(topics.TF):
            frames = {(ODOM, BASE): odometry.odom_base}
            if self._pipeline.past.last is not None and not self._pipeline.is_lost:
                map_odom = self._pipeline.map_base.compose(odometry.odom_base.inverse())
                frames[MAP, ODOM] = map_odom
            self._send(topics.TF, translation.transforms(stamp, frames), stamp)

    def draw(self, stamp: float) -> Callable[[], None] | None:
        """A function that sends the map of this moment, in a thread or later; None: no news.

        Call each such function before asking for the next.
        """
        work = self._drawing.update(self._pipeline, stamp)
        return None if work is None else partial(self._send_map, work, self._unix(stamp))

    def _send_map(self, work: Drawn, stamp: float) -> None:
        for topic, message in work(stamp).items():
            self._send(topic, message, stamp)

    def doubt(self, *, at_last: bool = False) -> None:
        """Note that the grid may be known better by now; `at_last` it is not drawn later on."""
        self._drawing.past.doubt(at_last=at_last)

    async def keep_shown(self, clock: Clock, off_loop: OffLoop) -> None:
        """Send the map as it grows, until cancelled."""
        while True:
            due = clock.now() + MAP_EVERY
            draw = self.draw(clock.now())
            if draw is not None:
                await off_loop(draw)
            await clock.sleep_until(due)

    def _is_wanted(self, topic: Topic) -> bool:
        return any(neighbour.wants(topic) for neighbour in self._neighbours)

    def _send(self, topic: Topic, message: Message, stamp: float) -> None:
        data = encode(message)
        for neighbour in self._neighbours:
            neighbour.send(topic, data, round(1e9 * stamp))


class _Drawing:
    """The grid grows with each keyframe, and follows when a loop closes; the graph is told anew."""

    def __init__(self) -> None:
        self._grid, self.past = GrowingGrid(), LivePast()

    def update(self, pipeline: Pipeline, stamp: float) -> Drawn | None:
        """A function that draws the grid and the graph of this moment, given a stamp."""
        portion = self.past.update(pipeline, stamp)
        if portion is None:
            return None
        graph, belief = pipeline.mapper.graph, pipeline.mapper.belief
        poses = {number: belief.map_vertex(number) for number in graph.vertices}
        covariances = {number: belief.vertex_covariance(number) for number in graph.vertices}
        return partial(self._drawn, portion, route_graph(pipeline, poses, covariances))

    def _drawn(
        self, find: Callable[[], Portion], graph: RouteGraph, stamp: float
    ) -> Mapping[Topic, Message]:
        drawn: dict[Topic, Message] = {topics.MARKERS: markers(graph, stamp)}
        new, is_all, *_ = find()
        if is_all:
            self._grid = GrowingGrid()
        scans = [(keyframe.map_base, keyframe.scan) for keyframe in new if keyframe.scan]
        for map_base, scan in scans:
            self._grid.add(map_base, scan.unpacked())
        if scans:
            grid = self._grid.grid()
            drawn[topics.MAP] = translation.occupancy_grid(
                grid.cells, grid.resolution_m, grid.origin, stamp
            )
        return drawn


class _Drift:
    """How uncertain dead reckoning has become since it began."""

    def __init__(self, noise: OdometryNoise) -> None:
        self._noise = noise
        self._last: Odometry | None = None
        self._pose: Array = np.zeros((3, 3))

    def after(self, odometry: Odometry) -> tuple[Array, Array]:
        """The covariances (3, 3) of the pose in the odom frame, and of the twist in the base's."""
        last, self._last = self._last, odometry
        if last is None or odometry.stamp <= last.stamp:
            return self._pose, np.zeros((3, 3))
        motion, elapsed = last.odom_base.to(odometry.odom_base), odometry.stamp - last.stamp
        added = self._noise.covariance(motion, elapsed)
        move = np.eye(3)
        move[0, 2] = -(odometry.odom_base.y - last.odom_base.y)
        move[1, 2] = odometry.odom_base.x - last.odom_base.x
        turned = rotated_covariance(added, last.odom_base.theta)
        self._pose = move @ self._pose @ move.T + turned
        return self._pose, added / elapsed**2
