"""Every stage from HAL messages to a twist, in the order of the flow. No I/O, clock or chance."""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.autonomy.control.edge_follower import EdgeFollowerConfig, follow
from gvgbot.autonomy.events import Event
from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.gvg.reduction import ReductionConfig, reduce_graph
from gvgbot.autonomy.gvg.voronoi import fine_graph
from gvgbot.autonomy.mapping import Mapper, MappingConfig, View
from gvgbot.autonomy.mission import Drive, ExplorationConfig, LookAround, Mission, Order, Stand
from gvgbot.autonomy.slam.ekf import OdometryNoise
from gvgbot.autonomy.slam.recognition import RecognitionConfig
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig, register
from gvgbot.autonomy.slam.smoothing import Constraint, smooth
from gvgbot.geometry import STANDSTILL, Array, Pose, Twist, wrap_angle
from gvgbot.hal.deskew import deskewed
from gvgbot.hal.messages import Odometry, Scan
from gvgbot.ranges import Range

_SCAN_EVERY_M, _SCAN_EVERY_RAD = 0.45, 0.4  # scans that are kept for the occupancy grid
_LEAST_SPAN_S = 0.04  # over which odometry tells a velocity
_MATCHED_RANGE_M = 24.0
_LONGEST_GAP_M = 0.5  # between two beams, for their even spacing
_LEAST_POINTS = 50  # fewer say nothing about a pose
_LEAST_INLIERS = 0.5  # of the beams must find a wall, or the match is not believed
_MATCHING_FLOOR = np.diag([0.004**2, 0.004**2, 0.0006**2])  # what matching cannot know of itself


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyframeConfig:
    """How much motion makes a new look worth its cost."""

    distance_m: Annotated[float, Range(0.02, 2.0)] = 0.25
    turn_rad: Annotated[float, Range(0.02, 2.0)] = 0.25
    interval_s: Annotated[float, Range(0.1, 10.0)] = 1.0
    matched_points: Annotated[int, Range(50, 5000)] = 300


@dataclass(frozen=True, slots=True, kw_only=True)
class AutonomyConfig:
    """All parts of autonomy, by their module's name."""

    keyframe: KeyframeConfig = field(default_factory=KeyframeConfig)
    local_map: LocalMapConfig = field(default_factory=lambda: LocalMapConfig(half_width_m=10.0))
    far_map: LocalMapConfig = field(
        default_factory=lambda: LocalMapConfig(half_width_m=20.0, cell_m=0.25, bridge_gap_m=0.0)
    )  # only matched with: the end of a long corridor is what tells how far one has come
    reduction: ReductionConfig = field(default_factory=ReductionConfig)
    edge_follower: EdgeFollowerConfig = field(default_factory=EdgeFollowerConfig)
    mapping: MappingConfig = field(default_factory=MappingConfig)
    recognition: RecognitionConfig = field(default_factory=RecognitionConfig)
    scan_matching: ScanMatchingConfig = field(default_factory=ScanMatchingConfig)
    odometry_noise: OdometryNoise = field(default_factory=OdometryNoise)
    passage_margin_m: Annotated[float, Range(0.0, 0.5)] = 0.03  # beyond the radius, on each side


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """The motion from one keyframe to the next, and its covariance (3, 3), in the first frame."""

    motion: Pose
    covariance: Array


@dataclass(frozen=True, slots=True, eq=False)
class Keyframe:
    """The poses at which a scan was used; the scan itself only where it shows something new."""

    stamp: float
    odom_base: Pose
    local_base: Pose
    map_base: Pose
    scan: Scan | None


