"""How the robot meets ROS 2 nodes."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from gvgbot.ranges import Range
from gvgbot.telemetry_config import check_endpoints

_NAMESPACE = r"(/[A-Za-z_]\w*)*"


@dataclass(frozen=True, slots=True, kw_only=True)
class Ros2Config:
    """Topics for ROS 2 nodes that use rmw_zenoh; ROS itself need not be installed here."""

    enabled: bool = False  # true: publish /scan, /odom, /tf, /tf_static, /map and /gvg/markers
    # type of /cmd_vel messages that drive the robot, through its guard; None: it does not listen
    cmd_vel: Literal["Twist", "TwistStamped"] | None = None
    namespace: str = ""  # put before every topic, such as /robot1
    domain: Annotated[int, Range(0, 232)] = 0  # ROS_DOMAIN_ID of the nodes
    connect: tuple[str, ...] = ("tcp/127.0.0.1:7447",)  # rmw_zenohd, through which nodes are found
    listen: tuple[str, ...] = ("tcp/127.0.0.1:0",)  # where nodes reach the robot; 0: any free port
    zenoh_file: Path | None = None  # JSON5: keys, passwords, access control; see configs/zenoh

    def __post_init__(self) -> None:
        """Raises ValueError for no address, and for a namespace that ROS would not take."""
        check_endpoints("listen", self.listen)
        check_endpoints("connect", self.connect)
        if re.fullmatch(_NAMESPACE, self.namespace, re.ASCII) is None:
            raise ValueError(
                f"namespace = {self.namespace!r}: must be names of letters, digits and _, "
                "a / before each"
            )
