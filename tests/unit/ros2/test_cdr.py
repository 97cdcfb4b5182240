"""Every message as an independent implementation encodes and defines it."""

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from gvgbot.ros2 import messages
from gvgbot.ros2.cdr import Message, decode_twist, definition, encode
from tests.unit.ros2.oracle import STORE, STORES, by_rosbags, random_message

CONTENTS = 100
TRAVELLING = [
    messages.LaserScan,
    messages.Odometry,
    messages.TFMessage,
    messages.OccupancyGrid,
    messages.MarkerArray,
    messages.Twist,
    messages.TwistStamped,
]


@pytest.mark.parametrize("kind", TRAVELLING, ids=lambda kind: kind.__name__)
def test_a_message_of_any_content_has_the_oracle_s_bytes(kind: type[Message]) -> None:
    rng = np.random.default_rng(7)
    for _ in range(CONTENTS):
        message = random_message(kind, rng)
        assert encode(message) == by_rosbags(message), message


def test_a_message_with_its_defaults_only_has_the_oracle_s_bytes() -> None:
    plain = messages.Marker(
        messages.Header(),
        "",
        0,
        0,
        0,
        messages.Pose(),
        messages.Vector3(),
        messages.ColorRGBA(),
    )
    whole = messages.MarkerArray((plain,))
    assert encode(whole) == by_rosbags(whole)


@pytest.mark.parametrize("release", STORES, ids=lambda store: store.name)
@pytest.mark.parametrize("kind", TRAVELLING, ids=lambda kind: kind.__name__)
def test_a_hash_is_that_of_every_release(kind: type[Message], release: Stores) -> None:
    assert get_typestore(release).hash_rihs01(kind.ros_name) == f"RIHS01_{kind.type_hash}"


@pytest.mark.parametrize("kind", TRAVELLING, ids=lambda kind: kind.__name__)
def test_a_definition_says_what_the_oracle_knows(kind: type[Message]) -> None:
    defined = get_types_from_msg(definition(kind), kind.ros_name)
    assert kind.ros_name in defined
    for name, (_, fields) in defined.items():
        assert _plain(fields) == _plain(STORE.fielddefs[name][1]), name


def _plain(fields: object) -> object:
    """Field definitions without what does not matter: how kinds of nodes are written."""
    if isinstance(fields, Nodetype):
        return fields.value
    if isinstance(fields, list | tuple):
        return [_plain(field) for field in fields]
    return fields


@pytest.mark.parametrize("kind", [messages.Twist, messages.TwistStamped], ids=lambda k: k.__name__)
@pytest.mark.parametrize("little", [True, False], ids=["little endian", "big endian"])
def test_a_twist_of_the_oracle_is_read(kind: type[Message], little: bool) -> None:
    rng = np.random.default_rng(11)
    for _ in range(200):
        message = random_message(kind, rng)
        twist = message.twist if isinstance(message, messages.TwistStamped) else message
        data = by_rosbags(message, little_endian=little)
        read = decode_twist(data, stamped=kind is messages.TwistStamped)
        np.testing.assert_array_equal(read, (twist.linear.x, twist.angular.z))


@given(st.binary(max_size=120), st.booleans())
def test_what_is_no_twist_is_refused_and_nothing_worse(data: bytes, stamped: bool) -> None:
    with contextlib.suppress(ValueError):
        decode_twist(data, stamped=stamped)


@given(st.booleans(), st.data())
def test_a_twist_that_is_cut_short_is_refused(stamped: bool, draw: st.DataObject) -> None:
    whole = encode(messages.TwistStamped() if stamped else messages.Twist())
    cut = draw.draw(st.integers(0, len(whole) - 1))
    with pytest.raises(ValueError, match=r"cut short|CDR"):
        decode_twist(whole[:cut], stamped=stamped)