class Pipeline:
    """The robot's mind: feed it odometry and scans, ask it for twists."""

    def __init__(
        self, config: AutonomyConfig, exploration: ExplorationConfig, robot_radius: float
    ) -> None:
        self._config, self._radius = config, robot_radius
        self._local_map = LocalMap(config.local_map)
        self._far_map = LocalMap(config.far_map)
        self.mapper = Mapper(config.mapping, config.recognition, config.scan_matching)
        self.mission = Mission(exploration, self.mapper)
        self._odometry: deque[Odometry] = deque(maxlen=64)
        self._local_odom: Pose | None = None
        self._last: Keyframe | None = None
        self._kept: Pose | None = None  # local_base of the last scan that was kept
        self._turning_to: float | None = None  # odom heading still to turn through, unwrapped sum
        self._turned = 0.0
        self._twist = STANDSTILL
        self._order: Order = Stand()
        self.gvg = LocalGvg()
        self.keyframes: list[Keyframe] = []
        self.steps: list[Step] = []
        self.travelled = 0.0

    # -- state -----------------------------------------------------------------------------------

    @property
    def map_base(self) -> Pose:
        """The pose as believed now."""
        if self._last is None or not self._odometry:
            return Pose()
        moved = self._last.odom_base.to(self._odometry[-1].odom_base)
        return self.mapper.belief.map_base.compose(moved)

    def _odom_base_at(self, stamp: float) -> Pose | None:
        """Odometry interpolated at a stamp; the nearest when it lies outside what is kept."""
        log = self._odometry
        if not log:
            return None
        for late, early in zip(reversed(log), list(reversed(log))[1:], strict=False):
            if early.stamp <= stamp:
                if stamp >= late.stamp:
                    return late.odom_base
                share = (stamp - early.stamp) / (late.stamp - early.stamp)
                motion = early.odom_base.to(late.odom_base)
                part = Pose(share * motion.x, share * motion.y, share * motion.theta)
                return early.odom_base.compose(part)
        return log[0].odom_base

    def _motion_during(self, scan: Scan) -> Pose:
        """Motion of the base during a sweep, from the odometry nearest to it in time."""
        duration = scan.time_increment * len(scan.ranges)
        end = min(scan.stamp + duration, self._odometry[-1].stamp)
        span = max(duration, _LEAST_SPAN_S)
        before, after = self._odom_base_at(end - span), self._odom_base_at(end)
        if duration == 0.0 or before is None or after is None:
            return Pose()
        motion, share = before.to(after), duration / span
        return Pose(share * motion.x, share * motion.y, share * motion.theta)

    # -- perception, per scan --------------------------------------------------------------------

    def perceive(self, scan: Scan) -> list[Event]:
        """Learn from a scan, if it was taken somewhere new; what happened."""
        odom_base = self._odom_base_at(scan.stamp)
        if (
            odom_base is None
            or self.mission.outcome is not None
            or not self._worth_a_look(scan, odom_base)
        ):
            return []
        scan = deskewed(scan, self._motion_during(scan))
        local_base = self._localise(scan, odom_base)
        for local_map in (self._local_map, self._far_map):
            local_map.insert(scan, local_base.compose(scan.base_laser), self.travelled)
        fine = fine_graph(
            self._local_map,
            local_base.position,
            min_clearance=self._radius + self._config.passage_margin_m,
            roughness=self._config.reduction.roughness_m,
        )
        self.gvg = reduce_graph(fine, self._config.reduction)
        view = View(
            len(self.keyframes),
            scan.stamp,
            self.travelled,
            local_base,
            self.gvg,
            self._local_map,
        )
        known, seen = self.mapper.observe(view)
        self._keep(scan, odom_base, local_base)
        if self._turning():
            return seen
        if len(self.keyframes) == 1:
            self._turn(_blind_angle(scan))
            return seen
        order, done = self.mission.advance(view, known)
        self._obey(order)
        return seen + done

    def _worth_a_look(self, scan: Scan, odom_base: Pose) -> bool:
        if self._last is None:
            return True
        moved, c = self._last.odom_base.to(odom_base), self._config.keyframe
        return (
            math.hypot(moved.x, moved.y) >= c.distance_m
            or abs(moved.theta) >= c.turn_rad
            or scan.stamp - self._last.stamp >= c.interval_s
        )

    def _localise(self, scan: Scan, odom_base: Pose) -> Pose:
        """The base in the local frame: odometry, corrected by matching the scan with the map."""
        if self._last is None:
            return Pose()
        motion = self._last.odom_base.to(odom_base)
        self.travelled += math.hypot(motion.x, motion.y)
        Q = self._config.odometry_noise.covariance(motion, scan.stamp - self._last.stamp)
        prior = self._last.local_base.compose(motion)
        local_base, covariance = self._match(scan, prior, _turned(Q, -motion.theta))
        step = Step(self._last.local_base.to(local_base), _turned(covariance, motion.theta))
        self.steps.append(step)
        self.mapper.move(step.motion, step.covariance)
        return local_base

    def _match(self, scan: Scan, prior: Pose, Q: Array) -> tuple[Pose, Array]:
        """The base in the local frame, and its covariance given the last one; in the base frame."""
        far = self._far_map.points()
        walls = np.concatenate([self._local_map.points(), far[~self._local_map.covers(far)]])
        points = _sampled(scan, self._config.keyframe.matched_points)
        if len(walls) < _LEAST_POINTS or len(points) < _LEAST_POINTS:
            return prior, Q
        found = register(points, cKDTree(walls), walls, prior, Q, self._config.scan_matching)
        if found is None or found.inliers < _LEAST_INLIERS:
            return prior, Q
        return found.pose, found.covariance + _MATCHING_FLOOR

    def _keep(self, scan: Scan, odom_base: Pose, local_base: Pose) -> None:
        map_base = self.mapper.belief.map_base
        moved = self._kept.to(local_base) if self._kept is not None else None
        if (
            moved is None
            or math.hypot(moved.x, moved.y) > _SCAN_EVERY_M
            or abs(moved.theta) > _SCAN_EVERY_RAD
        ):
            self._kept = local_base
            self._last = Keyframe(scan.stamp, odom_base, local_base, map_base, scan)
        else:
            self._last = Keyframe(scan.stamp, odom_base, local_base, map_base, None)
        self.keyframes.append(self._last)

    # -- control, per odometry message -------------------------------------------------------------

    def control(self, odometry: Odometry) -> Twist:
        """The twist to drive now."""
        if self._odometry:
            self._turned += wrap_angle(
                odometry.odom_base.theta - self._odometry[-1].odom_base.theta
            )
        self._odometry.append(odometry)
        if self._last is None:
            return STANDSTILL
        if self._turning():
            return Twist(0.0, self._config.edge_follower.max_turn_rate_radps * 0.8)
        match self._order:
            case Drive(track=track):
                local_base = self._last.local_base.compose(
                    self._last.odom_base.to(odometry.odom_base)
                )
                self._twist = follow(
                    track, local_base, self._twist.linear, self._radius, self._config.edge_follower
                )
                return self._twist
            case _:
                return STANDSTILL

    def _obey(self, order: Order) -> None:
        if isinstance(order, LookAround):
            self._turn(order.angle)
        self._order = order

    def _turn(self, angle: float) -> None:
        self._turned, self._turning_to = 0.0, angle

    def _turning(self) -> bool:
        if self._turning_to is not None and self._turned >= self._turning_to:
            self._turning_to = None
        return self._turning_to is not None


