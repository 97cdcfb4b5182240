"""What the robot will not do, whoever asks: what is not permitted, not safe, or makes no sense."""

import asyncio
from dataclasses import dataclass, field, replace
from typing import cast

import msgspec
import pytest

from gvgbot.autonomy.errands import Declined, Errands
from gvgbot.autonomy.errands.kinds import Errand, Home, ToVertex
from gvgbot.autonomy.events import Event, Finished, Requested
from gvgbot.config import Config, RobotConfig
from gvgbot.errors import GvgbotError
from gvgbot.hal.guard import GuardConfig, Reason
from gvgbot.hal.messages import Contact
from gvgbot.requests import MESSAGEPACK, REQUESTS, Answer, Asked, RequestName
from gvgbot.steering import SETTABLE, Steering
from gvgbot.telemetry_config import TelemetryConfig

FREE = Contact(stamp=0.0)
CONFIG = Config(robot=RobotConfig(limits=GuardConfig(max_speed_mps=0.5)))


@dataclass
class Body:
    """What the robot feels."""

    away: str | None = None
    contact: Contact | None = FREE
    stopped_for: Reason | None = None


class Willing:
    """Errands that agree to everything, and remember what."""

    def __init__(self) -> None:
        self.did: list[str] = []
        self.happened: list[Event] = []
        self.refuses = False
        self.is_placed, self.is_paused = True, False
        self.is_busy, self.stands_by = True, True
        self.errand: Errand | None = None
        self.given_up: Errand | None = None

    def __getattr__(self, name: str) -> object:
        def do(*_: object) -> str:
            if self.refuses:
                raise Declined("it does not want to")
            self.did.append(name)
            return f"did {name}"

        return do

    def take_events(self) -> list[Event]:
        happened, self.happened = self.happened, []
        return happened


@dataclass
class Rig:
    """A steering with all that it touches."""

    permitted: tuple[RequestName, ...] = REQUESTS
    body: Body = field(default_factory=Body)
    errands: Willing = field(default_factory=Willing)
    told: list[Event] = field(default_factory=list)
    used: list[Config] = field(default_factory=list)
    disk_is_full: bool = False
    told_when_saving: list[Event] = field(default_factory=list)
    time: float = 12.5

    async def save(self) -> str:
        self.told_when_saving = self.told.copy()
        if self.disk_is_full:
            raise GvgbotError("no space left")
        return "/somewhere"

    def __post_init__(self) -> None:
        self.steering = Steering(
            replace(CONFIG, telemetry=TelemetryConfig(requests=self.permitted)),
            cast(Errands, self.errands),
            self.body,
            now=lambda: self.time,
            save=self.save,
            use=self.used.append,
            tell=self.told.extend,
        )

    def ask(self, name: str, **arguments: object) -> Answer:
        data = msgspec.msgpack.encode(arguments)
        return asyncio.run(self.steering.handle(Asked(name, data, MESSAGEPACK, "ana")))


def test_a_request_comes_before_what_it_leads_to() -> None:
    rig = Rig()

    def home(*_: object) -> str:
        rig.time += 0.5
        rig.errands.happened.append(Finished(rig.time, "stopped", "by a request"))
        return "did home"

    rig.errands.__dict__["home"] = home
    rig.ask("home")
    assert [event.stamp for event in rig.told] == [12.5, 13.0]


FITTING: dict[str, dict[str, object]] = {
    "goto": {"vertex": 3},
    "set": {"key": "exploration.patience_s", "value": 30},
}
MOVING = ("resume", "home", "goto", "patrol", "coverage", "explore", "relocalise")


def touched(**felt: bool) -> Body:
    return Body(contact=replace(FREE, **felt))


@pytest.mark.parametrize("name", MOVING)
@pytest.mark.parametrize(
    ("body", "says"),
    [
        (Body(away="no laser: unplugged"), "no laser: unplugged"),
        (touched(bumper_left=True), "a bumper is pressed"),
        (touched(cliff_centre=True), "at a cliff"),
        (touched(wheel_drop_left=True), "lifted"),
        (touched(over_current=True), "overloaded"),
        (touched(charger_cable=True), "cable"),
        (Body(stopped_for="no scan"), "no scan"),
        (Body(stopped_for="laser sees nothing"), "laser sees nothing"),
        (Body(stopped_for="bad command"), "bad command"),
    ],
)
def test_nothing_sets_the_robot_in_motion_while_that_is_not_safe(
    name: str, body: Body, says: str
) -> None:
    rig = Rig(body=body)
    answer = rig.ask(name, **FITTING.get(name, {}))
    assert not answer.done
    assert says in answer.text
    assert rig.errands.did == []


@pytest.mark.parametrize("name", REQUESTS)
def test_what_cannot_be_steered_says_why_and_does_nothing(name: str) -> None:
    rig = Rig()
    rig.steering.declines = "this is a recording"
    assert rig.ask(name, **FITTING.get(name, {})) == Answer(done=False, text="this is a recording")
    assert rig.errands.did == []


