"""What becomes of a request: permitted or not, safe or not, done, answered and written down."""

import dataclasses
import math
from collections.abc import Awaitable, Callable
from typing import Any, Protocol, get_type_hints

from gvgbot.autonomy.errands import Declined, Errands
from gvgbot.autonomy.errands.kinds import Home
from gvgbot.autonomy.events import Event, Requested
from gvgbot.config import Config
from gvgbot.conversion import Problem, convert
from gvgbot.errors import GvgbotError
from gvgbot.hal.guard import Reason
from gvgbot.hal.messages import Contact
from gvgbot.requests import Answer, Arguments, Asked, Goto, Patrol, Set, in_words, parse
from gvgbot.words import counted, printable

SETTABLE = (
    "robot.limits.max_speed_mps",
    "robot.limits.max_turn_rate_radps",
    "exploration.policy",
    "exploration.patience_m",
    "exploration.patience_s",
    "exploration.look_around_s",
    "exploration.in_the_way_s",
    "exploration.nothing_in_sight_s",
)
_MOVING = ("resume", "home", "goto", "patrol", "coverage", "explore", "relocalise")
_HARMLESS: tuple[Reason, ...] = ("obstacle", "obstacle near")  # the robot may turn away from it
_LONGEST_WORDS = 200  # characters of a request in the list of events
_BURST, _A_SECOND = 20.0, 1.0  # requests that change nothing, and are written down all the same


class Body(Protocol):
    """What the robot feels, and what its guard says."""

    @property
    def away(self) -> str | None:
        """Which devices are missing."""

    @property
    def contact(self) -> Contact | None:
        """What the base feels."""

    @property
    def stopped_for(self) -> Reason | None:
        """Why the guard holds the robot."""


class Steering:
    """Answers requests.

    `save` writes the map and returns where; `use` puts a changed configuration into effect;
    `tell` is given what happens because of a request.
    """

    def __init__(
        self,
        config: Config,
        errands: Errands,
        body: Body,
        *,
        now: Callable[[], float],
        save: Callable[[], Awaitable[str]],
        use: Callable[[Config], None],
        tell: Callable[[list[Event]], None],
    ) -> None:
        self.declines: str | None = None  # why nothing is done, whatever is permitted
        self._config, self._limits = config, config.robot.limits
        self._errands, self._body = errands, body
        self._now, self._save, self._use, self._tell = now, save, use, tell
        self._ledger = _Ledger()
        self._is_called_home, self._is_homeward = False, False  # and is not there; and has set out
        self._no_way_home = ""  # why not

    async def handle(self, asked: Asked) -> Answer:
        """Do what is asked for, or say why not; either is written down with who asked.

        Not so what changes nothing, if there is much of it: whoever can ask could fill the disk.
        """
        stamp, words = self._now(), asked.name
        try:
            arguments = parse(asked.name, asked.data, asked.encoding)
            words = in_words(asked.name, arguments)
            self._check(asked.name)
            answer = Answer(done=True, text=await self._do(asked.name, arguments))
        except (Declined, ValueError, GvgbotError) as error:
            answer = Answer(done=False, text=str(error))
        answer = Answer(done=answer.done, text=printable(answer.text))
        words = printable(words)[:_LONGEST_WORDS]
        happened = Requested(stamp, words, asked.origin, answer.done, answer.text)
        self._tell([*self._ledger.enter(happened), *self._errands.take_events()])
        return answer

    def close(self) -> None:
        """Write down what was left out of a crowd at the end: nothing comes any more."""
        self._tell([*self._ledger.close()])

    def go_home(self, why: str) -> bool:
        """Let a robot that is busy drive home; it is written down as asked for by `why`.

        False if it is not over: it is paused or under way, or its place or a way is not known. Then
        ask again, also when all is explored meanwhile, or something stood in the way. Why it knows
        no way is written down once.
        """
        errands = self._errands
        if self._is_homeward and isinstance(errands.errand, Home):
            return False
        is_late = errands.stands_by or isinstance(errands.given_up, Home)
        is_busy = errands.is_busy and not self._is_homeward  # with what was asked for since
        is_due = is_busy or (self._is_called_home and is_late)
        self._is_called_home = is_due and self.declines is None
        self._is_homeward = self._is_called_home and self._goes_home(why)
        return not self._is_called_home

    def call_off(self) -> None:
        """Forget that it was called home and could not go: it need not any more."""
        self._is_called_home = self._is_homeward = False
        self._no_way_home = ""

    def _goes_home(self, why: str) -> bool:
        errands = self._errands
        if errands.is_paused or not errands.is_placed:
            return False
        try:
            answer = Answer(done=True, text=errands.home(self._now()))
        except Declined as error:
            answer = Answer(done=False, text=str(error))
        if answer.done or answer.text != self._no_way_home:
            happened = Requested(self._now(), "home", why, answer.done, answer.text)
            self._tell([happened, *errands.take_events()])
        self._no_way_home = "" if answer.done else answer.text
        return answer.done

    def _check(self, name: str) -> None:
        """Raises Declined if that is not permitted, or not safe just now."""
        if self.declines is not None:
            raise Declined(self.declines)
        permitted = self._config.telemetry.requests
        if name not in permitted:
            raise Declined(
                f"{name} is not permitted here: telemetry.requests in the robot's configuration "
                f"lists {', '.join(permitted) or 'nothing'}"
            )
        danger = self._danger() if name in _MOVING else None
        if danger is not None:
            raise Declined(f"it cannot move now: {danger}")

    def _danger(self) -> str | None:
        contact, stopped_for = self._body.contact, self._body.stopped_for
        if self._body.away is not None:
            return self._body.away
        if contact is not None and contact.wheel_drop:
            return "it is lifted"
        if contact is not None and contact.bumper:
            return "a bumper is pressed"
        if contact is not None and contact.cliff:
            return "it stands at a cliff"
        if contact is not None and contact.over_current:
            return "a motor is overloaded"
        if contact is not None and contact.charger_cable:
            return "the charger's cable is plugged in"
        return None if stopped_for in _HARMLESS else stopped_for

    async def _do(self, name: str, arguments: Arguments) -> str:
        errands, stamp = self._errands, self._now()
        match name, arguments:
            case "pause", _:
                return errands.pause()
            case "resume", _:
                return errands.resume()
            case "stop", _:
                text = errands.stop(stamp)
                self._tell(errands.take_events())  # now: to save the map may take long
                return f"{text}; {await self._saved_or_why_not()}"
            case "home", _:
                return errands.home(stamp)
            case "explore", _:
                return errands.explore(stamp)
            case "relocalise", _:
                return errands.relocalise(stamp)
            case "coverage", _:
                return errands.coverage(stamp)
            case _, Patrol(vertices=vertices):
                return errands.patrol(vertices, stamp)
            case _, Goto(vertex=None, x=float(x), y=float(y)):
                return errands.goto_point(x, y, stamp)
            case _, Goto(vertex=int(vertex)):
                return errands.goto_vertex(vertex, stamp)
            case _, Set(key=key, value=value):
                return self._set(key, value)
            case _:
                return f"map saved in {await self._save()}"

    async def _saved_or_why_not(self) -> str:
        """What to say of the map after something that is done whether it can be saved or not."""
        try:
            return f"map saved in {await self._save()}"
        except GvgbotError as error:
            return f"map not saved: {error}"

    def _set(self, key: str, value: bool | float | str) -> str:
        if key not in SETTABLE:
            raise Declined(
                f"{key} cannot be changed while the robot runs; {', '.join(SETTABLE)} can"
            )
        changed = _replaced(self._config, key, value)
        limits = changed.robot.limits
        if (
            limits.max_speed_mps > self._limits.max_speed_mps
            or limits.max_turn_rate_radps > self._limits.max_turn_rate_radps
        ):
            raise Declined(f"{key} cannot be raised above what the robot's configuration has")
        self._config = changed
        self._use(changed)
        return f"{key} is {value} now"


