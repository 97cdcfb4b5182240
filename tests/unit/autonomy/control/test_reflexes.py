"""What the robot does at once, cycle by cycle, and how long it takes."""

import math
from collections import deque

import pytest

from gvgbot.autonomy.control.reflexes import (
    Felt,
    Held,
    Hit,
    Incident,
    Moment,
    PutDown,
    ReflexConfig,
    Reflexes,
)
from gvgbot.geometry import STANDSTILL, Pose, Twist, wrap_angle
from gvgbot.hal.guard import Reason
from gvgbot.hal.messages import Contact

CONFIG = ReflexConfig()
CYCLE = 0.02  # s
AHEAD = Twist(0.4, 0.0)
NOTHING = Contact(0.0)
BUMP = Contact(0.0, bumper_left=True)


class Robot:
    """Reflexes and a base that does as it is told, along x."""

    def __init__(self, *, room_behind: float = 10.0) -> None:
        self.reflexes = Reflexes(CONFIG)
        self.stamp = self.x = 0.0
        self.room_behind = room_behind
        self.incidents: list[Incident] = []
        self.twist = STANDSTILL

    def feel(
        self,
        contact: Contact,
        seconds: float,
        *,
        wish: Twist = AHEAD,
        stopped_for: Reason | None = None,
        grip: float = 1.0,
    ) -> None:
        """Go on for a while with something felt; `grip` is the share of the wish that is driven."""
        for _ in range(round(seconds / CYCLE)):
            moment = Moment(self.stamp, Pose(self.x, 0.0, 0.0), wish, Felt(contact, stopped_for))
            self.twist, incident = self.reflexes.act(moment, lambda bearing: self.room_behind)
            self.incidents += [] if incident is None else [incident]
            self.stamp += CYCLE
            self.x += grip * CYCLE * self.twist.linear


def test_a_wish_passes_as_long_as_nothing_is_felt() -> None:
    robot = Robot()
    robot.feel(NOTHING, 20.0)
    assert robot.twist == AHEAD
    assert robot.incidents == []


@pytest.mark.parametrize(
    ("contact", "cause", "side"),
    [
        (Contact(0.0, bumper_left=True), "bumper", 1),
        (Contact(0.0, bumper_centre=True), "bumper", 0),
        (Contact(0.0, bumper_right=True), "bumper", -1),
        (Contact(0.0, cliff_right=True), "cliff", -1),
    ],
)
def test_a_contact_is_backed_off_from_and_told_with_its_side(
    contact: Contact, cause: str, side: int
) -> None:
    robot = Robot()
    robot.feel(contact, CYCLE)
    assert robot.twist.linear < 0.0
    (hit,) = robot.incidents
    assert isinstance(hit, Hit)
    assert hit.cause == cause
    (bearing,) = hit.bearings
    assert math.copysign(1, bearing) * (abs(bearing) > 0.2) == side
    assert abs(bearing) < math.pi / 2
    robot.feel(NOTHING, 2.0, wish=STANDSTILL)
    assert -0.15 <= robot.x <= -0.10  # as far as a Kobuki should
    assert robot.twist == STANDSTILL


@pytest.mark.parametrize("room", [0.0, 0.01, 0.04, 0.08])
def test_no_farther_back_than_there_is_room_for_a_base_that_rolls_on(room: float) -> None:
    """As a Kobuki: 0.06 s late, and slower by 0.5 m/s in a second."""
    robot, late = Robot(room_behind=room), deque([0.0] * round(0.06 / CYCLE))
    speed, contact = 0.0, BUMP
    for _ in range(round(3.0 / CYCLE)):
        robot.feel(contact, CYCLE, grip=0.0, wish=STANDSTILL)
        contact = NOTHING
        late.append(robot.twist.linear)
        speed += max(-0.5 * CYCLE, min(late.popleft() - speed, 0.5 * CYCLE))
        robot.x += CYCLE * speed
    assert speed == 0.0
    assert -room <= robot.x <= min(0.0, 0.02 - room)


def test_a_bumper_that_stays_pressed_is_backed_off_from_a_few_times_only() -> None:
    robot = Robot()
    robot.feel(BUMP, 60.0)
    assert len(robot.incidents) == 3


def test_backing_off_ends_even_if_the_robot_does_not_move() -> None:
    robot = Robot()
    robot.feel(BUMP, CYCLE)
    robot.feel(NOTHING, 10.0, grip=0.0, wish=Twist(0.0, 0.3))
    assert robot.twist == Twist(0.0, 0.3)


def test_a_lifted_robot_stands_and_tells_when_it_has_been_put_down() -> None:
    robot = Robot()
    robot.feel(Contact(0.0, wheel_drop_left=True), 5.0)
    assert robot.twist == STANDSTILL
    lifted = [robot.reflexes.is_lifted]
    robot.feel(NOTHING, CONFIG.rest_s - 0.1)
    assert robot.x == 0.0
    robot.feel(NOTHING, 0.3)
    assert robot.incidents == [PutDown()]
    assert [*lifted, robot.reflexes.is_lifted] == [True, False]
    assert robot.twist == AHEAD


