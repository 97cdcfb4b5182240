"""What the robot is to do until the next keyframe."""

from dataclasses import dataclass

from gvgbot.autonomy.control.edge_follower import Track

ARRIVED_M = 0.3  # at the end of a track, when no more of it is left


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """Follow a track."""

    track: Track


@dataclass(frozen=True, slots=True)
class LookAround:
    """Turn on the spot by an angle, rad."""

    angle: float


@dataclass(frozen=True, slots=True)
class Stand:
    """Stay where you are."""


Order = Drive | LookAround | Stand
