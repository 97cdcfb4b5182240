"""What the robot does at once when it is touched, lifted or held up, whatever its plan is."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal

from gvgbot.geometry import STANDSTILL, Pose, Twist, wrap_angle
from gvgbot.hal.guard import Reason
from gvgbot.hal.messages import Contact
from gvgbot.ranges import Range

_SIDE_RAD = math.radians(55)  # where the middle of the left bumper is
_GRIP_S = 3.0  # backing off longer than it should take, by this, is given up
_DEAD_S, _BRAKING_MPS2 = 0.1, 0.5  # until a base obeys, and how it then slows down
LONGEST_GAP_S = 2.0  # between cycles, or keyframes; a longer one is an outage of a device
_OFTEN_S = 20.0  # a second overload within this time means that something is in the way
_TRIES = 3  # to get rid of a contact by backing off
AWAY_M = 0.2  # out of a place in which nothing else helps
_BEARINGS = [math.pi + side * i * math.pi / 8 for i in range(8) for side in (-1, 1)]
_TURN_RADPS, _TURN_GAIN, _FACING_RAD = 1.0, 2.0, 0.1

Room = Callable[[float], float]  # how far it can go at a bearing (rad, base frame), m
Cause = Literal["bumper", "cliff", "over-current", "stuck"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReflexConfig:
    """How the robot gets away from what it has felt."""

    back_off_m: Annotated[float, Range(0.02, 0.5)] = 0.12  # after a bump or at a cliff
    back_off_speed_mps: Annotated[float, Range(0.01, 0.3)] = 0.1  # backwards
    rest_s: Annotated[float, Range(0.1, 60.0)] = 2.0  # after an overload, or being put down
    stuck_s: Annotated[float, Range(1.0, 60.0)] = 5.0  # without coming on: stuck
    stuck_m: Annotated[float, Range(0.01, 0.5)] = 0.05  # moved less than this in that time
    stuck_speed_mps: Annotated[float, Range(0.01, 0.5)] = 0.05  # though this was asked for


@dataclass(frozen=True, slots=True)
class Felt:
    """What the base feels, and what the guard made of the last wish."""

    contact: Contact | None = None
    stopped_for: Reason | None = None


@dataclass(frozen=True, slots=True)
class Moment:
    """A control cycle: where the robot is in the local frame, what it wishes and what it feels."""

    stamp: float
    local_base: Pose
    wish: Twist
    felt: Felt


@dataclass(frozen=True, slots=True)
class Hit:
    """Something is there at these bearings (rad) that the laser does not show."""

    cause: Cause
    bearings: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Held:
    """The guard has not let the robot go on for a while: it stands too near to something."""

    action: Literal["back off", "turn away"]


@dataclass(frozen=True, slots=True)
class PutDown:
    """The wheels are on the floor again, nobody knows where."""


Incident = Hit | Held | PutDown


@dataclass(frozen=True, slots=True)
class _BackOff:
    """Drive back until so far behind where it began."""

    begin: Pose
    metres: float
    until: float


@dataclass(frozen=True, slots=True)
class _TurnAway:
    """Turn to a heading, rad, local frame, and drive ahead until so far from where it began."""

    begin: Pose
    heading: float
    metres: float
    until: float


@dataclass(frozen=True, slots=True)
class _Rest:
    """Stand until a stamp; then back off if this was not the first time."""

    until: float
    incident: Incident | None


class Reflexes:
    """Lets a wish through, unless there is something more urgent to do."""

    def __init__(self, config: ReflexConfig) -> None:
        self._config = config
        self._doing: _BackOff | _TurnAway | _Rest | None = None
        self._touching = False
        self._tries = 0
        self._overloaded = -math.inf  # stamp
        self._past: deque[Moment] = deque()
        self.is_plugged_in = False  # on the charger's cable

    @property
    def is_lifted(self) -> bool:
        """Whether the wheels are, or were a moment ago, off the floor."""
        return isinstance(self._doing, _Rest) and isinstance(self._doing.incident, PutDown)

    def act(self, now: Moment, room: Room) -> tuple[Twist, Incident | None]:
        """The twist to drive, and what has happened."""
        contact = now.felt.contact
        self.is_plugged_in = contact is not None and contact.charger_cable
        if contact is not None and contact.wheel_drop:
            self._doing = _Rest(now.stamp + self._config.rest_s, PutDown())
        elif contact is not None and contact.over_current and not self.is_lifted:
            self._rest_from_overload(now)
        if isinstance(self._doing, _TurnAway) and _is_touching(contact):
            self._doing = None
        match self._doing:
            case _Rest():
                return self._rest(now, self._doing, room)
            case _BackOff():
                return self._go_back(now, self._doing), None
            case _TurnAway():
                return self._go_away(now, self._doing), None
            case None:
                return self._go_on(now, room)

    def _go_on(self, now: Moment, room: Room) -> tuple[Twist, Incident | None]:
        incident = self._notice(now)
        if incident is None:
            return now.wish, None
        if isinstance(incident, Held):
            return self._leave(now, room)
        return self._back_off(now, room), incident

    # -- what is felt ------------------------------------------------------------------------------

    def _notice(self, now: Moment) -> Incident | None:
        contact = now.felt.contact
        touching = _is_touching(contact)
        before, self._touching = self._touching, touching
        if contact is None or not touching:
            self._tries = 0
            return self._watch(now)
        self._past.clear()
        if before and self._tries >= _TRIES:
            return None
        self._tries += 1
        return Hit("cliff" if contact.cliff else "bumper", _bearings(contact))

    def _watch(self, now: Moment) -> Incident | None:
        """Whether the robot has not come on for a while, and why."""
        c, past = self._config, self._past
        if now.wish.linear < c.stuck_speed_mps or now.felt.stopped_for in _OTHER_STOPS:
            past.clear()
            return None
        if past and now.stamp - past[-1].stamp > LONGEST_GAP_S:
            past.clear()
        past.append(now)
        if now.stamp - past[0].stamp < c.stuck_s:
            return None
        begin = past.popleft()
        if begin.local_base.distance(now.local_base) > c.stuck_m:
            return None
        held = any(moment.felt.stopped_for is not None for moment in past)
        past.clear()
        return Held("back off") if held else Hit("stuck", (0.0,))

    # -- what is done ------------------------------------------------------------------------------

    def _rest_from_overload(self, now: Moment) -> None:
        if isinstance(self._doing, _Rest):
            return
        again = now.stamp - self._overloaded < _OFTEN_S
        self._overloaded = now.stamp
        incident = Hit("over-current", (0.0,)) if again else None
        self._doing = _Rest(now.stamp + self._config.rest_s, incident)

    def _rest(self, now: Moment, rest: _Rest, room: Room) -> tuple[Twist, Incident | None]:
        if now.stamp < rest.until:
            return STANDSTILL, None
        self._doing = None
        self._past.clear()
        if isinstance(rest.incident, Hit):
            return self._back_off(now, room), rest.incident
        return STANDSTILL, rest.incident

    def _leave(self, now: Moment, room: Room) -> tuple[Twist, Held]:
        """Back off; where there is no room behind, turn to where there is most, and go there."""
        widest = max(_BEARINGS, key=lambda bearing: min(room(bearing), AWAY_M))
        metres = min(room(widest), AWAY_M)
        if room(math.pi) >= min(metres, self._config.back_off_m):
            return self._back_off(now, room), Held("back off")
        until = (
            now.stamp + math.pi / _TURN_RADPS + metres / self._config.back_off_speed_mps + _GRIP_S
        )
        heading = now.local_base.theta + widest
        self._doing = away = _TurnAway(now.local_base, heading, metres, until)
        self._past.clear()
        return self._go_away(now, away), Held("turn away")

    def _go_away(self, now: Moment, away: _TurnAway) -> Twist:
        if away.begin.distance(now.local_base) >= away.metres or now.stamp > away.until:
            self._doing = None
            return STANDSTILL
        turn = wrap_angle(away.heading - now.local_base.theta)
        rate = min(max(_TURN_GAIN * turn, -_TURN_RADPS), _TURN_RADPS)
        return Twist(self._config.back_off_speed_mps if abs(turn) < _FACING_RAD else 0.0, rate)

    def _back_off(self, now: Moment, room: Room) -> Twist:
        c, speed = self._config, self._config.back_off_speed_mps
        rolls_on = speed * (_DEAD_S + speed / (2 * _BRAKING_MPS2))
        metres = min(c.back_off_m, room(math.pi) - rolls_on)
        until = now.stamp + metres / speed + _GRIP_S
        self._doing = _BackOff(now.local_base, metres, until)
        self._past.clear()
        return self._go_back(now, self._doing)

    def _go_back(self, now: Moment, back: _BackOff) -> Twist:
        behind = -back.begin.to(now.local_base).x  # of where it was felt, however long it braked
        if behind >= back.metres or now.stamp > back.until:
            self._doing = None
            return STANDSTILL
        return Twist(-self._config.back_off_speed_mps, 0.0)


# wherever the robot wants to go, it must wait
WAITS: tuple[Reason, ...] = (
    "bad command",
    "wheel drop",
    "charger cable",
    "no scan",
    "laser sees nothing",
)
_OTHER_STOPS: tuple[Reason, ...] = (*WAITS, "over-current", "bumper", "cliff")


def _is_touching(contact: Contact | None) -> bool:
    """Whether it has run into something, or stands where there is no floor ahead."""
    return contact is not None and (contact.bumper or contact.cliff)


def _bearings(contact: Contact) -> tuple[float, ...]:
    """Where the bumpers or cliff sensors are that feel something, rad."""
    sides = (
        (contact.bumper_left or contact.cliff_left, _SIDE_RAD),
        (contact.bumper_centre or contact.cliff_centre, 0.0),
        (contact.bumper_right or contact.cliff_right, -_SIDE_RAD),
    )
    return tuple(bearing for is_felt, bearing in sides if is_felt)
