"""What a base may be asked to do: twists made slower on the same arc, and gentler in time."""

import math
from dataclasses import dataclass

from gvgbot.geometry import STANDSTILL, Twist

_LONGEST_STEP = 0.1  # s; after a longer pause the ramps go on as if it had been this long


@dataclass(frozen=True, slots=True)
class Accelerations:
    """The most that the speed may rise and fall (m/s^2) and the turn rate change (rad/s^2)."""

    rise: float = math.inf
    fall: float = math.inf
    turn: float = math.inf


def slowed(twist: Twist, max_speed: float, max_turn_rate: float, wheel_base: float) -> Twist:
    """The twist on the same arc within the limits of the faster wheel (m/s) and the turn (rad/s).

    A twist that is not a number is a standstill.
    """
    if not (math.isfinite(twist.linear) and math.isfinite(twist.angular)):
        return STANDSTILL
    fast_wheel = abs(twist.linear) + abs(twist.angular) * wheel_base / 2
    share = max(1.0, fast_wheel / max_speed, abs(twist.angular) / max_turn_rate)
    return Twist(twist.linear / share, twist.angular / share)


def ramped(twist: Twist, last: Twist, elapsed: float, limits: Accelerations) -> Twist:
    """As near to the twist as the accelerations allow, `elapsed` seconds after the last one.

    A standstill is never put off; neither is going no further, be it to turn or to go back.
    """
    if twist == STANDSTILL:
        return twist
    elapsed = min(max(elapsed, 0.0), _LONGEST_STEP)
    start = last.linear if twist.linear * last.linear > 0.0 else 0.0
    change = (limits.fall if abs(twist.linear) < abs(start) else limits.rise) * elapsed
    turn = limits.turn * elapsed
    return Twist(
        min(max(twist.linear, start - change), start + change),
        min(max(twist.angular, last.angular - turn), last.angular + turn),
    )
