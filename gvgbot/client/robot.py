"""A robot seen over the network: its newest state and map, its events, and whether it is there."""

import asyncio
import contextlib
import threading
import time
from collections.abc import AsyncIterator, Iterator
from functools import partial
from types import TracebackType
from typing import Self, TypeVar

import zenoh
import zenoh.ext

from gvgbot.client.newest import Newest, decoded
from gvgbot.client.presence import Presence, Signs
from gvgbot.errors import GvgbotError, UsageError
from gvgbot.topics import (
    EVENTS,
    MAP,
    STATE,
    Event,
    Events,
    Map,
    State,
    Topic,
    alive_key,
    is_endpoint,
    is_robot_name,
)
from gvgbot.zenoh_config import reason, session_config

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"

_SETTLING = 1.0  # s after connecting, by when one has heard of all robots on the network

T = TypeVar("T", State, Map, Events)


def connect(robot: str, endpoint: str = DEFAULT_ENDPOINT, *, patience_s: float = 10.0) -> "Robot":
    """A robot by its name, to be entered with `with` or `async with`.

    `endpoint` is the address of the robot or of a zenoh router. Entering raises GvgbotError if
    nobody answers there for as long as the patience lasts; whether the robot itself is there, now
    or later, its `presence` tells. A connection that is lost later is made again by itself.
    Raises UsageError for a name or an address that cannot be one.
    """
    if not is_robot_name(robot):
        raise UsageError(f"no robot can be named {robot!r}: letters, digits, - and _ only")
    if not is_endpoint(endpoint):
        raise UsageError(
            f"{endpoint!r} is no address: give protocol/address, such as tcp/host:7447"
        )
    return Robot(robot, endpoint, patience_s)


def robots(endpoint: str = DEFAULT_ENDPOINT, *, patience_s: float = 10.0) -> list[str]:
    """The names of all robots that can be reached at an address; blocks.

    Raises GvgbotError if nobody answers, UsageError if it is no address.
    """
    _check_endpoint(endpoint)
    with _open(endpoint, patience_s) as session:
        threading.Event().wait(_SETTLING)
        return _names(session)


class Robot:
    """One robot; made by `connect`. What it says is kept up to date whether it is read or not."""

    def __init__(self, name: str, endpoint: str, patience_s: float) -> None:
        self.name, self.endpoint = name, endpoint
        self._patience_s = patience_s
        self._session: zenoh.Session | None = None
        self._state: Newest[State] = Newest()
        self._map: Newest[Map] = Newest()
        self._events: Newest[Events] = Newest()
        self._signs = Signs(0.0)
        self._gate = threading.Lock()  # one of opening and closing at a time
        self._is_closed = False
        self._has_been_seen = threading.Event()

    # -- what the robot says -----------------------------------------------------------------------

    def state(self) -> Newest[State]:
        """Its state, a few times a second."""
        return self._state

    def map(self) -> Newest[Map]:
        """Its map, each time it has grown."""
        return self._map

    def events(self) -> "EventStream":
        """What happens, one after another; those of the last minutes first."""
        return EventStream(self._events)

    @property
    def presence(self) -> Presence:
        """Whether the robot is there."""
        return self._signs.presence(time.perf_counter(), linked=self._is_linked())

    def others(self) -> list[str]:
        """The names of all robots that are on this network now."""
        assert self._session is not None, "the robot is not connected: use `with`"
        return _names(self._session)

    def _is_linked(self) -> bool:
        if self._session is None:
            return False
        info = self._session.info
        return bool(info.routers_zid() or info.peers_zid())

    # -- coming and going --------------------------------------------------------------------------

    def open(self) -> None:
        """Connect, and look for the robot; blocks. Raises GvgbotError if nobody answers."""
        session = _open(self.endpoint, self._patience_s)
        with self._gate:
            self._session = session
            if self._is_closed:  # by somebody who did not want to wait
                self._session.close()  # type: ignore[no-untyped-call]
                return
            self._begin(session)
        self._has_been_seen.wait(_SETTLING)

    def _begin(self, session: zenoh.Session) -> None:
        via_router = bool(session.info.routers_zid())
        self._signs = Signs(time.perf_counter(), via_router=via_router)
        session.liveliness().declare_subscriber(alive_key(self.name), self._on_token, history=True)
        self._subscribe(session, STATE, State, self._state)
        self._subscribe(session, MAP, Map, self._map)
        self._subscribe(session, EVENTS, Events, self._events)

    def _subscribe(
        self, session: zenoh.Session, topic: Topic, payload: type[T], newest: Newest[T]
    ) -> None:
        """Put each sample of a topic, and the last one before it was subscribed to, into a box."""
        zenoh.ext.declare_advanced_subscriber(
            session,
            topic.key(self.name),
            partial(self._on_sample, topic, payload, newest),
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
        )

    def _on_sample(
        self, topic: Topic, payload: type[T], newest: Newest[T], sample: zenoh.Sample
    ) -> None:
        encoding, data = str(sample.encoding), sample.payload.to_bytes()
        newest.put(partial(decoded, topic, payload, encoding, data))
        if topic is STATE:
            self._signs.heard_at = time.perf_counter()

    def _on_token(self, sample: zenoh.Sample) -> None:
        self._signs.has_token = sample.kind == zenoh.SampleKind.PUT
        self._signs.token_at = time.perf_counter()
        self._has_been_seen.set()

    def close(self) -> None:
        """Leave the network, and end all iterations."""
        for newest in (self._state, self._map, self._events):
            newest.close()
        with self._gate:
            self._is_closed = True
            if self._session is not None:
                with contextlib.suppress(zenoh.ZError):  # the other end is frozen
                    self._session.close()  # type: ignore[no-untyped-call]

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    async def __aenter__(self) -> Self:
        try:
            await asyncio.to_thread(self.open)
        except asyncio.CancelledError:  # the thread goes on until the patience ends
            self.close()
            raise
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await asyncio.to_thread(self.close)


