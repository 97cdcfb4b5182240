"""The robot at a moment, as the network gets it: its state, scans, odometry, and plan."""

import numpy as np

from gvgbot import topics
from gvgbot.autonomy.exploration.paths import Approach, shortest_path
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam.ekf import OdometryNoise, part, predict
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.autonomy.topology import outwards
from gvgbot.geometry import STANDSTILL, Array, Pose, wrap_angle
from gvgbot.hal.guard import NEEDS_SOMEBODY
from gvgbot.hal.messages import Battery, Odometry, Scan, Sign
from gvgbot.topics import (
    NOTHING_IN_RANGE,
    NOTHING_TRUSTED,
    UNKNOWN,
    LinkHealth,
    Mate,
    Phase,
    State,
    packed,
)

_FARTHEST_MM = NOTHING_IN_RANGE - 1


def state(
    pipeline: Pipeline,
    odometry: Odometry | None,
    battery: Battery | None,
    *,
    stamp: float,
    sequence: int,
    cycles: int,
    uptime: float,
    noise: OdometryNoise,
    away: str | None,
    guard: str | None,
    contacts: int,
    slips: int,
    laser: LinkHealth,
    base: LinkHealth,
    requests: tuple[str, ...] = (),
) -> State:
    """The state at `stamp`; `odometry` is the last control cycle's, `away` says what is missing."""
    mission, graph, map_base = pipeline.mission, pipeline.mapper.graph, pipeline.map_base
    twist = STANDSTILL if odometry is None else odometry.twist
    return State(
        stamp=stamp,
        sequence=sequence,
        cycles=cycles,
        cycle_age=None if odometry is None else stamp - odometry.stamp,
        phase=_phase(pipeline, away),
        outcome=mission.outcome,
        reason=_reason(pipeline, away),
        errand=pipeline.errands.progress,
        requests=requests,
        team=tuple(Mate(name=one.name, pose=_triple(one.pose)) for one in pipeline.traffic.present),
        uptime=uptime,
        pose=(map_base.x, map_base.y, map_base.theta),
        covariance=tuple(pose_covariance(pipeline, odometry, noise).ravel().tolist()),
        twist=(twist.linear, twist.angular),
        battery_voltage=None if battery is None else battery.voltage,
        battery_fraction=None if battery is None else battery.fraction,
        vertices=len(graph.vertices),
        edges=len(graph.edges),
        frontiers=len(graph.frontiers()),
        distance=pipeline.driven,
        guard=guard,
        contacts=contacts,
        slips=slips,
        laser=laser,
        base=base,
    )


def _reason(pipeline: Pipeline, away: str | None) -> str:
    """Why it is as it is; where a device is away, the mission's may be how exploring ended."""
    is_halted = _phase(pipeline, away) == "halted"
    return (not is_halted and pipeline.mission.reason) or away or ""


def _phase(pipeline: Pipeline, away: str | None) -> Phase:
    errands = pipeline.errands
    if errands.is_paused:
        return "paused"
    is_free = errands.progress is None or errands.is_resting
    if is_free and pipeline.mission.outcome is not None:
        return "finished"
    if pipeline.past.last is None:
        return "starting"
    if away is not None:
        return "halted"
    if errands.progress is not None:
        return "errand"
    return "waiting" if errands.is_waiting else "exploring"


def sign(now: State, *, is_lost: bool, needs_somebody: bool = False) -> Sign:
    """What people beside the robot are shown of its state."""
    if now.phase == "starting":
        return "starting"
    if now.phase == "halted" or now.guard in NEEDS_SOMEBODY or needs_somebody:
        return "trouble"
    if now.phase == "finished":
        return "trouble" if now.outcome == "failed" else "finished"
    if now.phase in ("paused", "waiting"):
        return "standing"
    return "searching" if is_lost else "busy"


