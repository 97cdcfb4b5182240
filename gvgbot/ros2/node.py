"""A node among those of ROS 2 that use rmw_zenoh: sends messages, hears who wants to drive."""

import asyncio
from collections import deque
from collections.abc import Callable
from typing import Self

import structlog
import zenoh
import zenoh.ext

from gvgbot.errors import GvgbotError, UsageError
from gvgbot.geometry import Twist
from gvgbot.ros2 import messages
from gvgbot.ros2.cdr import decode_twist
from gvgbot.ros2.config import Ros2Config
from gvgbot.ros2.delays import Delays
from gvgbot.ros2.topics import TOPICS, Node, Topic, attachment, gid, sent_by
from gvgbot.sleep import Sleep
from gvgbot.zenoh_config import addresses, has_listener, opened, reason, session_config

_HEARTBEAT_S = 0.5  # by which receivers of latched topics find out that they have missed one
_TWISTS = {"Twist": messages.Twist, "TwistStamped": messages.TwistStamped}
_LONGEST_COMMAND = 1000  # bytes

log = structlog.get_logger()


class Ros2Node:
    """The robot as a node; a context manager that leaves the network.

    Nothing waits: what cannot be sent is dropped.
    """

    def __init__(self, config: Ros2Config, robot: str, *, telemetry: str | None = None) -> None:
        """`telemetry` is the id of the robot's own session there, which is no router of ROS.

        Raises GvgbotError if the addresses cannot be used, UsageError if that session is there.
        """
        self._config, self._warned = config, False
        settings = _settings(config)
        self._session = _open(settings, config)
        self._node = Node(
            config.domain,
            str(self._session.info.zid()),
            config.namespace,
            f"gvgbot_{robot.replace('-', '_')}",
        )
        self._tokens: list[zenoh.LivelinessToken] = []  # gone with the session
        self._declare_token(self._node.token())
        self._publishers = {
            topic: self._publisher(number, topic) for number, topic in enumerate(TOPICS, start=1)
        }
        self._say_whether_met(", ".join(addresses(settings, "connect")), telemetry)

    def _say_whether_met(self, router: str, telemetry: str | None) -> None:
        """Opening the session has tried to connect once; later it tries again."""
        info = self._session.info
        met = {str(zid) for zid in (*info.routers_zid(), *info.peers_zid())}
        if telemetry in met:
            self.close()
            raise UsageError(
                f"telemetry listens at {router}, where rmw_zenohd of ROS 2 should: "
                "set telemetry.listen=[tcp/0.0.0.0:7448], for example"
            )
        if met:
            log.info("ROS 2 nodes can see the robot", router=router)
        else:
            log.warning("no ROS 2 router answers, trying again", router=router)

    def _declare_token(self, token: str) -> None:
        self._tokens.append(self._session.liveliness().declare_token(token))

    def _publisher(self, number: int, topic: Topic) -> "_Publisher":
        token = self._node.endpoint_token(number, topic)
        self._declare_token(token)
        return _Publisher(self._session, self._node.key(topic), gid(token), latched=topic.latched)

    def wants(self, topic: Topic) -> bool:
        """Whether to send messages of a topic: somebody listens, or latecomers get them."""
        return self._publishers[topic].is_heard

    def send(self, topic: Topic, data: bytes, unix_ns: int) -> None:
        """Send a message, in CDR; one topic from one thread."""
        self._publishers[topic].put(data, unix_ns)

    async def hear(self, drive: Callable[[Twist], None]) -> None:
        """Hand on the newest twist each time until cancelled, if the configuration permits that.

        Not what was held up on its way, or has come while the program was suspended or hung: who
        sent it may have stopped.
        """
        kind = self._config.cmd_vel
        if kind is None:
            return
        loop, arrived, sleep = asyncio.get_running_loop(), asyncio.Event(), Sleep()
        delays = Delays()
        newest: deque[zenoh.Sample] = deque(maxlen=1)

        def take(sample: zenoh.Sample) -> None:
            newest.append(sample)
            loop.call_soon_threadsafe(arrived.set)

        topic = Topic("/cmd_vel", _TWISTS[kind])
        with self._session.declare_subscriber(self._node.key(topic), take):
            self._declare_token(self._node.endpoint_token(len(TOPICS) + 1, topic, hears=True))
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(sleep.watch())
                while True:
                    await arrived.wait()
                    arrived.clear()
                    if newest:  # one that came while another was read has been read in its place
                        sample = newest.popleft()
                        was_held_up = _was_held_up(sample, delays, loop.time())
                        if not (was_held_up or sleep.is_or_was):
                            self._hand_on(sample, drive)

    def _hand_on(self, sample: zenoh.Sample, drive: Callable[[Twist], None]) -> None:
        data = sample.payload.to_bytes()[:_LONGEST_COMMAND]
        try:
            linear, angular = decode_twist(data, stamped=self._config.cmd_vel == "TwistStamped")
        except ValueError as error:
            if not self._warned:
                self._warned = True
                log.warning("damaged /cmd_vel are passed over", reason=str(error))
        else:
            drive(Twist(linear, angular))

    def close(self) -> None:
        """Leave the network."""
        self._session.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _was_held_up(sample: zenoh.Sample, delays: Delays, stamp: float) -> bool:
    """As far as that can be told: nobody knows it of what has no attachment."""
    sent = None if sample.attachment is None else sent_by(sample.attachment.to_bytes())
    return sent is not None and delays.held_up(sent[1], sent=sent[0], stamp=stamp)


