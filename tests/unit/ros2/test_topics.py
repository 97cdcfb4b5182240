"""Keys, tokens and attachments as independent implementations of rmw_zenoh have them."""

import zenoh
import zenoh.ext
from hypothesis import given
from hypothesis import strategies as st
from zenoh_ros2_sdk import attachment as sdk_attachment
from zenoh_ros2_sdk import entity, keyexpr, qos
from zenoh_ros2_sdk.utils import ros2_to_dds_type

from gvgbot.ros2 import topics
from gvgbot.ros2.messages import Twist
from gvgbot.ros2.topics import MAP, SCAN, TOPICS, Node, Topic, attachment, gid, sent_by

NODE = Node(7, "a1b2c3", "/robot1/base", "gvgbot_tester")
PLAIN = Node(0, "a1b2c3", "", "gvgbot_tester")
INT64 = st.integers(-(2**63), 2**63 - 1)


def theirs(node: Node) -> entity.NodeEntity:
    return entity.NodeEntity(
        node.domain, node.session, 0, node.name, namespace=node.namespace or "/"
    )


def test_keys_are_those_of_an_independent_implementation() -> None:
    for node in (NODE, PLAIN):
        for topic in TOPICS:
            kind = topic.message
            name, hashed = ros2_to_dds_type(kind.ros_name), f"RIHS01_{kind.type_hash}"
            expected = keyexpr.topic_keyexpr(node.domain, node.namespace + topic.name, name, hashed)
            assert node.key(topic) == expected
            assert str(zenoh.KeyExpr(expected)) == expected


def test_a_scan_s_key_is_as_the_design_document_has_keys() -> None:
    assert PLAIN.key(SCAN) == (
        "0/scan/sensor_msgs::msg::dds_::LaserScan_/"
        "RIHS01_64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828"
    )


def test_tokens_are_those_of_an_independent_implementation() -> None:
    for node in (NODE, PLAIN):
        assert node.token() == keyexpr.node_liveliness_keyexpr(theirs(node))
        for number, topic in enumerate((*TOPICS, Topic("/cmd_vel", Twist)), start=1):
            for hears, kind in (
                (False, entity.EntityKind.PUBLISHER),
                (True, entity.EntityKind.SUBSCRIPTION),
            ):
                expected = keyexpr.endpoint_liveliness_keyexpr(
                    entity.EndpointEntity(
                        theirs(node),
                        number,
                        kind,
                        node.namespace + topic.name,
                        ros2_to_dds_type(topic.message.ros_name),
                        f"RIHS01_{topic.message.type_hash}",
                        topic.qos,
                    )
                )
                token = node.endpoint_token(number, topic, hears=hears)
                assert token == expected
                assert str(zenoh.KeyExpr(token)) == token


def test_qualities_of_service_are_read_as_meant() -> None:
    scan, grid = (qos.QosProfile.decode(topic.qos) for topic in (SCAN, MAP))
    assert scan == qos.QosProfile()
    assert grid == qos.QosProfile(durability=qos.QosDurability.TRANSIENT_LOCAL, history_depth=1)


@given(INT64, INT64, st.binary(min_size=16, max_size=16))
def test_an_attachment_has_the_bytes_of_zenoh_s_own_serialisation(
    sequence: int, stamp: int, own: bytes
) -> None:
    kinds = (zenoh.ext.Int64, zenoh.ext.Int64, bytes)
    value = (zenoh.ext.Int64(sequence), zenoh.ext.Int64(stamp), own)
    ours = attachment(sequence, stamp, own)
    assert ours == zenoh.ext.z_serialize(value).to_bytes()
    read = zenoh.ext.z_deserialize(tuple[kinds], zenoh.ZBytes(ours))  # type: ignore[valid-type]
    assert read == (sequence, stamp, own)


@given(st.integers(0, 2**63 - 1), st.integers(0, 2**63 - 1))
def test_an_attachment_is_read_by_an_independent_implementation(sequence: int, stamp: int) -> None:
    read = sdk_attachment.Attachment.from_bytes(attachment(sequence, stamp, gid("a token")))
    assert (read.sequence_id, read.timestamp_ns, read.gid) == (sequence, stamp, gid("a token"))


@given(st.integers(0, 2**62), st.binary(min_size=16, max_size=16))
def test_who_sent_something_and_when_is_read_as_others_write_it(stamp: int, own: bytes) -> None:
    theirs = sdk_attachment.Attachment(sequence_id=7, timestamp_ns=stamp, gid=own).to_bytes()
    assert sent_by(theirs) == (stamp / 1e9, own)
    assert sent_by(theirs[:-1]) is None


def test_every_endpoint_has_an_id_of_its_own() -> None:
    tokens = [NODE.endpoint_token(n, topic) for n, topic in enumerate(topics.TOPICS)]
    assert len({gid(token) for token in tokens}) == len(tokens)
    assert {len(gid(token)) for token in tokens} == {topics.GID_BYTES}
