"""What the Foxglove app gets, by its own protocol over a plain WebSocket."""

import json
import struct
import threading
from collections.abc import Iterator
from pathlib import Path
from socket import SHUT_RD, SO_LINGER, SOL_SOCKET, create_connection
from typing import Any

import pytest
from rosbags.typesys import get_types_from_msg
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from gvgbot.config import Config, ServiceConfig
from gvgbot.daemon import run
from gvgbot.errors import GvgbotError
from gvgbot.foxglove.config import FoxgloveConfig
from gvgbot.foxglove.server import FoxgloveServer
from gvgbot.geometry import Pose
from gvgbot.ros2.cdr import encode
from gvgbot.ros2.topics import SCAN, TF, TF_STATIC, TOPICS, Topic
from gvgbot.ros2.translation import transforms
from gvgbot.stop_signals import StopSignals
from gvgbot.telemetry_config import TelemetryConfig
from tests.unit.ros2.oracle import STORE

pytestmark = pytest.mark.slow

PATIENCE = 60.0  # s, for a busy machine
NS = 1_700_000_000_000_000_000


@pytest.fixture
def server() -> Iterator[FoxgloveServer]:
    with FoxgloveServer(FoxgloveConfig(port=0), "tester") as served:
        yield served


class App:
    """As much of the app as is needed: subscribes, and reads messages."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self.channels: dict[str, dict[str, Any]] = {}
        self.numbers: dict[int, str] = {}
        while len(self.channels) < len(TOPICS):
            said = json.loads(self._text())
            if said["op"] == "advertise":
                self.channels |= {channel["topic"]: channel for channel in said["channels"]}

    def _text(self) -> str:
        while not isinstance(frame := self._socket.recv(PATIENCE), str):
            pass
        return frame

    def watch(self, topic: Topic) -> None:
        number = len(self.numbers) + 1
        self.numbers[number] = topic.name
        channel = self.channels[topic.name]["id"]
        what = [{"id": number, "channelId": channel}]
        self._socket.send(json.dumps({"op": "subscribe", "subscriptions": what}))

    def message(self) -> tuple[str, int, bytes]:
        """Topic, time in ns, and data of the next message."""
        while True:
            frame = self._socket.recv(PATIENCE)
            if isinstance(frame, bytes) and frame[0] == 1:
                number, stamp = struct.unpack_from("<IQ", frame, 1)
                return self.numbers[number], stamp, frame[13:]


@pytest.fixture
def app(server: FoxgloveServer) -> Iterator[App]:
    protocol = Subprotocol("foxglove.sdk.v1")
    with connect(f"ws://127.0.0.1:{server.port}", subprotocols=[protocol]) as socket:
        yield App(socket)


def test_topics_come_with_what_is_needed_to_read_them(app: App) -> None:
    assert set(app.channels) == {topic.name for topic in TOPICS}
    for topic in TOPICS:
        channel = app.channels[topic.name]
        assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
        assert channel["schemaName"] == topic.message.ros_name
        assert channel["schemaName"] in get_types_from_msg(channel["schema"], channel["schemaName"])


def test_who_comes_late_gets_what_stays_true(server: FoxgloveServer, app: App) -> None:
    mount = encode(transforms(1.0, {("base_link", "laser"): Pose(0.1, 0.0, 0.0)}))
    server.send(TF_STATIC, mount, NS)
    app.watch(TF_STATIC)
    topic, stamp, data = app.message()
    assert (topic, stamp, data) == ("/tf_static", NS, mount)
    (laser,) = STORE.deserialize_cdr(data, "tf2_msgs/msg/TFMessage").transforms  # type: ignore[attr-defined]
    assert laser.transform.translation.x == 0.1


def test_what_nobody_watches_is_not_wanted(server: FoxgloveServer, app: App) -> None:
    assert not server.wants(SCAN)
    assert server.wants(TF_STATIC)
    app.watch(TF_STATIC)
    app.watch(TF)
    while not server.wants(TF):
        threading.Event().wait(0.01)
    moved = encode(transforms(1.0, {("odom", "base_link"): Pose(2.0, 0.0, 0.0)}))
    server.send(TF, moved, NS + 5)
    assert app.message() == ("/tf", NS + 5, moved)


def test_a_port_that_is_taken_is_said_in_a_line(server: FoxgloveServer) -> None:
    with pytest.raises(GvgbotError, match=r"foxglove\.port"):
        FoxgloveServer(FoxgloveConfig(port=server.port), "another")


def test_a_daemon_whose_port_is_taken_leaves_no_run_however_often_it_is_started(
    server: FoxgloveServer, tmp_path: Path
) -> None:
    service = ServiceConfig(state_dir=str(tmp_path))
    network = TelemetryConfig(enabled=False)
    viewer = FoxgloveConfig(enabled=True, port=server.port)
    config = Config(service=service, telemetry=network, foxglove=viewer)
    for _ in range(2):
        with pytest.raises(GvgbotError, match=r"foxglove\.port"):
            run(config, StopSignals(), out=None, known=None, anew=False)
    assert not list(tmp_path.glob("runs/*"))


def test_who_goes_without_a_word_leaves_no_lines_in_the_log(
    server: FoxgloveServer, caplog: pytest.LogCaptureFixture
) -> None:
    protocol = Subprotocol("foxglove.sdk.v1")
    with connect(f"ws://127.0.0.1:{server.port}", subprotocols=[protocol]) as viewer:
        App(viewer).watch(TF)
        while not server.wants(TF):
            threading.Event().wait(0.01)
        viewer.socket.setsockopt(SOL_SOCKET, SO_LINGER, struct.pack("ii", 1, 0))
        viewer.socket.shutdown(SHUT_RD)
        viewer.socket.close()  # as if the computer was shut
        while server.wants(TF):
            threading.Event().wait(0.01)
    assert not caplog.records


def test_who_connects_and_says_nothing_does_not_hold_up_the_end() -> None:
    server = FoxgloveServer(FoxgloveConfig(port=0), "tester")
    protocol = Subprotocol("foxglove.sdk.v1")
    with (
        create_connection(("127.0.0.1", server.port)),
        connect(f"ws://127.0.0.1:{server.port}", subprotocols=[protocol]),  # taken in after it
    ):
        closing = threading.Thread(target=server.close, daemon=True)  # noqa: TID251  # may hang
        closing.start()
        closing.join(PATIENCE)
        assert not closing.is_alive()
