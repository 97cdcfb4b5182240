"""What can be asked of a robot, in JSON and in MessagePack, and what is wrong with the rest."""

import contextlib
import json
import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.requests import (
    JSON,
    MESSAGEPACK,
    REQUESTS,
    Arguments,
    Goto,
    Nothing,
    Patrol,
    Set,
    in_words,
    parse,
    request_key,
)

ARGUMENTS = [
    ("goto", {"vertex": 7}, Goto(vertex=7)),
    ("goto", {"x": 1, "y": -2.5}, Goto(x=1.0, y=-2.5)),
    ("set", {"key": "a.b", "value": True}, Set(key="a.b", value=True)),
    ("set", {"key": "a.b", "value": 0.25}, Set(key="a.b", value=0.25)),
    ("set", {"key": "a.b", "value": "kobuki"}, Set(key="a.b", value="kobuki")),
    ("pause", {}, Nothing()),
    ("patrol", {"vertices": [3, 1, 3]}, Patrol(vertices=(3, 1, 3))),
    ("patrol", {}, Patrol()),
    ("coverage", {}, Nothing()),
]


def test_the_requests_are_the_promised_ones() -> None:
    promised = {"pause", "resume", "stop", "home", "goto", "explore", "relocalise", "save", "set"}
    assert set(REQUESTS) >= promised
    assert request_key("sim", "goto") == "gvgbot/sim/ctl/goto"


@pytest.mark.parametrize(("name", "plain", "typed"), ARGUMENTS)
def test_arguments_come_in_json_or_in_messagepack(
    name: str, plain: dict[str, object], typed: Arguments
) -> None:
    assert parse(name, json.dumps(plain).encode(), JSON) == typed
    assert parse(name, msgspec.msgpack.encode(plain), MESSAGEPACK) == typed


def test_nothing_at_all_stands_for_no_arguments() -> None:
    assert parse("pause", b"", MESSAGEPACK) == Nothing()


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("goto", "{}", "either vertex, or x and y"),
        ("goto", '{"vertex": 1, "x": 2, "y": 3}', "either vertex, or x and y"),
        ("goto", '{"vertex": 1, "x": 2}', "either vertex, or x and y"),
        ("goto", '{"x": 2}', "either vertex, or x and y"),
        ("goto", '{"vertex": "7"}', "vertex"),
        ("goto", '{"vertex": 7.5}', "vertex"),
        ("goto", '{"x": 1e300, "y": 0}', "100000"),
        ("goto", '{"vertix": 7}', "vertix"),
        ("patrol", '{"vertices": 7}', "vertices"),
        ("patrol", '{"vertices": []}', "vertices"),  # a search without a hit shall not mean all
        ("patrol", '{"vertices": [1, "east"]}', "vertices"),
        ("patrol", json.dumps({"vertices": [1] * 1001}), "1000"),
        ("coverage", '{"vertices": [1]}', "vertices"),
        ("set", '{"key": "a"}', "value"),
        ("set", '{"key": "a", "value": null}', "value"),
        ("pause", '{"for": 3}', "for"),
        ("pause", "nonsense", "malformed"),
        ("pause", "[" * 900, ""),
        ("pause", "[" * 24_000, ""),
        ("pause", "[" * 30_000, "more than 25000 bytes"),
    ],
)
def test_wrong_arguments_are_called_wrong_in_words(name: str, text: str, says: str) -> None:
    with pytest.raises(ValueError, match=f"wrong arguments of {name}.*{says}"):
        parse(name, text.encode(), JSON)


@pytest.mark.parametrize("encoding", ["", "zenoh/bytes", "text/plain"])
def test_json_that_does_not_say_so_is_told_what_it_was_taken_for(encoding: str) -> None:
    with pytest.raises(ValueError, match=f"taken for {MESSAGEPACK} .*say {JSON}"):
        parse("goto", b'{"vertex": 7}', encoding)
    with pytest.raises(ValueError, match=r"^wrong arguments of goto: Expected"):
        parse("goto", b'{"vertex": 7}', MESSAGEPACK)
    assert parse("goto", msgspec.msgpack.encode({"vertex": 7}), encoding) == Goto(vertex=7)


@pytest.mark.parametrize("space", ["", " "])
def test_the_longest_patrol_is_not_too_long(space: str) -> None:
    vertices = [2**63 - 1 - each for each in range(1000)]
    text = json.dumps({"vertices": vertices}, separators=(f",{space}", f":{space}"))
    assert parse("patrol", text.encode(), JSON) == Patrol(vertices=tuple(vertices))


@given(st.sampled_from(REQUESTS), st.binary(max_size=200), st.sampled_from([JSON, MESSAGEPACK]))
def test_no_bytes_do_more_harm_than_that(name: str, data: bytes, encoding: str) -> None:
    with contextlib.suppress(ValueError):  # RecursionError, KeyError and others would show
        parse(name, data, encoding)


@given(st.floats(allow_nan=True, allow_infinity=True))
def test_a_point_is_a_number_within_reason(x: float) -> None:
    data = msgspec.msgpack.encode({"x": x, "y": 0.0})
    if abs(x) <= 1e5:
        assert parse("goto", data, MESSAGEPACK) == Goto(x=x, y=0.0)
    else:
        with pytest.raises(ValueError, match="wrong arguments"):
            parse("goto", data, MESSAGEPACK)


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize(
    ("metres", "says"), [(math.nan, "nan"), (math.inf, "inf"), (-2e5, "-200000")]
)
def test_which_coordinate_is_no_number_is_said_in_words(
    axis: str, metres: float, says: str
) -> None:
    data = msgspec.msgpack.encode({"x": 0.0, "y": 0.0, axis: metres})
    words = f"wrong arguments of goto: {axis} is {says}, must be a number from -100000 to 100000"
    with pytest.raises(ValueError, match=f"^{words}$"):
        parse("goto", data, MESSAGEPACK)


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("goto", Goto(vertex=7), "goto 7"),
        ("goto", Goto(x=1.5, y=-2.0), "goto 1.5 -2"),
        ("set", Set(key="a.b", value=True), "set a.b true"),
        ("home", Nothing(), "home"),
        ("patrol", Patrol(vertices=(3, 7)), "patrol 3 7"),
        ("patrol", Patrol(), "patrol"),
    ],
)
def test_a_request_can_be_read_by_people(name: str, arguments: Arguments, words: str) -> None:
    assert in_words(name, arguments) == words
