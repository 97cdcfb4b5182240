"""Addresses on this machine that nobody listens on, and routers at them."""

import json
import socket
from collections.abc import Iterator
from contextlib import contextmanager

import zenoh


def free_endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


@contextmanager
def router(endpoint: str) -> Iterator[zenoh.Session]:
    config = zenoh.Config()
    for key, value in {
        "mode": "router",
        "listen/endpoints": [endpoint],
        "scouting/multicast/enabled": False,
    }.items():
        config.insert_json5(key, json.dumps(value))
    with zenoh.open(config) as session:
        yield session


@contextmanager
def plain_session(endpoint: str) -> Iterator[zenoh.Session]:
    """A program on the network that knows nothing of us."""
    config = zenoh.Config()
    for key, value in {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "scouting/multicast/enabled": False,
    }.items():
        config.insert_json5(key, json.dumps(value))
    with zenoh.open(config) as session:
        yield session