class EventStream:
    """Each event once, with `for` or `async for`; those that a slow reader missed are left out."""

    def __init__(self, newest: Newest[Events]) -> None:
        self._newest = newest

    @property
    def latest(self) -> tuple[Event, ...]:
        """The latest events, oldest first."""
        newest = self._newest.latest
        return () if newest is None else newest.events

    def __iter__(self) -> Iterator[Event]:
        """Wait for events in this thread."""
        fresh = _Fresh()
        for sent in self._newest:
            yield from fresh.of(sent.events)

    async def __aiter__(self) -> AsyncIterator[Event]:
        """Wait for events in the running loop."""
        fresh = _Fresh()
        async for sent in self._newest:
            for event in fresh.of(sent.events):
                yield event


class _Fresh:
    """Tells which events of a message were not in those before it."""

    def __init__(self) -> None:
        self._last: Event | None = None

    def of(self, events: tuple[Event, ...]) -> tuple[Event, ...]:
        last, self._last = self._last, events[-1] if events else self._last
        if last is None or not events:
            return events
        same = [event for event in events if event.number == last.number]
        has_restarted = events[-1].number < last.number or (same and same[0] != last)
        return tuple(event for event in events if has_restarted or event.number > last.number)


def _check_endpoint(endpoint: str) -> None:
    if not is_endpoint(endpoint):
        raise UsageError(
            f"{endpoint!r} is no address: give protocol/address, such as tcp/host:7447"
        )


def _names(session: zenoh.Session) -> list[str]:
    """Of the robots that are on the network now."""
    found = session.liveliness().get(alive_key("*"), timeout=1.0)
    keys = [str(reply.ok.key_expr) for reply in found if reply.ok is not None]
    return sorted(key.split("/")[1] for key in keys)


def _open(endpoint: str, patience_s: float) -> zenoh.Session:
    settings = {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "connect/timeout_ms": round(1000 * patience_s),
    }
    try:
        return zenoh.open(session_config(settings))
    except zenoh.ZError as error:
        if "Unable to connect" in str(error):
            raise GvgbotError(f"nobody answers at {endpoint}") from error
        raise GvgbotError(f"cannot connect to {endpoint}: {reason(error)}") from error