def test_why_it_does_not_drive_home_is_written_down_once_until_it_does() -> None:
    rig = Rig()
    rig.errands.refuses = True
    assert not any(rig.steering.go_home("low battery") for _ in range(3))
    (told,) = rig.told
    assert told == Requested(12.5, "home", "low battery", False, "it does not want to")
    rig.errands.refuses = False
    rig.steering.go_home("low battery")
    assert rig.told[1:] == [Requested(12.5, "home", "low battery", True, "did home")]


def test_who_is_paused_drives_home_when_it_is_resumed() -> None:
    rig = Rig()
    rig.errands.is_paused = True
    assert not rig.steering.go_home("low battery")
    assert (rig.errands.did, rig.told) == ([], [])
    rig.errands.is_paused = False
    rig.steering.go_home("low battery")
    assert rig.errands.did == ["home"]


def test_who_does_not_know_its_place_yet_drives_home_later() -> None:
    rig = Rig()
    rig.errands.is_placed = False
    assert not rig.steering.go_home("low battery")
    assert (rig.errands.did, rig.told) == ([], [])
    rig.errands.is_placed = True
    rig.steering.go_home("low battery")
    assert rig.errands.did == ["home"]


@pytest.mark.parametrize("is_charged", [False, True])
def test_who_could_not_go_home_goes_though_all_is_explored_unless_it_was_charged(
    *, is_charged: bool
) -> None:
    rig = Rig()
    rig.errands.is_paused = True
    assert not rig.steering.go_home("low battery")
    if is_charged:
        rig.steering.call_off()
    rig.errands.is_paused = rig.errands.is_busy = False
    rig.steering.go_home("low battery")
    assert rig.errands.did == ([] if is_charged else ["home"])


@pytest.mark.parametrize(
    ("errand", "given_up", "is_over", "did"),
    [
        (Home(), None, False, ["home"]),
        (None, Home(), False, ["home", "home"]),
        (None, None, True, ["home"]),
        (ToVertex(3), None, True, ["home"]),
        (None, ToVertex(3), True, ["home"]),
    ],
    ids=["under way", "somebody stood there", "arrived", "sent elsewhere", "elsewhere in vain"],
)
def test_who_was_called_home_is_called_until_it_is_there_or_sent_elsewhere(
    errand: Errand | None, given_up: Errand | None, *, is_over: bool, did: list[str]
) -> None:
    rig = Rig()
    assert not rig.steering.go_home("low battery")
    rig.errands.errand, rig.errands.given_up = errand, given_up
    rig.errands.is_busy, rig.errands.stands_by = errand is not None, False
    assert rig.steering.go_home("low battery") == is_over
    assert rig.errands.did == did


def test_a_recording_is_not_driven_home() -> None:
    rig = Rig()
    rig.steering.declines = "this is a recording"
    assert rig.steering.go_home("low battery")
    assert (rig.errands.did, rig.told) == ([], [])


@pytest.mark.parametrize("name", ["pause", "stop", "save", "set"])
def test_what_does_not_move_the_robot_is_done_whatever_it_feels(name: str) -> None:
    rig = Rig(body=touched(bumper_left=True))
    assert rig.ask(name, **FITTING.get(name, {})).done


@pytest.mark.parametrize("name", MOVING)
def test_an_obstacle_ahead_is_no_reason_not_to_turn_away_from_it(name: str) -> None:
    assert Rig(body=Body(stopped_for="obstacle")).ask(name, **FITTING.get(name, {})).done


@pytest.mark.parametrize("name", REQUESTS)
def test_what_is_not_listed_is_refused_with_the_key_and_what_it_lists(name: RequestName) -> None:
    others = tuple(other for other in REQUESTS if other != name)
    for permitted, listed in ((others, ", ".join(others)), ((), "nothing")):
        answer = Rig(permitted=permitted).ask(name, **FITTING.get(name, {}))
        assert not answer.done
        assert "telemetry.requests" in answer.text
        assert answer.text.endswith(f"lists {listed}")
    assert Rig(permitted=(name,)).ask(name, **FITTING.get(name, {})).done


def test_every_request_is_told_of_with_its_origin_whatever_became_of_it() -> None:
    rig = Rig(permitted=("pause",))
    rig.ask("pause")
    rig.ask("goto", vertex=3)
    rig.ask("goto", vertix=3)
    rig.ask("dance" * 100)
    assert all(isinstance(event, Requested) for event in rig.told)
    lines = [event for event in rig.told if isinstance(event, Requested)]
    assert [(line.request[:8], line.done) for line in lines] == [
        ("pause", True),
        ("goto 3", False),
        ("goto", False),
        ("dancedan", False),
    ]
    assert {(line.origin, line.stamp) for line in lines} == {("ana", 12.5)}
    assert max(len(line.request) for line in lines) <= 200