def _turned(covariance: Array, angle: float) -> Array:
    """A motion covariance (3, 3) in a frame turned by -angle against its own."""
    c, s = math.cos(angle), math.sin(angle)
    G = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return G @ covariance @ G.T


def _blind_angle(scan: Scan) -> float:
    """How far to turn so that every direction has been seen, with some overlap; rad."""
    seen = scan.angle_increment * (len(scan.ranges) - 1)
    return max(0.0, math.tau - seen) + 0.2


def _sampled(scan: Scan, count: int) -> Array:
    """About so many end points (N, 2), evenly spaced along what the beams hit; base frame.

    Evenly in space, not in angle: far walls tell most about the heading, and have few beams.
    """
    with np.errstate(invalid="ignore"):
        hit = scan.ranges < _MATCHED_RANGE_M
    r, b = scan.ranges[hit], scan.bearings[hit]
    points = np.stack([r * np.cos(b), r * np.sin(b)], axis=1)
    gaps = np.hypot(*np.diff(points, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(np.minimum(gaps, _LONGEST_GAP_M))])
    step = max(float(along[-1]) / count, 1e-6)
    chosen = np.unique(np.floor(along / step), return_index=True)[1]
    return scan.base_laser.transform(points[chosen])


def smoothed(pipeline: Pipeline) -> tuple[list[Pose], dict[int, Pose]]:
    """The best estimate of all keyframes (map_base) and vertices (map_vertex)."""
    keyframes, mapper = pipeline.keyframes, pipeline.mapper
    ids = {vertex: len(keyframes) + i for i, vertex in enumerate(mapper.belief.ids)}
    start = [k.map_base for k in keyframes] + [mapper.belief.map_vertex(v) for v in ids]
    constraints = [
        Constraint(i, i + 1, step.motion, np.linalg.inv(step.covariance))
        for i, step in enumerate(pipeline.steps[: len(keyframes) - 1])
    ]
    for seen in mapper.observations:
        if seen.vertex in ids and seen.keyframe < len(keyframes):
            information = np.zeros((3, 3))
            k = len(seen.R)
            information[:k, :k] = np.linalg.inv(seen.R)
            constraints.append(
                Constraint(seen.keyframe, ids[seen.vertex], seen.base_vertex, information)
            )
    x = smooth(np.array([(p.x, p.y, p.theta) for p in start]).reshape(-1, 3), constraints)
    poses = [Pose.from_array(row) for row in x]
    return poses[: len(keyframes)], {vertex: poses[i] for vertex, i in ids.items()}
