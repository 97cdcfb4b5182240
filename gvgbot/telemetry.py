"""The network: publishes snapshots, answers who asks for the newest, never holds up the loop."""

import asyncio
import contextlib
import threading
from collections import deque
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Self

import msgspec
import structlog
import zenoh
import zenoh.ext

from gvgbot.errors import GvgbotError
from gvgbot.requests import (
    JSON,
    LONGEST_ARGUMENTS,
    MESSAGEPACK,
    STOPS,
    Answer,
    Asked,
    request_key,
)
from gvgbot.sleep import Sleep
from gvgbot.telemetry_config import LAST_PORT, TelemetryConfig
from gvgbot.topics import (
    HEARTBEAT,
    STATE,
    TEAM_PARTS,
    TOPICS,
    Payload,
    TeamPart,
    Topic,
    alive_key,
    team_key,
)
from gvgbot.words import printable
from gvgbot.zenoh_config import addresses, has_listener, opened, reason, session_config

_WAITING_QUERIES = 1000  # more than this are dropped, oldest first; who asked gets nothing
# While as many wait, others are refused; then dropped; then even those that stop the robot.
_WAITING_REQUESTS, _WAITING_REFUSALS, _WAITING_STOPS = 8, 1000, 2000
_CROWDED = Answer(done=False, text="too many requests wait: ask again")
_ASLEEP = Answer(done=False, text="the robot's program was asleep when that came: ask again")
_MAX_SESSIONS = 32
_LARGEST_MESSAGE = 16 * 2**20  # bytes that may come at once: more could fill the memory
_PARTING_S = 1.0  # that what was said last may take
_ANSWERERS = 8  # threads, of which somebody who does not read may hold up one for seconds
_STRAYS = 30  # states of another robot by the same name, three seconds, before that is said
_LONGEST_NAME = 80  # bytes of who asks
_MISSES = zenoh.ext.MissDetectionConfig(heartbeat=HEARTBEAT, sporadic_heartbeat=None)
# Each sample says who has sent it: its time may be a router's, if the two clocks do not agree.
_NUMBERED = zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=None)
_PRIORITIES = {
    "interactive_high": zenoh.Priority.INTERACTIVE_HIGH,
    "data_high": zenoh.Priority.DATA_HIGH,
    "data": zenoh.Priority.DATA,
    "data_low": zenoh.Priority.DATA_LOW,
}
Handle = Callable[[Asked], Awaitable[Answer]]

log = structlog.get_logger()


