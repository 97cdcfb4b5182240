"""A robot among ROS 2 nodes, which are an independent implementation's, and see it by a router."""

import asyncio
import json
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import structlog
import zenoh
import zenoh.ext

from benchmarks.rigs.addresses import free_endpoint, plain_session, router
from gvgbot.errors import UsageError
from gvgbot.ros2 import messages
from gvgbot.ros2.cdr import encode
from gvgbot.ros2.config import Ros2Config
from gvgbot.ros2.node import Ros2Node
from gvgbot.ros2.topics import MAP, SCAN, TF_STATIC, attachment
from gvgbot.ros2.translation import occupancy_grid
from gvgbot.telemetry import Telemetry
from gvgbot.telemetry_config import TelemetryConfig

pytestmark = pytest.mark.slow

NS = 1_700_000_000_123_456_789
DOMAIN = 3
GRID = occupancy_grid(np.full((400, 400), 100, np.int8), 0.05, (0.0, 0.0), 1.0)


@contextmanager
def process(*command: str) -> Iterator["subprocess.Popen[str]"]:
    with subprocess.Popen(
        [sys.executable, "-m", *command],
        text=True,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    ) as started:
        try:
            yield started
        finally:
            started.kill()


class Node:
    """The other node, and what it says."""

    def __init__(self, started: "subprocess.Popen[str]") -> None:
        self._process = started

    def drive(self, linear: float, angular: float, times: int) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{linear} {angular} {times}\n")
        self._process.stdin.flush()

    def said(self) -> Iterator[tuple[str, dict[str, Any]]]:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            topic, what = json.loads(line)
            yield topic, what


@contextmanager
def other_node(endpoint: str) -> Iterator[Node]:
    port = endpoint.rpartition(":")[2]
    with process("tests.process.ros_node", port, "3", str(DOMAIN)) as started:
        yield Node(started)


