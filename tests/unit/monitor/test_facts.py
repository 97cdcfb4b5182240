"""The words for a robot's state, its events and its presence."""

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest

from gvgbot.client import Event, Health, LinkHealth, Plan, Presence
from gvgbot.client.presence import Word
from gvgbot.hal.messages import LOW_BATTERY
from gvgbot.monitor import facts as facts_module
from gvgbot.monitor.facts import Fact, Tone, duration, facts, headline, told
from gvgbot.topics import Mate, packed
from tests.unit.test_telemetry import EXAMPLE, NOWHERE

ONCE_AWAY = LinkHealth(
    connected=True, messages=9, damaged=1, lost=0, reconnects=1, clock_offset=None
)
DECISION = Event(
    number=0,
    stamp=1.0,
    kind="decision",
    details={"vertex": 7, "bearing": math.pi / 2, "reason": "nearest frontier"},
)


PLAN = Plan(
    stamp=1.0, vertex=7, bearing=math.pi / 2, reason="nearest frontier", track=b"", route=b""
)
HEALTH = Health(
    stamp=1.0,
    uptime=60.0,
    cycles=3000,
    late_cycles=0,
    slowest_cycle=0.01,
    cpu=0.143,
    memory=82_400_000,
    unsent=0,
    laser=EXAMPLE.laser,
    base=EXAMPLE.base,
)


def test_page_and_monitor_warn_of_the_battery_when_the_robot_itself_does() -> None:
    words = (Path(facts_module.__file__).parents[1] / "web/static/words.js").read_text()
    assert f"LOW_BATTERY = {LOW_BATTERY}," in words
    below, above = (said(battery_fraction=LOW_BATTERY + more) for more in (-0.01, 0.01))
    assert (below["battery"].tone, above["battery"].tone) == ("bad", "good")


def said(**changes: object) -> dict[str, Fact]:
    return {
        fact.name: fact for fact in facts(msgspec.structs.replace(EXAMPLE, **changes), None, None)
    }


def test_the_numbers_of_a_state_are_said_in_the_units_of_people() -> None:
    lines = said(pose=(1.0, -2.0, math.pi / 6), twist=(0.25, -math.pi / 18))
    assert lines["pose"].text == "1.00 -2.00 m  30°"
    assert lines["speed"].text == "0.25 m/s  -10°/s"
    assert lines["driven"].text == "31.5 m"
    assert lines["battery"].text == "███████░ 90% 16.1 V"


def test_sigma_is_along_the_longest_axis_of_the_ellipse() -> None:
    c, s = math.cos(0.4), math.sin(0.4)  # an ellipse of 3 by 1 cm, turned by 0.4 rad
    xx, yy = 9e-4 * c * c + 1e-4 * s * s, 9e-4 * s * s + 1e-4 * c * c
    xy = (9e-4 - 1e-4) * c * s
    tt = math.radians(2.0) ** 2
    lines = said(covariance=(xx, xy, 0.0, xy, yy, 0.0, 0.0, 0.0, tt))
    assert lines["sigma"].text == "3.0 cm  2.0°"


def test_what_is_next_and_why_is_said() -> None:
    lines = {fact.name: fact.text for fact in facts(EXAMPLE, PLAN, None)}
    assert lines["going to"] == "vertex 7, 90°"
    assert lines["why"] == "nearest frontier"


def test_who_knows_no_vertex_yet_drives_along_its_first_edge() -> None:
    track = packed(np.array([[0.0, 0.0], [1.0, 0.0]]))
    plan = Plan(stamp=1.0, vertex=None, bearing=None, reason="", track=track, route=b"")
    begun = msgspec.structs.replace(EXAMPLE, vertices=0, edges=0, frontiers=0)
    lines = {fact.name: fact.text for fact in facts(begun, plan, None)}
    assert (lines["going to"], lines["why"]) == ("end of its first edge", "no vertex is known")
    looking_round = msgspec.structs.replace(plan, track=b"")
    lines = {fact.name: fact.text for fact in facts(begun, looking_round, None)}
    assert lines["going to"] == "-"


def test_who_has_finished_goes_nowhere() -> None:
    done = msgspec.structs.replace(
        EXAMPLE, phase="finished", outcome="explored", reason="no frontier is left"
    )
    lines = {fact.name: fact.text for fact in facts(done, PLAN, None)}
    assert (lines["phase"], lines["outcome"]) == ("finished", "explored")
    assert "going to" not in lines
    assert lines["why"] == "no frontier is left"


def test_no_frontier_is_left_of_a_team_that_has_explored_all() -> None:
    assert said(frontiers=8)["frontiers"].text == "8 left"
    team = (Mate(name="karl", pose=(3.0, -4.0, 0.0)),)
    ended = {"phase": "finished", "outcome": "explored", "team": team}
    assert said(frontiers=8, **ended)["frontiers"].text == "8 followed by others"
    assert said(frontiers=0, **ended)["frontiers"].text == "0 left"