def pose_covariance(pipeline: Pipeline, odometry: Odometry | None, noise: OdometryNoise) -> Array:
    """Covariance (3, 3) of map_base: the belief's, grown by the motion since the last keyframe.

    While the heading stays the same no gyro drifts, however long the robot stands there.
    """
    if pipeline.is_lost:
        return UNKNOWN * np.eye(3)
    robot = part(pipeline.mapper.belief, ())
    last = pipeline.past.last
    if odometry is None or last is None:
        return robot.P
    motion = last.odom_base.to(odometry.odom_base)
    growth = noise.covariance(motion, pipeline.tracker.felt_s(odometry.stamp - last.stamp))
    return predict(robot, motion, growth).P


def sweep(scan: Scan, map_base: Pose | None) -> topics.Scan:
    """A scan as it travels; `map_base` is where the robot was at the middle of it."""
    return topics.Scan(
        stamp=scan.stamp,
        time_increment=scan.time_increment,
        angle_min=scan.angle_min,
        angle_increment=scan.angle_increment,
        range_max=scan.range_max,
        base_laser=_triple(scan.base_laser),
        map_base=None if map_base is None else _triple(map_base),
        ranges=_millimetres(scan.ranges),
    )


def _millimetres(ranges: Array) -> bytes:
    """Ranges, m, as they travel; what is too far for that counts as out of range."""
    with np.errstate(invalid="ignore"):
        mm = np.minimum(np.rint(ranges * 1000.0), NOTHING_IN_RANGE)
        mm[mm > _FARTHEST_MM] = NOTHING_IN_RANGE
    mm[np.isnan(mm)] = NOTHING_TRUSTED
    return mm.astype("<u2").tobytes()


def movement(odometry: Odometry, map_base: Pose) -> topics.Odometry:
    """Odometry as it travels, with where the robot is believed to be."""
    return topics.Odometry(
        stamp=odometry.stamp,
        map_base=_triple(map_base),
        odom_base=_triple(odometry.odom_base),
        twist=(odometry.twist.linear, odometry.twist.angular),
    )


def _triple(pose: Pose) -> tuple[float, float, float]:
    return pose.x, pose.y, pose.theta


def plan(pipeline: Pipeline, reason: str, stamp: float) -> topics.Plan:
    """Where the robot goes; `reason` is the last decision's. An errand has a track only.

    Who does not know its place goes nowhere on the map.
    """
    if pipeline.is_lost:
        return topics.Plan(stamp=stamp, vertex=None, bearing=None, reason="", track=b"", route=b"")
    is_exploring, graph = pipeline.errands.errand is None, pipeline.mapper.graph
    target = pipeline.mission.target if is_exploring else None
    half = None if target is None else graph.half_edge(target)
    vertex = bearing = None
    route = np.zeros((0, 2))
    if target is not None and half is not None:
        vertex = target.vertex
        bearing = wrap_angle(half.bearing + pipeline.mapper.belief.map_vertex(vertex).theta)
        route = _route(pipeline, target)
    return topics.Plan(
        stamp=stamp,
        vertex=vertex,
        bearing=bearing,
        reason=reason if is_exploring else "",
        track=packed(pipeline.track),
        route=packed(route),
    )


def _route(pipeline: Pipeline, target: HalfEdgeId) -> Array:
    """The known edges (N, 2), m, from the end of the robot's own edge to a frontier's vertex."""
    graph, where = pipeline.mapper.graph, pipeline.mission.where
    if where.on_edge is None or where.on_edge == target:
        return np.zeros((0, 2))
    starts = [Approach(where.trail_length, where.on_edge)]
    edge = graph.edge_at(where.on_edge)
    if edge is not None:
        ahead = max(0.0, edge.length - where.trail_length)
        starts.append(Approach(ahead, edge.other(where.on_edge)))
    approach = shortest_path(graph, starts, target.vertex)
    departures = () if approach is None else approach.departures
    ways = ((graph.edge_at(end), end) for end in departures)
    belief = pipeline.mapper.belief
    lines = (outwards(belief, edge, end) for edge, end in ways if edge is not None)
    return np.concatenate([np.zeros((0, 2)), *lines])
