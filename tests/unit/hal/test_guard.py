"""The guard lets through what is safe, slows what can be slowed, and stops the rest."""

import math
from dataclasses import replace
from math import inf, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.config import load_config
from gvgbot.errors import ConfigError
from gvgbot.geometry import STANDSTILL, Array, Pose, Twist
from gvgbot.hal.guard import Guard, GuardConfig, GuardState, Reason
from gvgbot.hal.messages import Contact, Odometry, Scan

RADIUS = 0.177
PERIOD = 0.02
BEARINGS = np.radians(np.arange(-135.0, 135.25, 0.25))
Segment = tuple[float, float, float, float]

OPEN: list[Segment] = []


def cast(pose: Pose, walls: list[Segment]) -> Array:
    """Ranges (N,) of the beams to wall segments (x1, y1, x2, y2) in the world frame."""
    directions = np.column_stack([np.cos(pose.theta + BEARINGS), np.sin(pose.theta + BEARINGS)])
    ranges = np.full(len(BEARINGS), inf)
    for x1, y1, x2, y2 in walls:
        ex, ey, px, py = x2 - x1, y2 - y1, x1 - pose.x, y1 - pose.y
        with np.errstate(divide="ignore", invalid="ignore"):
            cross = directions[:, 0] * ey - directions[:, 1] * ex
            along = (px * ey - py * ex) / cross
            share = (px * directions[:, 1] - py * directions[:, 0]) / cross
        hit = (along > 0.0) & (share >= 0.0) & (share <= 1.0)
        ranges = np.where(hit & (along < ranges), along, ranges)
    return ranges


class Drive:
    """A robot that does at once what the guard permits, with a 10 Hz laser 0.1 s late."""

    def __init__(
        self,
        walls: list[Segment],
        *,
        noise: float = 0.0,
        base_laser: Pose | None = None,
        braking: float = 1.0,
    ) -> None:
        self.guard = Guard(GuardConfig(max_braking_mps2=braking), RADIUS)
        self.state = GuardState()
        self.walls, self.noise, self.mount = walls, noise, base_laser or Pose()
        self.rng = np.random.default_rng(7)
        self.pose, self.step, self.twist = Pose(), 0, STANDSTILL
        self.scans: list[Scan] = []
        self.reasons: list[Reason | None] = []
        self.speeds: list[float] = []
        self.clearance = inf
        self.contact: Contact | None = None

    def scan_now(self, stamp: float) -> None:
        ranges = cast(self.pose.compose(self.mount), self.walls)
        ranges = ranges + self.rng.normal(0.0, self.noise, len(ranges))
        self.scans.append(
            Scan(stamp, ranges, BEARINGS[0], math.radians(0.25), 0.02, 30.0, 0.0, self.mount)
        )

    def run(self, wish: Twist, seconds: float) -> "Drive":
        for _ in range(round(seconds / PERIOD)):
            stamp = self.step * PERIOD
            if self.step % 5 == 0:
                self.scan_now(stamp)
            seen = [
                scan for scan in self.scans if self.step == 0 or scan.stamp <= stamp - 0.1 + 1e-9
            ]
            self.state, self.twist, reason = self.guard.permit(
                self.state,
                wish,
                stamp=stamp,
                odometry=Odometry(stamp, self.pose, self.twist),
                scan=seen[-1] if seen else self.scans[0],
                contact=self.contact,
            )
            self.reasons.append(reason)
            self.speeds.append(self.twist.linear)
            self.move(self.twist)
            self.step += 1
        return self

    def move(self, twist: Twist) -> None:
        turn = twist.angular * PERIOD
        ahead = twist.linear * PERIOD
        half = Pose(0.0, 0.0, turn / 2)
        self.pose = self.pose.compose(half).compose(Pose(ahead, 0.0)).compose(half)
        self.clearance = min([self.clearance, *(self.away(wall) for wall in self.walls)])

    def away(self, wall: Segment) -> float:
        x1, y1, x2, y2 = wall
        ex, ey = x2 - x1, y2 - y1
        share = ((self.pose.x - x1) * ex + (self.pose.y - y1) * ey) / (ex * ex + ey * ey)
        share = min(max(share, 0.0), 1.0)
        return math.hypot(self.pose.x - x1 - share * ex, self.pose.y - y1 - share * ey)


