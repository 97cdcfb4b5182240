"""A round differential-drive robot in the simulated world: it accelerates, collides and slips."""

import math
from collections import deque
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from gvgbot.drivers.discs import disc_offsets
from gvgbot.drivers.people import People
from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose, wrap_angle, wrap_angles
from gvgbot.ranges import Range

MAX_STRIDE = 0.01  # m of travel per integration step, so that no wall is jumped over
MAX_STEP = 0.02  # s per integration step, so that an arc driven while accelerating stays an arc
TOUCH = 1e-3  # m: nearer than this, a wall or a person presses the bumper
RELEASE = 0.01  # m: this far from both, a contact is over
OVERLAP = 1e-6  # m of overlap forgiven, so that the robot can roll along a wall that it touches
SNUG = 1e-4  # m: a robot as near as this cannot get nearer
HALVINGS = 10  # of a blocked stride, to find the place of contact
NOTHING = np.empty((0, 2))
BUMPER_EDGE = math.pi / 6  # rad: the centre bumper reaches this far to either side
REMEMBERED = 64  # steps: half a second


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyConfig:
    """What the simulated robot is built like and can do."""

    radius_m: Annotated[float, Range(minimum=0.01)] = 0.177
    wheel_base_m: Annotated[float, Range(minimum=0.01)] = 0.23
    max_acceleration_mps2: Annotated[float, Range(minimum=0.01)] = 1.0
    max_angular_acceleration_radps2: Annotated[float, Range(minimum=0.01)] = 6.0


