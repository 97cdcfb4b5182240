"""How the laser is connected, mounted and read."""

import math
import re
from dataclasses import dataclass
from typing import Annotated, Literal

from gvgbot.drivers.hokuyo.scip_messages import USER_STRING
from gvgbot.geometry import Pose
from gvgbot.ranges import Range

Echo = Literal["single", "first", "last", "strongest"]


@dataclass(frozen=True, slots=True, kw_only=True)
class HokuyoConfig:
    """How the laser is connected, mounted and read."""

    port: str = "/dev/ttyACM0"  # or tcp://host:10940
    serial: str = ""  # number of the laser to use, where several are; empty: whichever is there
    baud: Annotated[int, Range(19200, 750000)] = 115200  # means nothing on USB and Ethernet
    # what carries the bytes, and so how many; auto: told by the port
    link: Literal["auto", "usb", "serial", "tcp"] = "auto"
    rate_hz: Annotated[float, Range(0.5, 50.0)] = 10.0  # scans a second, as near as the motor does
    skip: Annotated[int, Range(0, 9)] | None = None  # scans left out between two; beats rate_hz
    cluster: Annotated[int, Range(1, 99)] = 1  # steps per beam
    adapt: bool = True  # to a link that is too slow: coarser, shorter or fewer scans
    echo: Echo = "single"  # which of several returns along a beam; needs a multi-echo laser
    intensities: bool = False  # ask for them beside the ranges
    user_string: str = ""  # marks the scans asked for; up to 16 of A-Z a-z 0-9 . _ + @ and space
    x_m: Annotated[float, Range(-2.0, 2.0)] = 0.0  # of the laser on the base
    y_m: Annotated[float, Range(-2.0, 2.0)] = 0.0  # likewise, to the left
    yaw_deg: Annotated[float, Range(-180.0, 180.0)] = 0.0  # likewise, anticlockwise
    upside_down: bool = False  # mounted with its top down: angles are mirrored
    first_angle_deg: Annotated[float, Range(-180.0, 180.0)] = -180.0  # of the laser as mounted:
    last_angle_deg: Annotated[float, Range(-180.0, 180.0)] = 180.0  # beams outside are left out
    min_range_m: Annotated[float, Range(0.0, 10.0)] = 0.0  # the laser's own limit holds too
    max_range_m: Annotated[float, Range(0.5, 100.0)] = 30.0  # what is beyond counts as nothing hit
    processing_latency_s: Annotated[float, Range(0.0, 0.1)] = 0.00475  # last beam to first byte
    synchronise: bool = True  # ask the laser for its time before the scans
    reply_timeout_s: Annotated[float, Range(0.15, 10.0)] = 0.4  # slow ones need 0.11 s
    opening_patience_s: Annotated[float, Range(1.0, 60.0)] = 4.0  # with a laser that boots
    missed_scans: Annotated[int, Range(1, 100)] = 3  # before the stream is started again

    def __post_init__(self) -> None:
        """Raise ValueError for limits in the wrong order, or a string that no laser accepts."""
        if self.last_angle_deg <= self.first_angle_deg:
            raise ValueError("last_angle_deg must be greater than first_angle_deg")
        if self.max_range_m <= self.min_range_m:
            raise ValueError(
                f"max_range_m = {self.max_range_m:g}: must be greater than "
                f"min_range_m = {self.min_range_m:g}, or nothing is ever seen"
            )
        if self.user_string and not re.fullmatch(USER_STRING, self.user_string):
            raise ValueError(
                f"user_string = {self.user_string!r}: "
                "must be up to 16 of A-Z a-z 0-9 . _ + @ and space"
            )

    @property
    def base_laser(self) -> Pose:
        """The laser on the base."""
        return Pose(self.x_m, self.y_m, math.radians(self.yaw_deg))

    @property
    def wants_intensities(self) -> bool:
        """Whether the laser must send intensities: they tell which echo is the strongest."""
        return self.intensities or self.echo == "strongest"