class Telemetry:
    """The robot's end of the network; a context manager that leaves it.

    A session left open keeps the process from ending, so close it on every way out.
    """

    def __init__(self, config: TelemetryConfig, robot: str, *, relays: bool = False) -> None:
        """Listen. Raises GvgbotError if an address cannot be had.

        `relays`: also hand on what those say to each other who meet here, or at a router.
        """
        self.failures = 0  # samples that could not be sent
        self._latest: dict[Topic, Payload] = {}
        self._sender = ThreadPoolExecutor(1, "sender")
        self._answerers = ThreadPoolExecutor(_ANSWERERS, "answers")
        self._unsent: dict[str, Callable[[], None]] = {}  # the newest of each topic
        self._gate = threading.Lock()
        self._robot, self._strays = robot, 0  # states of another robot by this name
        settings = _session_config(config, relays=relays)
        self.addresses = ", ".join(addresses(settings, "listen"))  # perhaps those of a file
        self._session = _open(settings, config.zenoh_file, addresses(settings, "listen"))
        self._publishers = {topic.payload: (topic, self._publisher(topic)) for topic in TOPICS}
        self._alive = self._session.liveliness().declare_token(alive_key(robot))

    @property
    def zid(self) -> str:
        """The id of the session."""
        return str(self._session.info.zid())

    def _publisher(self, topic: Topic) -> zenoh.Publisher | zenoh.ext.AdvancedPublisher:
        """A publisher that drops rather than waits, and keeps what a latecomer gets."""
        if not topic.history:
            return self._session.declare_publisher(
                topic.key(self._robot),
                encoding=zenoh.Encoding(topic.encoding),
                congestion_control=zenoh.CongestionControl.DROP,
                priority=_PRIORITIES[topic.priority],
            )
        return zenoh.ext.declare_advanced_publisher(
            self._session,
            topic.key(self._robot),
            encoding=zenoh.Encoding(topic.encoding),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=_PRIORITIES[topic.priority],
            cache=zenoh.ext.CacheConfig(topic.history),
            sample_miss_detection=_MISSES if topic.on_change else _NUMBERED,
            publisher_detection=True,
        )

    def is_heard(self, payload: type[Payload]) -> bool:
        """Whether to send values of a type; not, if nobody listens and none are kept."""
        _, publisher = self._publishers[payload]
        if isinstance(publisher, zenoh.ext.AdvancedPublisher):
            return True
        return has_listener(publisher)

    def publish(self, value: Payload, latest: Payload | None = None) -> None:
        """Send to whoever listens; without waiting, and without complaining if it fails.

        `latest` is what those get who ask for the newest, if not the value itself.
        """
        topic, publisher = self._publishers[type(value)]
        self._latest[topic] = value if latest is None else latest
        self._send(topic.name, partial(publisher.put, msgspec.msgpack.encode(value)))

    def tell_team(self, part: TeamPart, data: bytes) -> None:
        """Send to the other robots, without waiting, and without complaining if it fails.

        Of each part they may get the newest only.
        """
        key = team_key(self._robot, part)
        drop = zenoh.CongestionControl.DROP
        self._send(part, partial(self._session.put, key, data, congestion_control=drop))

    def _send(self, name: str, put: Callable[[], None]) -> None:
        """Let a thread send the newest of a topic.

        An answer on its way to somebody who does not read holds up for seconds whatever else is
        sent there, also what is dropped rather than waits.
        """
        with self._gate:
            is_due = name not in self._unsent
            self._unsent[name] = put
        if is_due:
            with contextlib.suppress(RuntimeError):  # closed meanwhile
                self._sender.submit(self._send_newest, name)

    def _send_newest(self, name: str) -> None:
        with self._gate:
            put = self._unsent.pop(name)
        try:
            put()
        except zenoh.ZError:
            self.failures += 1

    async def hear_team(self, handle: Callable[[str, bytes], None]) -> None:
        """Hand on what other robots tell, the newest of each key expression, until cancelled."""
        loop, arrived = asyncio.get_running_loop(), asyncio.Event()
        newest: dict[str, bytes] = {}
        own = {team_key(self._robot, part) for part in TEAM_PARTS}

        def take(sample: zenoh.Sample) -> None:
            key = str(sample.key_expr)
            if len(newest) < 2 * _MAX_SESSIONS or key in newest:
                newest[key] = sample.payload.to_bytes()
                loop.call_soon_threadsafe(arrived.set)

        with contextlib.ExitStack() as stack:
            for part in TEAM_PARTS:
                others = self._session.declare_subscriber(
                    team_key("*", part), take, allowed_origin=zenoh.Locality.REMOTE
                )
                stack.enter_context(others)
            while True:
                await arrived.wait()
                arrived.clear()
                for key in list(newest):
                    if key in own:  # that is said by who reads it
                        self._strays = _STRAYS
                    handle(key, newest.pop(key))

    async def answer(self) -> None:
        """Answer queries for the newest values until cancelled.

        And say so if somebody else is by the name of this robot.
        """
        loop, arrived = asyncio.get_running_loop(), asyncio.Event()
        waiting: deque[tuple[Topic, zenoh.Query]] = deque(maxlen=_WAITING_QUERIES)

        def taking(topic: Topic) -> Callable[[zenoh.Query], None]:
            def take(query: zenoh.Query) -> None:
                waiting.append((topic, query))
                loop.call_soon_threadsafe(arrived.set)

            return take

        def meet(_: zenoh.Sample) -> None:
            if self._strays < _STRAYS:
                loop.call_soon_threadsafe(self._note_stray)

        remote = zenoh.Locality.REMOTE
        with contextlib.ExitStack() as stack:
            stack.enter_context(
                self._session.declare_subscriber(
                    STATE.key(self._robot), meet, allowed_origin=remote
                )
            )
            for topic in TOPICS:
                if topic.queryable:
                    key = topic.key(self._robot)
                    stack.enter_context(self._session.declare_queryable(key, taking(topic)))
            while True:
                await arrived.wait()
                arrived.clear()
                # a frozen asker can block a reply, so the loop stays out of it
                await self._aside(self._reply_to_all, waiting)

    def _note_stray(self) -> None:
        self._strays += 1
        if self._strays == _STRAYS:
            log.warning(
                "another robot has this name; give one another robot.name", name=self._robot
            )

    def _reply_to_all(self, waiting: deque[tuple[Topic, zenoh.Query]]) -> None:
        while waiting:
            self._reply(*waiting.popleft())

    def _reply(self, topic: Topic, query: zenoh.Query) -> None:
        with query, contextlib.suppress(zenoh.ZError):  # who asked may have gone
            latest = self._latest.get(topic)
            if latest is None:
                query.reply_err(f"no {topic.name} yet")
                return
            encode, encoding = _form(topic, query.parameters.get("format"))
            # without a time of its own, it would give way to what a router has in store
            now = self._session.new_timestamp()
            query.reply(topic.key(self._robot), encode(latest), encoding=encoding, timestamp=now)

    async def hear(self, handle: Handle) -> None:
        """Put requests to the handler as they come, and send its answers, until cancelled.

        Of a crowd the first are heard, and those that stop the robot. So are only these of what has
        come while the program was suspended or hung: nobody may expect any more that the robot
        moves. A query for several keys at once is none: who reads all that a robot has to say must
        not find that it has stopped.
        """
        loop, arrived = asyncio.get_running_loop(), asyncio.Event()
        waiting: deque[tuple[zenoh.Query, str, Handle]] = deque()
        stops, sleep = {request_key(self._robot, name) for name in STOPS}, Sleep()

        def take(query: zenoh.Query) -> None:
            key, others = str(query.key_expr), len(waiting)
            if others < (_WAITING_STOPS if key in stops else _WAITING_REQUESTS):
                waiting.append((query, key, handle))
            elif others < _WAITING_REFUSALS:
                waiting.append((query, key, _refuse))
            loop.call_soon_threadsafe(arrived.set)

        every = request_key(self._robot, "*")
        with self._session.declare_queryable(every, take):
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(sleep.watch())
                while True:
                    await arrived.wait()
                    arrived.clear()
                    while waiting:
                        query, key, handler = waiting.popleft()
                        if key not in stops and sleep.is_or_was:
                            handler = _decline
                        if "*" in key:
                            self._aside(query.drop)
                        else:  # one that takes long must not hold up the next
                            tasks.create_task(self._put(query, key, handler))

    async def _put(self, query: zenoh.Query, key: str, handle: Handle) -> None:
        answer = await handle(_asked(query, key))
        await self._aside(_tell, query, key, answer)

    def _aside(self, function: Callable[..., None], *arguments: object) -> asyncio.Future[None]:
        """Let a thread do what may wait for an asker, beside those that save and draw the map."""
        return asyncio.get_running_loop().run_in_executor(self._answerers, function, *arguments)

    def close(self) -> None:
        """Leave the network, after what was said last."""
        with contextlib.suppress(TimeoutError, RuntimeError):  # nobody reads, or it is closed
            self._sender.submit(lambda: None).result(_PARTING_S)
        self._session.close()
        self._sender.shutdown(wait=False)
        self._answerers.shutdown(wait=False, cancel_futures=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


async def _refuse(_: Asked) -> Answer:
    return _CROWDED


async def _decline(_: Asked) -> Answer:
    return _ASLEEP


def _asked(query: zenoh.Query, key: str) -> Asked:
    data = b"" if query.payload is None else query.payload.to_bytes()
    encoding = "" if query.encoding is None else str(query.encoding)
    data = data[: LONGEST_ARGUMENTS + 1]  # what is cut is too long still, and will be called so
    return Asked(printable(key.rpartition("/")[2]), data, encoding, _origin(query))


def _origin(query: zenoh.Query) -> str:
    """Who asks: the name that it gives itself, and its session's id if the network tells it."""
    named = b"" if query.attachment is None else query.attachment.to_bytes()[:_LONGEST_NAME]
    name = printable(named.decode(errors="replace")) or "somebody"
    source = query.source_info
    return name if source is None else f"{name}, session {source.source_id.zid}"


def _tell(query: zenoh.Query, key: str, answer: Answer) -> None:
    """Send the answer in the language of the question."""
    is_json = query.encoding is not None and str(query.encoding).startswith(JSON)
    encode = msgspec.json.encode if is_json else msgspec.msgpack.encode
    encoding = zenoh.Encoding(JSON if is_json else MESSAGEPACK)
    with query, contextlib.suppress(zenoh.ZError):  # who asked may have gone
        if answer.done:
            query.reply(key, encode(answer), encoding=encoding)
        else:
            query.reply_err(encode(answer), encoding=encoding)


def _form(topic: Topic, wanted: str | None) -> tuple[Callable[[Payload], bytes], zenoh.Encoding]:
    """How to encode an answer, and the encoding that says so."""
    if wanted == "json":
        return msgspec.json.encode, zenoh.Encoding.APPLICATION_JSON
    return msgspec.msgpack.encode, zenoh.Encoding(topic.encoding)


def _open(config: zenoh.Config, file: Path | None, listen: Sequence[str]) -> zenoh.Session:
    try:
        return opened(config, file)
    except zenoh.ZError as error:
        others = ", ".join(map(_next_port, listen))
        raise GvgbotError(
            f"cannot listen on {', '.join(listen)}: {reason(error)}; choose another address "
            f"(--set 'telemetry.listen=[{others}]'), or set telemetry.enabled=false"
        ) from error


def _next_port(address: str) -> str:
    """The address one port on, to be proposed; itself if it has no port."""
    host, colon, port = address.rpartition(":")
    return f"{host}{colon}{int(port) % LAST_PORT + 1}" if port.isdecimal() else address


def _session_config(config: TelemetryConfig, *, relays: bool) -> zenoh.Config:
    return session_config(
        {
            "mode": "router" if relays else "peer",  # peers of one router do not hear each other
            "listen/endpoints": config.listen,
            "connect/endpoints": config.connect,
            "transport/link/tx/lease": round(1000 * config.lease_s),
            "transport/unicast/max_sessions": _MAX_SESSIONS,
            "transport/link/rx/max_message_size": _LARGEST_MESSAGE,
            "timestamping/enabled": True,
        },
        config.zenoh_file,
    )
