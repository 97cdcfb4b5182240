"""An ideal differential-drive body in an empty world: it does what it is told, at once."""

import math

from gvgbot.geometry import Pose, Twist, wrap_angle

HALF_BASE = 0.115  # m


class IdealBody:
    """Moves along exact arcs; remembers every command with its time."""

    def __init__(self) -> None:
        self.now = 0.0
        self.twist = Twist()
        self.pose = Pose()
        self.left_travel = 0.0
        self.right_travel = 0.0
        self.bumper = (False, False, False)
        self.commands: list[tuple[float, Twist]] = []

    def command(self, linear: float, angular: float) -> None:
        self.twist = Twist(linear, angular)
        self.commands.append((self.now, self.twist))

    def advance(self, now: float) -> None:
        dt = max(0.0, now - self.now)
        self.now += dt
        way, turn = self.twist.linear * dt, self.twist.angular * dt
        self.left_travel += way - HALF_BASE * turn
        self.right_travel += way + HALF_BASE * turn
        chord = way if turn == 0.0 else way * math.sin(turn / 2) / (turn / 2)
        middle = self.pose.theta + turn / 2
        self.pose = Pose(
            self.pose.x + chord * math.cos(middle),
            self.pose.y + chord * math.sin(middle),
            wrap_angle(self.pose.theta + turn),
        )