def test_what_plays_tricks_on_a_terminal_is_neither_told_nor_answered() -> None:
    """A sequence that clears the screen, or a line of its own, in the key that shall be set."""
    rig = Rig()
    answer = rig.ask("set", key="a\x1b]0;owned\x07\x1b[2J\nX", value="v")
    (line,) = [event for event in rig.told if isinstance(event, Requested)]
    assert not answer.done
    assert all(text.isprintable() for text in (answer.text, line.request, line.answer))
    assert "owned" in line.request


def test_what_the_errands_decline_is_refused_with_their_reason() -> None:
    rig = Rig()
    rig.errands.refuses = True
    assert rig.ask("home") == Answer(done=False, text="it does not want to")


def test_a_map_that_cannot_be_saved_is_said_to_be_so() -> None:
    assert Rig().ask("save") == Answer(done=True, text="map saved in /somewhere")
    assert Rig(disk_is_full=True).ask("save") == Answer(done=False, text="no space left")


def test_a_robot_that_stops_says_so_though_its_map_cannot_be_saved() -> None:
    rig = Rig(disk_is_full=True)
    assert rig.ask("stop") == Answer(done=True, text="did stop; map not saved: no space left")
    assert rig.errands.did == ["stop"]


def test_that_a_robot_has_stopped_is_told_before_its_map_is_saved() -> None:
    """Saving takes long, and the power may fail meanwhile."""
    rig, ended = Rig(), Finished(12.5, "stopped", "by a request")
    rig.errands.happened = [ended]
    assert rig.ask("stop").done
    assert rig.told_when_saving == [ended]
    assert [type(event) for event in rig.told] == [Finished, Requested]


def test_a_value_takes_effect_and_the_next_one_counts_from_there() -> None:
    rig = Rig()
    assert rig.ask("set", key="robot.limits.max_speed_mps", value=0.2).done
    assert rig.ask("set", key="exploration.patience_s", value=30).done
    last = rig.used[-1]
    assert (last.robot.limits.max_speed_mps, last.exploration.patience_s) == (0.2, 30.0)
    assert last.robot.limits.margin_m == CONFIG.robot.limits.margin_m


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("robot.limits.max_speed_mps", 0.6, "cannot be raised"),
        ("robot.limits.max_turn_rate_radps", 3.0, "cannot be raised"),
        ("robot.limits.max_speed_mps", -1, "from 0.05 to 0.7"),
        ("robot.limits.max_speed_mps", "fast", "a number"),
        ("robot.limits.max_speed_mps", True, "a number"),
        ("exploration.policy", "random", "one of"),
        ("robot.limits.margin_m", 0.0, "cannot be changed while the robot runs"),
        ("telemetry.requests", "stop", "cannot be changed while the robot runs"),
        ("__class__", 1, "cannot be changed while the robot runs"),
    ],
)
def test_a_value_that_does_not_fit_changes_nothing(key: str, value: object, says: str) -> None:
    rig = Rig()
    answer = rig.ask("set", key=key, value=value)
    assert not answer.done
    assert says in answer.text
    assert rig.used == []


@pytest.mark.parametrize("key", SETTABLE)
def test_every_key_that_is_offered_exists(key: str) -> None:
    node: object = CONFIG
    for part in key.split("."):
        node = getattr(node, part)
    rig = Rig()
    assert rig.ask("set", key=key, value=node).done
    assert rig.used == [replace(CONFIG, telemetry=TelemetryConfig(requests=REQUESTS))]


def refused(rig: Rig) -> list[str]:
    return [one.answer for one in rig.told if isinstance(one, Requested) and not one.done]


def test_who_is_refused_over_and_over_does_not_fill_the_disk() -> None:
    """A second of 1,500 requests, and another one a minute later: each of them is answered."""
    rig = Rig(permitted=())
    for k in range(1500):
        rig.time = 10.0 + k / 1500
        assert not rig.ask("goto", vertex=k).done
    assert 10 < len(rig.told) < 30
    rig.time = 70.0
    rig.ask("home")
    first, *_, last = refused(rig)
    assert "not written down" not in first
    assert f"{1500 - len(rig.told) + 1} requests before this one were not written down" in last


def test_the_same_over_and_over_is_written_down_a_few_times() -> None:
    """Nobody asks any more: at the end of the run the latest is told, and how many are missing."""
    rig = Rig()
    rig.steering.close()
    assert rig.told == []
    for k in range(1500):
        rig.time = 10.0 + k / 1500
        assert rig.ask("pause").done
    assert rig.errands.did == ["pause"] * 1500
    assert 10 < len(rig.told) < 30
    written, rig.time = len(rig.told), 99.0
    rig.steering.close()
    *_, last = rig.told
    assert isinstance(last, Requested)
    assert last.stamp == 10.0 + 1499 / 1500
    assert f"({1499 - written} requests before this one were not written down)" in last.answer


def test_whatever_does_something_else_than_before_is_written_down() -> None:
    rig = Rig()
    for _ in range(100):
        rig.ask("pause")
        rig.ask("resume")
    assert len(rig.told) == 200
