"""What crosses the hardware abstraction: frozen values, each with the stamp of when it was true."""

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal, Self

import numpy as np

from gvgbot.geometry import Array, Pose, Twist

_AHEAD = math.radians(30.0)  # to either side: what is there comes into the way of a body soon

# what a base shows to people beside it: the robot drives, looks for its place, stands until it is
# asked for something, is done, or needs somebody
Sign = Literal["off", "starting", "busy", "searching", "standing", "finished", "trouble"]


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """One laser sweep.

    `ranges` (N,) in metres, read-only; NaN = nothing trusted, inf = nothing within range.
    Beam i points to `angle_min + i * angle_increment` (rad) in the laser frame, anticlockwise.
    `stamp` is the time of the first beam (s, monotonic); beam i is `i * time_increment` later.
    Where nothing is within range, all is free up to `range_max` (m); what reflects well may be seen
    from farther off.
    """

    stamp: float
    ranges: Array
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    time_increment: float = 0.0
    base_laser: Pose = field(default_factory=Pose)

    def __post_init__(self) -> None:
        self.ranges.setflags(write=False)

    @property
    def bearings(self) -> Array:
        """Beam directions (N,) in the laser frame, rad."""
        return _beams(self.angle_min, self.angle_increment, len(self.ranges))[0]

    @property
    def field_of_view(self) -> tuple[float, float]:
        """Directions of the first and the last beam, rad, base frame, not wrapped."""
        first = self.base_laser.theta + self.angle_min
        return first, first + self.angle_increment * (len(self.ranges) - 1)

    @property
    def looks_ahead(self) -> bool:
        """Whether beams cover what will soon be in the way of a base that drives forwards."""
        first, last = self.field_of_view
        reach = last - first + self.angle_increment  # the beams of a whole turn meet
        return all((bearing - first) % math.tau <= reach for bearing in (-_AHEAD, 0.0, _AHEAD))

    @property
    def directions(self) -> Array:
        """Beam directions (N, 2) in the laser frame, as vectors one metre long."""
        return _beams(self.angle_min, self.angle_increment, len(self.ranges))[1]

    def unpacked(self) -> Self:
        """The scan itself, where others have been packed."""
        return self

    @property
    def ends(self) -> Array:
        """Where beams hit something (N, 2), m, laser frame, in the order of the beams."""
        hit = np.isfinite(self.ranges)
        ends: Array = self.ranges[hit, None] * self.directions[hit]
        return ends


@lru_cache(maxsize=8)
def _beams(first: float, increment: float, count: int) -> tuple[Array, Array]:
    """Bearings (N,), rad, and directions (N, 2) of beams; read-only, since a laser has the same."""
    bearings = first + increment * np.arange(count, dtype=np.float64)
    directions = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    for beams in (bearings, directions):
        beams.setflags(write=False)
    return bearings, directions


@dataclass(frozen=True, slots=True)
class Odometry:
    """Dead reckoning since the driver started: a pose, so a missed message costs nothing.

    `breaks` is how often the base has lost count since: where a pose follows one with another
    number, the base has not moved between them as far as it knows, but may have been carried.
    """

    stamp: float
    odom_base: Pose
    twist: Twist
    breaks: int = 0


@dataclass(frozen=True, slots=True)
class Contact:
    """What the base feels: bumper and cliff per side, wheels off the floor, motors overloaded.

    And whether the charger's cable ties it to a wall.
    """

    stamp: float
    bumper_left: bool = False
    bumper_centre: bool = False
    bumper_right: bool = False
    cliff_left: bool = False
    cliff_centre: bool = False
    cliff_right: bool = False
    wheel_drop_left: bool = False
    wheel_drop_right: bool = False
    over_current: bool = False
    charger_cable: bool = False

    @property
    def bumper(self) -> bool:
        """Whether any bumper is pressed."""
        return self.bumper_left or self.bumper_centre or self.bumper_right

    @property
    def cliff(self) -> bool:
        """Whether any cliff sensor sees no floor."""
        return self.cliff_left or self.cliff_centre or self.cliff_right

    @property
    def wheel_drop(self) -> bool:
        """Whether a wheel hangs in the air."""
        return self.wheel_drop_left or self.wheel_drop_right


LOW_BATTERY, EMPTY_BATTERY = 0.28, 0.05  # of a full charge: 14.0 and 13.2 V of a Kobuki's


@dataclass(frozen=True, slots=True)
class Battery:
    """State of the battery: volts, charge fraction 0..1, and whether it is being charged."""

    stamp: float
    voltage: float
    fraction: float
    charging: bool
