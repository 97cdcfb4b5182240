import msgspec
import pytest

from gvgbot.names import is_robot_name
from gvgbot.team import news


@pytest.mark.parametrize(
    ("name", "is_one"),
    [
        ("turtlebot2", True),
        ("Robot_7-b", True),
        ("", False),
        ("two words", False),
        ("sim/ctl", False),
        ("*", False),
        ("käfer", False),
        ("sim\n", False),
    ],
)
def test_a_robot_may_be_called_so_in_its_configuration_and_in_its_team(
    name: str, is_one: bool
) -> None:
    assert is_robot_name(name) == is_one
    try:
        msgspec.convert(name, news.Name)
    except msgspec.ValidationError:
        assert not is_one
    else:
        assert is_one
