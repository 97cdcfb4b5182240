"""Whether the base does what it is told: one that hears nothing stands where it is."""

from gvgbot.geometry import Pose, Twist, wrap_angle

DOES_NOT_MOVE = (
    "the base does not move when it is told to: check that its motors have power, that its wheels "
    "turn, and the wire from the computer to it, and restart the program"
)
_STANDS_M, _STANDS_RAD = 0.01, 0.02
_MOVES_MPS, _MOVES_RADPS = 0.03, 0.1  # what is slower may be too slow for the motors
_LONG_S = 20.0


class Obedience:
    """Adds up how long the base has been told to move, and has not."""

    def __init__(self) -> None:
        self._stood, self._vain_s = Pose(), 0.0  # odom_base, and since it came there

    @property
    def is_lacking(self) -> bool:
        """Whether it has not moved at all for so long that it will not."""
        return self._vain_s > _LONG_S

    def note(self, odom_base: Pose, told: Twist, free_s: float) -> None:
        """Account for so many seconds in which nothing kept it from what it was told."""
        turned = abs(wrap_angle(odom_base.theta - self._stood.theta))
        if self._stood.distance(odom_base) > _STANDS_M or turned > _STANDS_RAD:
            self._stood, self._vain_s = odom_base, 0.0
        if abs(told.linear) > _MOVES_MPS or abs(told.angular) > _MOVES_RADPS:
            self._vain_s += free_s