def still_scan(stamp: float, ranges: Array | None = None) -> Scan:
    filled = np.full(len(BEARINGS), inf) if ranges is None else ranges
    return Scan(stamp, filled, BEARINGS[0], math.radians(0.25), 0.02, 30.0)


def permit_once(
    twist: Twist,
    *,
    last: Twist = STANDSTILL,
    scan: Scan | None = None,
    contact: Contact | None = None,
    scan_age: float = 0.0,
) -> tuple[Twist, Reason | None]:
    """One call at 100 s, a hundredth of a second after the last."""
    state = GuardState(twist=last, stamp=99.99)
    scan = still_scan(100.0 - scan_age) if scan is None else scan
    odometry = Odometry(100.0, Pose(), last)
    guard = Guard(GuardConfig(), RADIUS)
    _, permitted, reason = guard.permit(
        state, twist, stamp=100.0, odometry=odometry, scan=scan, contact=contact
    )
    return permitted, reason


CRUISE = Twist(0.3, 0.2)
TURN = Twist(0.0, 0.5)
BACK = Twist(-0.05, 0.0)
BUMPER = Contact(100.0, bumper_centre=True)
CLIFF = Contact(100.0, cliff_left=True)
WHEEL = Contact(100.0, wheel_drop_right=True)
MOTOR = Contact(100.0, over_current=True)
CABLE = Contact(100.0, charger_cable=True)

CONTACTS = {
    "nothing felt, cruise": (Contact(100.0), CRUISE, CRUISE, None),
    "not yet known, cruise": (None, CRUISE, CRUISE, None),
    "bumper, cruise": (BUMPER, CRUISE, STANDSTILL, "bumper"),
    "left bumper, cruise": (Contact(100.0, bumper_left=True), CRUISE, STANDSTILL, "bumper"),
    "right bumper, cruise": (Contact(100.0, bumper_right=True), CRUISE, STANDSTILL, "bumper"),
    "bumper, turn in place": (BUMPER, TURN, TURN, None),
    "bumper, back off": (BUMPER, BACK, BACK, None),
    "cliff, cruise": (CLIFF, CRUISE, STANDSTILL, "cliff"),
    "cliff, turn in place": (CLIFF, TURN, TURN, None),
    "cliff, back off": (CLIFF, BACK, BACK, None),
    "wheel drop, cruise": (WHEEL, CRUISE, STANDSTILL, "wheel drop"),
    "wheel drop, turn in place": (WHEEL, TURN, STANDSTILL, "wheel drop"),
    "wheel drop, back off": (WHEEL, BACK, STANDSTILL, "wheel drop"),
    "charger cable, cruise": (CABLE, CRUISE, STANDSTILL, "charger cable"),
    "charger cable, turn in place": (CABLE, TURN, STANDSTILL, "charger cable"),
    "over-current, cruise": (MOTOR, CRUISE, STANDSTILL, "over-current"),
    "over-current, turn in place": (MOTOR, TURN, STANDSTILL, "over-current"),
    "over-current, back off": (MOTOR, BACK, STANDSTILL, "over-current"),
}
STILL_ROLLING = {
    "ahead, asked to back off": (CRUISE, BACK),
    "ahead, asked to turn": (CRUISE, TURN),
    "back, asked to cruise": (BACK, CRUISE),
}


@pytest.mark.parametrize(
    ("contact", "asked", "permitted", "reason"), CONTACTS.values(), ids=CONTACTS
)
def test_what_the_base_feels_stops_it_at_once(
    contact: Contact | None, asked: Twist, permitted: Twist, reason: Reason | None
) -> None:
    assert permit_once(asked, last=asked, contact=contact) == (permitted, reason)


@pytest.mark.parametrize(("last", "asked"), STILL_ROLLING.values(), ids=STILL_ROLLING)
@pytest.mark.parametrize(("contact", "reason"), [(BUMPER, "bumper"), (CLIFF, "cliff")])
def test_what_is_felt_ahead_ends_all_rolling_at_once(
    last: Twist, asked: Twist, contact: Contact, reason: Reason
) -> None:
    """By its ramp alone the robot would roll on for a while, or on backwards."""
    permitted, why = permit_once(asked, last=last, contact=contact)
    assert (permitted.linear, why) == (0.0, reason)


@pytest.mark.parametrize(
    ("age", "permitted"), [(0.0, CRUISE), (0.2, CRUISE), (0.49, CRUISE), (0.51, STANDSTILL)]
)
def test_a_scan_older_than_half_a_second_is_no_scan(age: float, permitted: Twist) -> None:
    reason = None if permitted is CRUISE else "no scan"
    assert permit_once(CRUISE, last=CRUISE, scan_age=age) == (permitted, reason)


