"""What is said in the terminal of a page's server."""

import pytest

from gvgbot.client.presence import Word
from gvgbot.web.app import Spoken
from gvgbot.web.wire import Link


@pytest.mark.parametrize(
    ("word", "text"),
    [
        ("alive", "connected to karl"),
        ("doubled", "several robots are named karl: give one another robot.name"),
        ("quiet", "karl says nothing: its program hangs"),
        ("gone", "karl has gone (waiting for it)"),
        ("absent", "no robot named karl here; there is none"),
        ("cut off", "connection to karl lost (trying again)"),
    ],
)
def test_how_things_are_with_the_robot_is_said_once(word: Word, text: str) -> None:
    said: list[str] = []
    spoken = Spoken(said.append)
    for for_s in (0.0, 0.5):
        spoken.tell(Link(robot="karl", endpoint="tcp/127.0.0.1:7447", word=word, for_s=for_s))
    assert said == [text]
