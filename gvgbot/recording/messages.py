"""Values of the HAL to and from the bytes in a recording; nothing is rounded on the way."""

import math
from dataclasses import dataclass, fields
from typing import Any, cast

import numpy as np

from gvgbot.autonomy.control.reflexes import Felt
from gvgbot.autonomy.loop import Cycle
from gvgbot.geometry import Pose, Twist
from gvgbot.hal.guard import Reason
from gvgbot.hal.messages import Battery, Contact, Odometry, Scan
from gvgbot.recording.schemas import decoded, message

_FARTHEST_M = 1000.0  # no laser sees as far
_BOOLS = [field.name for field in fields(Contact) if field.name != "stamp"]


@dataclass(frozen=True, slots=True)
class Channel:
    """A stream of messages of one kind; `schema` is the name of a type in the table, or of JSON."""

    topic: str
    encoding: str  # protobuf, json, or nothing that anybody knows
    schema: str = ""


SCAN = Channel("/scan", "protobuf", "foxglove.LaserScan")
CYCLE = Channel("/cycle", "protobuf", "gvgbot.Cycle")
BATTERY = Channel("/battery", "protobuf", "gvgbot.Battery")
TRANSFORM = Channel("/tf", "protobuf", "foxglove.FrameTransform")
EVENT = Channel("/events", "json", "gvgbot.Event")
RAW = {
    link: (Channel(f"/raw/{link}/heard", ""), Channel(f"/raw/{link}/said", ""))
    for link in ("laser", "base")
}
CHANNELS = (SCAN, CYCLE, BATTERY, TRANSFORM, EVENT, *(one for two in RAW.values() for one in two))


def encode_scan(scan: Scan) -> bytes:
    """A scan, seen from the base."""
    laser = scan.base_laser
    encoded = message(
        SCAN.schema,
        timestamp=_time(scan.stamp),
        frame_id="base",
        pose={"position": _vector(laser), "orientation": _quaternion(laser)},
        start_angle=scan.angle_min,
        end_angle=scan.angle_min + scan.angle_increment * (len(scan.ranges) - 1),
        ranges=scan.ranges.tolist(),
        stamp=scan.stamp,
        angle_increment=scan.angle_increment,
        time_increment=scan.time_increment,
        range_min=scan.range_min,
        range_max=scan.range_max,
        base_laser=_pose(laser),
    )
    return cast(bytes, encoded.SerializeToString())


def decode_scan(data: bytes) -> Scan:
    """The inverse of `encode_scan`.

    Raises google.protobuf.message.DecodeError, or ValueError for what no laser sends.
    """
    m = decoded(SCAN.schema, data)
    ranges = np.array(m.ranges, np.float64)
    angles, limits = (m.start_angle, m.angle_increment), (m.range_min, m.range_max)
    _check_finite(m.stamp, *angles, *limits, m.time_increment)
    farthest = ranges.max(initial=m.range_max, where=np.isfinite(ranges))
    if len(ranges) < 2 or not m.angle_increment or farthest > _FARTHEST_M:
        raise ValueError(f"no scan: {len(ranges)} beams, {m.angle_increment} rad, {farthest} m")
    return Scan(
        stamp=m.stamp,
        ranges=ranges,
        angle_min=m.start_angle,
        angle_increment=m.angle_increment,
        range_min=m.range_min,
        range_max=m.range_max,
        time_increment=m.time_increment,
        base_laser=_to_pose(m.base_laser),
    )


def encode_cycle(cycle: Cycle) -> bytes:
    """A control cycle."""
    odometry, felt = cycle.odometry, cycle.felt
    encoded = message(
        CYCLE.schema,
        stamp=odometry.stamp,
        odom_base=_pose(odometry.odom_base),
        measured=_twist(odometry.twist),
        breaks=odometry.breaks,
        contact=None if felt.contact is None else _contact(felt.contact),
        stopped_for=felt.stopped_for or "",
        wish=_twist(cycle.wish),
        permitted=_twist(cycle.permitted),
    )
    return cast(bytes, encoded.SerializeToString())


def decode_cycle(data: bytes) -> Cycle:
    """The inverse of `encode_cycle`.

    Raises google.protobuf.message.DecodeError, or ValueError for numbers that are none.
    """
    m = decoded(CYCLE.schema, data)
    _check_finite(m.stamp)
    contact = None
    if m.HasField("contact"):
        felt = {name: getattr(m.contact, name) for name in _BOOLS}
        contact = Contact(m.contact.stamp, **felt)
    return Cycle(
        Odometry(m.stamp, _to_pose(m.odom_base), _to_twist(m.measured), m.breaks),
        Felt(contact, cast("Reason | None", m.stopped_for or None)),
        _to_twist(m.wish),
        _to_twist(m.permitted),
    )


def encode_battery(battery: Battery) -> bytes:
    """A state of the battery."""
    encoded = message(
        BATTERY.schema,
        stamp=battery.stamp,
        voltage=battery.voltage,
        fraction=battery.fraction,
        charging=battery.charging,
    )
    return cast(bytes, encoded.SerializeToString())


def decode_battery(data: bytes) -> Battery:
    """The inverse of `encode_battery`. Raises google.protobuf.message.DecodeError."""
    m = decoded(BATTERY.schema, data)
    return Battery(m.stamp, m.voltage, m.fraction, m.charging)


def encode_transform(stamp: float, map_base: Pose) -> bytes:
    """Where the base was believed to be, for those who look at a recording."""
    encoded = message(
        TRANSFORM.schema,
        timestamp=_time(stamp),
        parent_frame_id="map",
        child_frame_id="base",
        translation=_vector(map_base),
        rotation=_quaternion(map_base),
    )
    return cast(bytes, encoded.SerializeToString())


def _check_finite(*numbers: float) -> None:
    if not all(map(math.isfinite, numbers)):
        raise ValueError("a number that is none")


def nanoseconds(stamp: float) -> int:
    """A stamp as MCAP has times."""
    return max(0, round(1e9 * stamp))


def _time(stamp: float) -> dict[str, int]:
    seconds, nanos = divmod(nanoseconds(stamp), 10**9)
    return {"seconds": seconds, "nanos": nanos}


def _pose(pose: Pose) -> dict[str, float]:
    return {"x": pose.x, "y": pose.y, "theta": pose.theta}


def _to_pose(m: Any) -> Pose:
    _check_finite(m.x, m.y, m.theta)
    return Pose(m.x, m.y, m.theta)


def _twist(twist: Twist) -> dict[str, float]:
    return {"linear": twist.linear, "angular": twist.angular}


def _to_twist(m: Any) -> Twist:
    _check_finite(m.linear, m.angular)
    return Twist(m.linear, m.angular)


def _contact(contact: Contact) -> dict[str, Any]:
    return {"stamp": contact.stamp} | {name: getattr(contact, name) for name in _BOOLS}


def _vector(pose: Pose) -> dict[str, float]:
    return {"x": pose.x, "y": pose.y}


def _quaternion(pose: Pose) -> dict[str, float]:
    return {"z": math.sin(pose.theta / 2), "w": math.cos(pose.theta / 2)}