class RobotBody:
    """The true state of the robot.

    `pose` is world_base. `left_travel` and `right_travel` are what the wheels have rolled, m, slip
    against a wall included; `distance_m` is the way that the robot itself has come. `contacts`
    counts separate collisions, with walls, with people, who walk on as the body advances, and with
    `others`: bodies in the same world, where they stood when they were advanced last.
    """

    def __init__(
        self,
        world: World,
        start: Pose,
        config: BodyConfig | None = None,
        stamp: float = 0.0,
        people: People | None = None,
    ) -> None:
        self.config = config or BodyConfig()
        self.pose = start
        self.left_travel = self.right_travel = 0.0
        self.distance_m = 0.0
        self.contacts = 0
        self.others: list[RobotBody] = []
        self._world = world
        self._people = people
        self.now = stamp
        self._linear = self._angular = 0.0
        self._target_linear = self._target_angular = 0.0
        self._in_contact = False
        self._trail = deque([(stamp, start)], REMEMBERED)

    def command(self, linear: float, angular: float) -> None:
        """Head for this velocity (m/s, rad/s) from the time of the last `advance` on."""
        self._target_linear, self._target_angular = linear, angular

    def advance(self, now: float) -> None:
        """Move on to the time `now`, s; an earlier time than the last is ignored."""
        while self._people is not None and self._people.next_step <= now:
            self._drive_until(self._people.next_step)
            poses = [self.pose, *(other.pose for other in self.others)]
            self._people.step(poses, self.config.radius_m)
        self._drive_until(now)

    def _drive_until(self, now: float) -> None:
        before, gap = self.now, now - self.now
        if gap <= 0.0:
            return
        self.now = now
        if not self._moves:
            self._trail.append((now, self.pose))
            return
        fastest = max(abs(self._linear), abs(self._target_linear))
        steps = math.ceil(max(gap / MAX_STEP, gap * fastest / MAX_STRIDE))
        for step in range(1, steps + 1):
            self._step(gap / steps)
            self._trail.append((before + step * gap / steps, self.pose))

    def pose_at(self, stamp: float) -> Pose:
        """Where it was at a time of the last half second, s; at a later one, where it is."""
        later, after = self.now, self.pose
        for earlier, pose in reversed(self._trail):
            if earlier <= stamp:
                share = (stamp - earlier) / (later - earlier) if later > earlier else 0.0
                return pose.towards(after, min(share, 1.0))
            later, after = earlier, pose
        return after

    @property
    def bumper(self) -> tuple[bool, bool, bool]:
        """Whether something presses the left, centre and right third of the front half."""
        near = self._obstacles(self.pose.x, self.pose.y, self.config.radius_m + TOUCH)
        if len(near) == 0:
            return False, False, False
        bearings = wrap_angles(np.arctan2(near[:, 1], near[:, 0]) - self.pose.theta)
        front = np.abs(bearings) <= math.pi / 2
        left = front & (bearings > BUMPER_EDGE)
        right = front & (bearings < -BUMPER_EDGE)
        centre = np.abs(bearings) <= BUMPER_EDGE
        return bool(left.any()), bool(centre.any()), bool(right.any())

    @property
    def linear(self) -> float:
        """Speed of the wheels' centre as they turn, m/s."""
        return self._linear

    @property
    def angular(self) -> float:
        """Turn rate, rad/s."""
        return self._angular

    @property
    def _moves(self) -> bool:
        return bool(self._linear or self._angular or self._target_linear or self._target_angular)

    def _step(self, duration: float) -> None:
        config = self.config
        way, self._linear = _ramp(
            self._linear, self._target_linear, config.max_acceleration_mps2, duration
        )
        turn, self._angular = _ramp(
            self._angular, self._target_angular, config.max_angular_acceleration_radps2, duration
        )
        half_base = config.wheel_base_m / 2
        self.left_travel += way - turn * half_base
        self.right_travel += way + turn * half_base
        self._roll(way, turn)

    def _roll(self, way: float, turn: float) -> None:
        """Follow an arc of length `way` (m) and angle `turn` (rad) as far as walls allow."""
        x, y, theta = self.pose.x, self.pose.y, self.pose.theta
        half = turn / 2
        chord = way * math.sin(half) / half if half else way
        dx, dy = chord * math.cos(theta + half), chord * math.sin(theta + half)
        share = self._free_share(x, y, dx, dy)
        self.pose = Pose(x + share * dx, y + share * dy, wrap_angle(theta + turn))
        self.distance_m += share * abs(way)

    def _free_share(self, x: float, y: float, dx: float, dy: float) -> float:
        """How much of the stride can be made, 0..1; keeps count of the contacts."""
        reach = self.config.radius_m + RELEASE
        after = self._gap(x + dx, y + dy)
        if after == math.inf:
            self._in_contact = False
            return 1.0
        before = self._gap(x, y)
        floor = self.config.radius_m - OVERLAP
        if after >= floor or after > before or dx == dy == 0.0:
            self._in_contact = self._in_contact and after < reach
            return 1.0
        self.contacts += not self._in_contact
        self._in_contact = True
        return 0.0 if before < floor + SNUG else self._share_to_wall(x, y, dx, dy)

    def _share_to_wall(self, x: float, y: float, dx: float, dy: float) -> float:
        """How much of a blocked stride ends in touch with the wall."""
        floor = self.config.radius_m - OVERLAP
        low, high = 0.0, 1.0
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            fits = self._gap(x + middle * dx, y + middle * dy) >= floor
            low, high = (middle, high) if fits else (low, middle)
        return low

    def _gap(self, x: float, y: float) -> float:
        """Distance from a place to the nearest obstacle, m; inf beyond the robot's surroundings."""
        offsets = self._obstacles(x, y, self.config.radius_m + RELEASE)
        return float(np.hypot(offsets[:, 0], offsets[:, 1]).min(initial=math.inf))

    def _obstacles(self, x: float, y: float, reach: float) -> Array:
        """From a place to the nearest point of each wall square and person in reach: (N, 2), m."""
        far = self._world.clear_of_walls(x, y) > reach
        walls = NOTHING if far else self._world.wall_offsets(x, y, reach)
        if self._people is not None:
            walls = np.concatenate((walls, self._people.offsets(x, y, reach)))
        if not self.others:
            return walls
        return np.concatenate((walls, disc_offsets(*discs_of(self.others), x, y, reach)))


def discs_of(bodies: list[RobotBody]) -> tuple[Array, Array]:
    """Where bodies are in the world: centres (N, 2) and radii (N,), m."""
    centres = np.array([body.pose.position for body in bodies]).reshape(-1, 2)
    return centres, np.array([body.config.radius_m for body in bodies])


def _ramp(speed: float, target: float, limit: float, duration: float) -> tuple[float, float]:
    """Way covered in `duration` while the speed heads for the target, and the speed then."""
    rising = min(duration, abs(target - speed) / limit)
    reached = target if rising < duration else speed + math.copysign(limit * rising, target - speed)
    return (speed + reached) / 2 * rising + target * (duration - rising), reached
