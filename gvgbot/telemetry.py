"""The network: publishes snapshots, answers who asks for the newest, never holds up the loop."""

import asyncio
import contextlib
import re
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import Self

import msgspec
import zenoh

from gvgbot.errors import GvgbotError
from gvgbot.topics import STATE, State, TelemetryConfig, alive_key

_WAITING_QUERIES = 32  # more than this are dropped, oldest first; who asked gets nothing
_MAX_SESSIONS = 32
_PRIORITIES = {
    "interactive_high": zenoh.Priority.INTERACTIVE_HIGH,
    "data_high": zenoh.Priority.DATA_HIGH,
    "data": zenoh.Priority.DATA,
    "data_low": zenoh.Priority.DATA_LOW,
}


class Telemetry:
    """The robot's end of the network; a context manager that leaves it.

    A session left open keeps the process from ending, so close it on every way out.
    """

    def __init__(self, config: TelemetryConfig, robot: str) -> None:
        """Listen. Raises GvgbotError if an address cannot be had."""
        self.failures = 0  # samples that could not be sent
        self._latest: State | None = None
        self._key = STATE.key(robot)
        self._session = _open(config)
        self._publisher = self._session.declare_publisher(
            self._key,
            encoding=zenoh.Encoding(STATE.encoding),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=_PRIORITIES[STATE.priority],
        )
        self._alive = self._session.liveliness().declare_token(alive_key(robot))

    def publish(self, state: State) -> None:
        """Send a state to whoever listens; without waiting, and without complaining if it fails."""
        self._latest = state
        try:
            self._publisher.put(msgspec.msgpack.encode(state))
        except zenoh.ZError:
            self.failures += 1

    async def answer(self) -> None:
        """Answer queries for the newest state until cancelled."""
        loop, arrived = asyncio.get_running_loop(), asyncio.Event()
        waiting: deque[zenoh.Query] = deque(maxlen=_WAITING_QUERIES)

        def take(query: zenoh.Query) -> None:
            waiting.append(query)
            loop.call_soon_threadsafe(arrived.set)

        with self._session.declare_queryable(self._key, take):
            while True:
                await arrived.wait()
                arrived.clear()
                while waiting:  # a frozen asker can block a reply, so the loop stays out of it
                    await asyncio.to_thread(self._reply, waiting.popleft())

    def _reply(self, query: zenoh.Query) -> None:
        with query, contextlib.suppress(zenoh.ZError):  # who asked may have gone
            if self._latest is None:
                query.reply_err("there is no state yet")
                return
            encode, encoding = _form(query.parameters.get("format"))
            query.reply(self._key, encode(self._latest), encoding=encoding)

    def close(self) -> None:
        """Leave the network."""
        self._session.close()  # type: ignore[no-untyped-call]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _form(wanted: str | None) -> tuple[Callable[[State], bytes], zenoh.Encoding]:
    """How to encode an answer, and the encoding that says so."""
    if wanted == "json":
        return msgspec.json.encode, zenoh.Encoding.APPLICATION_JSON
    return msgspec.msgpack.encode, zenoh.Encoding(STATE.encoding)


def _open(config: TelemetryConfig) -> zenoh.Session:
    try:
        return zenoh.open(_session_config(config))
    except zenoh.ZError as error:
        where = ", ".join(config.listen)
        raise GvgbotError(
            f"cannot listen on {where}: {_reason(error)}; "
            "choose another address (telemetry.listen), or set telemetry.enabled=false"
        ) from error


def _session_config(config: TelemetryConfig) -> zenoh.Config:
    settings: dict[str, object] = {
        "mode": "peer",
        "listen/endpoints": config.listen,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": round(1000 * config.lease_s),
        "transport/unicast/max_sessions": _MAX_SESSIONS,
        "timestamping/enabled": True,
    }
    session = zenoh.Config()
    for key, value in settings.items():
        session.insert_json5(key, msgspec.json.encode(value).decode())
    return session


def _reason(error: zenoh.ZError) -> str:
    """What the library says is wrong, without the places in its own source."""
    if "already in use" in str(error):
        return "the address is already in use, perhaps by another gvgbot"
    found = re.search(r"\[([^\]]*)\]", str(error))
    return re.sub(r" at /\S+", "", found.group(1) if found else str(error)).strip(". ")
