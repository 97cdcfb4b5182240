"""Asking a robot, and what becomes of questions and answers that are broken."""

from types import SimpleNamespace
from typing import Any, cast

import msgspec
import numpy as np
import pytest
import zenoh

from gvgbot.client.asking import Asking, ask
from gvgbot.client.newest import decoded
from gvgbot.errors import GvgbotError
from gvgbot.requests import JSON, MESSAGEPACK, Arguments, Goto, Nothing, Patrol, Set
from gvgbot.topics import STATE, State

DEEP = 200_000  # brackets
NO_LETTERS = b"\x82\xa4done\xc3\xa4text\xa2\xff\xfe"  # {"done": true, "text": ...}


class Network:
    """A session in which somebody answers with this reply."""

    def __init__(self, reply: object = None) -> None:
        self.reply = reply
        self.payload = b""

    def get(self, _: str, callback: Any, *, payload: bytes, **__: object) -> None:
        self.payload = payload
        callback.callback(self.reply)
        callback.drop()


def asked(reply: object) -> Asking:
    return ask(cast(zenoh.Session, Network(reply)), "near", "pause", Nothing())


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


@pytest.mark.parametrize(
    ("arguments", "sent"),
    [
        (Goto(x=np.float32(0.5), y=np.float32(-2.0)), {"x": 0.5, "y": -2.0}),  # type: ignore[arg-type]
        (Patrol(vertices=(np.int64(3), np.int64(7))), {"vertices": [3, 7]}),  # type: ignore[arg-type]
        (Set(key="exploration.patience_m", value=np.float64(2.5)), {"value": 2.5}),
    ],
)
def test_numbers_of_arrays_are_sent_as_numbers(
    arguments: Arguments, sent: dict[str, object]
) -> None:
    network = Network()
    ask(cast(zenoh.Session, network), "near", "goto", arguments)
    assert sent.items() <= msgspec.msgpack.decode(network.payload).items()


@pytest.mark.parametrize(
    ("answer", "encoding"),
    [
        pytest.param(NO_LETTERS, MESSAGEPACK, id="no letters"),
        pytest.param(b'{"done": true, "text": "\xff"}', JSON, id="no letters in JSON"),
        pytest.param(b'{"a": ' + b"[" * DEEP, JSON, id="deep"),
        pytest.param(b"\xc1", MESSAGEPACK, id="no message"),
    ],
)
def test_an_answer_that_cannot_be_read_is_an_error_in_words(answer: bytes, encoding: str) -> None:
    reply = SimpleNamespace(payload=zenoh.ZBytes(answer), encoding=zenoh.Encoding(encoding))
    with pytest.raises(GvgbotError, match="cannot be read"):
        asked(SimpleNamespace(ok=reply, err=None, replier_id=None)).result(timeout=1.0)


def test_nobody_waits_for_ever_whatever_is_wrong() -> None:
    with pytest.raises(AttributeError):
        asked(SimpleNamespace()).result(timeout=1.0)


@pytest.mark.parametrize(
    "sample",
    [
        pytest.param(b"\x81\xa6reason\xa2\xff\xfe", id="no letters"),
        pytest.param(b"\x81\xa1a" + b"\x91" * DEEP, id="deep"),
    ],
)
def test_a_sample_that_cannot_be_read_is_an_error_in_words(sample: bytes) -> None:
    with pytest.raises(GvgbotError, match="damaged sample of state"):
        decoded(STATE, State, STATE.encoding, sample)
