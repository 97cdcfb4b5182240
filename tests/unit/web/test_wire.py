"""What passes between server and page, and who is sent what."""

import asyncio
import json
import math

import msgspec
import pytest

from gvgbot.requests import Goto, Nothing
from gvgbot.topics import Events
from gvgbot.web.feed import _Histories
from gvgbot.web.viewers import Audience, Viewer
from gvgbot.web.wire import Link, Reply, frame, wish
from tests.unit.test_telemetry import EXAMPLE, NOWHERE

A_LINK = Link(robot="karl", endpoint="tcp/h:1", word="alive", for_s=3.0)


def kinds_waiting(viewer: Viewer) -> list[str]:
    found: list[str] = []
    while viewer.has_news:
        found.append(msgspec.msgpack.decode(asyncio.run(viewer.next()))[0])
    return found


def test_a_message_to_the_page_is_a_pair_of_kind_and_value() -> None:
    kind, value = msgspec.msgpack.decode(frame("state", EXAMPLE))
    assert kind == "state"
    assert value == json.loads(msgspec.json.encode(EXAMPLE))  # as the topic has it


def test_a_wish_has_the_arguments_of_its_request() -> None:
    asked = wish('{"id": 3, "name": "goto", "arguments": {"x": 1, "y": -2.5}}')
    assert (asked.id, asked.name, asked.typed) == (3, "goto", Goto(x=1.0, y=-2.5))
    assert wish('{"id": 4, "name": "pause"}').typed == Nothing()


@pytest.mark.parametrize(
    "text",
    [
        pytest.param("", id="nothing"),
        pytest.param("[]", id="a list"),
        pytest.param("[" * 1900, id="deep brackets"),
        pytest.param('{"id": 1, "name": "drive"}', id="no such request"),
        pytest.param('{"id": "a", "name": "pause"}', id="no number"),
        pytest.param(f'{{"id": {10**30}, "name": "pause"}}', id="a number that cannot be replied"),
        pytest.param('{"id": 1, "name": "pause", "sudo": true}', id="a field too many"),
        pytest.param(b"\xff\xfe", id="no text"),
    ],
)
def test_what_is_no_wish_is_refused(text: str | bytes) -> None:
    with pytest.raises(ValueError, match="no wish"):
        wish(text)


@pytest.mark.parametrize(
    "arguments",
    ['{"vertex": "a"}', '{"x": 1}', "{}", '{"vertex": 1, "z": 2}', '{"x": 1e9, "y": 0}'],
)
def test_arguments_that_do_not_fit_are_refused_in_words(arguments: str) -> None:
    asked = wish(f'{{"id": 1, "name": "goto", "arguments": {arguments}}}')
    with pytest.raises(ValueError, match="wrong arguments of goto"):
        _ = asked.typed


def test_who_joins_gets_the_newest_of_each_kind() -> None:
    audience, viewer = Audience(), Viewer()
    audience.show("link", A_LINK)
    audience.show("state", EXAMPLE)
    audience.show("state", EXAMPLE)
    audience.join(viewer)
    assert kinds_waiting(viewer) == ["link", "state"]
    audience.leave(viewer)
    audience.show("link", A_LINK)
    assert kinds_waiting(viewer) == []


def test_a_slow_viewer_skips_to_the_newest_and_holds_nobody_up() -> None:
    audience, slow, quick = Audience(), Viewer(), Viewer()
    audience.join(slow)
    audience.join(quick)
    got = []
    for number in range(1000):
        audience.show("state", msgspec.structs.replace(EXAMPLE, sequence=number))
        got += kinds_waiting(quick)
    assert len(got) == 1000
    kind, state = msgspec.msgpack.decode(asyncio.run(slow.next()))
    assert (kind, state["sequence"]) == ("state", 999)
    assert kinds_waiting(slow) == []


def test_every_reply_is_sent_and_before_all_else() -> None:
    viewer = Viewer()
    viewer.put("state", frame("state", EXAMPLE))
    for number in range(3):
        viewer.put("reply", frame("reply", Reply(id=number, done=True, text="")))
    assert kinds_waiting(viewer) == ["reply", "reply", "reply", "state"]


def test_what_is_kept_for_those_who_come_is_not_sent_to_those_who_are_there() -> None:
    audience, early, late = Audience(), Viewer(), Viewer()
    audience.join(early)
    audience.keep("events", Events(events=()))
    audience.join(late)
    assert (kinds_waiting(early), kinds_waiting(late)) == ([], ["events"])


def test_a_history_is_thinned_and_begins_anew_with_the_robot() -> None:
    histories = _Histories()
    for tick in range(100):  # ten seconds
        histories.add(msgspec.structs.replace(EXAMPLE, stamp=100.0 + 0.1 * tick))
    stamps = histories.columns().stamps
    assert stamps == pytest.approx((100.0, 102.0, 104.0, 106.0, 108.0))
    histories.add(msgspec.structs.replace(EXAMPLE, stamp=3.0, battery_fraction=None))
    assert histories.columns().stamps == (3.0,)
    assert histories.columns().batteries == (None,)


def test_a_history_ends_after_half_an_hour() -> None:
    histories = _Histories()
    for tick in range(4000):
        histories.add(msgspec.structs.replace(EXAMPLE, stamp=2.0 * tick))
    stamps = histories.columns().stamps
    assert stamps[-1] - stamps[0] == pytest.approx(1800.0, abs=5.0)


def test_a_history_has_no_sigma_of_a_place_that_is_not_known() -> None:
    histories = _Histories()
    histories.add(msgspec.structs.replace(EXAMPLE, stamp=0.0, covariance=NOWHERE))
    histories.add(msgspec.structs.replace(EXAMPLE, stamp=10.0))
    unknown, known = histories.columns().sigmas
    assert unknown is None
    assert known == pytest.approx(math.sqrt(2.0))
