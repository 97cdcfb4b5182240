"""Carries out what the robot is to do until the next keyframe."""

from collections.abc import Callable

from gvgbot.autonomy.control.edge_follower import EdgeFollowerConfig, follow
from gvgbot.autonomy.control.orders import Drive, LookAround, Order, Stand
from gvgbot.geometry import STANDSTILL, Pose, Twist

_TURN_SHARE = 0.8  # of the fastest turn, to look around
_LEAST_TURN_RAD, _IN_S = 0.1, 10.0  # a base that turns less than that in this time cannot


class Execution:
    """Follows the track of an order, turns on the spot, or stands."""

    def __init__(self, config: EdgeFollowerConfig, robot_radius: float) -> None:
        self._config, self._radius = config, robot_radius
        self.order: Order = Stand()
        self._twist = STANDSTILL  # wished last along a track
        self._turning_to: float | None = None  # rad, anticlockwise, while it turns in place
        self._turned = 0.0  # rad, since it began to
        self._farthest, self._vain_s = 0.0, 0.0  # rad, and how long since it came there

    @property
    def is_turning(self) -> bool:
        """Whether the robot turns in place, whatever the order."""
        return self._turning_to is not None

    @property
    def cannot_turn(self) -> bool:
        """Whether the robot is to turn in place, and has not come on for long."""
        return self.is_turning and self._vain_s > _IN_S

    def obey(self, order: Order) -> None:
        """Carry out an order from now on."""
        if isinstance(order, LookAround):
            self.turn(order.angle)
        self.order = order

    def turn(self, angle: float) -> None:
        """Turn in place by an angle, rad, before anything else."""
        self._turned, self._turning_to = 0.0, angle
        self._farthest = self._vain_s = 0.0

    def stand(self) -> None:
        """Give up the order, and the turn."""
        self.order, self._turning_to = Stand(), None

    def note_turn(self, angle: float, free_s: float) -> None:
        """Account for a turn of the base, rad, in so many seconds in which nothing forbade it."""
        self._turned += angle
        self._vain_s += free_s
        if self._turned > self._farthest + _LEAST_TURN_RAD:
            self._farthest, self._vain_s = self._turned, 0.0
        if self._turning_to is not None and self._turned >= self._turning_to:
            self._turning_to = None

    def wish(self, local_base: Pose, careful: Callable[[Twist], Twist]) -> Twist:
        """The twist that carries out the order; `careful` slows it down along a track."""
        if self.is_turning:
            return Twist(0.0, self._config.max_turn_rate_radps * _TURN_SHARE)
        if not isinstance(self.order, Drive):
            return STANDSTILL
        speed = self._twist.linear
        self._twist = careful(
            follow(self.order.track, local_base, speed, self._radius, self._config)
        )
        return self._twist
