"""Asking a robot, and what becomes of questions and answers that are broken."""

from typing import cast

import pytest
import zenoh

from gvgbot.client.asking import ask
from gvgbot.errors import GvgbotError
from gvgbot.requests import Arguments, Goto, Patrol, Set


class Network:
    """A session in which nobody answers."""

    def get(self, *_: object, **__: object) -> None:
        """Send a question."""


@pytest.mark.parametrize(
    "arguments",
    [
        Goto(vertex=10**30),
        Patrol(vertices=(1, -(10**30))),
        Set(key="exploration.patience_m", value=10**30),
        Set(key="exploration.policy", value="\udc80"),
    ],
)
def test_what_no_message_can_say_is_an_error_in_words(arguments: Arguments) -> None:
    with pytest.raises(GvgbotError, match="cannot be asked for"):
        ask(cast(zenoh.Session, Network()), "near", "goto", arguments)