def _replaced(config: Config, key: str, value: bool | float | str) -> Config:
    """The configuration with another value. Raises Declined if that does not fit."""
    *sections, name = key.split(".")
    nodes: list[Any] = [config]
    for section in sections:
        nodes.append(getattr(nodes[-1], section))
    problems: list[Problem] = []
    kind = get_type_hints(type(nodes[-1]), include_extras=True)[name]
    changed = convert(kind, value, (*sections, name), problems)
    if problems:
        raise Declined(str(problems[0]))
    for node, part in zip(reversed(nodes), reversed([*sections, name]), strict=True):
        changed = dataclasses.replace(node, **{part: changed})
    result: Config = changed
    return result


class _Ledger:
    """Which requests are written down: all that do something new, and a few of the others."""

    def __init__(self) -> None:
        self._newest: Requested | None = None
        self._left_out: Requested | None = None  # the latest that was not written down
        self._room, self._since = _BURST, -math.inf  # for others, by when
        self._missing = 0

    def enter(self, asked: Requested) -> list[Requested]:
        """The request, if it is to be written down, with how many before it were not."""
        is_new = self._newest is None or not _are_alike(asked, self._newest)
        if not (asked.done and is_new):
            waited = max(0.0, asked.stamp - self._since)
            self._room = min(_BURST, self._room + _A_SECOND * waited)
            self._since = asked.stamp
            if self._room < 1.0:
                self._missing += 1
                self._left_out = asked
                return []
            self._room -= 1.0
        self._newest, self._left_out = asked, None
        missing, self._missing = self._missing, 0
        return [_with_count(asked, missing)]

    def close(self) -> list[Requested]:
        """The latest request, if it was left out, with how many before it were."""
        return [] if self._left_out is None else [_with_count(self._left_out, self._missing - 1)]


def _with_count(asked: Requested, missing: int) -> Requested:
    """The request, with how many before it were not written down."""
    if not missing:
        return asked
    were = counted(missing, "request before this one was", "requests before this one were")
    answer = f"{asked.answer} ({were} not written down)"
    return dataclasses.replace(asked, answer=answer)


def _are_alike(one: Requested, other: Requested) -> bool:
    return dataclasses.replace(one, stamp=other.stamp) == other