def test_a_node_of_ros_sees_the_robot_and_drives_it(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    settings = {
        "robot.name": "tester",
        "telemetry.enabled": "false",
        "ros2.enabled": "true",
        "ros2.cmd_vel": "Twist",
        "ros2.domain": str(DOMAIN),
        "ros2.connect": f"[{endpoint}]",
    }
    command = ["gvgbot", "run", "--out", str(tmp_path / "run")]
    command += [f"--set={key}={value}" for key, value in settings.items()]
    with router(endpoint), process(*command), other_node(endpoint) as node:
        heard: dict[str, dict[str, Any]] = {}
        for topic, what in node.said():
            heard[topic] = what
            if len(heard) == 7:
                break
        assert heard["/tf_static"] == {"children": ["laser"]}
        assert "base_link" in heard["/tf"]["children"]
        assert heard["/scan"]["beams"] > 600
        assert heard["/map"]["walls"] > 100
        assert "edges" in heard["/gvg/markers"]["namespaces"]
        node.drive(0.0, -0.4, 600)  # the other way than it turns by itself
        wait_for(node, lambda rate: rate == pytest.approx(-0.4, abs=0.05))


def wait_for(node: Node, is_so: Any) -> None:
    """Wait until the robot turns as it should."""
    for topic, what in node.said():
        if topic == "/odom" and is_so(what["turn_rate"]):
            return
    raise AssertionError("the node has gone")


def read_attachment(attached: Any) -> tuple[int, int, bytes]:
    """What rmw_zenoh reads: a sequence number, a time in ns, and who sent it."""
    kinds: Any = tuple[zenoh.ext.Int64, zenoh.ext.Int64, bytes]
    sequence, stamp, own = zenoh.ext.z_deserialize(kinds, attached)
    return int(sequence), int(stamp), own


@pytest.fixture
def network() -> Iterator[str]:
    endpoint = free_endpoint()
    with router(endpoint):
        yield endpoint


@pytest.fixture
def robot(network: str) -> Iterator[Ros2Node]:
    with Ros2Node(Ros2Config(enabled=True, connect=(network,), domain=DOMAIN), "a-b") as node:
        yield node


def test_it_says_once_whether_there_is_a_router(network: str) -> None:
    for address, says in ((network, "can see"), (free_endpoint(), "no ROS 2 router answers")):
        with structlog.testing.capture_logs() as logs:
            Ros2Node(Ros2Config(enabled=True, connect=(address,), domain=DOMAIN), "a").close()
        (line,) = logs
        assert says in line["event"]
        assert line["router"] == address


def test_the_robot_s_own_telemetry_is_no_router_of_ros() -> None:
    """By another name of the machine, as in a file of zenoh, the addresses look different."""
    here = free_endpoint()
    anywhere = here.replace("127.0.0.1", "0.0.0.0")
    config = Ros2Config(enabled=True, connect=(here,), domain=DOMAIN)
    with (
        Telemetry(TelemetryConfig(listen=(anywhere,)), "a") as telemetry,
        pytest.raises(UsageError, match=f"telemetry listens at {here}"),
    ):
        Ros2Node(config, "a", telemetry=telemetry.zid)


def test_a_latecomer_gets_the_map(network: str, robot: Ros2Node) -> None:
    data = encode(GRID)
    robot.send(MAP, data, NS)
    with other_node(network) as node:
        topic, what = next(said for said in node.said() if said[0] != "ready")
    assert (topic, what) == ("/map", {"walls": 400 * 400, "cells": 400 * 400})


def test_what_is_late_does_not_drive_the_robot(network: str) -> None:
    """Who sent it may have stopped since: it came while the program slept, or a router kept it."""
    config = Ros2Config(enabled=True, connect=(network,), domain=DOMAIN, cmd_vel="Twist")
    driven: list[float] = []

    async def story(robot: Ros2Node, others: zenoh.Session) -> None:
        key = f"{DOMAIN}/cmd_vel/geometry_msgs::msg::dds_::Twist_/RIHS01_{messages.Twist.type_hash}"
        async with asyncio.TaskGroup() as tasks:
            hearing = tasks.create_task(robot.hear(lambda twist: driven.append(twist.linear)))
            for metres_per_s, sleeps_s in ((0.1, 0.0), (0.2, 2.5), (0.3, 0.0)):
                await asyncio.sleep(1.5)
                others.put(key, encode(messages.Twist(linear=messages.Vector3(metres_per_s))))
                time.sleep(sleeps_s)  # noqa: ASYNC251, TID251  # a loop that hangs
            for metres_per_s, late_s in ((0.4, 0), (0.5, 3), (0.6, 0)):
                await asyncio.sleep(0.2)
                others.put(
                    key,
                    encode(messages.Twist(linear=messages.Vector3(metres_per_s))),
                    attachment=attachment(1, time.time_ns() - late_s * 10**9, bytes(16)),
                )
            await asyncio.sleep(0.5)
            hearing.cancel()

    with Ros2Node(config, "a-b") as robot, plain_session(network) as others:
        asyncio.run(story(robot, others))
    assert driven == [0.1, 0.3, 0.4, 0.6]


def test_an_advanced_subscriber_as_rmw_zenoh_has_it_gets_the_map_with_its_attachment(
    network: str, robot: Ros2Node
) -> None:
    robot.send(MAP, encode(GRID), NS)
    got: Any = zenoh.handlers.FifoChannel(4)
    with plain_session(network) as session:
        subscriber = zenoh.ext.declare_advanced_subscriber(
            session,
            robot._node.key(MAP),
            got,
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
            recovery=zenoh.ext.RecoveryConfig(heartbeat=True, periodic_queries=None),
            subscriber_detection=True,
        )
        sample = subscriber.recv()
        assert sample.payload.to_bytes() == encode(GRID)
        attached = sample.attachment
        assert attached is not None
        sequence, stamp, own = read_attachment(attached)
        assert (sequence, stamp, len(own)) == (1, NS, 16)
        assert len(attached.to_bytes()) == 33


def test_every_message_has_an_attachment_that_can_be_read(network: str, robot: Ros2Node) -> None:
    got: Any = zenoh.handlers.FifoChannel(64)
    with plain_session(network) as session:
        subscriber = session.declare_subscriber(f"{DOMAIN}/**", got)
        while not robot.wants(SCAN):  # the subscription is on its way
            threading.Event().wait(0.01)
        for count in range(20):
            robot.send(SCAN, b"\0\1\0\0", NS + count)
            robot.send(TF_STATIC, b"\0\1\0\0", NS + count)
        seen: dict[str, list[tuple[int, int, bytes]]] = {}
        for _ in range(40):
            sample = subscriber.recv()
            read = read_attachment(sample.attachment)
            seen.setdefault(str(sample.key_expr), []).append(read)
    for samples in seen.values():
        assert [sequence for sequence, _, _ in samples] == list(range(1, 21))
        assert [stamp for _, stamp, _ in samples] == [NS + count for count in range(20)]
    (one,), (other,) = ({own for _, _, own in samples} for samples in seen.values())
    assert one != other


def test_tokens_say_what_there_is_until_the_robot_goes(network: str, robot: Ros2Node) -> None:
    with plain_session(network) as session:
        everything = f"@ros2_lv/{DOMAIN}/**"
        got: Any = zenoh.handlers.FifoChannel(64)
        watching = session.liveliness().declare_subscriber(everything, got, history=True)
        there = {str(watching.recv().key_expr) for _ in range(7)}
        assert {token.split("/")[8] for token in there} == {"gvgbot_a_b"}  # ROS takes no -
        topics = {token.split("/")[9] for token in there if "/MP/" in token}
        assert topics == {"%scan", "%odom", "%tf", "%tf_static", "%map", "%gvg%markers"}
        robot.close()
        gone = {str(watching.recv().key_expr) for _ in range(7)}
        assert gone == there