def test_a_motor_overloaded_twice_in_a_short_time_means_an_obstacle() -> None:
    robot = Robot()
    overload = Contact(0.0, over_current=True)
    robot.feel(overload, 0.2)
    assert robot.twist == STANDSTILL
    robot.feel(NOTHING, 3.0)
    assert robot.incidents == []
    robot.feel(overload, 0.2)
    robot.feel(NOTHING, 3.0)
    (hit,) = robot.incidents
    assert isinstance(hit, Hit)
    assert hit.cause == "over-current"


def test_wheels_that_move_nothing_are_noticed_after_five_seconds() -> None:
    robot = Robot()
    robot.feel(NOTHING, 4.9, grip=0.0)
    assert robot.incidents == []
    robot.feel(NOTHING, 0.3, grip=0.0)
    assert robot.incidents == [Hit("stuck", (0.0,))]


def test_a_robot_that_comes_on_slowly_is_not_stuck() -> None:
    robot = Robot()
    robot.feel(NOTHING, 30.0, grip=0.05)  # 2 cm/s: 10 cm in five seconds
    assert robot.incidents == []


def test_a_robot_whose_base_is_away_as_it_sets_out_is_not_stuck() -> None:
    robot = Robot()
    robot.feel(NOTHING, 0.1)
    robot.stamp += 6.0
    robot.feel(NOTHING, 10.0)
    assert robot.incidents == []


def test_a_robot_that_the_guard_holds_tells_so_and_makes_room() -> None:
    robot = Robot()
    robot.feel(NOTHING, 5.1, grip=0.0, stopped_for="obstacle")
    assert robot.incidents == [Held("back off")]
    assert robot.twist.linear < 0.0


@pytest.mark.parametrize("opening", [math.radians(135.0), math.radians(-45.0)])
def test_a_robot_that_is_held_before_and_behind_turns_to_the_opening_and_goes_there(
    opening: float,
) -> None:
    """Between two things it fits at the side only, at 22.5 degrees either way less far."""
    reflexes, pose, driven, twist = Reflexes(CONFIG), Pose(1.0, 2.0, 3.0), 0.0, STANDSTILL
    incidents: list[Incident | None] = []

    def room(bearing: float) -> float:
        off = abs(wrap_angle(pose.theta + bearing - 3.0 - opening))
        return 0.5 if off < 0.1 else 0.1 if off < 0.5 else 0.02

    for i in range(round(20.0 / CYCLE)):
        wish = AHEAD if i < 5.1 / CYCLE else STANDSTILL
        felt = Felt(NOTHING, "obstacle" if i < 5.1 / CYCLE else None)
        twist, incident = reflexes.act(Moment(i * CYCLE, pose, wish, felt), room)
        incidents += [] if incident is None else [incident]
        if incidents:
            assert twist.linear >= 0.0
            driven += CYCLE * twist.linear
            pose = pose.compose(Pose(CYCLE * twist.linear, 0.0, CYCLE * twist.angular))
    assert incidents == [Held("turn away")]
    assert twist == STANDSTILL
    assert driven == pytest.approx(0.2, abs=0.01)
    dx, dy = Pose(1.0, 2.0, 3.0).inverse().transform(pose.position)
    assert math.atan2(dy, dx) == pytest.approx(opening, abs=0.1)


def test_who_runs_into_something_on_the_way_out_backs_off_from_it() -> None:
    reflexes, stamp = Reflexes(CONFIG), 0.0

    def act(contact: Contact, stopped_for: Reason | None = None) -> tuple[Twist, Incident | None]:
        moment = Moment(stamp, Pose(), AHEAD, Felt(contact, stopped_for))
        return reflexes.act(moment, lambda bearing: 0.5 if abs(bearing) < 1.6 else 0.02)

    incident: Incident | None = None
    while incident is None:
        stamp += CYCLE
        _, incident = act(NOTHING, "obstacle")
    assert incident == Held("turn away")
    stamp += CYCLE
    twist, incident = act(BUMP)
    assert isinstance(incident, Hit)
    assert twist.linear <= 0.0


def test_turning_to_the_opening_ends_even_if_the_robot_does_not_move() -> None:
    reflexes, told, twist = Reflexes(CONFIG), list[Incident](), AHEAD
    for i in range(round(20.0 / CYCLE)):
        held = Felt(NOTHING, None if told else "obstacle")
        moment = Moment(i * CYCLE, Pose(), STANDSTILL if told else AHEAD, held)
        twist, incident = reflexes.act(moment, lambda bearing: 0.5 if abs(bearing) < 1.6 else 0.02)
        told += [] if incident is None else [incident]
    assert told == [Held("turn away")]
    assert twist == STANDSTILL


def test_a_robot_that_is_held_on_all_sides_stands_until_that_changes() -> None:
    robot = Robot(room_behind=0.0)
    robot.feel(NOTHING, 20.0, grip=0.0, stopped_for="obstacle")
    assert set(robot.incidents) == {Held("back off")}
    assert robot.x == 0.0


@pytest.mark.parametrize("reason", ["no scan", "laser sees nothing", "charger cable"])
def test_what_makes_it_wait_wherever_it_wants_to_go_is_no_obstacle(reason: Reason) -> None:
    robot = Robot()
    robot.feel(NOTHING, 60.0, grip=0.0, stopped_for=reason)
    assert robot.incidents == []
