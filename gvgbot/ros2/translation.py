"""What the robot knows, as messages of ROS 2. Stamps are seconds since 1970."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gvgbot.geometry import Array, Pose
from gvgbot.hal import messages as hal
from gvgbot.ros2 import messages as ros

MAP, ODOM, BASE, LASER = "map", "odom", "base_link", "laser"  # frames; the first three by REP 105
_PLANAR = np.ix_([0, 1, 5], [0, 1, 5])  # x, y and the turn about z, of the six that ROS has
_NANOSECONDS = 10**9


def to_time(stamp: float) -> ros.Time:
    """A stamp, to the nanosecond as far as a float has it.

    Seconds have 32 bits: after January 2038, as of a clock that is set wrong, they come round.
    """
    sec = math.floor(stamp)
    carry, nanosec = divmod(round((stamp - sec) * _NANOSECONDS), _NANOSECONDS)
    return ros.Time((sec + carry + 2**31) % 2**32 - 2**31, nanosec)


def header(stamp: float, frame: str) -> ros.Header:
    """When something was true, and in which frame."""
    return ros.Header(to_time(stamp), frame)


def laser_scan(scan: hal.Scan, stamp: float, period: float) -> ros.LaserScan:
    """A scan; `stamp` is that of its first beam, `period` the time (s) since the one before."""
    return ros.LaserScan(
        header(stamp, LASER),
        angle_min=scan.angle_min,
        angle_max=scan.angle_min + scan.angle_increment * (len(scan.ranges) - 1),
        angle_increment=scan.angle_increment,
        time_increment=scan.time_increment,
        scan_time=period,
        range_min=scan.range_min,
        range_max=scan.range_max,
        ranges=scan.ranges,
    )


def odometry(odometry: hal.Odometry, stamp: float, pose: Array, twist: Array) -> ros.Odometry:
    """Dead reckoning with the covariances (3, 3) of its pose and its twist."""
    moving = ros.Twist(ros.Vector3(x=odometry.twist.linear), ros.Vector3(z=odometry.twist.angular))
    return ros.Odometry(
        header(stamp, ODOM),
        BASE,
        ros.PoseWithCovariance(to_pose(odometry.odom_base), _in_space(pose)),
        ros.TwistWithCovariance(moving, _in_space(twist)),
    )


def _in_space(covariance: Array) -> Array:
    """The covariance (36,) of a robot that stays on its floor."""
    spatial = np.zeros((6, 6))
    spatial[_PLANAR] = covariance
    return spatial.ravel()


def transforms(stamp: float, frames: Mapping[tuple[str, str], Pose]) -> ros.TFMessage:
    """Poses of frames by their names: parent and child."""
    return ros.TFMessage(
        tuple(
            ros.TransformStamped(
                header(stamp, parent),
                child,
                ros.Transform(ros.Vector3(pose.x, pose.y), _turned(pose.theta)),
            )
            for (parent, child), pose in frames.items()
        )
    )


def occupancy_grid(
    cells: NDArray[np.int8], resolution_m: float, origin: tuple[float, float], stamp: float
) -> ros.OccupancyGrid:
    """A grid: percent occupied, -1 unknown, (rows, columns) with row 0 at the bottom."""
    rows, columns = cells.shape
    corner = ros.Pose(ros.Point(*origin))
    info = ros.MapMetaData(to_time(stamp), resolution_m, columns, rows, corner)
    return ros.OccupancyGrid(header(stamp, MAP), info, cells.ravel())


def to_pose(pose: Pose) -> ros.Pose:
    """A pose on the floor."""
    return ros.Pose(ros.Point(pose.x, pose.y), _turned(pose.theta))


def _turned(angle: float) -> ros.Quaternion:
    return ros.Quaternion(z=math.sin(angle / 2), w=math.cos(angle / 2))
