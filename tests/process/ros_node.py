"""A ROS 2 node by an independent implementation of rmw_zenoh, in a process of its own.

Says a line of JSON for each message of the topics that it hears, at most as many as asked for of
each; a line on stdin, such as `0.0 0.5 20`, makes it send so many twists, ten a second.
"""

import json
import select
import sys
import threading
from collections import Counter
from collections.abc import Callable
from typing import Any

from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk.publisher import ROS2Publisher
from zenoh_ros2_sdk.qos import QosDurability, QosProfile
from zenoh_ros2_sdk.subscriber import ROS2Subscriber

LATCHED = QosProfile(durability=QosDurability.TRANSIENT_LOCAL, history_depth=1)
TOPICS = {
    "/scan": ("sensor_msgs/msg/LaserScan", None),
    "/odom": ("nav_msgs/msg/Odometry", None),
    "/tf": ("tf2_msgs/msg/TFMessage", None),
    "/tf_static": ("tf2_msgs/msg/TFMessage", LATCHED),
    "/map": ("nav_msgs/msg/OccupancyGrid", LATCHED),
    "/gvg/markers": ("visualization_msgs/msg/MarkerArray", LATCHED),
}
TWIST = "geometry_msgs/msg/Twist"
STORE = get_typestore(Stores.ROS2_KILTED)


def main(port: int, most: int, domain: int) -> None:
    said, one_at_a_time = Counter[str](), threading.Lock()

    def telling(topic: str) -> Callable[[Any], None]:
        def tell(message: Any) -> None:
            with one_at_a_time:
                said[topic] += 1
                if said[topic] <= most or topic == "/odom":
                    say(topic, described(message))

        return tell

    where = {"router_ip": "127.0.0.1", "router_port": port, "domain_id": domain}
    subscribers = {
        topic: ROS2Subscriber(topic, kind, telling(topic), **known(kind), qos=qos, **where)
        for topic, (kind, qos) in TOPICS.items()
    }
    publisher = ROS2Publisher("/cmd_vel", TWIST, **known(TWIST), **where)
    say("ready", {})
    while True:
        while not select.select([sys.stdin], [], [], 0.2)[0]:
            for topic, subscriber in subscribers.items():
                if TOPICS[topic][1] is LATCHED and not said[topic]:
                    subscriber._query_historical_data()  # it asks once, which may be too early
        linear, angular, times = map(float, sys.stdin.readline().split())
        vector = STORE.types["geometry_msgs/msg/Vector3"]
        for _ in range(int(times)):
            publisher.publish(linear=vector(linear, 0.0, 0.0), angular=vector(0.0, 0.0, angular))
            threading.Event().wait(0.1)


def say(topic: str, what: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps([topic, what]) + "\n")
    sys.stdout.flush()


def known(kind: str) -> dict[str, str]:
    """What there is to know of a type, by yet another implementation."""
    definition, _ = STORE.generate_msgdef(kind, ros_version=2)
    return {"msg_definition": definition, "type_hash": STORE.hash_rihs01(kind)}


def described(message: Any) -> dict[str, Any]:
    """The little of a message that a test looks at."""
    match message.__msgtype__:
        case "nav_msgs/msg/Odometry":
            return {"turn_rate": message.twist.twist.angular.z}
        case "nav_msgs/msg/OccupancyGrid":
            return {"walls": int((message.data > 65).sum()), "cells": len(message.data)}
        case "tf2_msgs/msg/TFMessage":
            return {"children": [t.child_frame_id for t in message.transforms]}
        case "sensor_msgs/msg/LaserScan":
            return {"beams": len(message.ranges)}
        case _:
            return {"namespaces": [marker.ns for marker in message.markers]}


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
