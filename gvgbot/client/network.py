"""Sessions of zenoh with a robot or a router, and the robots that can be reached there."""

import json
import socket
import threading
from collections.abc import Callable
from pathlib import Path

import zenoh
import zenoh.ext

from gvgbot.errors import GvgbotError, UsageError
from gvgbot.telemetry_config import is_endpoint
from gvgbot.topics import (
    Topic,
    alive_key,
)
from gvgbot.zenoh_config import opened, reason, session_config

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"

_TRYING = 1.0  # s, whether anything listens at an address
SETTLING = 1.0  # s after connecting, by when one has heard of all robots on the network


def robots(
    endpoint: str = DEFAULT_ENDPOINT, *, patience_s: float = 10.0, zenoh_file: Path | None = None
) -> list[str]:
    """The names of all robots that can be reached at an address; blocks.

    Raises GvgbotError if nobody answers, UsageError if it is no address or no file of zenoh.
    """
    check_endpoint(endpoint)
    with open_session(endpoint, patience_s, zenoh_file) as session:
        threading.Event().wait(SETTLING)
        return names_on(session)


def only_robot(endpoint: str, patience_s: float = 10.0, zenoh_file: Path | None = None) -> str:
    """The name of the one robot that can be reached at an address; blocks.

    Raises UsageError if there are several, GvgbotError if there is none or nobody answers.
    """
    names = robots(endpoint, patience_s=patience_s, zenoh_file=zenoh_file)
    if len(names) > 1:
        raise UsageError(f"there are several robots: {', '.join(names)}; name one of them")
    if not names:
        raise GvgbotError(f"no robot at {endpoint}: is one running there, or connected to it?")
    return names[0]


def check_endpoint(endpoint: str) -> None:
    """Raises UsageError if this cannot be an address."""
    if not is_endpoint(endpoint):
        raise UsageError(
            f"{endpoint!r} is no address: give protocol/host:port, such as tcp/host:7447"
        )


def open_session(endpoint: str, patience_s: float, file: Path | None) -> zenoh.Session:
    """A client's session; blocks. Raises GvgbotError if nobody answers for so long, s."""
    settings = {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "connect/timeout_ms": round(1000 * patience_s),
    }
    config = session_config(settings, file)
    if endpoint != DEFAULT_ENDPOINT:  # somebody wants this one, whatever the file says
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    try:
        return opened(config, file)
    except zenoh.ZError as error:
        where = ", ".join(json.loads(config.get_json("connect/endpoints")))
        if "Unable to connect" in str(error):
            raise GvgbotError(f"nobody answers at {where}: {_why_nobody(where, file)}") from error
        raise GvgbotError(f"cannot connect to {where}: {reason(error)}") from error


def _why_nobody(where: str, file: Path | None) -> str:
    """What may be the reason that nobody answers at an address."""
    if file is not None:
        return f"no robot is running there, or it does not accept the keys of {file}"
    host, _, port = where.partition("/")[2].partition("#")[0].rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), _TRYING).close()
    except socket.gaierror as error:
        return f"the name {host} is not found ({error.strerror})"
    except (OSError, ValueError):
        return "is a robot running there?"
    return (
        "something listens there, but it is no robot, hangs or is suspended, serves as many "
        "programs as it can already, or wants a password or certificate, such as "
        "--zenoh-file client_tls.json5"
    )


def names_on(session: zenoh.Session) -> list[str]:
    """The names of the robots that are on the network now."""
    found = session.liveliness().get(alive_key("*"), timeout=1.0)
    keys = [str(reply.ok.key_expr) for reply in found if reply.ok is not None]
    return sorted(key.split("/")[1] for key in keys)


def subscribe(
    session: zenoh.Session, topic: Topic, key: str, on_sample: Callable[[zenoh.Sample], None]
) -> None:
    """Subscribe; what is kept for latecomers is sent first, and what is lost is sent again."""
    if not topic.history:
        session.declare_subscriber(key, on_sample)
        return
    recovery = zenoh.ext.RecoveryConfig(heartbeat=True, periodic_queries=None)
    zenoh.ext.declare_advanced_subscriber(
        session,
        key,
        on_sample,
        history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
        recovery=recovery if topic.on_change else None,
    )