def test_without_a_first_scan_nothing_moves_not_even_in_place() -> None:
    guard = Guard(GuardConfig(), RADIUS)
    _, permitted, reason = guard.permit(
        GuardState(),
        TURN,
        stamp=0.0,
        odometry=Odometry(0.0, Pose(), STANDSTILL),
        scan=None,
        contact=None,
    )
    assert (permitted, reason) == (STANDSTILL, "no scan")


def test_a_laser_that_is_lost_stops_the_robot_though_its_last_scan_is_not_old() -> None:
    guard = Guard(GuardConfig(), RADIUS)
    state, permitted = GuardState(), list[tuple[Twist, Reason | None]]()
    for step, scan in enumerate([still_scan(0.0), None]):
        stamp = step * PERIOD
        odometry = Odometry(stamp, Pose(), STANDSTILL)
        state, twist, reason = guard.permit(
            state, CRUISE, stamp=stamp, odometry=odometry, scan=scan, contact=None
        )
        permitted.append((twist, reason))
    assert permitted[0][1] is None
    assert permitted[1] == (STANDSTILL, "no scan")


def test_a_covered_laser_stops_the_robot_as_a_silent_one_does_and_is_called_so() -> None:
    drive = Drive(OPEN).run(Twist(0.3, 0.0), 2.0)
    assert drive.speeds[-1] == pytest.approx(0.3)
    drive.noise = math.nan
    drive.run(Twist(0.3, 0.0), 0.8)
    assert (drive.twist, drive.reasons[-1]) == (STANDSTILL, "laser sees nothing")


@pytest.mark.parametrize("bad", [math.nan, inf, -inf])
def test_a_command_that_is_no_number_stops_the_robot(bad: float) -> None:
    assert permit_once(Twist(bad, 0.0), last=CRUISE) == (STANDSTILL, "bad command")
    assert permit_once(Twist(0.0, bad), last=CRUISE) == (STANDSTILL, "bad command")


LIMITS = {
    "within": (Twist(0.4, 0.5), Twist(0.4, 0.5)),
    "too fast": (Twist(1.0, 0.0), Twist(0.7, 0.0)),
    "too fast on an arc keeps the arc": (Twist(1.0, 1.0), Twist(0.7, 0.7)),
    "too fast backwards": (Twist(-0.4, 0.0), Twist(-0.1, 0.0)),
    "turning too fast": (Twist(0.0, -4.0), Twist(0.0, -1.5)),
    "turning too fast keeps the arc": (Twist(0.2, 3.0), Twist(0.1, 1.5)),
}


@pytest.mark.parametrize(("asked", "reached"), LIMITS.values(), ids=LIMITS)
def test_speeds_are_limited_on_the_arc_that_was_asked_for(asked: Twist, reached: Twist) -> None:
    drive = Drive(OPEN).run(asked, 2.0)
    assert (drive.twist.linear, drive.twist.angular) == pytest.approx(
        (reached.linear, reached.angular)
    )
    assert set(drive.reasons) == {None}


@given(st.floats(0.0, 0.5), st.floats(-1.5, 1.5), st.floats(-1.0, 1.0), st.floats(-3.0, 3.0))
def test_no_step_exceeds_the_acceleration_limits(
    v: float, w: float, asked_v: float, asked_w: float
) -> None:
    permitted, _ = permit_once(Twist(asked_v, asked_w), last=Twist(v, w))
    assert v - 1.0 * 0.01 - 1e-9 <= permitted.linear <= v + 0.5 * 0.01 + 1e-9
    assert abs(permitted.angular - w) <= 3.5 * 0.01 + 1e-9


@pytest.mark.parametrize(("last", "asked"), [(0.4, 0.0), (0.4, 0.2), (0.1, -0.1), (-0.08, 0.0)])
def test_slowing_down_takes_half_as_long_as_speeding_up(last: float, asked: float) -> None:
    """At 1 m/s^2, not at 0.5, in a hundredth of a second."""
    permitted, _ = permit_once(Twist(asked, 0.0), last=Twist(last, 0.0))
    assert abs(permitted.linear - last) == pytest.approx(0.01)