@pytest.mark.parametrize(("phase", "errand"), [("exploring", None), ("errand", "goto 7")])
def test_who_does_not_know_its_place_says_so_and_goes_to_no_vertex(
    phase: str, errand: str | None
) -> None:
    doubt = "not sure where it is: 2 places fit, 0.71 for the best"
    lost = msgspec.structs.replace(EXAMPLE, phase=phase, reason=doubt, covariance=NOWHERE)
    lost = msgspec.structs.replace(lost, errand=errand)
    lines = {fact.name: fact for fact in facts(lost, PLAN, None)}
    assert lines["phase"] == Fact("phase", phase, "warning")
    assert lines["pose"].text == "not known"
    assert "sigma" not in lines
    assert "going to" not in lines
    assert lines["why"].text == doubt
    assert headline("karl", Presence("alive", 1.0), lost, []) == Fact("karl", doubt, "warning")


def test_the_health_of_the_program_is_said() -> None:
    state = msgspec.structs.replace(EXAMPLE, cycle_age=0.02)
    lines = {fact.name: fact for fact in facts(state, None, HEALTH)}
    assert lines["program"].text == "14% cpu  82 MB"
    assert lines["control"] == Fact("control", "running", "good")
    ill = msgspec.structs.replace(HEALTH, late_cycles=5, unsent=2)
    lines = {fact.name: fact for fact in facts(state, None, ill)}
    assert lines["program"].text == "14% cpu  82 MB  2 unsent"
    assert lines["control"].text == "running, 5 late"


def test_troubles_of_links_are_counted() -> None:
    lines = said()
    assert lines["laser"].text == "4 lost, 3 damaged"
    assert lines["base"] == Fact("base", "away", "bad")


@pytest.mark.parametrize(
    ("changes", "name", "expected"),
    [
        ({"cycle_age": 5.2}, "control", Fact("control", "no cycle for 5 s", "bad")),
        ({"cycle_age": None}, "control", Fact("control", "not begun", "faint")),
        ({"guard": "obstacle near"}, "guard", Fact("guard", "obstacle near", "warning")),
        ({"contacts": 0, "slips": 0}, "contacts", Fact("contacts", "0", "plain")),
        ({"contacts": 0, "slips": 1}, "contacts", Fact("contacts", "0, 1 slip", "warning")),
        ({"laser": ONCE_AWAY}, "laser", Fact("laser", "1 damaged, 1 reconnect", "plain")),
        ({"battery_fraction": None}, "battery", Fact("battery", "unknown", "faint")),
        (
            {"battery_fraction": 0.1, "battery_voltage": 13.2},
            "battery",
            Fact("battery", "█░░░░░░░ 10% 13.2 V", "bad"),
        ),
        ({"phase": "halted"}, "phase", Fact("phase", "halted", "bad")),
        ({"pose": (-0.001, -0.001, -0.001)}, "pose", Fact("pose", "0.00 0.00 m  0°", "plain")),
        ({"twist": (-0.001, -0.001)}, "speed", Fact("speed", "0.00 m/s  +0°/s", "plain")),
    ],
)
def test_what_needs_a_look_is_toned(changes: dict[str, object], name: str, expected: Fact) -> None:
    assert said(**changes)[name] == expected


@pytest.mark.parametrize(
    ("word", "others", "text"),
    [
        ("absent", ["a", "b"], "no robot named karl here; there is a, b"),
        ("absent", [], "no robot named karl here; there is none"),
        ("gone", [], "robot gone for 12 s"),
        ("cut off", [], "connection lost for 12 s, trying again"),
        ("doubled", [], "several robots are named karl: give one another robot.name"),
        ("quiet", [], "quiet for 12 s: its program hangs"),
        ("alive", [], "exploring"),
    ],
)
def test_the_headline_says_how_things_are(word: Word, others: list[str], text: str) -> None:
    presence = Presence(word, 12.3)
    state = msgspec.structs.replace(EXAMPLE, reason="")
    assert headline("karl", presence, state, others).text == text


@pytest.mark.parametrize(
    ("phase", "errand", "text"),
    [
        ("finished", None, "no frontier is left"),
        ("errand", "goto 7", "goto 7"),
        ("waiting", None, "waiting"),
        ("paused", "goto 7", "paused"),
    ],
)
def test_what_it_does_now_is_said_and_not_how_the_exploration_ended(
    phase: str, errand: str | None, text: str
) -> None:
    ended = {"outcome": "explored", "reason": "no frontier is left"}
    state = msgspec.structs.replace(EXAMPLE, phase=phase, errand=errand, **ended)
    assert headline("karl", Presence("alive", 1.0), state, []).text == text


def test_before_its_first_word_a_robot_is_connected_to_and_not_lost() -> None:
    assert headline("karl", Presence("cut off", 0.1), None, []).text == "connecting to the robot"


def test_a_control_loop_that_is_stuck_makes_the_headline() -> None:
    laser = msgspec.structs.replace(EXAMPLE.base, connected=True)
    stuck = msgspec.structs.replace(EXAMPLE, cycle_age=7.0, base=laser)
    assert headline("karl", Presence("alive", 1.0), stuck, []).tone == "bad"


