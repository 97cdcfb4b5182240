"""Driving along an edge: pure pursuit on its polyline, slower where it is narrow, bent or ends."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from gvgbot.geometry import STANDSTILL, Array, Pose, Twist, stations_of, wrap_angle
from gvgbot.ranges import Range

_LEAST_LOOK_AHEAD_M = 0.12
_TIGHT_M, _TIGHT_TURN_RAD = 0.1, 0.35  # room beside the robot in which an arc would scrape
_CUT = 0.8  # of the clearance, the farthest to look ahead
_END_M, _AIM_M = 0.05, 0.1  # from the end of a track, and from the point to steer for, it is there
_TURN_PER_RAD = 1.5  # 1/s; on the spot, the robot turns the slower the less is left
_POINTS_BEYOND = 5  # the point to steer for, where there must be room as well
_LEAST_SHARE = 0.2  # of the speed, however far off course


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeFollowerConfig:
    """Speeds and look-ahead."""

    max_speed_mps: Annotated[float, Range(0.05, 2.0)] = 0.6  # where it is wide and straight
    max_turn_rate_radps: Annotated[float, Range(0.1, 4.0)] = 1.2  # on the spot and on the way
    # before the end of a track and before bends
    braking_mps2: Annotated[float, Range(0.05, 5.0)] = 0.4
    # to the point that it steers for, standing
    look_ahead_m: Annotated[float, Range(0.1, 2.0)] = 0.25
    # and farther off by what it drives in this time
    look_ahead_s: Annotated[float, Range(0.0, 3.0)] = 0.5
    # farther off course than this, it turns before it drives
    turn_on_the_spot_rad: Annotated[float, Range(0.2, 3.0)] = 0.9
    slow_clearance_m: Annotated[float, Range(0.1, 2.0)] = (
        0.6  # narrower than this, the robot slows down
    )
    min_speed_mps: Annotated[float, Range(0.01, 0.5)] = 0.15  # in the narrowest passage


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """What to drive along, local frame: polyline (N, 2), clearance and metres along it (N,)."""

    polyline: Array
    clearance: Array
    stations: Array

    @classmethod
    def of(cls, polyline: Array, clearance: Array) -> "Track":
        """A track from its polyline (N, 2), local frame, and the clearance (N,), m, along it."""
        return cls(polyline, clearance, stations_of(polyline))

    @property
    def length(self) -> float:
        """Metres from end to end."""
        return float(self.stations[-1])

    def until(self, metres: float) -> "Track":
        """The beginning of it, so long; at least two points."""
        if metres >= self.length:
            return self
        count = max(2, int(np.searchsorted(self.stations, metres)))
        return Track(self.polyline[:count], self.clearance[:count], self.stations[:count])


def follow(
    track: Track, local_base: Pose, speed: float, robot_radius: float, config: EdgeFollowerConfig
) -> Twist:
    """The twist that drives along a track; standstill at its end. `speed` is what it is, m/s."""
    line, stations, clearance = track.polyline, track.stations, track.clearance
    here = int(np.hypot(line[:, 0] - local_base.x, line[:, 1] - local_base.y).argmin())
    station = float(stations[here])
    remaining = track.length - station
    ahead = config.look_ahead_m + config.look_ahead_s * max(speed, 0.0)
    soon = clearance[here : int(stations.searchsorted(station + ahead))]
    room = float(soon.min(initial=np.inf))
    # Who looks far ahead cuts corners: where it is narrow, there is no room for that.
    ahead = min(ahead, max(_LEAST_LOOK_AHEAD_M, _CUT * room))
    aim = int(stations.searchsorted(station + ahead))
    x, y = line[min(aim, len(line) - 1)].tolist()
    away = math.hypot(x - local_base.x, y - local_base.y)
    if remaining < _END_M and away < _AIM_M:
        return STANDSTILL
    angle = wrap_angle(math.atan2(y - local_base.y, x - local_base.x) - local_base.theta)
    is_tight = room < robot_radius + _TIGHT_M
    most = _TIGHT_TURN_RAD if is_tight else config.turn_on_the_spot_rad
    if abs(angle) > most and away > _END_M:
        rate = min(config.max_turn_rate_radps, _TURN_PER_RAD * abs(angle))
        return Twist(0.0, math.copysign(rate, angle))
    narrowest = float(clearance[here : max(here + 1, aim + _POINTS_BEYOND)].min())
    limit = _speed_limit(narrowest, robot_radius, config)
    limit = min(limit, math.sqrt(2 * config.braking_mps2 * max(remaining, away - _END_M, 0.0)))
    curvature = 2 * math.sin(angle) / max(away, _AIM_M)
    if abs(curvature) > 1e-6:
        limit = min(limit, config.max_turn_rate_radps / abs(curvature))
    limit *= max(_LEAST_SHARE, math.cos(angle))
    return Twist(limit, limit * curvature)


def _speed_limit(clearance: float, robot_radius: float, config: EdgeFollowerConfig) -> float:
    """Full speed in the open, linearly down to the least speed where the robot just fits."""
    room = (clearance - robot_radius) / max(config.slow_clearance_m - robot_radius, 0.01)
    slow, full = config.min_speed_mps, config.max_speed_mps
    return slow + (full - slow) * min(1.0, max(0.0, room))
