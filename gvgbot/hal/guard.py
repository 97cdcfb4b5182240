"""The last gate before the motors: limits, staleness, contact, and obstacles on the newest scan."""

from dataclasses import dataclass, field, replace
from math import copysign, isfinite, sqrt
from typing import Annotated, Literal

from gvgbot.geometry import STANDSTILL, Array, Twist
from gvgbot.hal.messages import Contact, Odometry, Scan
from gvgbot.hal.sweep import free_distance, has_sight, no_points, obstacle_points, seen_from
from gvgbot.ranges import Range

LONGEST_STEP = 0.1  # s; after a longer silence the ramps go on as if it had been this long
CREEP = 0.01  # m/s; slower than this is a stop

Reason = Literal[
    "bad command",
    "wheel drop",
    "over-current",
    "charger cable",
    "no scan",
    "laser sees nothing",
    "bumper",
    "cliff",
    "obstacle",
    "obstacle near",
]
NEEDS_SOMEBODY: tuple[Reason, ...] = (
    "wheel drop",
    "over-current",
    "charger cable",
    "no scan",
    "laser sees nothing",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardConfig:
    """What the robot may do at most, whatever autonomy asks for."""

    max_speed_mps: Annotated[float, Range(0.05, 0.7)] = 0.7  # forwards
    max_reverse_speed_mps: Annotated[float, Range(0.0, 0.3)] = 0.1  # the laser sees little behind
    max_turn_rate_radps: Annotated[float, Range(0.1, 3.14)] = 1.5  # a gyro degrades when faster
    max_acceleration_mps2: Annotated[float, Range(0.05, 3.0)] = 0.5  # speeding up
    # slowing down, also to stop for something ahead
    max_braking_mps2: Annotated[float, Range(0.05, 3.0)] = 1.0
    # of turning faster or slower
    max_angular_acceleration_radps2: Annotated[float, Range(0.1, 20.0)] = 3.5
    max_scan_age_s: Annotated[float, Range(0.05, 2.0)] = 0.5  # older than this, the robot stops
    margin_m: Annotated[float, Range(0.0, 0.5)] = 0.02  # kept free around the footprint
    # from a command until odometry shows its whole effect
    response_time_s: Annotated[float, Range(0.0, 1.0)] = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class GuardState:
    """What the guard remembers between calls.

    `twist` is what it permitted last, at `stamp` (s). `track` is the odometry of about the last
    `max_scan_age_s`, oldest first. `points` (N, 2) are the near returns of `scan`, m, odom frame.
    """

    twist: Twist = STANDSTILL
    stamp: float | None = None
    track: tuple[Odometry, ...] = ()
    scan: Scan | None = None
    points: Array = field(default_factory=no_points)


@dataclass(frozen=True, slots=True)
class Guard:
    """Lets a twist through, slows it or stops it, for a round robot of the given radius (m)."""

    config: GuardConfig
    radius: float

    def permit(
        self,
        state: GuardState,
        twist: Twist,
        *,
        stamp: float,
        odometry: Odometry,
        scan: Scan | None,
        contact: Contact | None,
    ) -> tuple[GuardState, Twist, Reason | None]:
        """The twist that the motors get at `stamp` (s), and why, if safety changed it.

        `scan` and `contact` are the newest, None before the first and while there is no laser.
        Call it once per odometry.
        """
        state = self._observe(state, odometry, scan)
        reason = _fault(twist, contact)
        if reason is None and (scan is None or self._is_old(state.scan, stamp)):
            reason = "no scan" if self._is_old(scan, stamp) else "laser sees nothing"
        permitted = STANDSTILL
        if reason is None:
            wish = self._ramp(state, self._limit(twist), stamp)
            permitted, reason = self._clear_way(state, wish, twist, odometry, contact)
        return replace(state, twist=permitted, stamp=stamp), permitted, reason

    def _observe(self, state: GuardState, odometry: Odometry, scan: Scan | None) -> GuardState:
        """The state with this odometry, and with the near returns if the scan is a new one."""
        track = state.track
        if not track or track[-1] is not odometry:
            too_old = odometry.stamp - self.config.max_scan_age_s - LONGEST_STEP
            kept = track[1:] if track and track[0].stamp < too_old else track
            track = (*kept, odometry)
        if scan is None or scan is state.scan or not has_sight(scan):
            return replace(state, track=track)
        points = obstacle_points(scan, track, reach=self._reach())
        return replace(state, track=track, scan=scan, points=points)

    def _reach(self) -> float:
        """How far from its centre (m) the robot can touch anything before the next scan is due."""
        limits = self.config
        blind = limits.max_scan_age_s + limits.response_time_s
        speed = limits.max_speed_mps
        stopping = speed * blind + speed**2 / (2.0 * limits.max_braking_mps2)
        return stopping + self.radius + limits.margin_m

    def _is_old(self, scan: Scan | None, stamp: float) -> bool:
        return scan is None or stamp - scan.stamp > self.config.max_scan_age_s

    def _limit(self, twist: Twist) -> Twist:
        """The twist on the same arc within the speed limits."""
        limits = self.config
        fastest = limits.max_speed_mps if twist.linear >= 0.0 else limits.max_reverse_speed_mps
        scale = min(
            1.0,
            fastest / abs(twist.linear) if twist.linear else 1.0,
            limits.max_turn_rate_radps / abs(twist.angular) if twist.angular else 1.0,
        )
        return Twist(scale * twist.linear, scale * twist.angular)

    def _ramp(self, state: GuardState, target: Twist, stamp: float) -> Twist:
        """As near to the target as the acceleration limits allow from the last twist."""
        limits, last = self.config, state.twist
        elapsed = LONGEST_STEP if state.stamp is None else stamp - state.stamp
        if elapsed > limits.max_scan_age_s:  # nobody has driven meanwhile: the base has stopped
            last = STANDSTILL
        elapsed = min(max(elapsed, 0.0), LONGEST_STEP)
        slower = abs(target.linear) < abs(last.linear) or target.linear * last.linear < 0.0
        change = elapsed * (limits.max_braking_mps2 if slower else limits.max_acceleration_mps2)
        turn = elapsed * limits.max_angular_acceleration_radps2
        return Twist(
            min(max(target.linear, last.linear - change), last.linear + change),
            min(max(target.angular, last.angular - turn), last.angular + turn),
        )

    def _clear_way(
        self,
        state: GuardState,
        wish: Twist,
        asked: Twist,
        odometry: Odometry,
        contact: Contact | None,
    ) -> tuple[Twist, Reason | None]:
        """The wish, slowed until the robot can stop before it hits something; it may turn."""
        felt = felt_ahead(contact)
        if felt is not None and (wish.linear > 0.0 or asked.linear > 0.0):
            return (STANDSTILL if asked.linear > 0.0 else Twist(0.0, wish.angular)), felt
        if wish.linear == 0.0:
            return wish, None
        points = seen_from(odometry.odom_base, state.points)
        speed = self._safe_speed(points, wish)
        if speed == abs(wish.linear):
            return wish, None
        if speed > 0.0:  # the slower robot turns as asked, so it is on a tighter arc
            speed = self._safe_speed(points, replace(wish, linear=copysign(speed, wish.linear)))
        if speed < CREEP:
            return replace(wish, linear=0.0), "obstacle"
        return replace(wish, linear=copysign(speed, wish.linear)), "obstacle near"

    def _safe_speed(self, points: tuple[Array, Array], wish: Twist) -> float:
        """The speed (m/s), at most the wished, that can be braked in the free part of the arc."""
        limits = self.config
        way = free_distance(points, wish, radius=self.radius, margin=limits.margin_m)
        delay = limits.max_braking_mps2 * limits.response_time_s
        stoppable = sqrt(delay**2 + 2.0 * limits.max_braking_mps2 * way) - delay
        return min(abs(wish.linear), stoppable)


def felt_ahead(contact: Contact | None) -> Reason | None:
    """What the robot has run into, or would fall off, if it went on."""
    if contact is None:
        return None
    if contact.bumper:
        return "bumper"
    return "cliff" if contact.cliff else None


def _fault(twist: Twist, contact: Contact | None) -> Reason | None:
    """What forbids any motion at all, whatever the laser sees."""
    if not (isfinite(twist.linear) and isfinite(twist.angular)):
        return "bad command"
    if contact is not None and contact.wheel_drop:
        return "wheel drop"
    if contact is not None and contact.over_current:
        return "over-current"
    if contact is not None and contact.charger_cable:
        return "charger cable"
    return None