BOUNDS = {
    "max_speed_mps": (0.05, 0.7),  # a Kobuki's fastest
    "max_reverse_speed_mps": (0.0, 0.3),
    "max_turn_rate_radps": (0.1, 3.14),  # 180 degrees a second
    "max_acceleration_mps2": (0.05, 3.0),
    "max_braking_mps2": (0.05, 3.0),
    "max_angular_acceleration_radps2": (0.1, 20.0),
    "max_scan_age_s": (0.05, 2.0),
    "margin_m": (0.0, 0.5),
    "response_time_s": (0.0, 1.0),
}


@pytest.mark.parametrize(("key", "bounds"), BOUNDS.items(), ids=BOUNDS)
def test_nobody_can_set_a_limit_beyond_its_bounds(key: str, bounds: tuple[float, float]) -> None:
    least, most = bounds
    for allowed in bounds:
        limits = load_config(None, [f"robot.limits.{key}={allowed}"]).robot.limits
        assert getattr(limits, key) == allowed
    for beyond in (least - 0.001, most + 0.001):
        with pytest.raises(ConfigError, match=key):
            load_config(None, [f"robot.limits.{key}={beyond}"])


def test_the_robot_takes_a_second_to_reach_half_a_metre_per_second() -> None:
    speeds = Drive(OPEN).run(Twist(0.5, 0.0), 1.2).speeds
    assert speeds.index(max(speeds)) * PERIOD == pytest.approx(1.0, abs=0.12)


@pytest.mark.parametrize("last", [0.0, 0.5], ids=["it stood", "it was rolling"])
def test_after_a_long_silence_the_robot_does_not_jump_to_full_speed(last: float) -> None:
    """Meanwhile nobody has driven the base, so that it stands."""
    state = GuardState(twist=Twist(last, 0.0), stamp=0.0)
    _, permitted, _ = Guard(GuardConfig(), RADIUS).permit(
        state,
        Twist(0.5, 0.0),
        stamp=100.0,
        odometry=Odometry(100.0, Pose(), STANDSTILL),
        scan=still_scan(100.0),
        contact=None,
    )
    assert 0.0 < permitted.linear <= 0.05 + 1e-9


WALL_AHEAD: list[Segment] = [(2.0, -3.0, 2.0, 3.0)]
SLANTED: list[Segment] = [(1.0, -1.0, 3.0, 1.0)]
POST: list[Segment] = [(2.0, 0.17, 2.01, 0.17), (2.01, 0.17, 2.0, 0.18)]


def box(x: float, y: float, width: float, height: float) -> list[Segment]:
    """The four sides of a box from its lower left corner."""
    right, top = x + width, y + height
    return [(x, y, right, y), (right, y, right, top), (right, top, x, top), (x, top, x, y)]


ROOM = box(-1.0, -1.0, 2.0, 2.0)

COLLISIONS = {
    "wall ahead, full speed": (WALL_AHEAD, Twist(0.5, 0.0)),
    "wall ahead, slowly": (WALL_AHEAD, Twist(0.1, 0.0)),
    "slanted wall": (SLANTED, Twist(0.5, 0.0)),
    "post at the edge of the footprint": (POST, Twist(0.5, 0.0)),
    "left arc in a room": (ROOM, Twist(0.5, 0.5)),
    "right arc in a room": (ROOM, Twist(0.5, -0.6)),
    "spiral in a room": (ROOM, Twist(0.4, 1.0)),
    "backing in a room": (ROOM, Twist(-0.1, 0.1)),
}


@pytest.mark.parametrize(("walls", "asked"), COLLISIONS.values(), ids=COLLISIONS)
def test_the_robot_stops_before_it_touches_whatever_is_asked(
    walls: list[Segment], asked: Twist
) -> None:
    drive = Drive(walls).run(asked, 15.0)
    assert drive.clearance > RADIUS


def clutter(rng: np.random.Generator) -> list[Segment]:
    """A room of 4 m with a dozen boxes, none within 0.6 m of the start."""
    corners = rng.uniform(-1.5, 1.5, (60, 2))
    corners = corners[np.hypot(*corners.T) > 0.85][:12]
    sizes = rng.uniform(0.02, 0.2, corners.shape)
    boxes = [box(x, y, w, h) for (x, y), (w, h) in zip(corners, sizes, strict=True)]
    return [*box(-2.0, -2.0, 4.0, 4.0), *(side for sides in boxes for side in sides)]


