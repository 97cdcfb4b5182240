"""What the robot says to ROS 2, and by which keys and attachments rmw_zenoh lets it travel."""

import hashlib
import struct
from dataclasses import dataclass

from gvgbot.ros2.cdr import Message
from gvgbot.ros2.messages import LaserScan, MarkerArray, OccupancyGrid, Odometry, TFMessage

GID_BYTES = 16
_ATTACHED = struct.Struct("<qqB")  # number, ns, and how long the id is that follows


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic; of a `latched` one, who comes late gets the last message (transient local)."""

    name: str
    message: type[Message]
    latched: bool = False

    @property
    def qos(self) -> str:
        """As in tokens: reliable, transient local or volatile, keep last, depth, no deadlines."""
        return ":1:,1:,:,:,," if self.latched else "::,10:,:,:,,"


SCAN = Topic("/scan", LaserScan)
ODOM = Topic("/odom", Odometry)
TF = Topic("/tf", TFMessage)
TF_STATIC = Topic("/tf_static", TFMessage, latched=True)
MAP = Topic("/map", OccupancyGrid, latched=True)
MARKERS = Topic("/gvg/markers", MarkerArray, latched=True)
TOPICS = (SCAN, ODOM, TF, TF_STATIC, MAP, MARKERS)


@dataclass(frozen=True, slots=True)
class Node:
    """A node of ROS as others see it; `session` is the id of its zenoh session."""

    domain: int
    session: str
    namespace: str
    name: str

    def key(self, topic: Topic) -> str:
        """The key expression that messages of a topic travel by."""
        return f"{self.domain}{self._full(topic)}/{_type(topic)}"

    def token(self) -> str:
        """The liveliness token that says that the node is there."""
        return self._begin(0, "NN")

    def endpoint_token(self, number: int, topic: Topic, *, hears: bool = False) -> str:
        """The token of a publisher, or of a subscription; the number is its own."""
        begin = self._begin(number, "MS" if hears else "MP")
        return f"{begin}/{_mangled(self._full(topic))}/{_type(topic)}/{topic.qos}"

    def _begin(self, number: int, kind: str) -> str:
        where = f"{_mangled(self.namespace or '/')}/{self.name}"
        return f"@ros2_lv/{self.domain}/{self.session}/0/{number}/{kind}/%/{where}"

    def _full(self, topic: Topic) -> str:
        return self.namespace + topic.name


def _mangled(name: str) -> str:
    return name.replace("/", "%")


def _type(topic: Topic) -> str:
    """The type's name as DDS has it, and its hash."""
    package, _, name = topic.message.ros_name.split("/")
    return f"{package}::msg::dds_::{name}_/RIHS01_{topic.message.type_hash}"


def gid(token: str) -> bytes:
    """An id of its own for each endpoint, from its token."""
    return hashlib.blake2b(token.encode(), digest_size=GID_BYTES).digest()


def attachment(sequence: int, unix_ns: int, gid: bytes) -> bytes:
    """What travels with each message; one that is not just so ends the program that gets it.

    Raises ValueError for an id that is too short or long, struct.error for numbers out of range.
    """
    if len(gid) != GID_BYTES:
        raise ValueError(f"an id has {GID_BYTES} bytes, not {len(gid)}")
    return _ATTACHED.pack(sequence, unix_ns, GID_BYTES) + gid


def sent_by(attached: bytes) -> tuple[float, bytes] | None:
    """When a message was sent, in s by the sender's clock, and the sender's id; None if unread."""
    if len(attached) != _ATTACHED.size + GID_BYTES:
        return None
    _, unix_ns, _ = _ATTACHED.unpack_from(attached)
    return unix_ns / 1e9, attached[_ATTACHED.size :]
