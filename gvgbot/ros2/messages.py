"""The messages of ROS 2 that a robot sends, field by field as ROS has them.

Lengths in m, angles in rad. Hashes are those of ROS 2 Humble to Lyrical, in which these types
are the same.
"""

from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import numpy as np

from gvgbot.geometry import Array
from gvgbot.ros2.cdr import (
    Bool,
    Bytes,
    Float32,
    Float32s,
    Float64,
    Int8s,
    Int32,
    Matrix6,
    Message,
    Rows,
    UInt32,
)


def _none() -> Array:
    return np.zeros(0)


@dataclass(frozen=True, slots=True)
class Time(Message):
    """A time since 1970."""

    ros_name: ClassVar[str] = "builtin_interfaces/msg/Time"
    sec: Int32 = 0
    nanosec: UInt32 = 0


@dataclass(frozen=True, slots=True)
class Duration(Message):
    """A duration; of a marker, none means for ever."""

    ros_name: ClassVar[str] = "builtin_interfaces/msg/Duration"
    sec: Int32 = 0
    nanosec: UInt32 = 0


@dataclass(frozen=True, slots=True)
class Header(Message):
    """When a message was true, and in which frame."""

    ros_name: ClassVar[str] = "std_msgs/msg/Header"
    stamp: Time = Time()
    frame_id: str = ""


@dataclass(frozen=True, slots=True)
class ColorRGBA(Message):
    """A colour, each part from 0 to 1."""

    ros_name: ClassVar[str] = "std_msgs/msg/ColorRGBA"
    r: Float32 = 0.0
    g: Float32 = 0.0
    b: Float32 = 0.0
    a: Float32 = 0.0


@dataclass(frozen=True, slots=True)
class Vector3(Message):
    """A vector."""

    ros_name: ClassVar[str] = "geometry_msgs/msg/Vector3"
    x: Float64 = 0.0
    y: Float64 = 0.0
    z: Float64 = 0.0


@dataclass(frozen=True, slots=True)
class Point(Message):
    """A point."""

    ros_name: ClassVar[str] = "geometry_msgs/msg/Point"
    x: Float64 = 0.0
    y: Float64 = 0.0
    z: Float64 = 0.0


@dataclass(frozen=True, slots=True)
class Quaternion(Message):
    """A rotation."""

    ros_name: ClassVar[str] = "geometry_msgs/msg/Quaternion"
    x: Float64 = 0.0
    y: Float64 = 0.0
    z: Float64 = 0.0
    w: Float64 = 1.0


@dataclass(frozen=True, slots=True)
class Pose(Message):
    """A place and a direction."""

    ros_name: ClassVar[str] = "geometry_msgs/msg/Pose"
    position: Point = Point()
    orientation: Quaternion = Quaternion()


@dataclass(frozen=True, slots=True)
class Transform(Message):
    """Where a frame is in another one."""

    ros_name: ClassVar[str] = "geometry_msgs/msg/Transform"
    translation: Vector3 = Vector3()
    rotation: Quaternion = Quaternion()


@dataclass(frozen=True, slots=True)
class TransformStamped(Message):
    """Where a frame was in that of the header."""

    ros_name: ClassVar[str] = "geometry_msgs/msg/TransformStamped"
    header: Header = Header()
    child_frame_id: str = ""
    transform: Transform = Transform()


@dataclass(frozen=True, slots=True, eq=False)
class PoseWithCovariance(Message):
    """A pose; the covariance is that of x, y, z and the turns about them."""

    ros_name: ClassVar[str] = "geometry_msgs/msg/PoseWithCovariance"
    pose: Pose = Pose()
    covariance: Matrix6 = field(default_factory=lambda: np.zeros(36))


@dataclass(frozen=True, slots=True)
class Twist(Message):
    """A velocity, m/s and rad/s."""

    ros_name: ClassVar[str] = "geometry_msgs/msg/Twist"
    type_hash: ClassVar[str] = "9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"
    linear: Vector3 = Vector3()
    angular: Vector3 = Vector3()


@dataclass(frozen=True, slots=True)
class TwistStamped(Message):
    """A velocity, with the time for which it was meant."""

    ros_name: ClassVar[str] = "geometry_msgs/msg/TwistStamped"
    type_hash: ClassVar[str] = "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64"
    header: Header = Header()
    twist: Twist = Twist()