@pytest.mark.parametrize("seed", range(6))
def test_a_robot_driven_at_random_through_clutter_touches_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    drive = Drive(clutter(rng))
    for _ in range(20):
        drive.run(Twist(rng.uniform(0.0, 0.6), rng.normal(0.0, 0.8)), 0.6)
    assert drive.clearance > RADIUS


@pytest.mark.parametrize("asked", [Twist(0.5, 0.0), Twist(0.5, 0.1)], ids=["straight", "arc"])
def test_the_robot_comes_close_before_it_stops(asked: Twist) -> None:
    drive = Drive(WALL_AHEAD).run(asked, 15.0)
    assert drive.speeds[-1] == pytest.approx(0.0, abs=0.011)
    assert drive.clearance < RADIUS + 0.03


@pytest.mark.parametrize("braking", [0.3, 1.0, 3.0])
def test_before_a_wall_the_robot_slows_as_its_brakes_allow(braking: float) -> None:
    """It never drives faster than v = sqrt(2 a d), which stops it in the free distance d."""
    drive = Drive(WALL_AHEAD, braking=braking)
    while drive.step < 400:
        drive.run(Twist(0.5, 0.0), PERIOD)
        free = 2.0 - drive.pose.x - RADIUS
        assert drive.twist.linear <= math.sqrt(2.0 * braking * max(free, 0.0)) + 1e-6
    assert "obstacle near" in drive.reasons


def test_a_slow_start_in_many_small_steps_is_not_taken_for_a_stop() -> None:
    permitted, reason = permit_once(Twist(0.004, 0.0))
    assert (permitted, reason) == (Twist(0.004, 0.0), None)


def test_at_a_wall_the_robot_may_turn_in_place() -> None:
    drive = Drive(WALL_AHEAD).run(Twist(0.5, 0.0), 12.0).run(Twist(0.3, 0.8), 1.0)
    assert drive.twist.angular == pytest.approx(0.8)
    drive = Drive(WALL_AHEAD).run(Twist(0.5, 0.0), 12.0).run(Twist(0.0, 0.8), 1.0)
    assert (drive.twist, drive.reasons[-1]) == (Twist(0.0, 0.8), None)


def test_a_robot_that_turned_away_from_a_wall_may_leave() -> None:
    drive = Drive(WALL_AHEAD).run(Twist(0.5, 0.0), 12.0).run(Twist(0.0, 1.0), pi / 2 + 0.35)
    drive.run(Twist(0.0, 0.0), 1.0).run(Twist(0.3, 0.0), 3.0)
    assert drive.twist.linear == pytest.approx(0.3)


def test_something_that_appears_within_the_stopping_distance_brakes_as_hard_as_it_can() -> None:
    ranges = np.full(len(BEARINGS), inf)
    ranges[np.abs(BEARINGS) < 0.1] = RADIUS + 0.02
    permitted, reason = permit_once(
        Twist(0.5, 0.0), last=Twist(0.5, 0.0), scan=still_scan(99.9, ranges)
    )
    assert reason in {"obstacle", "obstacle near"}
    assert permitted.linear < 0.06


def test_the_tighter_arc_of_a_robot_that_was_slowed_is_as_free_as_it_must_be() -> None:
    """A post on the wide arc slows the robot, which then turns towards another, inside of that.

    Where it touches a post is found by going along the arc in steps of a millimetre.
    """
    ranges, posts = np.full(len(BEARINGS), inf), []
    for x, y in ((0.282, 0.087), (0.05, 0.205)):
        beam = int(np.abs(BEARINGS - math.atan2(y, x)).argmin())
        ranges[beam] = math.hypot(x, y)
        posts.append(Pose(theta=BEARINGS[beam]).transform(np.array([ranges[beam], 0.0])))
    asked, reach = Twist(0.5, 1.0), RADIUS + 0.02

    def free(radius: float, post: Array) -> float:
        angle = np.arange(0.0, 1.5, 0.001) / radius
        along = radius * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
        return radius * float(angle[np.argmax(np.hypot(*(along - post).T) < reach)])

    def stoppable(way: float) -> float:
        return math.sqrt(0.25**2 + 2.0 * way) - 0.25

    slowed = stoppable(free(0.5, posts[0]))
    permitted, reason = permit_once(asked, last=asked, scan=still_scan(99.9, ranges))
    assert (permitted.angular, reason) == (1.0, "obstacle near")
    assert permitted.linear == pytest.approx(stoppable(free(slowed, posts[1])), abs=0.003)
    assert permitted.linear < 0.8 * slowed


