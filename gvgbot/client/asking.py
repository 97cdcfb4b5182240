"""Asking a robot for something: the question on its way, and the answer when it comes."""

import asyncio
import getpass
import socket
from collections.abc import Generator
from concurrent.futures import Future

import msgspec
import numpy as np
import zenoh

from gvgbot import __version__
from gvgbot.client.newest import UNREADABLE
from gvgbot.errors import GvgbotError
from gvgbot.requests import JSON, MESSAGEPACK, Answer, Arguments, RequestName, request_key

PATIENCE_S = 10.0  # for an answer


class Refused(GvgbotError):
    """The robot will not do what it was asked for; nothing has changed."""


class Asking(Future[str]):
    """A request that has been sent: `await` it, or call `result()`, for what the robot does now.

    Both raise Refused with the robot's reason, GvgbotError if there is no answer.
    """

    def __await__(self) -> Generator[None, None, str]:
        """Wait in the running loop."""
        return asyncio.wrap_future(self).__await__()


def ask(session: zenoh.Session, robot: str, name: RequestName, arguments: Arguments) -> Asking:
    """Send a request, without waiting.

    Raises GvgbotError if it cannot be sent, or the connection is closed.
    """
    payload = _payload(arguments)
    asking, replies = Asking(), list[zenoh.Reply]()
    asking.set_running_or_notify_cancel()  # what is sent cannot be called back

    def answered() -> None:
        try:
            asking.set_result(_text(replies, robot))
        except Exception as error:  # noqa: BLE001 - somebody waits
            asking.set_exception(error)

    try:
        session.get(
            request_key(robot, name),
            zenoh.handlers.Callback(replies.append, answered),
            payload=payload,
            encoding=zenoh.Encoding(MESSAGEPACK),
            attachment=_name(),
            timeout=PATIENCE_S,
            consolidation=zenoh.ConsolidationMode.NONE,  # all who answer are to be noticed
        )
    except zenoh.ZError as error:
        raise GvgbotError("the connection to the robot is closed") from error
    return asking


def _payload(arguments: Arguments) -> bytes:
    """Raises GvgbotError for what has no form on the network: a huge number, a broken character."""
    try:
        return msgspec.msgpack.encode(arguments, enc_hook=_plain)
    except (OverflowError, UnicodeEncodeError) as error:
        raise GvgbotError(f"this cannot be asked for: {error}") from error


def _plain(value: object) -> object:
    """A number of NumPy's as one of Python's: what the robot says of places is in arrays."""
    if isinstance(value, np.generic):
        return value.item()
    raise NotImplementedError


def _text(replies: list[zenoh.Reply], robot: str) -> str:
    if not replies:
        raise GvgbotError(
            f"{robot} does not answer: it is not there, or this program may not ask it for that"
        )
    if (namesakes := len({str(reply.replier_id) for reply in replies})) > 1:
        raise GvgbotError(
            f"{namesakes} robots are named {robot}, and each was asked: give one another robot.name"
        )
    ok, err = replies[0].ok, replies[0].err
    if ok is not None:
        return _answer(ok.payload, ok.encoding).text
    assert err is not None
    if not str(err.encoding).startswith((MESSAGEPACK, JSON)):  # not the robot's, but zenoh's
        raise GvgbotError(f"{robot} has not answered in time: look at it with gvgbot monitor")
    raise Refused(_answer(err.payload, err.encoding).text)


def answer_of(life: str | None, replies: list[zenoh.Reply]) -> zenoh.Sample | None:
    """What that life has answered, or anybody if none is known."""
    for reply in replies:
        who = reply.replier_id
        if reply.ok is not None and (life is None or (who is not None and str(who.zid) == life)):
            return reply.ok
    return None


def _answer(payload: zenoh.ZBytes, encoding: zenoh.Encoding) -> Answer:
    decode = msgspec.json.decode if str(encoding).startswith(JSON) else msgspec.msgpack.decode
    try:
        return decode(payload.to_bytes(), type=Answer)
    except UNREADABLE as error:
        raise GvgbotError(f"an answer that cannot be read: {error}") from error


def _name() -> str:
    """Who asks, for the robot's log."""
    try:
        user = getpass.getuser()
    except (OSError, KeyError):  # no name in the user database, as in some containers
        user = "somebody"
    return f"{user}@{socket.gethostname()} gvgbot/{__version__}"
