"""What the words after `gvgbot ctl` mean, before anything is sent."""

import pytest

from gvgbot.cli import main
from gvgbot.cli.entry import parser
from gvgbot.ctl import _split, _value

NOBODY = ("--connect", "tcp/127.0.0.1:1")


@pytest.mark.parametrize(
    ("words", "name", "request_", "arguments"),
    [
        (["pause"], None, "pause", []),
        (["sim", "pause"], "sim", "pause", []),
        (["goto", "7"], None, "goto", ["7"]),
        (["sim", "goto", "1.5", "-2"], "sim", "goto", ["1.5", "-2"]),
        (["stop", "stop"], "stop", "stop", []),  # a robot may be called anything
        (["home", "goto", "3"], "home", "goto", ["3"]),
    ],
)
def test_the_name_of_the_robot_can_be_left_out(
    words: list[str], name: str | None, request_: str, arguments: list[str]
) -> None:
    assert _split(words) == (name, request_, arguments)


@pytest.mark.parametrize(
    "words",
    [
        ["sim", *NOBODY, "goto", "1.5", "-2"],
        ["sim", "goto", *NOBODY, "1.5", "-2"],
        ["sim", "goto", "1.5", *NOBODY, "-2"],
        [*NOBODY, "sim", "goto", "1.5", "-2"],
    ],
)
def test_the_address_may_stand_anywhere_among_the_words(words: list[str]) -> None:
    behind = parser().parse_args(["ctl", "sim", "goto", "1.5", "-2", *NOBODY])
    assert vars(parser().parse_args(["ctl", *words])) == vars(behind)


@pytest.mark.parametrize(
    ("text", "value"),
    [("true", True), ("0.3", 0.3), ("-2", -2), ("kobuki", "kobuki"), ("null", "null"), ("", "")],
)
def test_a_value_is_a_number_or_a_truth_or_text(text: str, value: object) -> None:
    found = _value(text)
    assert (found, type(found)) == (value, type(value))


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["dance"], "'dance' is no request"),
        (["sim", "dance"], "'dance' is no request"),
        (["pasue"], "'pasue' is no request: did you mean pause?"),
        (["sim", "pasue"], "'pasue' is no request: did you mean pause?"),
        (["ptrol", "4", "6"], "'ptrol' is no request: did you mean patrol?"),
        (["GOTO", "1"], "'GOTO' is no request: did you mean goto?"),
        (["dance", "1", "2"], "'dance' is no request: there are"),
        (["goto"], "goto needs a vertex, or x and y"),
        (["goto", "seven"], "'seven' must be the id of a vertex"),
        (["goto", "1", "east"], "'east' must be a number"),
        (["goto", "1", "nan"], "'nan' must be a number"),
        (["goto", "1", "2", "3"], "goto needs"),
        (["patrol", "1", "east"], "'east' must be the id of a vertex"),
        (["coverage", "1"], "coverage takes no arguments"),
        (["set", "robot.limits.max_speed_mps"], "set needs a key and a value"),
        (["sim", "pause", "now"], "pause takes no arguments"),
        (["no robot", "pause"], "no robot can be named"),
    ],
)
def test_words_that_are_no_request_are_bad_usage(
    words: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["ctl", *words, *NOBODY]) == 2
    shown = capsys.readouterr()
    assert says in shown.err
    assert shown.err.count("\n") == 1
    assert shown.out == ""


def test_a_point_can_have_negative_coordinates(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ctl", "sim", "goto", "-1.5", "-2", "--zenoh-file", "no such file"]) == 2
    assert "cannot read no such file" in capsys.readouterr().err


@pytest.mark.parametrize(
    "address",
    [
        *("127.0.0.1:7447", "tcp/127.0.0.1", "tcp/127.0.0.1:74470", "tpc/127.0.0.1:7447"),
        "tcp/\udcff:7447",  # a byte that is no UTF-8
    ],
)
def test_what_is_no_address_with_a_port_is_bad_usage(
    address: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["ctl", "pause", "--connect", address]) == 2
    assert f"{address!r} is no address: give protocol/host:port" in capsys.readouterr().err
