"""The live view: what ROS would hear, sent to who has the Foxglove app open."""

import logging
import threading
from typing import Self

import foxglove
import structlog
from foxglove.websocket import ChannelView, Client, ServerListener

from gvgbot.errors import GvgbotError
from gvgbot.foxglove import LAYOUT
from gvgbot.foxglove.config import FoxgloveConfig
from gvgbot.ros2.cdr import definition
from gvgbot.ros2.topics import TOPICS, Topic

_PATIENCE_S = 1.0  # with taking leave of those who watch

log = structlog.get_logger()


class FoxgloveServer:
    """Serves the app; a context manager that stops."""

    def __init__(self, config: FoxgloveConfig, robot: str) -> None:
        """Raises GvgbotError if the port cannot be had."""
        # it would write a line for each message that a viewer who has gone did not get
        logging.getLogger("foxglove").setLevel(logging.CRITICAL)
        self._context = foxglove.Context()
        self._channels = {topic: _channel(topic, self._context) for topic in TOPICS}
        latecomers = _Latecomers(self._channels)
        self._kept = latecomers.kept
        try:
            self._server = foxglove.start_server(
                name=robot,
                host=config.host,
                port=config.port,
                context=self._context,
                server_listener=latecomers,
            )
        except (OSError, RuntimeError) as error:
            raise GvgbotError(
                f"cannot serve Foxglove at {config.host}:{config.port}: {error}; "
                "choose another address (foxglove.host, foxglove.port)"
            ) from error
        where = f"ws://{config.host}:{self.port}"
        log.info("Foxglove can watch", address=where, layout=str(LAYOUT))

    @property
    def port(self) -> int:
        """Where it serves."""
        return self._server.port

    def wants(self, topic: Topic) -> bool:
        """Whether anybody watches a topic, or latecomers get it."""
        return topic.latched or self._channels[topic].has_sinks()

    def send(self, topic: Topic, data: bytes, unix_ns: int) -> None:
        """Send a message, in CDR; to nobody if that is too slow."""
        if topic.latched:
            self._kept[topic.name] = data, unix_ns
        self._channels[topic].log(data, log_time=unix_ns)

    def close(self) -> None:
        """Stop, also while somebody is connected who says nothing."""
        stopping = threading.Thread(  # noqa: TID251  # the library waits for such without end
            target=self._server.stop, name="foxglove", daemon=True
        )
        stopping.start()
        stopping.join(_PATIENCE_S)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class _Latecomers(ServerListener):
    """Sends who begins to watch what was sent before, as far as it stays true."""

    def __init__(self, channels: dict[Topic, foxglove.Channel]) -> None:
        self.kept: dict[str, tuple[bytes, int]] = {}  # by topic
        self._channels = {topic.name: channel for topic, channel in channels.items()}

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """Called in a thread of the server's."""
        kept = self.kept.get(channel.topic)
        if kept is not None:
            data, unix_ns = kept
            self._channels[channel.topic].log(data, log_time=unix_ns)


def _channel(topic: Topic, context: foxglove.Context) -> foxglove.Channel:
    kind = topic.message
    schema = foxglove.Schema(name=kind.ros_name, encoding="ros2msg", data=definition(kind).encode())
    return foxglove.Channel(topic.name, schema=schema, message_encoding="cdr", context=context)