@dataclass(frozen=True, slots=True, eq=False)
class TwistWithCovariance(Message):
    """A velocity; the covariance is ordered as that of a pose."""

    ros_name: ClassVar[str] = "geometry_msgs/msg/TwistWithCovariance"
    twist: Twist = Twist()
    covariance: Matrix6 = field(default_factory=lambda: np.zeros(36))


@dataclass(frozen=True, slots=True, eq=False)
class Odometry(Message):
    """Where a frame is by dead reckoning, and how it moves in its own axes."""

    ros_name: ClassVar[str] = "nav_msgs/msg/Odometry"
    type_hash: ClassVar[str] = "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"
    header: Header
    child_frame_id: str
    pose: PoseWithCovariance
    twist: TwistWithCovariance


@dataclass(frozen=True, slots=True)
class MapMetaData(Message):
    """How a grid lies in its frame; the origin is the outer corner of its first cell."""

    ros_name: ClassVar[str] = "nav_msgs/msg/MapMetaData"
    map_load_time: Time
    resolution: Float32
    width: UInt32
    height: UInt32
    origin: Pose


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyGrid(Message):
    """Cells row by row from the origin: percent occupied, -1 unknown."""

    ros_name: ClassVar[str] = "nav_msgs/msg/OccupancyGrid"
    type_hash: ClassVar[str] = "8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7"
    header: Header
    info: MapMetaData
    data: Int8s


@dataclass(frozen=True, slots=True, eq=False)
class LaserScan(Message):
    """One sweep: NaN where nothing is trusted, inf where nothing is in range."""

    ros_name: ClassVar[str] = "sensor_msgs/msg/LaserScan"
    type_hash: ClassVar[str] = "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828"
    header: Header
    angle_min: Float32
    angle_max: Float32
    angle_increment: Float32
    time_increment: Float32
    scan_time: Float32
    range_min: Float32
    range_max: Float32
    ranges: Float32s
    intensities: Float32s = field(default_factory=_none)


@dataclass(frozen=True, slots=True)
class TFMessage(Message):
    """Transforms between frames."""

    ros_name: ClassVar[str] = "tf2_msgs/msg/TFMessage"
    type_hash: ClassVar[str] = "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"
    transforms: tuple[TransformStamped, ...]


@dataclass(frozen=True, slots=True, eq=False)
class CompressedImage(Message):
    """The texture of a marker."""

    ros_name: ClassVar[str] = "sensor_msgs/msg/CompressedImage"
    header: Header = Header()
    format: str = ""
    data: Bytes = field(default_factory=_none)


@dataclass(frozen=True, slots=True)
class UVCoordinate(Message):
    """Where a point of a marker is on its texture."""

    ros_name: ClassVar[str] = "visualization_msgs/msg/UVCoordinate"
    u: Float32 = 0.0
    v: Float32 = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class MeshFile(Message):
    """The mesh of a marker."""

    ros_name: ClassVar[str] = "visualization_msgs/msg/MeshFile"
    filename: str = ""
    data: Bytes = field(default_factory=_none)


@dataclass(frozen=True, slots=True, eq=False)
class Marker(Message):
    """Something to be drawn; it replaces the one of the same namespace and id."""

    ros_name: ClassVar[str] = "visualization_msgs/msg/Marker"
    header: Header
    ns: str
    id: Int32
    type: Int32
    action: Int32
    pose: Pose
    scale: Vector3
    color: ColorRGBA
    lifetime: Duration = Duration()
    frame_locked: Bool = False
    points: Annotated[Array, Rows(Point)] = field(default_factory=_none)
    colors: tuple[ColorRGBA, ...] = ()
    texture_resource: str = ""
    texture: CompressedImage = field(default_factory=CompressedImage)
    uv_coordinates: tuple[UVCoordinate, ...] = ()
    text: str = ""
    mesh_resource: str = ""
    mesh_file: MeshFile = field(default_factory=MeshFile)
    mesh_use_embedded_materials: Bool = False


@dataclass(frozen=True, slots=True, eq=False)
class MarkerArray(Message):
    """Things to be drawn."""

    ros_name: ClassVar[str] = "visualization_msgs/msg/MarkerArray"
    type_hash: ClassVar[str] = "86cb8800b6fb05b5eff1abd7a56f62a5641d3ae9a1c29e78e67e704f1d067dcf"
    markers: tuple[Marker, ...]