class _Publisher:
    """One topic: counts its messages, and says with each who sent it and when."""

    def __init__(self, session: zenoh.Session, key: str, own: bytes, *, latched: bool) -> None:
        self._gid, self._sequence = own, 0
        self._plain: zenoh.Publisher | None = None
        self._advanced: zenoh.ext.AdvancedPublisher | None = None
        if latched:
            self._advanced = zenoh.ext.declare_advanced_publisher(
                session,
                key,
                congestion_control=zenoh.CongestionControl.DROP,
                cache=zenoh.ext.CacheConfig(1),
                sample_miss_detection=zenoh.ext.MissDetectionConfig(
                    heartbeat=None, sporadic_heartbeat=_HEARTBEAT_S
                ),
                publisher_detection=True,
            )
        else:
            self._plain = session.declare_publisher(
                key, congestion_control=zenoh.CongestionControl.DROP
            )

    @property
    def is_heard(self) -> bool:
        """Whether there is a point in sending."""
        return self._plain is None or has_listener(self._plain)

    def put(self, data: bytes, unix_ns: int) -> None:
        """Send a message."""
        self._sequence += 1  # as rmw_zenoh counts: from 1
        attached = attachment(self._sequence, unix_ns, self._gid)
        try:
            if self._advanced is not None:
                self._advanced.put(data, attachment=attached)
            elif self._plain is not None:
                self._plain.put(data, attachment=attached)
        except zenoh.ZError as error:
            log.debug("not sent to ROS 2", reason=reason(error))


def _settings(config: Ros2Config) -> zenoh.Config:
    """Those of a session like that of a ROS node: found and linked to by way of a router."""
    return session_config(
        {
            "mode": "peer",
            "listen/endpoints": config.listen,
            "connect/endpoints": config.connect,
            "scouting/gossip/enabled": True,
            "timestamping/enabled": True,
        },
        config.zenoh_file,
    )


def _open(settings: zenoh.Config, config: Ros2Config) -> zenoh.Session:
    try:
        return opened(settings, config.zenoh_file)
    except zenoh.ZError as error:
        raise GvgbotError(
            f"cannot meet ROS 2 from {', '.join(config.listen)}: {reason(error)}; "
            "choose another address (ros2.listen), or set ros2.enabled=false"
        ) from error