@pytest.mark.parametrize("filler", [math.nan, inf], ids=["dropout", "nothing within range"])
def test_a_beam_without_a_range_is_no_obstacle(filler: float) -> None:
    ranges = np.full(len(BEARINGS), 4.0)
    ranges[::7] = filler
    assert permit_once(CRUISE, last=CRUISE, scan=still_scan(100.0, ranges)) == (CRUISE, None)


def corridor(half_width: float) -> list[Segment]:
    return [(-2.0, half_width, 9.0, half_width), (-2.0, -half_width, 9.0, -half_width)]


def door(half_width: float) -> list[Segment]:
    """A wall 0.1 m thick across the way at 1.5 m, with an opening."""
    jambs = [(1.5, side * half_width, 1.6, side * half_width) for side in (1, -1)]
    faces = [(x, side * half_width, x, side * 3.0) for x in (1.5, 1.6) for side in (1, -1)]
    return [*jambs, *faces]


def test_walls_alongside_do_not_slow_the_robot() -> None:
    drive = Drive(corridor(RADIUS + 0.05)).run(Twist(0.3, 0.0), 8.0)
    assert set(drive.reasons) == {None}
    assert drive.pose.x > 2.0


def test_the_robot_drives_through_a_door_with_five_centimetres_to_spare() -> None:
    drive = Drive(door(RADIUS + 0.05)).run(Twist(0.3, 0.0), 10.0)
    assert set(drive.reasons) == {None}
    assert drive.pose.x > 2.0


def test_a_noisy_laser_hardly_delays_the_robot_in_such_a_door() -> None:
    drive = Drive(door(RADIUS + 0.05), noise=0.01).run(Twist(0.3, 0.0), 10.0)
    assert drive.pose.x > 2.5
    assert sum(reason is not None for reason in drive.reasons) < 0.05 * len(drive.reasons)


def test_the_robot_stops_before_a_door_that_is_too_narrow() -> None:
    drive = Drive(door(RADIUS - 0.01)).run(Twist(0.3, 0.0), 10.0)
    assert drive.pose.x < 1.5
    assert drive.clearance > RADIUS


@pytest.mark.parametrize(
    "mount",
    [Pose(0.1, 0.0, 0.0), Pose(-0.05, 0.03, pi / 4), Pose(-0.8, 0.0, 0.0)],
    ids=["ahead", "turned", "far behind"],
)
def test_the_mount_of_the_laser_is_taken_into_account(mount: Pose) -> None:
    drive = Drive(WALL_AHEAD, base_laser=mount).run(Twist(0.5, 0.0), 12.0)
    assert RADIUS < drive.clearance < RADIUS + 0.03


@pytest.mark.parametrize("cycles", [10, 24])
def test_a_late_scan_is_placed_where_the_robot_was_when_it_was_taken(cycles: int) -> None:
    """The wall was 0.5 m ahead; in each cycle since the robot has driven 0.01 m towards it."""
    ranges = 0.5 / np.maximum(np.cos(BEARINGS), 1e-3)
    guard = Guard(replace(GuardConfig(), response_time_s=0.0, margin_m=0.0), RADIUS)
    state, twist = GuardState(twist=Twist(0.5, 0.0), stamp=0.0), Twist(0.5, 0.0)
    permitted = twist
    for step in range(cycles + 1):
        stamp = step * PERIOD
        odometry = Odometry(stamp, Pose(0.5 * stamp, 0.0), twist)
        scan = still_scan(0.0, ranges)
        state, permitted, _ = guard.permit(
            state, twist, stamp=stamp, odometry=odometry, scan=scan, contact=None
        )
        state = replace(state, twist=twist)
    assert permitted.linear == pytest.approx(
        min(0.5, math.sqrt(2 * (0.5 - 0.01 * cycles - RADIUS))), abs=1e-3
    )


def test_a_bumper_hit_leads_to_a_slow_retreat() -> None:
    drive = Drive(OPEN).run(Twist(0.3, 0.0), 1.0)
    drive.contact = Contact(0.0, bumper_centre=True)
    drive.run(Twist(0.3, 0.0), PERIOD)
    assert (drive.twist, drive.reasons[-1]) == (STANDSTILL, "bumper")
    drive.run(Twist(-0.3, 0.0), 1.0)
    assert drive.twist.linear == pytest.approx(-0.1)
