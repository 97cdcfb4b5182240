"""The robot's state at a moment, as the network gets it."""

from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam.ekf import OdometryNoise, predict
from gvgbot.geometry import STANDSTILL, Array
from gvgbot.hal.messages import Battery, Odometry
from gvgbot.topics import LinkHealth, Phase, State


def state(
    pipeline: Pipeline,
    odometry: Odometry | None,
    battery: Battery | None,
    *,
    stamp: float,
    sequence: int,
    cycles: int,
    noise: OdometryNoise,
    away: str | None,
    guard: str | None,
    contacts: int,
    slips: int,
    laser: LinkHealth,
    base: LinkHealth,
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
        reason=mission.reason or away or "",
        pose=(map_base.x, map_base.y, map_base.theta),
        covariance=tuple(pose_covariance(pipeline, odometry, noise).ravel().tolist()),
        twist=(twist.linear, twist.angular),
        battery_voltage=None if battery is None else battery.voltage,
        battery_fraction=None if battery is None else battery.fraction,
        vertices=len(graph.vertices),
        edges=len(graph.edges),
        frontiers=len(graph.frontiers()),
        distance=pipeline.travelled,
        guard=guard,
        contacts=contacts,
        slips=slips,
        laser=laser,
        base=base,
    )


def _phase(pipeline: Pipeline, away: str | None) -> Phase:
    if pipeline.mission.outcome is not None:
        return "finished"
    if not pipeline.keyframes:
        return "starting"
    return "exploring" if away is None else "halted"


def pose_covariance(pipeline: Pipeline, odometry: Odometry | None, noise: OdometryNoise) -> Array:
    """Covariance (3, 3) of map_base: the belief's, grown by the motion since the last keyframe."""
    belief = pipeline.mapper.belief
    if odometry is None or not pipeline.keyframes:
        return belief.P[:3, :3]
    last = pipeline.keyframes[-1]
    motion = last.odom_base.to(odometry.odom_base)
    growth = noise.covariance(motion, max(0.0, odometry.stamp - last.stamp))
    return predict(belief, motion, growth).P[:3, :3]