def test_a_robot_without_its_base_says_why_it_stands_and_not_that_it_is_stuck() -> None:
    """Its cycles are those of odometry."""
    away = msgspec.structs.replace(EXAMPLE.base, connected=False)
    waits = {"phase": "halted", "reason": "the base is away", "errand": None}
    state = msgspec.structs.replace(EXAMPLE, cycle_age=7.0, base=away, **waits)
    assert headline("karl", Presence("alive", 1.0), state, []).text == "the base is away"


def test_an_event_is_a_sentence_with_its_age() -> None:
    assert told(DECISION, 13.5) == Fact("    12 s", "go to vertex 7, 90°: nearest frontier")


@pytest.mark.parametrize(
    ("seconds", "age"),
    [(59.9, "59 s"), (79.0, "1 min"), (3599.0, "59 min"), (7260.0, "2 h"), (720_000.0, "200 h")],
)
def test_the_age_of_an_event_fits_its_column(seconds: float, age: str) -> None:
    fact = told(DECISION, DECISION.stamp + seconds)
    assert fact is not None
    assert fact.name.strip() == age
    assert len(fact.name) == 8


@pytest.mark.parametrize(
    ("kind", "details", "text"),
    [
        (
            "requested",
            {"request": "goto 7", "origin": "ann@desk", "done": True, "answer": "it drives"},
            "goto 7: it drives (ann@desk)",
        ),
        (
            "requested",
            {"request": "home", "origin": "ann@desk", "done": False, "answer": "it is lifted"},
            "home refused: it is lifted (ann@desk)",
        ),
        (
            "errand_ended",
            {"errand": "goto 7", "outcome": "given up", "reason": "no way is left"},
            "goto 7 given up, no way is left",
        ),
        ("errand_ended", {"errand": "home", "outcome": "arrived", "reason": ""}, "home arrived"),
        ("round_ended", {"round": 3, "reached": 5, "missed": 1}, "round 3: 5 reached, 1 missed"),
        ("place_doubted", {"vertex": 9, "known": 2}, "vertex 9 may be 2: the next ones tell"),
        ("doubt_settled", {"vertex": 9, "known": 2}, "vertex 9 is 2"),
        ("doubt_settled", {"vertex": 9, "known": None}, "vertex 9 is a new one"),
        ("closure_revoked", {"vertex": 2}, "closure at vertex 2 taken back"),
        ("vertex_moved", {"vertex": 2, "metres": 0.4}, "vertex 2 proves to stand elsewhere"),
    ],
)
def test_what_happened_is_told_in_words(
    kind: str, details: dict[str, str | int | float | bool | None], text: str
) -> None:
    fact = told(Event(number=1, stamp=0.0, kind=kind, details=details), 0.0)
    assert fact is not None
    assert fact.text == text


@pytest.mark.parametrize(
    ("outcome", "words", "tone"),
    [
        ("explored", "explored", "good"),
        ("explored_with_blocked", "explored with blocked", "warning"),
        ("failed", "failed", "warning"),
        ("stopped", "stopped", "warning"),
    ],
)
def test_an_end_is_good_when_all_is_explored(outcome: str, words: str, tone: Tone) -> None:
    details: dict[str, str | int | float | bool | None] = {"outcome": outcome, "reason": "why"}
    ended = Event(number=1, stamp=0.0, kind="finished", details=details)
    assert told(ended, 12.0) == Fact("    12 s", f"{words}: why", tone)


def test_a_kind_of_event_that_is_not_known_yet_is_told_all_the_same() -> None:
    strange = Event(number=1, stamp=0.0, kind="wheel_lost", details={"wheel": "left"})
    fact = told(strange, 0.0)
    assert fact is not None
    assert fact.text == "wheel lost: wheel left"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.9, "0 s"),
        (59.9, "59 s"),
        (60.0, "1 min 0 s"),
        (3599.0, "59 min 59 s"),
        (7620, "2 h 7 min"),
    ],
)
def test_a_duration_is_told_in_whole_units_two_at_most(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_each_other_robot_of_the_team_has_a_line_with_its_place() -> None:
    team = (Mate(name="karl", pose=(3.21, -4.5, 0.0)), Mate(name="otto", pose=(0.0, 7.0, 1.0)))
    state = msgspec.structs.replace(EXAMPLE, team=team)
    lines = {fact.name: fact.text for fact in facts(state, None, None)}
    assert lines["karl"] == "3.21 -4.50 m"
    assert lines["otto"] == "0.00 7.00 m"


def test_robots_with_long_names_are_told_apart() -> None:
    names = ("kitchen-robot-1", "kitchen-robot-2", "a-robot-with-too-long-a-name-to-be-told-3")
    team = tuple(Mate(name=name, pose=(-123.45, -5.0, 0.0)) for name in names)
    state = msgspec.structs.replace(EXAMPLE, team=team)
    one, two, three = (fact for fact in facts(state, None, None) if "robot" in fact.name)
    assert (one.name[-2:], two.name[-2:], three.name[-2:]) == ("-1", "-2", "-3")
    assert all(len(fact.name) > 10 for fact in (one, two, three))
    assert all(fact.text == "-123.45 -5.00 m" for fact in (one, two, three))
